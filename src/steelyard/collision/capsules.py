"""Capsules against spheres, capsules and boxes: the nearest points of their segments, two where they lie alongside.

The distance of a place on a segment from a box is convex along it, and its square's derivative is piecewise linear, so
the nearest place follows from the few places at which that bends. Source: Ericson, *Real-Time Collision Detection*,
5.1 (segments).
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..model.colliders import SIZE
from .manifold import axis, local, outward, put_point
from .spheres import balls, clamp, nearest_face

# Segments are taken for parallel below this sine squared.
_PARALLEL = 1e-4


@inner
def sphere_capsule(m, a, b, out, margin):
    """One point, at the nearest place of the segment."""
    dx, dy, dz = axis(m, b, 1)
    h = m[b + SIZE + 1]
    t = clamp(dx * (m[a] - m[b]) + dy * (m[a + 1] - m[b + 1]) + dz * (m[a + 2] - m[b + 2]), h)
    return balls(
        m, out, 0, m[a], m[a + 1], m[a + 2], m[a + SIZE], m[b] + t * dx, m[b + 1] + t * dy, m[b + 2] + t * dz,
        m[b + SIZE], margin, 0.0,
    )  # fmt: skip


@inner
def _at(m, c, t):
    """Place on a capsule's segment."""
    dx, dy, dz = axis(m, c, 1)
    return m[c] + t * dx, m[c + 1] + t * dy, m[c + 2] + t * dz


@inner
def capsule_capsule(m, a, b, out, margin):
    """One point at the nearest places, or two at the ends of what lies alongside."""
    ux, uy, uz = axis(m, a, 1)
    vx, vy, vz = axis(m, b, 1)
    ha = m[a + SIZE + 1]
    hb = m[b + SIZE + 1]
    rx = m[a] - m[b]
    ry = m[a + 1] - m[b + 1]
    rz = m[a + 2] - m[b + 2]
    c = ux * vx + uy * vy + uz * vz
    d = ux * rx + uy * ry + uz * rz
    e = vx * rx + vy * ry + vz * rz
    sine = 1.0 - c * c
    if sine < _PARALLEL:
        # Where both overlap along a, in a's parameter.
        middle = -d
        reach = hb * abs(c)
        low = max(-ha, middle - reach)
        high = min(ha, middle + reach)
        if high > low:
            count = 0
            for end in range(2):
                s = low if end == 0 else high
                x, y, z = _at(m, a, s)
                t = clamp(e + s * c, hb)
                px, py, pz = _at(m, b, t)
                count += balls(
                    m, out, count, x, y, z, m[a + SIZE], px, py, pz, m[b + SIZE], margin, 1.0 + end
                )
            return count
        s = clamp(middle, ha)
    else:
        s = clamp((c * e - d) / sine, ha)
    t = clamp(e + s * c, hb)
    s = clamp(c * t - d, ha)
    t = clamp(e + s * c, hb)
    x, y, z = _at(m, a, s)
    px, py, pz = _at(m, b, t)
    return balls(m, out, 0, x, y, z, m[a + SIZE], px, py, pz, m[b + SIZE], margin, 0.0)


@inner
def _outside(value, limit):
    """How far a coordinate lies beyond a half edge."""
    return value - clamp(value, limit)


@inner
def _pull(hx, hy, hz, x, y, z, ux, uy, uz, t):
    """Half the derivative along a segment of the square of its distance from a box."""
    return (
        ux * _outside(x + t * ux, hx)
        + uy * _outside(y + t * uy, hy)
        + uz * _outside(z + t * uz, hz)
    )


@inner
def _nearest_to_box(hx, hy, hz, x, y, z, ux, uy, uz, h):
    """Parameter of the place of a segment nearest to a box."""
    low = -h
    high = h
    at_low = _pull(hx, hy, hz, x, y, z, ux, uy, uz, low)
    at_high = _pull(hx, hy, hz, x, y, z, ux, uy, uz, high)
    if at_low >= 0.0:
        return low
    if at_high <= 0.0:
        return high
    for k in range(6):
        p = x if k < 2 else (y if k < 4 else z)
        u = ux if k < 2 else (uy if k < 4 else uz)
        limit = hx if k < 2 else (hy if k < 4 else hz)
        if u != 0.0:
            bend = ((limit if k % 2 == 0 else -limit) - p) / u
            if low < bend < high:
                value = _pull(hx, hy, hz, x, y, z, ux, uy, uz, bend)
                if value < 0.0:
                    low = bend
                    at_low = value
                elif value > 0.0:
                    high = bend
                    at_high = value
                else:
                    low = bend
                    high = bend
    if high <= low:
        return low
    return (low * at_high - high * at_low) / (at_high - at_low)


@inner
def _on_face(m, a, b, out, margin, k, sign, x, y, z, ux, uy, uz):
    """Ends of the part of the segment above a face of the box."""
    r = m[a + SIZE]
    h = m[a + SIZE + 1]
    low = -h
    high = h
    for j in range(3):
        if j != k:
            p = x if j == 0 else (y if j == 1 else z)
            u = ux if j == 0 else (uy if j == 1 else uz)
            limit = m[b + SIZE + j]
            if abs(u) > 1e-12:
                one = (limit - p) / u
                two = (-limit - p) / u
                low = max(low, min(one, two))
                high = min(high, max(one, two))
    nx, ny, nz = axis(m, b, k)
    nx *= sign
    ny *= sign
    nz *= sign
    p = x if k == 0 else (y if k == 1 else z)
    u = ux if k == 0 else (uy if k == 1 else uz)
    count = 0
    for end in range(2):
        t = low if end == 0 else high
        gap = sign * (p + t * u) - m[b + SIZE + k] - r
        if gap <= margin and (end == 0 or high > low + 1e-9 * h):
            cx, cy, cz = _at(m, a, t)
            put_point(
                m, out, count, nx, ny, nz, gap, cx - r * nx, cy - r * ny, cz - r * nz, 1.0 + end
            )
            count += 1
    return count


