"""Drag: F = -(k1 |u| + k2 |u|^2) u/|u|, u the velocity relative to the wind.

Explicit Euler takes it as a force. The other integrators take it as an exact flow of its own, split
symmetrically around the rest: for speed w = |u|, dw/dt = -(k1 w + k2 w^2)/m gives over a time t

    w(t) = w e / (1 + k2 w phi),    e = exp(-k1 t/m),    phi = (1 - e)/k1  (t/m where k1 = 0),

and the direction stays. Record: velocity, force, k1, k2, first row of the wind, e, phi.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, sqrt, store
from ..model.tape import H_DRAGS

RECORD = 7


@inner
def add_drag(tape, s):
    """Add every drag to the force rows."""
    at = tape[H_DRAGS]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        v = tape[k]
        wind = tape[k + 4]
        x = load(s, v) - load(s, wind)
        y = load(s, v + 1) - load(s, wind + 1)
        z = load(s, v + 2) - load(s, wind + 2)
        speed = sqrt(fma(z, z, fma(y, y, x * x)))
        brake = splat(0.0) - fma(load(s, tape[k + 3]), speed, load(s, tape[k + 2]))
        f = tape[k + 1]
        store(s, f, fma(brake, x, load(s, f)))
        store(s, f + 1, fma(brake, y, load(s, f + 1)))
        store(s, f + 2, fma(brake, z, load(s, f + 2)))


@inner
def flow_drag(tape, s, backwards):
    """Change every velocity by the exact flow of its drag; one after the other where several act.

    The two halves of a step take them in opposite orders, which keeps the splitting symmetric.
    """
    at = tape[H_DRAGS]
    count = tape[at]
    for index in range(count):
        k = at + 1 + RECORD * (count - 1 - index if backwards else index)
        v = tape[k]
        wind = tape[k + 4]
        x = load(s, v) - load(s, wind)
        y = load(s, v + 1) - load(s, wind + 1)
        z = load(s, v + 2) - load(s, wind + 2)
        speed = sqrt(fma(z, z, fma(y, y, x * x)))
        slowed = fma(load(s, tape[k + 3]) * speed, load(s, tape[k + 6]), splat(1.0))
        factor = load(s, tape[k + 5]) / slowed
        store(s, v, fma(factor, x, load(s, wind)))
        store(s, v + 1, fma(factor, y, load(s, wind + 1)))
        store(s, v + 2, fma(factor, z, load(s, wind + 2)))
