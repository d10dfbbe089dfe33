"""The sum of all forces on every particle (d'Alembert)."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import any_lane, load, splat, store
from ..model.tape import H_ACTIVE, H_FORCE, H_FORCED, H_PARTICLES, H_USER_FORCES
from ..stage import stage
from .buoyancy import add_buoyancy
from .drag import add_drag
from .gravity import add_gravity
from .springs import add_springs


@inner
def accumulate_forces(tape, s):
    """Clear the force rows and add all forces but drag, which integrators treat in their own way."""
    if tape[H_FORCED] == 0:
        return
    zero = splat(0.0)
    for row in range(3 * tape[H_PARTICLES] + 3):
        store(s, tape[H_FORCE] + row, zero)
    add_springs(tape, s)
    add_gravity(tape, s)
    add_buoyancy(tape, s)
    given = tape[H_USER_FORCES]
    if given >= 0:
        for row in range(3 * tape[H_PARTICLES]):
            f = tape[H_FORCE] + row
            store(s, f, load(s, f) + load(s, given + row))


@stage
def sum_forces(tape, s, skip, part):
    """All forces at the state at hand, drag too; nothing where no world is active."""
    if any_lane(load(s, tape[H_ACTIVE]) > splat(0.5)):
        accumulate_forces(tape, s)
        add_drag(tape, s)
