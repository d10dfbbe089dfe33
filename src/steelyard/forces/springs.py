"""Springs and bungees: F = -k (l - l0) n, n from the other end to this one.

Record: x_a, x_b, force_a, force_b, stiffness, rest length, kind: both ways, one-sided (bungee), or only k l0 n,
which is what a method leaves that moves -k x by a flow of its own. Where the ends coincide the direction, and so the
force, is taken as zero. Energy k (l - l0)^2 / 2.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import load, select, splat, sqrt
from ..math.vectors import add_scaled, between, dot
from ..model.tape import H_SPRINGS

RECORD = 7
TWO_SIDED, ONE_SIDED, REST_ALONE = range(3)


@inner
def add_springs(tape, s):
    """Add every spring's force to the force rows."""
    zero = splat(0.0)
    at = tape[H_SPRINGS]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        x, y, z = between(s, tape[k], tape[k + 1])
        length = sqrt(dot(x, y, z, x, y, z))
        stretch = length - load(s, tape[k + 5])
        if tape[k + 6] == ONE_SIDED:
            stretch = select(stretch > zero, stretch, zero)
        elif tape[k + 6] == REST_ALONE:
            stretch = -load(s, tape[k + 5])
        apart = length > zero
        pull = load(s, tape[k + 4]) * stretch / select(apart, length, splat(1.0))
        pull = select(apart, -pull, zero)
        add_scaled(s, tape[k + 2], pull, x, y, z)
        add_scaled(s, tape[k + 3], -pull, x, y, z)
