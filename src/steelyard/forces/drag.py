"""Drag: F = -(k1 |u| + k2 |u|^2) u/|u|, u the velocity relative to the wind.

Explicit Euler takes it as a force. The other integrators take it as an exact flow of its own, split
symmetrically around the rest: for speed w = |u|, dw/dt = -(k1 w + k2 w^2)/m gives over a time t

    w(t) = w e / (1 + k2 w phi),    e = exp(-k1 t/m),    phi = (1 - e)/k1  (t/m where k1 = 0),

and the direction stays. Record: velocity, force, k1, k2, first row of the wind, e, phi.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, sqrt
from ..math.vectors import add_scaled, between, dot, load_coordinates, store_coordinates
from ..model.tape import H_DRAGS

RECORD = 7


@inner
def _through_air(tape, s, k):
    """Velocity relative to the wind, and its size."""
    x, y, z = between(s, tape[k], tape[k + 4])
    return x, y, z, sqrt(dot(x, y, z, x, y, z))


@inner
def add_drag(tape, s):
    """Add every drag to the force rows."""
    at = tape[H_DRAGS]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        x, y, z, speed = _through_air(tape, s, k)
        brake = -fma(load(s, tape[k + 3]), speed, load(s, tape[k + 2]))
        add_scaled(s, tape[k + 1], brake, x, y, z)


@inner
def flow_drag(tape, s, backwards):
    """Change every velocity by the exact flow of its drag; one after the other where several act.

    The two halves of a step take them in opposite orders, which keeps the splitting symmetric.
    """
    at = tape[H_DRAGS]
    count = tape[at]
    for index in range(count):
        k = at + 1 + RECORD * (count - 1 - index if backwards else index)
        x, y, z, speed = _through_air(tape, s, k)
        slowed = fma(load(s, tape[k + 3]) * speed, load(s, tape[k + 6]), splat(1.0))
        factor = load(s, tape[k + 5]) / slowed
        wx, wy, wz = load_coordinates(s, tape[k + 4])
        store_coordinates(s, tape[k], fma(factor, x, wx), fma(factor, y, wy), fma(factor, z, wz))
