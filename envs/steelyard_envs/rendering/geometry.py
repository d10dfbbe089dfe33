"""Outlines in space: normals, slabs, discs and ribbons."""

from __future__ import annotations

import math

import numpy as np

from .camera import Array

DISC_CORNERS = 48
TURN = np.linspace(0.0, 2.0 * math.pi, DISC_CORNERS, endpoint=False)
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN)], axis=1)


def cross(a: Array, b: Array) -> Array:
    """Cross products over the last axis; numpy's own costs five times as much on few vectors."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def polygon_normal(corners: Array) -> Array | None:
    """Unit normal of a flat polygon, shape (n, 3), or None when it has no area.

    Source: Newell's sum of areas, taken about a corner to stay accurate far away.
    """
    spokes = corners[1:] - corners[0]
    total = cross(spokes[:-1], spokes[1:]).sum(axis=0)
    length = math.sqrt(float(total @ total))
    return total / length if length > 0.0 else None


def slab_sides(corners: Array, normal: Array, half: float) -> tuple[list[Array], Array]:
    """Sides of a slab around a flat polygon, and their outward normals.

    Args:
        corners: of the polygon [m], shape (n, 3), in order around `normal`.
        normal: unit normal of the polygon.
        half: half of the thickness [m].

    Returns:
        n + 2 outlines, and unit normals of shape (n + 2, 3).
    """
    top, bottom = corners + half * normal, corners - half * normal
    after = np.concatenate([corners[1:], corners[:1]])
    across = cross(after - corners, np.broadcast_to(normal, corners.shape))
    across /= np.maximum(np.sqrt((across**2).sum(axis=1)), 1e-300)[:, None]
    walls = np.stack([bottom, after - half * normal, after + half * normal, top], axis=1)
    return [top, bottom[::-1], *walls], np.concatenate([[normal, -normal], across])


def disc_outline(centre: Array, radius: float, axis: Array) -> Array:
    """Corners of a flat disc [m], shape (DISC_CORNERS, 3), in order around its axis."""
    axis = axis / math.sqrt(float(axis @ axis))
    first = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= math.sqrt(float(first @ first))
    return centre + radius * (CIRCLE @ np.stack([first, cross(axis, first)]))


def ribbon_from_above(start: Array, end: Array, width: float) -> Array:
    """What a bar of a width [m] covers seen from straight above [m], shape (4, 3)."""
    along = end - start
    length = math.hypot(along[0], along[2])
    across = np.array([along[2], 0.0, -along[0]]) / length if length > 0.0 else np.eye(3)[0]
    across = 0.5 * width * across
    return np.stack([start - across, start + across, end + across, end - across])
