"""Casts: when a shape that moves along a straight line first touches another, which stands still.

The gap between two convex shapes is a convex function of the way, so Newton's method from the start, where it is above
0, comes nearer from one side and never passes the first root: it ends there, or where the gap no longer falls, which is
a miss. Two boxes touch when their extents overlap on all fifteen axes across which faces and edges can part them: each
gives an interval of the way.
"""

from __future__ import annotations

from math import sqrt

from ..collision.broad_phase import half_extent
from ..collision.hierarchy import (
    box_of,
    children,
    clear_tree,
    insert_leaf,
    meets,
    root_of,
)
from ..collision.manifold import axis
from ..collision.narrow_phase import ALL_POINTS, POINT, WORK, collide
from ..kernel import inner, kernel
from ..math.pointers import doubles_at
from ..model.colliders import BOX, HALF_SPACE, PLACED, SIZE

#: Newton's steps.
STEPS = 100
# The gap [m] that is none, over the sizes at hand.
_TOUCHING = 1e-14
FAR = 1e300
#: Where the axes of two boxes are parallel, products of edges part nothing that faces do not.
PARALLEL = 1e-12
# Gap [m], over the box's size, within which the places where two boxes touch are looked for.
_MANIFOLD = 1e-7
#: Two colliders lie in the memory, then the points at which they touch.
OUT = 2 * PLACED
_WORK = OUT + ALL_POINTS * POINT
#: Numbers to work in.
MEMORY = _WORK + WORK
#: Colliders from which on a tree is made (below, planting it takes what it saves).
MANY = 4
# Boxes about what is placed are larger by this, over place and size, than rounding makes them smaller.
_ROUNDING = 1e-15
# Numbers of a hit: way, gap, normal, place.
HIT = 8


@inner
def nearest(m, kind_a, kind_b, margin):
    """Index of the point of least gap, or -1 without any."""
    count = collide(m, kind_a, 0, kind_b, PLACED, OUT, _WORK, margin)
    best = -1
    for i in range(count):
        if best < 0 or m[OUT + POINT * i + 3] < m[OUT + POINT * best + 3]:
            best = i
    return best


@inner
def _write(m, hit, way, index):
    """A hit from a point."""
    at = OUT + POINT * index
    hit[0] = way
    hit[1] = m[at + 3]
    for k in range(3):
        hit[2 + k] = m[at + k]
        hit[5 + k] = m[at + 4 + k]


@inner
def _cast_convex(m, kind_a, kind_b, x, y, z, dx, dy, dz, reach, hit):
    """By the gap: way to the first touch, or a far one; the point is written."""
    size = m[SIZE] + m[SIZE + 1] + m[PLACED + SIZE] + m[PLACED + SIZE + 1] + m[PLACED + SIZE + 2]
    size += abs(x) + abs(y) + abs(z) + abs(m[PLACED]) + abs(m[PLACED + 1]) + abs(m[PLACED + 2])
    way = 0.0
    for _ in range(STEPS):
        m[0] = x + way * dx
        m[1] = y + way * dy
        m[2] = z + way * dz
        index = nearest(m, kind_a, kind_b, FAR)
        if index < 0:
            return FAR
        at = OUT + POINT * index
        gap = m[at + 3]
        if gap <= _TOUCHING * size:
            _write(m, hit, way, index)
            return way
        slope = m[at] * dx + m[at + 1] * dy + m[at + 2] * dz
        if slope >= 0.0:
            return FAR
        step = -gap / slope
        if way + step > reach:
            return FAR
        if way + step == way:
            _write(m, hit, way, index)
            return way
        way += step
    return FAR


@inner
def extent(m, box, x, y, z):
    """Half the length of a box along an axis of any length."""
    total = 0.0
    for k in range(3):
        ax, ay, az = axis(m, box, k)
        total += m[box + SIZE + k] * abs(ax * x + ay * y + az * z)
    return total


