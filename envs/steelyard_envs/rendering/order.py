"""Back to front: the order in which shapes are painted."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from .patches import bounds
from .shapes import Shape

Bools = NDArray[np.bool_]


def back_to_front(shapes: list[Shape]) -> list[Shape]:
    """Shapes of one layer in painting order.

    The distance of the middles alone would paint a ball on the far half of a deck before the
    deck. So a shape that lies wholly on one side of a face's plane, and overlaps the face on the
    picture, is painted before or after the face, and a bar that passes a ball is compared where
    they pass. Distance decides the rest, and cuts circles.

    Source: after Newell, Newell and Sancha, A Solution to the Hidden Surface Problem, 1972, with
    no splitting.
    """
    count = len(shapes)
    if count < 2:
        return shapes
    before = _before_faces(shapes) | _before_balls(shapes)
    before &= _overlap(shapes)
    before &= ~before.T  # contradictions say nothing

    waiting = before.sum(axis=0)
    followers: dict[int, list[int]] = {}
    for first, then in np.argwhere(before).tolist():
        followers.setdefault(first, []).append(then)
    farthest = sorted(range(count), key=lambda index: (-shapes[index].depth, index))
    ready = [(-shapes[index].depth, index) for index in farthest if waiting[index] == 0]
    heapq.heapify(ready)
    done = np.zeros(count, bool)
    order: list[Shape] = []
    while len(order) < count:
        # An empty heap with shapes left is a circle; it is cut at its farthest shape.
        index = heapq.heappop(ready)[1] if ready else next(i for i in farthest if not done[i])
        if done[index]:
            continue
        done[index] = True
        order.append(shapes[index])
        for then in followers.get(index, ()):
            waiting[then] -= 1
            if waiting[then] == 0:
                heapq.heappush(ready, (-shapes[then].depth, then))
    return order


def _before_faces(shapes: list[Shape]) -> Bools:
    """Entry [i, j]: shape i must be painted before shape j because one of them is a face."""
    count = len(shapes)
    before = np.zeros((count, count), bool)
    flat = [index for index, shape in enumerate(shapes) if shape.normal is not None]
    balls = np.array([shape.ball for shape in shapes])
    bars = np.array([shape.normal is None and not shape.ball for shape in shapes])
    corners = np.concatenate([shape.corners for shape in shapes])
    starts = np.cumsum([0] + [len(shape.corners) for shape in shapes[:-1]])
    for face in flat:
        shape = shapes[face]
        assert shape.normal is not None
        middle = shape.corners.mean(axis=0)
        # The eye is at 0: positive is the side of the eye.
        normal = shape.normal if middle @ shape.normal < 0.0 else -shape.normal
        side = (corners - middle) @ normal
        slack = shape.half_thickness + 1e-4 * shape.depth
        lowest = np.minimum.reduceat(side, starts)
        highest = np.maximum.reduceat(side, starts)
        level = (lowest >= -slack) & (highest <= slack)
        before[face] |= (lowest >= -slack) & ~level
        before[:, face] |= (highest <= slack) & ~level
        # In the plane itself: a bar lies inside a slab and is hidden; a ball, or what was added
        # later than a bare face, is seen.
        if shape.half_thickness > 0.0:
            before[:, face] |= level & bars
            before[face] |= level & balls
        else:
            before[face] |= level & (np.arange(count) > face)
    np.fill_diagonal(before, False)
    return before


def _before_balls(shapes: list[Shape]) -> Bools:
    """Entry [i, j]: shape i must be painted before shape j: a bar that passes a ball."""
    count = len(shapes)
    before = np.zeros((count, count), bool)
    bars = [i for i, shape in enumerate(shapes) if shape.normal is None and not shape.ball]
    if not bars:
        return before
    ends = np.stack([shapes[bar].corners for bar in bars])
    halves = np.array([shapes[bar].half_thickness for bar in bars])
    along = ends[:, 1] - ends[:, 0]
    for ball in (index for index, shape in enumerate(shapes) if shape.ball):
        centre = shapes[ball].corners[0]
        sight = centre / np.linalg.norm(centre)
        # Nearest point of each bar to the line of sight, both seen across the line of sight.
        start_across = ends[:, 0] - np.outer(ends[:, 0] @ sight, sight)
        along_across = along - np.outer(along @ sight, sight)
        length = np.maximum((along_across**2).sum(axis=1), 1e-30)
        part = np.clip(-(start_across * along_across).sum(axis=1) / length, 0.0, 1.0)
        passing = start_across + part[:, None] * along_across
        gap = np.sqrt((passing**2).sum(axis=1))
        distance = (ends[:, 0] + part[:, None] * along) @ sight
        meets = gap <= shapes[ball].half_thickness + halves
        # A bar that ends in the middle of a ball is painted first, so that the ball covers its end.
        behind = distance > shapes[ball].depth - 0.5 * shapes[ball].half_thickness
        before[bars, ball] = meets & behind
        before[ball, bars] = meets & ~behind
    return before


def _overlap(shapes: list[Shape]) -> Bools:
    """Entry [i, j]: whether the boxes around shapes i and j on the picture overlap."""
    boxes = np.array([bounds(shape.patches) for shape in shapes])
    low, high = boxes[:, :2], boxes[:, 2:]
    overlap = (low[:, None] <= high[None]) & (low[None] <= high[:, None])
    return np.all(overlap, axis=2)
