"""Narrow phase: the manifold of any two placed colliders."""

from __future__ import annotations

from ..kernel import inner, kernel
from ..math.pointers import doubles_at
from ..model.colliders import BOX, CAPSULE, HALF_SPACE, PLACED, SPHERE
from .boxes import WORK, box_box
from .capsules import capsule_box, capsule_capsule, sphere_capsule
from .half_spaces import box_half_space, capsule_half_space, sphere_half_space
from .manifold import ALL_POINTS, IDS, MOST_POINTS, POINT, flip
from .spheres import sphere_box, sphere_sphere

__all__ = ["ALL_POINTS", "IDS", "MOST_POINTS", "POINT", "WORK", "collide", "collide_many"]


@inner
def _ordered(m, kind_a, a, kind_b, b, out, work, margin):
    """Manifold of kinds in the order sphere, capsule, box, half-space."""
    if kind_b == HALF_SPACE:
        if kind_a == SPHERE:
            return sphere_half_space(m, a, b, out, margin)
        if kind_a == CAPSULE:
            return capsule_half_space(m, a, b, out, margin)
        if kind_a == BOX:
            return box_half_space(m, a, b, out, margin)
        return 0
    if kind_a == SPHERE:
        if kind_b == SPHERE:
            return sphere_sphere(m, a, b, out, margin)
        if kind_b == CAPSULE:
            return sphere_capsule(m, a, b, out, margin)
        return sphere_box(m, a, b, out, margin)
    if kind_a == CAPSULE:
        if kind_b == CAPSULE:
            return capsule_capsule(m, a, b, out, margin)
        return capsule_box(m, a, b, out, margin)
    return box_box(m, a, b, out, work, margin)


@inner
def _rank(kind):
    return 0 if kind == SPHERE else (1 if kind == CAPSULE else (2 if kind == BOX else 3))


@inner
def collide(m, kind_a, a, kind_b, b, out, work, margin):
    """Write the points of two placed colliders whose gap is at most the margin; how many, MOST_POINTS at most.

    Args:
        m: pointer to numbers.
        kind_a: kind of the first collider.
        a: first entry of it as placed (``model.colliders``).
        kind_b: kind of the second one.
        b: first entry of it.
        out: first of ALL_POINTS * POINT entries for the points; normals point from b to a.
        work: first of WORK entries to work in.
        margin: [m].
    """
    if _rank(kind_a) <= _rank(kind_b):
        return _ordered(m, kind_a, a, kind_b, b, out, work, margin)
    count = _ordered(m, kind_b, b, kind_a, a, out, work, margin)
    flip(m, out, count)
    return count


@kernel
def collide_many(kinds, placed, margin, memory, points, counts):
    """Manifolds of many pairs.

    Args:
        kinds: (pairs, 2) int64.
        placed: (pairs, 2, PLACED) float64, colliders placed in the world.
        margin: largest gap of a point [m].
        memory: (2 * PLACED + ALL_POINTS * POINT + WORK,) float64 to work in.
        points: (pairs, ALL_POINTS * POINT) float64, written.
        counts: (pairs,) int64, written: how many points each pair has.
    """
    m = doubles_at(memory.ctypes.data)
    for pair in range(placed.shape[0]):
        for k in range(PLACED):
            memory[k] = placed[pair, 0, k]
            memory[PLACED + k] = placed[pair, 1, k]
        counts[pair] = collide(
            m,
            kinds[pair, 0],
            0,
            kinds[pair, 1],
            PLACED,
            2 * PLACED,
            2 * PLACED + ALL_POINTS * POINT,
            margin,
        )
        for k in range(ALL_POINTS * POINT):
            points[pair, k] = memory[2 * PLACED + k]
