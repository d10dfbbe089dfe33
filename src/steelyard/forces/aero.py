"""Aerodynamic surfaces: F = R A R^T (v - u), v the velocity of the surface's point and u that of the air.

A is a 3 x 3 matrix [N s/m] in the body's frame; with a control c in [-1, 1] it lies between those for -1, 0 and 1.
Record: orientation, velocity and force of the point, wind, A at 0 (nine rows), its change for c < 0 and c > 0, row of
c; the last three are -1 where there is no control.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, select, splat
from ..math.rotations import load_turn, rotate, rotate_back
from ..math.vectors import add_scaled, between, dot
from ..model.tape import H_SURFACES

SURFACE = 8


@inner
def _row(s, k, tape, row, x, y, z):
    """One row of the matrix at hand times a vector."""
    base = tape[k + 4] + 3 * row
    value = dot(load(s, base), load(s, base + 1), load(s, base + 2), x, y, z)
    if tape[k + 7] >= 0:
        zero = splat(0.0)
        one = splat(1.0)
        control = load(s, tape[k + 7])
        control = select(control > one, one, control)
        control = select(control < -one, -one, control)
        for side in range(2):
            change = tape[k + 5 + side] + 3 * row
            more = dot(load(s, change), load(s, change + 1), load(s, change + 2), x, y, z)
            share = -control if side == 0 else control
            value = fma(select(share > zero, share, zero), more, value)
    return value


@inner
def add_surfaces(tape, s):
    """Add the force of every surface to its point."""
    one = splat(1.0)
    at = tape[H_SURFACES]
    for index in range(tape[at]):
        k = at + 1 + SURFACE * index
        f, w, x, y, z = load_turn(s, tape[k])
        a, b, c = rotate_back(f, w, x, y, z, *between(s, tape[k + 1], tape[k + 3]))
        fx = _row(s, k, tape, 0, a, b, c)
        fy = _row(s, k, tape, 1, a, b, c)
        fz = _row(s, k, tape, 2, a, b, c)
        add_scaled(s, tape[k + 2], one, *rotate(f, w, x, y, z, fx, fy, fz))
