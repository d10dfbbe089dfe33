"""Manifolds: the points at which two placed colliders touch, ``POINT`` numbers each.

Of a point: unit normal from b to a, gap along it (below 0: penetration), place midway between both surfaces, and an id
that stays while the same features touch. All sizes in metres, in the world's axes.
"""

from __future__ import annotations

from ..kernel import inner
from ..model.colliders import TURN

POINT = 8
#: Points that a pair keeps, and those that it may have before they are reduced.
MOST_POINTS, ALL_POINTS = 4, 8
#: Ids of a pair are below this.
IDS = 128
_GAP, _PLACE, _ID = 3, 4, 7
# Rounding decides nothing: of equal points the first is kept.
_TIE = 1e-9


@inner
def put_point(m, out, index, nx, ny, nz, gap, x, y, z, name):
    """Write a point whose place is given on the surface of a, midway being half the gap against the normal."""
    at = out + POINT * index
    m[at] = nx
    m[at + 1] = ny
    m[at + 2] = nz
    m[at + _GAP] = gap
    m[at + _PLACE] = x - 0.5 * gap * nx
    m[at + _PLACE + 1] = y - 0.5 * gap * ny
    m[at + _PLACE + 2] = z - 0.5 * gap * nz
    m[at + _ID] = name


@inner
def axis(m, placed, k):
    """Axis k of a placed collider in the world."""
    return m[placed + TURN + k], m[placed + TURN + 3 + k], m[placed + TURN + 6 + k]


@inner
def local(m, placed, x, y, z):
    """A vector of the world in the axes of a placed collider."""
    t = placed + TURN
    return (
        m[t] * x + m[t + 3] * y + m[t + 6] * z,
        m[t + 1] * x + m[t + 4] * y + m[t + 7] * z,
        m[t + 2] * x + m[t + 5] * y + m[t + 8] * z,
    )


@inner
def outward(m, placed, x, y, z):
    """A vector in the axes of a placed collider in those of the world."""
    t = placed + TURN
    return (
        m[t] * x + m[t + 1] * y + m[t + 2] * z,
        m[t + 3] * x + m[t + 4] * y + m[t + 5] * z,
        m[t + 6] * x + m[t + 7] * y + m[t + 8] * z,
    )


@inner
def flip(m, out, count):
    """Normals from a to b instead."""
    for index in range(count):
        for k in range(3):
            m[out + POINT * index + k] *= -1.0


@inner
def _signed_area(m, out, i, j, k):
    """Twice the area of three points seen along the normal."""
    a = out + POINT * i + _PLACE
    b = out + POINT * j + _PLACE
    c = out + POINT * k + _PLACE
    ux, uy, uz = m[b] - m[a], m[b + 1] - m[a + 1], m[b + 2] - m[a + 2]
    vx, vy, vz = m[c] - m[a], m[c + 1] - m[a + 1], m[c + 2] - m[a + 2]
    return (
        m[out] * (uy * vz - uz * vy)
        + m[out + 1] * (uz * vx - ux * vz)
        + m[out + 2] * (ux * vy - uy * vx)
    )


@inner
def _deepest(m, out, count):
    """The point that lies deeper than all others, or -1."""
    best = 0
    second = 1e300
    for i in range(1, count):
        gap = m[out + POINT * i + _GAP]
        if gap < m[out + POINT * best + _GAP]:
            second = m[out + POINT * best + _GAP]
            best = i
        else:
            second = min(second, gap)
    return best if m[out + POINT * best + _GAP] < second - _TIE else -1


@inner
def reduce_points(m, out, count):
    """Leave out corners of a polygon, those first that take least off its area, but not the deepest; how many are left.

    Where edges lie on each other, rounding makes corners all along them: of these none is left.
    Source: Visvalingam & Whyatt (1993), *Line Generalisation by Repeated Elimination of Points*.
    """
    deepest = _deepest(m, out, count)
    while count > MOST_POINTS:
        best = -1
        least = 1e300
        for i in range(count):
            if i != deepest:
                area = abs(_signed_area(m, out, (i - 1) % count, i, (i + 1) % count))
                if area < least * (1.0 - _TIE):
                    least = area
                    best = i
        count -= 1
        for at in range(out + POINT * best, out + POINT * count):
            m[at] = m[at + POINT]
        if best < deepest:
            deepest -= 1
    return count
