"""Box against box: separating axes, then a face clipped by the other's, or the nearest points of two edges.

Of the fifteen axes that with the largest gap decides; a face is preferred to an edge, and the first box's to the second
one's, unless the other is better by ``_BIAS``, so that boxes at rest keep their manifold. Across a face the opposite
box's most opposed face is clipped by the planes of its sides (Sutherland & Hodgman 1974); ids name the vertex or the
two edges that a point comes from. Source: Gottschalk, Lin & Manocha (1996); Ericson, *Real-Time Collision Detection*,
4.4.
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..model.colliders import SIZE
from .manifold import ALL_POINTS, axis, flip, local, put_point, reduce_points

# Preference of an earlier axis, over the smallest half edge.
_BIAS = 1e-3
# Edges are taken for parallel below this sine squared.
_PARALLEL = 1e-6
# Numbers of a vertex of the polygon: coordinates on the face and above it, its id, and the edge that follows.
_VERTEX = 5
_TURN, _POLYGON, _CLIPPED = 0, 9, 9 + 12 * _VERTEX
#: Numbers that ``box_box`` works in.
WORK = 9 + 24 * _VERTEX
# Ids of points on faces of the second box, and of edges, come behind those of the first.
_SECOND, _EDGES = 40, 80
_CORNERS = 20


@inner
def _relative(m, a, b, work):
    """Rotation of b in the axes of a, and the vector between their centres."""
    for j in range(3):
        bx, by, bz = axis(m, b, j)
        x, y, z = local(m, a, bx, by, bz)
        m[work + j] = x
        m[work + 3 + j] = y
        m[work + 6 + j] = z
    return local(m, a, m[b] - m[a], m[b + 1] - m[a + 1], m[b + 2] - m[a + 2])


@inner
def _pick(k, x, y, z):
    return x if k == 0 else (y if k == 1 else z)


@inner
def _face_gap_a(m, a, b, work, k, t):
    """Gap along axis k of a."""
    row = work + 3 * k
    reach = (
        abs(m[row]) * m[b + SIZE]
        + abs(m[row + 1]) * m[b + SIZE + 1]
        + abs(m[row + 2]) * m[b + SIZE + 2]
    )
    return abs(t) - m[a + SIZE + k] - reach


@inner
def _face_gap_b(m, a, b, work, k, tx, ty, tz):
    """Gap along axis k of b, and the centres' distance along it."""
    x = m[work + k]
    y = m[work + 3 + k]
    z = m[work + 6 + k]
    along = tx * x + ty * y + tz * z
    reach = abs(x) * m[a + SIZE] + abs(y) * m[a + SIZE + 1] + abs(z) * m[a + SIZE + 2]
    return abs(along) - m[b + SIZE + k] - reach, along


@inner
def _edge_axis(m, work, i, j):
    """e_i x c_j in the axes of a."""
    x = m[work + j]
    y = m[work + 3 + j]
    z = m[work + 6 + j]
    if i == 0:
        return 0.0, -z, y
    if i == 1:
        return z, 0.0, -x
    return -y, x, 0.0


