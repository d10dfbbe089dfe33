"""Spheres, boxes and capsules against a half-space: the points that reach furthest into it."""

from __future__ import annotations

from ..kernel import inner
from ..model.colliders import SIZE
from .manifold import axis, local, outward, put_point

# Rounding decides nothing: of faces that look alike the first is taken.
_TIE = 1e-9


@inner
def _height(m, plane, nx, ny, nz, x, y, z):
    """Distance of a place from the plane."""
    return nx * (x - m[plane]) + ny * (y - m[plane + 1]) + nz * (z - m[plane + 2])


@inner
def sphere_half_space(m, a, b, out, margin):
    """One point."""
    nx, ny, nz = axis(m, b, 1)
    r = m[a + SIZE]
    gap = _height(m, b, nx, ny, nz, m[a], m[a + 1], m[a + 2]) - r
    if gap > margin:
        return 0
    put_point(m, out, 0, nx, ny, nz, gap, m[a] - r * nx, m[a + 1] - r * ny, m[a + 2] - r * nz, 0.0)
    return 1


@inner
def capsule_half_space(m, a, b, out, margin):
    """The two ends."""
    nx, ny, nz = axis(m, b, 1)
    dx, dy, dz = axis(m, a, 1)
    r = m[a + SIZE]
    h = m[a + SIZE + 1]
    count = 0
    for end in range(2):
        t = h if end == 1 else -h
        x = m[a] + t * dx
        y = m[a + 1] + t * dy
        z = m[a + 2] + t * dz
        gap = _height(m, b, nx, ny, nz, x, y, z) - r
        if gap <= margin:
            put_point(
                m, out, count, nx, ny, nz, gap, x - r * nx, y - r * ny, z - r * nz, float(end)
            )
            count += 1
    return count


@inner
def box_half_space(m, a, b, out, margin):
    """Corners of the face that looks at the plane: what lies above these would take their place in a thin box."""
    nx, ny, nz = axis(m, b, 1)
    lx, ly, lz = local(m, a, nx, ny, nz)
    most = lx
    face = 1
    if abs(ly) > abs(most) + _TIE:
        most = ly
        face = 2
    if abs(lz) > abs(most) + _TIE:
        most = lz
        face = 4
    wanted = 0 if most > 0.0 else face
    count = 0
    for corner in range(8):
        if corner & face != wanted:
            continue
        x, y, z = outward(
            m, a,
            m[a + SIZE] if corner & 1 else -m[a + SIZE],
            m[a + SIZE + 1] if corner & 2 else -m[a + SIZE + 1],
            m[a + SIZE + 2] if corner & 4 else -m[a + SIZE + 2],
        )  # fmt: skip
        x += m[a]
        y += m[a + 1]
        z += m[a + 2]
        gap = _height(m, b, nx, ny, nz, x, y, z)
        if gap <= margin:
            put_point(m, out, count, nx, ny, nz, gap, x, y, z, float(corner))
            count += 1
    return count
