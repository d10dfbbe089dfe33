"""Spheres against spheres and boxes: the nearest points."""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..model.colliders import SIZE
from .manifold import local, outward, put_point


@inner
def balls(m, out, index, ax, ay, az, ra, bx, by, bz, rb, margin, name):
    """The point of two balls, if the gap is within the margin; how many. Coinciding centres part along y."""
    dx = ax - bx
    dy = ay - by
    dz = az - bz
    distance = sqrt(dx * dx + dy * dy + dz * dz)
    gap = distance - ra - rb
    if gap > margin:
        return 0
    nx = dx / distance if distance > 0.0 else 0.0
    ny = dy / distance if distance > 0.0 else 1.0
    nz = dz / distance if distance > 0.0 else 0.0
    put_point(m, out, index, nx, ny, nz, gap, ax - ra * nx, ay - ra * ny, az - ra * nz, name)
    return 1


@inner
def sphere_sphere(m, a, b, out, margin):
    """One point."""
    return balls(
        m,
        out,
        0,
        m[a],
        m[a + 1],
        m[a + 2],
        m[a + SIZE],
        m[b],
        m[b + 1],
        m[b + 2],
        m[b + SIZE],
        margin,
        0.0,
    )


@inner
def clamp(value, limit):
    """The nearest number of at most a size."""
    return min(max(value, -limit), limit)


@inner
def nearest_face(m, box, x, y, z):
    """Axis, sign and depth of the face of a box that a place inside, in the box's axes, is nearest to."""
    found = 0
    sign = 1.0
    least = 1e300
    for k in range(3):
        value = x if k == 0 else (y if k == 1 else z)
        depth = m[box + SIZE + k] - abs(value)
        if depth < least:
            least = depth
            found = k
            sign = 1.0 if value >= 0.0 else -1.0
    return found, sign, least


@inner
def sphere_box(m, a, b, out, margin):
    """One point; a centre inside leaves through the nearest face."""
    r = m[a + SIZE]
    x, y, z = local(m, b, m[a] - m[b], m[a + 1] - m[b + 1], m[a + 2] - m[b + 2])
    dx = x - clamp(x, m[b + SIZE])
    dy = y - clamp(y, m[b + SIZE + 1])
    dz = z - clamp(z, m[b + SIZE + 2])
    distance = sqrt(dx * dx + dy * dy + dz * dz)
    if distance > 0.0:
        gap = distance - r
        dx /= distance
        dy /= distance
        dz /= distance
    else:
        k, sign, depth = nearest_face(m, b, x, y, z)
        gap = -depth - r
        dx = sign if k == 0 else 0.0
        dy = sign if k == 1 else 0.0
        dz = sign if k == 2 else 0.0
    if gap > margin:
        return 0
    nx, ny, nz = outward(m, b, dx, dy, dz)
    put_point(m, out, 0, nx, ny, nz, gap, m[a] - r * nx, m[a + 1] - r * ny, m[a + 2] - r * nz, 0.0)
    return 1
