"""Sweeps: when a shape that moves straight and turns evenly comes into another, which stands still.

Along the normal at which two convex shapes are nearest, the gap closes no faster than the one moves that way and its
turn swings its farthest point that way: until they could have closed it nothing touches, so there one looks again
(conservative advancement; Mirtich, *Impulse-based Dynamic Simulation of Rigid Body Systems*, 1996). Of what does
not turn these are Newton's steps of a cast. In the end a place is found where the shapes do overlap, or none is.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from ..collision.manifold import POINT
from ..kernel import inner
from ..model.colliders import BOX, CENTRE, PLACED, SIZE, TURN
from .casts import FAR, OUT, PARALLEL, STEPS, extent, nearest, parting_axis

#: Numbers of a path: centre and rotation at its start, way, unit axis and angle [rad] of the turn, and how far from the
#: centre [m] something is that this turn swings.
FROM, ROTATION, WAY, AXIS, ANGLE, ARM, PATH = 0, 3, 12, 15, 18, 19, 20
#: What is returned where a path does not come in: above all shares.
NEVER = 2.0
# Depth, over the sizes, below which a shape is not in the other: more than rounding makes of what moves along a side.
_DEPTH = 1e-9


@inner
def _gap(m, kind_a, kind_b):
    """Gap of two colliders [m] and the unit normal from b to a; of boxes along the axis that parts them most."""
    if kind_a != BOX or kind_b != BOX:
        index = nearest(m, kind_a, kind_b, FAR)
        if index < 0:
            return FAR, 0.0, 0.0, 0.0
        at = OUT + POINT * index
        return m[at + 3], m[at], m[at + 1], m[at + 2]
    gap = -FAR
    x = y = z = 0.0
    for i in range(15):
        ax, ay, az = parting_axis(m, i)
        square = ax * ax + ay * ay + az * az
        if square > PARALLEL:
            inverse = 1.0 / sqrt(square)
            apart = (
                ax * (m[0] - m[PLACED]) + ay * (m[1] - m[PLACED + 1]) + az * (m[2] - m[PLACED + 2])
            )
            half = extent(m, 0, ax, ay, az) + extent(m, PLACED, ax, ay, az)
            if (abs(apart) - half) * inverse > gap:
                gap = (abs(apart) - half) * inverse
                sign = inverse if apart >= 0.0 else -inverse
                x = sign * ax
                y = sign * ay
                z = sign * az
    return gap, x, y, z


@inner
def _place(m, path, share):
    """Put the second collider where it is after a share of the path."""
    for k in range(3):
        m[PLACED + CENTRE + k] = path[FROM + k] + share * path[WAY + k]
    c = cos(share * path[ANGLE])
    s = sin(share * path[ANGLE])
    ux = path[AXIS]
    uy = path[AXIS + 1]
    uz = path[AXIS + 2]
    for j in range(3):
        x = path[ROTATION + j]
        y = path[ROTATION + 3 + j]
        z = path[ROTATION + 6 + j]
        along = (1.0 - c) * (ux * x + uy * y + uz * z)
        m[PLACED + TURN + j] = c * x + s * (uy * z - uz * y) + along * ux
        m[PLACED + TURN + 3 + j] = c * y + s * (uz * x - ux * z) + along * uy
        m[PLACED + TURN + 6 + j] = c * z + s * (ux * y - uy * x) + along * uz


@inner
def sweep(m, kind_a, kind_b, path):
    """Share of the path after which the second collider first is in the first one, its end left out; or NEVER.

    Args:
        m: pointer to MEMORY numbers: the first collider as placed, then of the second one the sizes.
        kind_a: kind of the first.
        kind_b: kind of the second.
        path: (PATH,) of the second.
    """
    deep = m[SIZE] + m[SIZE + 1] + m[SIZE + 2]
    deep = _DEPTH * (deep + m[PLACED + SIZE] + m[PLACED + SIZE + 1] + m[PLACED + SIZE + 2])
    swing = path[ANGLE] * path[ARM]
    share = 0.0
    for _ in range(STEPS):
        _place(m, path, share)
        gap, x, y, z = _gap(m, kind_a, kind_b)
        if gap <= -0.5 * deep:
            return share
        rate = x * path[WAY] + y * path[WAY + 1] + z * path[WAY + 2]
        if swing > 0.0:
            cx = path[AXIS + 1] * z - path[AXIS + 2] * y
            cy = path[AXIS + 2] * x - path[AXIS] * z
            cz = path[AXIS] * y - path[AXIS + 1] * x
            rate += swing * sqrt(cx * cx + cy * cy + cz * cz)
        # Written so that numbers that are not finite end it.
        if not rate > 0.0:
            return NEVER
        share += (gap + deep) / rate
        if not share < 1.0:
            return NEVER
    return NEVER
