"""Rigid bodies as they lie: boxes with edges, balls and capsules with a mark that shows how they turn."""

from __future__ import annotations

import numpy as np

from ..scene.body import Body
from ..scene.shapes import Box, Capsule, Hollow, Part, Sphere, rotation_matrix
from . import palette
from .primitives import Color, Drawing

Vector = np.ndarray

#: Corners of a cube by their signs, and its sides as corners in order.
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_SIDES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))


def draw_body(
    drawing: Drawing, body: Body, place: Vector, orientation: Vector, *, axes: float
) -> None:
    """Add a body.

    Args:
        drawing: what it is added to.
        body: its parts; without any, its axes are drawn.
        place: of its frame's origin [m], (3,).
        orientation: unit quaternion (w, x, y, z).
        axes: length of the axes of a body without parts [m].
    """
    turn = rotation_matrix(orientation)
    color = palette.DECK if body.movable else palette.EARTH
    for part in body.placed:
        own = turn @ rotation_matrix(np.array(part.orientation))
        _draw_part(drawing, part, place + turn @ np.array(part.offset), own, color)
    if not body.placed:
        for axis, tint in zip(turn.T, (palette.TARGET, palette.DECK, palette.WIND), strict=True):
            drawing.line(place, place + axes * axis, color=tint, pixels=2.0)
        drawing.circle(place, 0.1 * axes, color=palette.INK)
    if body.pivot is not None:
        drawing.circle(place, 0.15 * axes, color=palette.INK)


def _draw_part(drawing: Drawing, part: Part, centre: Vector, turn: Vector, color: Color) -> None:
    draw_shape(
        drawing,
        part.shape.outer if isinstance(part.shape, Hollow) else part.shape,
        centre,
        turn,
        color,
    )


def draw_shape(
    drawing: Drawing, shape: Sphere | Box | Capsule, centre: Vector, turn: Vector, color: Color
) -> None:
    """Add a ball, box or capsule with its centre [m] and rotation (3, 3)."""
    if isinstance(shape, Sphere):
        drawing.circle(centre, shape.radius, color=color)
        # Two great circles: a ball alone does not show that it turns.
        for axis in turn.T[:2]:
            drawing.circle(centre, shape.radius, color=palette.INK, fill=False, normal=axis)
    elif isinstance(shape, Capsule):
        ends = [centre + side * shape.half_length * turn[:, 1] for side in (-1.0, 1.0)]
        drawing.line(*ends, color=color, width=2.0 * shape.radius)
        for end in ends:
            drawing.circle(end, shape.radius, color=color)
            drawing.circle(end, shape.radius, color=palette.INK, fill=False, normal=turn[:, 1])
    else:
        assert isinstance(shape, Box)
        corners = centre + (_CORNERS * shape.half_size) @ turn.T
        for side in _SIDES:
            outline = [corners[k] for k in side]
            drawing.face(outline, color=color)
            for a, b in zip(outline, [*outline[1:], outline[0]], strict=True):
                drawing.line(a, b, color=palette.INK, pixels=1.0)