@inner
def box_box(m, a, b, out, work, margin):
    """Up to four points."""
    tx, ty, tz = _relative(m, a, b, work)
    least = min(
        min(m[a + SIZE], min(m[a + SIZE + 1], m[a + SIZE + 2])),
        min(m[b + SIZE], min(m[b + SIZE + 1], m[b + SIZE + 2])),
    )
    best = -1e300
    face = 0
    sign = 1.0
    for k in range(3):
        t = _pick(k, tx, ty, tz)
        gap = _face_gap_a(m, a, b, work, k, t)
        if gap > margin:
            return 0
        if gap > best:
            best = gap
            face = k
            sign = 1.0 if t >= 0.0 else -1.0
    for k in range(3):
        gap, along = _face_gap_b(m, a, b, work, k, tx, ty, tz)
        if gap > margin:
            return 0
        if gap > best + _BIAS * least:
            best = gap
            face = 3 + k
            sign = 1.0 if along >= 0.0 else -1.0
    edge = -1
    for i in range(3):
        for j in range(3):
            square = 1.0 - m[work + 3 * i + j] ** 2
            if square > _PARALLEL:
                x, y, z = _edge_axis(m, work, i, j)
                reach = abs(x) * m[a + SIZE] + abs(y) * m[a + SIZE + 1] + abs(z) * m[a + SIZE + 2]
                for k in range(3):
                    if k != j:
                        reach += m[b + SIZE + k] * abs(
                            x * m[work + k] + y * m[work + 3 + k] + z * m[work + 6 + k]
                        )
                gap = (abs(tx * x + ty * y + tz * z) - reach) / sqrt(square)
                if gap > margin:
                    return 0
                if gap > best + _BIAS * least:
                    best = gap
                    edge = 3 * i + j
    if edge >= 0:
        return _edges(m, a, b, out, work, edge, best, tx, ty, tz)
    if face < 3:
        count = _faces(m, a, b, out, work, face, sign, margin, 0.0)
        # Written with the normal out of the reference face: from a to b.
        flip(m, out, count)
        return count
    return _faces(m, b, a, out, work, face - 3, -sign, margin, float(_SECOND))


@inner
def _edges(m, a, b, out, work, edge, gap, tx, ty, tz):
    """The point of two edges, midway between the nearest points of their lines."""
    i = edge // 3
    j = edge % 3
    x, y, z = _edge_axis(m, work, i, j)
    size = sqrt(x * x + y * y + z * z)
    if tx * x + ty * y + tz * z < 0.0:
        size = -size
    x /= size
    y /= size
    z /= size
    # In the axes of a, with the normal from a to b: the edge of a furthest along it, that of b furthest against it.
    px = 0.0 if i == 0 else (m[a + SIZE] if x > 0.0 else -m[a + SIZE])
    py = 0.0 if i == 1 else (m[a + SIZE + 1] if y > 0.0 else -m[a + SIZE + 1])
    pz = 0.0 if i == 2 else (m[a + SIZE + 2] if z > 0.0 else -m[a + SIZE + 2])
    qx = tx
    qy = ty
    qz = tz
    for k in range(3):
        if k != j:
            cx = m[work + k]
            cy = m[work + 3 + k]
            cz = m[work + 6 + k]
            h = m[b + SIZE + k]
            if x * cx + y * cy + z * cz > 0.0:
                h = -h
            qx += h * cx
            qy += h * cy
            qz += h * cz
    # Line of a along e_i through p, line of b along c through q.
    cx = m[work + j]
    cy = m[work + 3 + j]
    cz = m[work + 6 + j]
    c = _pick(i, cx, cy, cz)
    dx = qx - px
    dy = qy - py
    dz = qz - pz
    along = _pick(i, dx, dy, dz)
    other = dx * cx + dy * cy + dz * cz
    s = (along - c * other) / (1.0 - c * c)
    h = m[a + SIZE + i]
    s = min(max(s, -h), h)
    px += s if i == 0 else 0.0
    py += s if i == 1 else 0.0
    pz += s if i == 2 else 0.0
    nx = 0.0
    ny = 0.0
    nz = 0.0
    wx = m[a]
    wy = m[a + 1]
    wz = m[a + 2]
    for k in range(3):
        ex, ey, ez = axis(m, a, k)
        n = _pick(k, x, y, z)
        p = _pick(k, px, py, pz)
        nx -= n * ex
        ny -= n * ey
        nz -= n * ez
        wx += p * ex
        wy += p * ey
        wz += p * ez
    put_point(m, out, 0, nx, ny, nz, gap, wx, wy, wz, float(_EDGES + edge))
    return 1


