"""Buoyancy at a level surface: F_y = rho V g (h + d - y)/(2 d), clipped to [0, rho V g].

Record: row of y, row of F_y, then the rows of h, d and rho V g.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, select, splat, store
from ..model.tape import H_BUOYANCIES

RECORD = 5


@inner
def add_buoyancy(tape, s):
    """Add every float's lift to the force rows."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_BUOYANCIES]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        half = load(s, tape[k + 3])
        share = (load(s, tape[k + 2]) + half - load(s, tape[k])) / (half + half)
        share = select(share > zero, share, zero)
        share = select(share < one, share, one)
        store(s, tape[k + 1], fma(share, load(s, tape[k + 4]), load(s, tape[k + 1])))
