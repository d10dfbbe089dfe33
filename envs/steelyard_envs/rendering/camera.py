"""The point of view: perspective projection, and clipping to what can be seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Things nearer than this part of the camera's distance are cut away.
NEAR = 0.02
# Polygons are cut this far outside the picture, so that no rim of a cut shows and no coordinate
# grows beyond what a painter can take.
MARGIN = 1.25


@dataclass(frozen=True)
class Camera:
    """A camera that looks at a target and never rolls, so that the horizon is level.

    Attributes:
        target: the point in the middle of the picture [m], (x, y, z), y up.
        distance: from the target [m].
        azimuth: of the camera seen from the target [deg]; 0 stands at +z, 90 at +x.
        elevation: of the camera above the target [deg], -89 to 89.
        field_of_view: over the height of the picture [deg], 1 to 150.

    Raises:
        ValueError: a distance, elevation or field of view out of range.
    """

    target: tuple[float, float, float] = (0.0, 1.0, 0.0)
    distance: float = 10.0
    azimuth: float = 30.0
    elevation: float = 15.0
    field_of_view: float = 40.0

    def __post_init__(self) -> None:
        if not 0.0 < self.distance < math.inf:
            raise ValueError(f"camera distance is {self.distance} m; it must be above 0 and finite")
        if not -89.0 <= self.elevation <= 89.0:
            raise ValueError(
                f"camera elevation is {self.elevation} degrees; keep it within -89 and 89"
            )
        if not 1.0 <= self.field_of_view <= 150.0:
            raise ValueError(
                f"camera field of view is {self.field_of_view} degrees; keep it within 1 and 150"
            )


class View:
    """A camera bound to a picture of a given size.

    View coordinates are right, up and depth [m], measured from the eye; pixel coordinates are right
    and down from the top left corner.

    Attributes:
        axes: rows right, up and forward in world space, shape (3, 3).
        eye: place of the camera [m], shape (3,).
        focal: distance of the picture from the eye [px].
        near: least depth that is drawn [m].
    """

    def __init__(self, camera: Camera, *, width: int, height: int) -> None:
        azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
        sin_a, cos_a = math.sin(azimuth), math.cos(azimuth)
        sin_e, cos_e = math.sin(elevation), math.cos(elevation)
        self.axes = np.array(
            [
                [cos_a, 0.0, -sin_a],
                [-sin_e * sin_a, cos_e, -sin_e * cos_a],
                [-cos_e * sin_a, -sin_e, -cos_e * cos_a],
            ]
        )
        self.camera = camera
        self.width, self.height = width, height
        self.eye = np.asarray(camera.target, dtype=float) - camera.distance * self.axes[2]
        self.focal = 0.5 * height / math.tan(0.5 * math.radians(camera.field_of_view))
        self.near = NEAR * camera.distance
        half_x, half_y = MARGIN * 0.5 * width / self.focal, MARGIN * 0.5 * height / self.focal
        # Inside where planes @ (right, up, depth) >= offsets.
        self._planes = np.array(
            [[0, 0, 1], [-1, 0, half_x], [1, 0, half_x], [0, -1, half_y], [0, 1, half_y]], float
        )
        self._offsets = np.array([self.near, 0.0, 0.0, 0.0, 0.0])

    def from_world(self, points: Array) -> Array:
        """World points as view coordinates [m], both of shape (n, 3)."""
        return (points - self.eye) @ self.axes.T

    def to_pixels(self, points: Array) -> Array:
        """View coordinates, shape (n, 3), as pixels, shape (n, 2); depths must be positive."""
        scale = self.focal / points[:, 2]
        return np.stack(
            [0.5 * self.width + scale * points[:, 0], 0.5 * self.height - scale * points[:, 1]],
            axis=1,
        )

    def clip_segment(self, start: Array, end: Array) -> tuple[Array, Array] | None:
        """The part of a segment in view coordinates beyond the near plane, or None."""
        before, after = start[2] - self.near, end[2] - self.near
        if before < 0.0 and after < 0.0:
            return None
        if before < 0.0:
            start = start + (end - start) * (before / (before - after))
        elif after < 0.0:
            end = end + (start - end) * (after / (after - before))
        return start, end

    def clip_polygon(self, points: Array) -> Array:
        """The part of a polygon in view coordinates that can be seen, shape (m, 3), m may be 0.

        Source: Sutherland and Hodgman, Reentrant Polygon Clipping, 1974.
        """
        for plane, offset in zip(self._planes, self._offsets, strict=True):
            side = points @ plane - offset
            if (side >= 0.0).all():
                continue
            kept: list[Array] = []
            for here in range(len(points)):
                previous = here - 1
                if (side[here] >= 0.0) != (side[previous] >= 0.0):
                    part = side[previous] / (side[previous] - side[here])
                    kept.append(points[previous] + part * (points[here] - points[previous]))
                if side[here] >= 0.0:
                    kept.append(points[here])
            points = np.array(kept).reshape(-1, 3)
        return points

    def project_polygons(self, outlines: Sequence[Array] | Array) -> list[Array]:
        """Polygons in view coordinates, each of shape (n, 3), as clipped polygons in pixels.

        One that cannot be seen comes back with no points, shape (0, 2).
        """
        clipped = outlines
        together = np.concatenate(outlines)
        inside = together @ self._planes.T >= self._offsets
        if not inside.all():
            starts = np.cumsum([0] + [len(outline) for outline in outlines[:-1]])
            whole = np.logical_and.reduceat(inside.all(axis=1), starts)
            seen = np.all(np.logical_or.reduceat(inside, starts), axis=1)
            clipped = [
                outline if fits else self.clip_polygon(outline) if part else np.empty((0, 3))
                for outline, fits, part in zip(outlines, whole, seen, strict=True)
            ]
            together = np.concatenate(clipped)
        pixels = self.to_pixels(together)
        ends = accumulate(len(outline) for outline in clipped)
        return [pixels[end - len(part) : end] for end, part in zip(ends, clipped, strict=True)]
