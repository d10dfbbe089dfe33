"""What a picture is painted with: polygons and discs, in pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .camera import Array

Color = tuple[int, ...]


@dataclass(slots=True)
class Polygon:
    """A filled outline, pixels of shape (n, 2)."""

    points: Array
    color: Color

    def moved(self, right: float, down: float) -> Polygon:
        """The same polygon elsewhere on the picture [px]."""
        return Polygon(self.points + np.array((right, down)), self.color)

    def bounds(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom [px]."""
        left, top = self.points.min(axis=0).tolist()
        right, bottom = self.points.max(axis=0).tolist()
        return left, top, right, bottom


@dataclass(slots=True)
class Disc:
    """A filled circle, in pixels."""

    x: float
    y: float
    radius: float
    color: Color

    def moved(self, right: float, down: float) -> Disc:
        """The same disc elsewhere on the picture [px]."""
        return Disc(self.x + right, self.y + down, self.radius, self.color)

    def bounds(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom [px]."""
        r = self.radius
        return self.x - r, self.y - r, self.x + r, self.y + r


def bounds(patches: Sequence[Polygon | Disc]) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of one or more patches [px]."""
    left, top, right, bottom = zip(*(patch.bounds() for patch in patches), strict=True)
    return min(left), min(top), max(right), max(bottom)


def shade(color: Color, light: float) -> Color:
    """A colour at `light` times its brightness; above 1 it turns towards white."""
    if light <= 1.0:
        lit = [round(channel * light) for channel in color[:3]]
    else:
        lit = [round(channel + (255 - channel) * min(light - 1.0, 1.0)) for channel in color[:3]]
    return (*lit, *color[3:])
