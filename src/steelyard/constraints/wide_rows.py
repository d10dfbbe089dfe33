"""Rows of joints as six-vectors of both solids, each in one register.

What solvers ask of a row, over and over, is the velocity along it, and what an impulse along it does to the velocities
of its two solids. Both are made ready once: the direction (force, and its moment on either solid), and the direction
times the inverse of mass and inertia. Eight numbers of a solid's velocity are loaded at a time; the last two of each
are zero.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load_at, splat, store_at, sum_lanes
from ..model.rigid_layout import (
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_VELOCITY,
    W_B,
    W_MOVES_A,
    W_MOVES_B,
)
from .solids import symmetric_times


@inner
def finish_wide_row(s, w, a, b, bx, by, bz):
    """Make a row ready whose direction on a, force and moment, is there; b has the force against it, and a moment.

    Returns:
        Its mobility: the velocity along it that a unit impulse makes.
    """
    fx = s[w]
    fy = s[w + 1]
    fz = s[w + 2]
    ax = s[w + 3]
    ay = s[w + 4]
    az = s[w + 5]
    s[w + W_B] = -fx
    s[w + W_B + 1] = -fy
    s[w + W_B + 2] = -fz
    s[w + W_B + 3] = -bx
    s[w + W_B + 4] = -by
    s[w + W_B + 5] = -bz
    one = s[a + S_INVERSE]
    other = s[b + S_INVERSE]
    x, y, z = symmetric_times(s, a + S_INVERSE_INERTIA, ax, ay, az)
    s[w + W_MOVES_A] = one * fx
    s[w + W_MOVES_A + 1] = one * fy
    s[w + W_MOVES_A + 2] = one * fz
    s[w + W_MOVES_A + 3] = x
    s[w + W_MOVES_A + 4] = y
    s[w + W_MOVES_A + 5] = z
    mobility = (one + other) * (fx * fx + fy * fy + fz * fz) + (ax * x + ay * y + az * z)
    x, y, z = symmetric_times(s, b + S_INVERSE_INERTIA, bx, by, bz)
    s[w + W_MOVES_B] = -other * fx
    s[w + W_MOVES_B + 1] = -other * fy
    s[w + W_MOVES_B + 2] = -other * fz
    s[w + W_MOVES_B + 3] = -x
    s[w + W_MOVES_B + 4] = -y
    s[w + W_MOVES_B + 5] = -z
    return mobility + (bx * x + by * y + bz * z)


@inner
def load_velocity(s, solid):
    """Velocity of a solid as a lane vector."""
    return load_at(s, solid + S_VELOCITY)


@inner
def store_velocity(s, solid, value):
    """Put it back."""
    store_at(s, solid + S_VELOCITY, value)


@inner
def velocity_along(s, w, va, vb):
    """Velocity along a row."""
    return sum_lanes(fma(load_at(s, w), va, load_at(s, w + W_B) * vb))


@inner
def response_along(s, w, other):
    """Velocity along a row that a unit impulse along another row of the same solids makes."""
    return velocity_along(s, w, load_at(s, other + W_MOVES_A), load_at(s, other + W_MOVES_B))


@inner
def moved(s, w, va, vb, impulse):
    """Velocities after an impulse along a row."""
    value = splat(impulse)
    return (
        fma(value, load_at(s, w + W_MOVES_A), va),
        fma(value, load_at(s, w + W_MOVES_B), vb),
    )