@inner
def capsule_box(m, a, b, out, margin):
    """Two points above a face, else the nearest one; a segment through the box leaves by the axis of least depth."""
    r = m[a + SIZE]
    h = m[a + SIZE + 1]
    hx = m[b + SIZE]
    hy = m[b + SIZE + 1]
    hz = m[b + SIZE + 2]
    x, y, z = local(m, b, m[a] - m[b], m[a + 1] - m[b + 1], m[a + 2] - m[b + 2])
    ax, ay, az = axis(m, a, 1)
    ux, uy, uz = local(m, b, ax, ay, az)
    t = _nearest_to_box(hx, hy, hz, x, y, z, ux, uy, uz, h)
    dx = _outside(x + t * ux, hx)
    dy = _outside(y + t * uy, hy)
    dz = _outside(z + t * uz, hz)
    distance = sqrt(dx * dx + dy * dy + dz * dz)
    if distance - r > margin:
        return 0
    if distance > 0.0:
        beyond = (1 if dx != 0.0 else 0) + (1 if dy != 0.0 else 0) + (1 if dz != 0.0 else 0)
        if beyond == 1:
            k = 0 if dx != 0.0 else (1 if dy != 0.0 else 2)
            sign = 1.0 if dx + dy + dz > 0.0 else -1.0
            return _on_face(m, a, b, out, margin, k, sign, x, y, z, ux, uy, uz)
        nx, ny, nz = outward(m, b, dx / distance, dy / distance, dz / distance)
        cx, cy, cz = _at(m, a, t)
        put_point(m, out, 0, nx, ny, nz, distance - r, cx - r * nx, cy - r * ny, cz - r * nz, 0.0)
        return 1
    return _through(m, a, b, out, margin, x, y, z, ux, uy, uz)


@inner
def _through(m, a, b, out, margin, x, y, z, ux, uy, uz):
    """A segment that meets the box: the axis of least depth among the faces' and those across segment and edges."""
    r = m[a + SIZE]
    h = m[a + SIZE + 1]
    k, sign, _ = nearest_face(m, b, x, y, z)
    least = -1e300
    for j in range(3):
        p = x if j == 0 else (y if j == 1 else z)
        u = ux if j == 0 else (uy if j == 1 else uz)
        apart = abs(p) - m[b + SIZE + j] - h * abs(u)
        if apart > least:
            least = apart
            k = j
            sign = 1.0 if p >= 0.0 else -1.0
    edge = -1
    for j in range(3):
        # e_j x u, along which the segment has no length.
        vx = 0.0 if j == 0 else (uz if j == 1 else -uy)
        vy = -uz if j == 0 else (0.0 if j == 1 else ux)
        vz = uy if j == 0 else (-ux if j == 1 else 0.0)
        size = sqrt(vx * vx + vy * vy + vz * vz)
        if size > 1e-3:
            reach = abs(vx) * m[b + SIZE] + abs(vy) * m[b + SIZE + 1] + abs(vz) * m[b + SIZE + 2]
            apart = (abs(vx * x + vy * y + vz * z) - reach) / size
            if apart > least + 1e-3 * r:
                least = apart
                edge = j
    if edge < 0:
        return _on_face(m, a, b, out, margin, k, sign, x, y, z, ux, uy, uz)
    vx = 0.0 if edge == 0 else (uz if edge == 1 else -uy)
    vy = -uz if edge == 0 else (0.0 if edge == 1 else ux)
    vz = uy if edge == 0 else (-ux if edge == 1 else 0.0)
    size = sqrt(vx * vx + vy * vy + vz * vz)
    if vx * x + vy * y + vz * z < 0.0:
        size = -size
    vx /= size
    vy /= size
    vz /= size
    # The edge that reaches furthest along the axis, and the segment's place nearest to its line.
    ex = 0.0 if edge == 0 else (m[b + SIZE] if vx > 0.0 else -m[b + SIZE])
    ey = 0.0 if edge == 1 else (m[b + SIZE + 1] if vy > 0.0 else -m[b + SIZE + 1])
    ez = 0.0 if edge == 2 else (m[b + SIZE + 2] if vz > 0.0 else -m[b + SIZE + 2])
    px = 0.0 if edge == 0 else ux
    py = 0.0 if edge == 1 else uy
    pz = 0.0 if edge == 2 else uz
    square = px * px + py * py + pz * pz
    t = clamp((px * (ex - x) + py * (ey - y) + pz * (ez - z)) / square, h)
    nx, ny, nz = outward(m, b, vx, vy, vz)
    cx, cy, cz = _at(m, a, t)
    put_point(m, out, 0, nx, ny, nz, least - r, cx - r * nx, cy - r * ny, cz - r * nz, 3.0 + edge)
    return 1