@inner
def parting_axis(m, i):
    """Of the fifteen axes across which faces and edges of two boxes can part them, one, of any length."""
    if i < 6:
        return axis(m, 0 if i < 3 else PLACED, i % 3)
    ux, uy, uz = axis(m, 0, (i - 6) // 3)
    vx, vy, vz = axis(m, PLACED, (i - 6) % 3)
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@inner
def _cast_boxes(m, x, y, z, dx, dy, dz, reach, hit):
    """By the fifteen axes: way to the first touch, or a far one."""
    first = 0.0
    last = reach
    px = x - m[PLACED]
    py = y - m[PLACED + 1]
    pz = z - m[PLACED + 2]
    for i in range(15):
        ax, ay, az = parting_axis(m, i)
        if ax * ax + ay * ay + az * az > PARALLEL:
            apart = ax * px + ay * py + az * pz
            speed = ax * dx + ay * dy + az * dz
            half = extent(m, 0, ax, ay, az) + extent(m, PLACED, ax, ay, az)
            if speed == 0.0:
                if abs(apart) > half:
                    return FAR
            else:
                one = (-half - apart) / speed
                two = (half - apart) / speed
                first = max(first, min(one, two))
                last = min(last, max(one, two))
    if first > last:
        return FAR
    m[0] = x + first * dx
    m[1] = y + first * dy
    m[2] = z + first * dz
    margin = _MANIFOLD * (m[SIZE] + m[SIZE + 1] + m[SIZE + 2])
    count = collide(m, BOX, 0, BOX, PLACED, OUT, _WORK, margin if first > 0.0 else 0.0)
    if count > 0:
        # The middle of the points that touch.
        best = 0
        for i in range(1, count):
            if m[OUT + POINT * i + 3] < m[OUT + POINT * best + 3]:
                best = i
        _write(m, hit, first, best)
        if first > 0.0:
            hit[1] = 0.0
            for k in range(3):
                total = 0.0
                for i in range(count):
                    total += m[OUT + POINT * i + 4 + k]
                hit[5 + k] = total / count
    else:
        # A corner's touch that rounding misses: between both centres.
        hit[0] = first
        hit[1] = 0.0
        for k in range(3):
            hit[2 + k] = m[k] - m[PLACED + k]
            hit[5 + k] = 0.5 * (m[k] + m[PLACED + k])
        size = sqrt(hit[2] * hit[2] + hit[3] * hit[3] + hit[4] * hit[4])
        for k in range(3):
            hit[2 + k] = hit[2 + k] / size if size > 0.0 else (1.0 if k == 1 else 0.0)
    return first


@inner
def _cast_one(m, kind_a, kind_b, x, y, z, dx, dy, dz, reach, hit):
    """Way of collider a, at entry 0 of m, to collider b behind it."""
    if kind_a == BOX and kind_b == BOX:
        return _cast_boxes(m, x, y, z, dx, dy, dz, reach, hit)
    return _cast_convex(m, kind_a, kind_b, x, y, z, dx, dy, dz, reach, hit)


@inner
def _half_box(placed, kind, k):
    """Half the length [m] along an axis of the world of a box that holds a placed collider, rounding or not."""
    half = half_extent(placed, kind, 0, k)
    return half + _ROUNDING * (abs(placed[k]) + half)


@inner
def plant(kinds, placed, allowed, n, s):
    """A tree of the allowed colliders of one world that have an end, in all of two arrays."""
    leaves = kinds.shape[0]
    clear_tree(n, 0, leaves)
    for i in range(leaves):
        if allowed[i] and kinds[i] != HALF_SPACE:
            own = box_of(0, i)
            for k in range(3):
                half = _half_box(placed[i], kinds[i], k)
                s[own + k] = placed[i, k] - half
                s[own + 3 + k] = placed[i, k] + half
            insert_leaf(n, 0, s, 0, leaves, i)


@inner
def _enters(s, node, ray, half, limit):
    """Way at which a node's box, enlarged by half extents, is entered; above the limit where it is not."""
    first = 0.0
    last = limit
    own = box_of(0, node)
    for k in range(3):
        low = s[own + k] - half[k] - ray[k]
        high = s[own + 3 + k] + half[k] - ray[k]
        speed = ray[3 + k]
        if speed == 0.0:
            if low > 0.0 or high < 0.0:
                return FAR
        else:
            one = low / speed
            two = high / speed
            first = max(first, min(one, two))
            last = min(last, max(one, two))
    return first if first <= last else FAR


@kernel
def cast_many(
    kinds, placed, allowed, kind, query, direction, reach, every, tree, found, hits,
    memory, words, boxes, stack, ray,
):  # fmt: skip
    """Casts of many shapes in many worlds.

    Args:
        kinds: of the colliders, (n,) int64.
        placed: colliders in the world, (worlds, n, PLACED).
        allowed: which of them can be hit, (n,) bool.
        kind: of what is cast.
        query: placed at its start, (worlds, casts, PLACED).
        direction: unit vectors, (worlds, casts, 3).
        reach: longest way [m], (worlds, casts).
        every: whether all hits are wanted, and not the first alone.
        tree: whether to plant one, or to try all colliders.
        found: collider that is hit, or -1, (worlds, casts, n or 1) int64, written; all hits in the colliders' order.
        hits: of these, (worlds, casts, n or 1, HIT), written.
        memory: (MEMORY,) to work in; the other arrays are for the tree's words, its boxes and one more behind them,
            the nodes before a walk and the ray.
    """
    m = doubles_at(memory.ctypes.data)
    n = kinds.shape[0]
    half = ray[6:9]
    hit = ray[9:]
    for w in range(placed.shape[0]):
        if tree:
            plant(kinds, placed[w], allowed, words, boxes)
        for c in range(query.shape[1]):
            for k in range(3):
                ray[k] = query[w, c, k]
                ray[3 + k] = direction[w, c, k]
                half[k] = _half_box(query[w, c], kind, k)
            for k in range(PLACED):
                m[k] = query[w, c, k]
            best = reach[w, c]
            waiting = 0
            if tree and root_of(words, 0) >= 0:
                stack[0] = root_of(words, 0)
                waiting = 1
            # What no tree holds comes first: its hits shorten the walk.
            other = 0
            while other < n or waiting > 0:
                item = -1
                if other < n:
                    if allowed[other] and (not tree or kinds[other] == HALF_SPACE):
                        item = other
                    other += 1
                else:
                    waiting -= 1
                    node = stack[waiting]
                    if _enters(boxes, node, ray, half, best) <= best:
                        if node < n:
                            item = node
                        else:
                            left, right = children(words, 0, node)
                            near = _enters(boxes, left, ray, half, best)
                            far = _enters(boxes, right, ray, half, best)
                            if near > far:
                                left, right = right, left
                                near, far = far, near
                            if far <= best:
                                stack[waiting] = right
                                waiting += 1
                            if near <= best:
                                stack[waiting] = left
                                waiting += 1
                if item >= 0:
                    for k in range(PLACED):
                        m[PLACED + k] = placed[w, item, k]
                    way = _cast_one(
                        m,
                        kind,
                        kinds[item],
                        ray[0],
                        ray[1],
                        ray[2],
                        ray[3],
                        ray[4],
                        ray[5],
                        best,
                        hit,
                    )
                    if way <= best:
                        slot = item if every else 0
                        first = every or found[w, c, 0] < 0
                        # Of what is hit at once the first collider counts, whatever the tree.
                        if first or way < hits[w, c, 0, 0] or item < found[w, c, 0]:
                            found[w, c, slot] = item
                            for k in range(HIT):
                                hits[w, c, slot, k] = hit[k]
                        if not every:
                            best = way


@kernel
def overlap_many(
    kinds, placed, allowed, kind, query, tree, found, hits, memory, words, boxes, stack
):
    """Which colliders a shape overlaps, in many worlds; see ``cast_many``, whose hits these are with ways of 0."""
    m = doubles_at(memory.ctypes.data)
    n = kinds.shape[0]
    box = boxes.shape[0] - 6
    for w in range(placed.shape[0]):
        if tree:
            plant(kinds, placed[w], allowed, words, boxes)
        for c in range(query.shape[1]):
            for k in range(PLACED):
                m[k] = query[w, c, k]
            for k in range(3):
                half = _half_box(query[w, c], kind, k)
                boxes[box + k] = query[w, c, k] - half
                boxes[box + 3 + k] = query[w, c, k] + half
            waiting = 0
            if tree and root_of(words, 0) >= 0:
                stack[0] = root_of(words, 0)
                waiting = 1
            other = 0
            while other < n or waiting > 0:
                item = -1
                if other < n:
                    if allowed[other] and (not tree or kinds[other] == HALF_SPACE):
                        item = other
                    other += 1
                else:
                    waiting -= 1
                    node = stack[waiting]
                    if meets(boxes, box_of(0, node), box):
                        if node < n:
                            item = node
                        else:
                            left, right = children(words, 0, node)
                            stack[waiting] = left
                            stack[waiting + 1] = right
                            waiting += 2
                if item >= 0:
                    for k in range(PLACED):
                        m[PLACED + k] = placed[w, item, k]
                    index = nearest(m, kind, kinds[item], 0.0)
                    if index >= 0:
                        found[w, c, item] = item
                        _write(m, hits[w, c, item], 0.0, index)
