"""The primitives of a drawing as seen from one view: what to paint, and what sorts it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .camera import Array, View
from .geometry import cross, disc_outline, polygon_normal, ribbon_from_above, slab_sides
from .patches import Color, Disc, Polygon, shade

if TYPE_CHECKING:
    import steelyard as sy

# Where the light comes from: right of, above and behind whoever looks, whatever the azimuth. Every
# side that is seen is lit that way. Below it: how much of a colour is left where no light falls.
LIGHT = np.array([0.35, 0.82, 0.45]) / math.sqrt(0.35**2 + 0.82**2 + 0.45**2)
AMBIENT = 0.68
# Farther than this [m] nothing is drawn; comparing with it also catches what is not a number.
FARTHEST = 1e9
# A ball is painted as discs, each smaller, lighter and nearer the light: (radius, shift, shade).
BALL_DISCS = ((1.0, 0.0, 0.72), (0.93, 0.06, 0.86), (0.8, 0.15, 1.0), (0.48, 0.36, 1.12))
# A bar is painted as strips: (from, to, shade), in half widths, positive to the light.
BAR_STRIPS = ((-1.0, 1.0, 0.82), (-0.45, 0.75, 1.0), (0.1, 0.5, 1.12))
PLAIN_STRIP = ((-1.0, 1.0, 1.0),)
QUAD_ENDS = [0, 0, 1, 1]
# Lines narrower than this [px of the finished picture] are plain, and end square.
BAR_PIXELS = 3.0
# The shadow of a rope would be too thin to see.
SHADOW_WIDTH = 0.03


class Drawable(NamedTuple):
    """The part of a drawing that can be drawn, and the number of primitives that cannot."""

    faces: list[sy.draw.Face]
    lines: list[sy.draw.Line]
    circles: list[sy.draw.Circle]
    texts: list[sy.draw.Text]
    missing: int


@dataclass(slots=True)
class Shape:
    """One primitive, ready to be sorted and painted.

    Attributes:
        patches: what to paint, in order.
        corners: view coordinates [m], shape (n, 3), which stand for the primitive in the sort.
        layer: as in the primitive.
        normal: of a flat shape, in view coordinates.
        half_thickness: of a slab, a bar or a ball [m].
        ball: whether it is a ball.
        depth: distance of the middle from the eye [m].
    """

    patches: list[Polygon | Disc]
    corners: Array
    layer: int
    normal: Array | None = None
    half_thickness: float = 0.0
    ball: bool = False
    depth: float = field(init=False)

    def __post_init__(self) -> None:
        self.depth = float(np.linalg.norm(self.corners.mean(axis=0)))


class Projector:
    """Turns the primitives of a drawing into shapes.

    Args:
        view: bound to the canvas.
        pixel: canvas pixels to one pixel of the finished picture.
    """

    def __init__(self, view: View, *, pixel: float) -> None:
        self.view = view
        self.pixel = pixel
        right, _, ahead = view.axes
        back = np.array([-ahead[0], 0.0, -ahead[2]]) / math.hypot(ahead[0], ahead[2])
        self.light = view.axes @ (LIGHT[0] * right + LIGHT[1] * np.eye(3)[1] + LIGHT[2] * back)

    def shapes(self, drawable: Drawable) -> list[Shape]:
        """Everything that can be seen."""
        shapes = chain(
            map(self._face, drawable.faces),
            map(self._line, drawable.lines),
            map(self._circle, drawable.circles),
        )
        return [shape for shape in shapes if shape is not None and shape.patches]

    def shadows(self, drawable: Drawable) -> list[Polygon]:
        """Outlines on the ground below all solid things.

        The shadows fall straight down, because they then say what a thing is above, which is what
        one wants to know of a shot or of a load.
        """
        outlines = [np.array(face.points) for face in drawable.faces if _casts(face)]
        for line in filter(_casts, drawable.lines):
            start, end = np.array(line.start), np.array(line.end)
            outlines.append(ribbon_from_above(start, end, max(line.width, SHADOW_WIDTH)))
        for circle in filter(_casts, drawable.circles):
            if circle.fill:
                axis = np.array(circle.normal or (0.0, 1.0, 0.0))
                outlines.append(disc_outline(np.array(circle.centre), circle.radius, axis))
        flat = [
            self.view.from_world(outline * (1.0, 0.0, 1.0))
            for outline in outlines
            if outline[:, 1].max() > 0.0
        ]
        return self._polygons(flat, [(0, 0, 0)] * len(flat))

    def _polygons(
        self, outlines: Sequence[Array] | Array, colors: Sequence[Color]
    ) -> list[Polygon]:
        """What can be seen of polygons in view coordinates."""
        if len(outlines) == 0:
            return []
        seen = zip(self.view.project_polygons(outlines), colors, strict=True)
        return [Polygon(points, color) for points, color in seen if len(points) >= 3]

    def _face(self, face: sy.draw.Face) -> Shape | None:
        corners = self.view.from_world(np.array(face.points))
        normal = polygon_normal(corners)
        if normal is None:
            return None
        half = 0.5 * face.thickness
        if half > 0.0:
            sides, outward = slab_sides(corners, normal, half)
            towards_eye = [
                float(side[0] @ axis) < 0.0 for side, axis in zip(sides, outward, strict=True)
            ]
            sides, outward = list(compress(sides, towards_eye)), outward[towards_eye]
        else:
            # A bare face has no outside: it shows the side that is turned to the eye.
            sides = [corners]
            outward = -math.copysign(1.0, float(normal @ corners[0])) * normal[None]
        colors = [shade(face.color, light) for light in self._lit(outward)]
        patches: list[Polygon | Disc] = [*self._polygons(sides, colors)]
        return Shape(patches, corners, face.layer, normal=normal, half_thickness=half)

    def _on_canvas(self, x: float, y: float, radius: float) -> bool:
        return -radius < x < self.view.width + radius and -radius < y < self.view.height + radius

    def _lit(self, normals: Array) -> list[float]:
        """Brightness of surfaces with these unit normals, shape (n, 3)."""
        facing = normals @ self.light
        light: list[float] = np.where(
            facing > 0.0, AMBIENT + (1.0 - AMBIENT) * facing, AMBIENT + 0.06 * facing
        ).tolist()
        return light

    def _line(self, line: sy.draw.Line) -> Shape | None:
        ends = self.view.from_world(np.array((line.start, line.end)))
        clipped = self.view.clip_segment(ends[0], ends[1])
        if clipped is None:
            return None
        ends = np.stack(clipped)
        across = cross(ends[1] - ends[0], ends[0])
        length = math.sqrt(float(across @ across))
        if length < 1e-12:  # seen end on
            across, length = np.eye(3)[0], 1.0
        across *= math.copysign(1.0, float(across @ self.light)) / length
        scale = self.view.focal / ends[:, 2]
        halves = np.maximum(0.5 * line.width, 0.5 * line.pixels * self.pixel / scale)

        wide = 2.0 * float((halves * scale).max()) >= BAR_PIXELS * self.pixel
        broad = wide and _opaque(line.color)  # pieces of a translucent trail must not overlap
        strips = BAR_STRIPS if broad else PLAIN_STRIP
        offsets = np.array([(low, high, high, low) for low, high, _ in strips])
        quads = ends[QUAD_ENDS] + (offsets * halves[QUAD_ENDS])[:, :, None] * across
        colors = [shade(line.color, light) for _, _, light in strips]
        patches: list[Polygon | Disc] = [*self._polygons(quads, colors)]
        if broad and patches:
            caps = zip(self.view.to_pixels(ends).tolist(), (halves * scale).tolist(), strict=True)
            patches[:0] = [
                Disc(x, y, radius, colors[0])
                for (x, y), radius in caps
                if self._on_canvas(x, y, radius)
            ]
        return Shape(patches, ends, line.layer, half_thickness=float(halves.max()))

    def _circle(self, circle: sy.draw.Circle) -> Shape | None:
        centre = self.view.from_world(np.array([circle.centre]))
        if circle.fill and circle.normal is None:
            return self._ball(circle, centre)
        towards_eye = -centre[0]
        if not towards_eye.any():
            return None  # the eye is in the middle of it
        axis = towards_eye if circle.normal is None else self.view.axes @ np.array(circle.normal)
        normal = axis / np.linalg.norm(axis)
        normal *= math.copysign(1.0, float(normal @ towards_eye))
        outer = disc_outline(centre[0], circle.radius, normal)
        patches: list[Polygon | Disc] = []
        if circle.fill:
            patches += self._polygons([outer], [shade(circle.color, self._lit(normal[None])[0])])
        else:
            patches += self._rim(outer, circle)
        return Shape(patches, centre, circle.layer, normal=normal)

    def _rim(self, points: Array, circle: sy.draw.Circle) -> list[Polygon]:
        """A closed line through points in view coordinates, of even width on the picture.

        A rim flat in the plane of its circle would break into dashes where that plane is seen at
        a low angle.
        """
        across = cross(np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0), points)
        across /= np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
        depth = np.maximum(points[:, 2], self.view.near)
        least = circle.pixels * self.pixel / self.view.focal * depth
        across *= 0.5 * np.maximum(circle.width, least)[:, None]
        inner, outer = points - across, points + across
        corners = [inner, outer, np.roll(outer, -1, axis=0), np.roll(inner, -1, axis=0)]
        return self._polygons(np.stack(corners, axis=1), [circle.color] * len(points))

    def _ball(self, circle: sy.draw.Circle, centre: Array) -> Shape | None:
        depth = float(centre[0, 2])
        if depth - circle.radius < self.view.near:
            return None
        radius = max(circle.radius * self.view.focal / depth, 0.5 * circle.pixels * self.pixel)
        x, y = self.view.to_pixels(centre)[0].tolist()
        if not self._on_canvas(x, y, radius):
            return None
        discs = BALL_DISCS if 2.0 * radius > BAR_PIXELS * self.pixel else BALL_DISCS[:1]
        patches: list[Polygon | Disc] = [
            Disc(
                x + self.light[0] * shift * radius,
                y - self.light[1] * shift * radius,
                part * radius,
                shade(circle.color, light),
            )
            for part, shift, light in discs
        ]
        return Shape(patches, centre, circle.layer, half_thickness=circle.radius, ball=True)


def drawable_part(drawing: sy.draw.Drawing) -> Drawable:
    """Sort out what has a place or a size that is not finite, as after a world has blown up."""
    faces = [face for face in drawing.faces if _near(*face.points, (face.thickness,))]
    lines = [line for line in drawing.lines if _near(line.start, line.end, (line.width,))]
    circles = [
        circle
        for circle in drawing.circles
        if _near(circle.centre, (circle.radius, circle.width), circle.normal or ())
    ]
    texts = [text for text in drawing.texts if _near(text.position or ())]
    missing = (
        len(drawing.faces) + len(drawing.lines) + len(drawing.circles) + len(drawing.texts)
    ) - (len(faces) + len(lines) + len(circles) + len(texts))
    return Drawable(faces, lines, circles, texts, missing)


def _near(*lengths: tuple[float, ...]) -> bool:
    return all(abs(value) < FARTHEST for group in lengths for value in group)


def _opaque(color: Color) -> bool:
    return len(color) == 3 or color[3] == 255


def _casts(primitive: sy.draw.Face | sy.draw.Line | sy.draw.Circle) -> bool:
    """Whether a thing throws a shadow: solid things do, marks and glazes do not."""
    return primitive.layer == 0 and _opaque(primitive.color)