@inner
def _incident(m, ref, inc, work, k, sign, u, v):
    """The face of the other box most opposed to the reference face, as a polygon over it."""
    nx, ny, nz = axis(m, ref, k)
    nx *= sign
    ny *= sign
    nz *= sign
    face = 0
    most = -1.0
    outer = 1.0
    for j in range(3):
        x, y, z = axis(m, inc, j)
        along = nx * x + ny * y + nz * z
        if abs(along) > most:
            most = abs(along)
            face = j
            outer = -1.0 if along > 0.0 else 1.0
    p = (face + 1) % 3
    q = (face + 2) % 3
    fx, fy, fz = axis(m, inc, face)
    px, py, pz = axis(m, inc, p)
    qx, qy, qz = axis(m, inc, q)
    hf = outer * m[inc + SIZE + face]
    cx = m[inc] + hf * fx - m[ref]
    cy = m[inc + 1] + hf * fy - m[ref + 1]
    cz = m[inc + 2] + hf * fz - m[ref + 2]
    ux, uy, uz = axis(m, ref, u)
    vx, vy, vz = axis(m, ref, v)
    for corner in range(4):
        hp = m[inc + SIZE + p] * (1.0 if corner == 1 or corner == 2 else -1.0)
        hq = m[inc + SIZE + q] * (1.0 if corner >= 2 else -1.0)
        x = cx + hp * px + hq * qx
        y = cy + hp * py + hq * qy
        z = cz + hp * pz + hq * qz
        at = work + _POLYGON + _VERTEX * corner
        m[at] = x * ux + y * uy + z * uz
        m[at + 1] = x * vx + y * vy + z * vz
        m[at + 2] = x * nx + y * ny + z * nz
        m[at + 3] = float(corner)
        m[at + 4] = float(corner)


@inner
def _copy(m, source, target):
    for k in range(_VERTEX):
        m[target + k] = m[source + k]


@inner
def _clip(m, source, target, count, coordinate, limit, side):
    """Polygon without what lies beyond a side: where sign times the coordinate is above the limit; its size."""
    sign = 1.0 if side % 2 == 0 else -1.0
    kept = 0
    for i in range(count):
        here = source + _VERTEX * i
        there = source + _VERTEX * ((i + 1) % count)
        d = sign * m[here + coordinate] - limit
        e = sign * m[there + coordinate] - limit
        if d <= 0.0:
            _copy(m, here, target + _VERTEX * kept)
            kept += 1
        if (d <= 0.0) != (e <= 0.0):
            share = d / (d - e)
            at = target + _VERTEX * kept
            for k in range(3):
                m[at + k] = m[here + k] + share * (m[there + k] - m[here + k])
            edge = m[here + 4]
            if edge < 4.0:
                m[at + 3] = 4.0 + 4.0 * edge + side
            else:
                m[at + 3] = _CORNERS + 4.0 * (edge - 4.0) + side
            # Outside it goes on along the side, inside along the edge that was cut.
            m[at + 4] = 4.0 + side if d <= 0.0 else edge
            kept += 1
    return kept


@inner
def _faces(m, ref, inc, out, work, k, sign, margin, names):
    """Points of the incident face within the reference face's sides; normals out of the latter."""
    u = (k + 1) % 3
    v = (k + 2) % 3
    _incident(m, ref, inc, work, k, sign, u, v)
    source = work + _POLYGON
    target = work + _CLIPPED
    count = 4
    for side in range(4):
        coordinate = side // 2
        limit = m[ref + SIZE + (u if coordinate == 0 else v)]
        count = _clip(m, source, target, count, coordinate, limit, side)
        source, target = target, source
    nx, ny, nz = axis(m, ref, k)
    nx *= sign
    ny *= sign
    nz *= sign
    ux, uy, uz = axis(m, ref, u)
    vx, vy, vz = axis(m, ref, v)
    face = m[ref + SIZE + k]
    kept = 0
    for i in range(count):
        at = source + _VERTEX * i
        gap = m[at + 2] - face
        if gap <= margin and kept < ALL_POINTS:
            # The point of the incident face, which lies above the reference face by the gap.
            x = m[ref] + m[at] * ux + m[at + 1] * vx + m[at + 2] * nx
            y = m[ref + 1] + m[at] * uy + m[at + 1] * vy + m[at + 2] * ny
            z = m[ref + 2] + m[at] * uz + m[at + 1] * vz + m[at + 2] * nz
            put_point(m, out, kept, nx, ny, nz, gap, x, y, z, names + m[at + 3])
            kept += 1
    return reduce_points(m, out, kept)
