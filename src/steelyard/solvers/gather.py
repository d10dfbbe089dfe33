"""All impulses of a stage, gathered and applied."""

from __future__ import annotations

from ..constraints.contacts import contact_impulses
from ..constraints.links import link_impulses
from ..constraints.riders import rider_impulses
from ..kernel import kernel
from ..math.lanes import fma, load, splat, store
from ..model.tape import H_FREE, H_IMPULSE, H_INVERSE_MASS, H_PARTICLES


@kernel
def gather(tape, s, skip, velocity, target):
    """Sum all impulses and apply them: rows ``target`` = free rows + M^-1 impulse."""
    zero = splat(0.0)
    count = 3 * tape[H_PARTICLES]
    for row in range(count + 3):
        store(s, tape[H_IMPULSE] + row, zero)
    link_impulses(tape, s, velocity)
    rider_impulses(tape, s, velocity)
    contact_impulses(tape, s, skip, velocity)
    for p in range(tape[H_PARTICLES]):
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(3):
            row = 3 * p + component
            part = load(s, tape[H_IMPULSE] + row)
            store(s, target + row, fma(inverse, part, load(s, tape[H_FREE] + row)))
