"""Gravity as a force: F = m g, nothing on immovable particles. Energy -m g . x.

Record: force, mass, first row of g.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, store
from ..math.pointers import axes
from ..model.tape import H_GRAVITIES

RECORD = 3


@inner
def add_gravity(tape, s):
    """Add every gravity's force to the force rows; the mass row of an immovable particle is 0."""
    at = tape[H_GRAVITIES]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        mass = load(s, tape[k + 1])
        for component in range(axes(s)):
            row = tape[k] + component
            store(s, row, fma(mass, load(s, tape[k + 2] + component), load(s, row)))
