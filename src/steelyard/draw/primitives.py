"""What a picture is made of: lines, circles, faces and text in world space, with no window code."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from . import palette

Point = tuple[float, float, float]
Color = tuple[int, ...]

#: What callers may pass for a point: three numbers [m], y up.
Coordinates = Sequence[float] | NDArray[Any]


@dataclass(frozen=True, slots=True)
class Line:
    """A straight strut, rope or mark.

    Attributes:
        start, end: the two ends [m], (x, y, z), y up.
        color: (r, g, b) or (r, g, b, a), 0 to 255.
        width: thickness [m]; it shrinks with distance, though never below `pixels`.
        pixels: least thickness on the screen [px].
        layer: below 0 painted on the ground, 0 sorted by depth, above 0 over everything.
    """

    start: Point
    end: Point
    color: Color = palette.INK
    width: float = 0.0
    pixels: float = 1.5
    layer: int = 0


@dataclass(frozen=True, slots=True)
class Circle:
    """A ball (filled, no normal), or else a flat disc or a ring.

    Attributes:
        centre: [m], (x, y, z), y up.
        radius: [m].
        color: (r, g, b) or (r, g, b, a), 0 to 255.
        fill: False leaves only the rim.
        normal: axis of a flat disc, any length; None turns to the viewer.
        width: thickness of the rim [m], never below `pixels` on the screen; of no use when filled.
        pixels: least thickness of the rim on the screen [px].
        layer: below 0 painted on the ground, 0 sorted by depth, above 0 over everything.
    """

    centre: Point
    radius: float
    color: Color = palette.INK
    fill: bool = True
    normal: Point | None = None
    width: float = 0.0
    pixels: float = 1.5
    layer: int = 0


@dataclass(frozen=True, slots=True)
class Face:
    """A flat convex polygon, or a slab of that outline.

    Attributes:
        points: corners in order [m], three or more, each (x, y, z), y up.
        color: (r, g, b) or (r, g, b, a), 0 to 255.
        thickness: of the slab [m], half to either side of the polygon.
        layer: below 0 painted on the ground, 0 sorted by depth, above 0 over everything.
    """

    points: tuple[Point, ...]
    color: Color = palette.DECK
    thickness: float = 0.0
    layer: int = 0


@dataclass(frozen=True, slots=True)
class Text:
    """A row of the panel in the top left corner, or a label at a place in the world.

    Attributes:
        label: what is said.
        value: shown beside the label, in a column of its own.
        position: place of a label in the world [m]; None puts the text in the panel.
        color: (r, g, b), 0 to 255.
    """

    label: str
    value: str = ""
    position: Point | None = None
    color: Color = palette.INK


@dataclass
class Drawing:
    """A picture of a world: lists of primitives, in the order in which they were added.

    Example:
        >>> drawing = Drawing()
        >>> drawing.line((0, 0, 0), (0, 2, 0), width=0.1)
        >>> drawing.circle((0, 2, 0), 0.3, color=(238, 122, 66))
        >>> len(drawing.lines), len(drawing.circles)
        (1, 1)
    """

    lines: list[Line] = field(default_factory=list)
    circles: list[Circle] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)

    def line(
        self,
        start: Coordinates,
        end: Coordinates,
        *,
        color: Sequence[int] = palette.INK,
        width: float = 0.0,
        pixels: float = 1.5,
        layer: int = 0,
    ) -> None:
        """Add a `Line` from `start` to `end` [m].

        Raises:
            ValueError: a point without three coordinates, a bad colour, a negative width.
        """
        width, pixels = _length("width", width), _length("pixels", pixels)
        self.lines.append(Line(_point(start), _point(end), _color(color), width, pixels, layer))

    def circle(
        self,
        centre: Coordinates,
        radius: float,
        *,
        color: Sequence[int] = palette.INK,
        fill: bool = True,
        normal: Coordinates | None = None,
        width: float = 0.0,
        pixels: float = 1.5,
        layer: int = 0,
    ) -> None:
        """Add a `Circle`: a ball, or with a `normal` a flat disc, or without `fill` a ring.

        Raises:
            ValueError: a point without three coordinates, a normal of length 0, a bad colour,
                a negative radius or width.
        """
        axis = None if normal is None else _point(normal)
        if axis == (0.0, 0.0, 0.0):
            raise ValueError(
                "normal is (0, 0, 0) and has no direction; leave it out to draw a ball"
            )
        self.circles.append(
            Circle(
                _point(centre),
                _length("radius", radius),
                _color(color),
                fill,
                axis,
                _length("width", width),
                _length("pixels", pixels),
                layer,
            )
        )

    def face(
        self,
        points: Iterable[Coordinates],
        *,
        color: Sequence[int] = palette.DECK,
        thickness: float = 0.0,
        layer: int = 0,
    ) -> None:
        """Add a `Face` with these corners [m], in order around it.

        Raises:
            ValueError: fewer than three corners, a bad corner or colour, a negative thickness.
        """
        corners = tuple(_point(point) for point in points)
        if len(corners) < 3:
            raise ValueError(
                f"a face of {len(corners)} points has no area; give at least 3, or draw a line"
            )
        thickness = _length("thickness", thickness)
        self.faces.append(Face(corners, _color(color), thickness, layer))

    def text(
        self,
        label: str,
        *,
        value: str = "",
        position: Coordinates | None = None,
        color: Sequence[int] = palette.INK,
    ) -> None:
        """Add a `Text`: a row of the panel, or a label at a `position` [m].

        Raises:
            ValueError: a position without three coordinates, a bad colour.
        """
        place = None if position is None else _point(position)
        self.texts.append(Text(label, value, place, _color(color)))

    def extend(self, other: Drawing) -> None:
        """Add everything of another drawing after what is here."""
        self.lines.extend(other.lines)
        self.circles.extend(other.circles)
        self.faces.extend(other.faces)
        self.texts.extend(other.texts)


def _point(value: Coordinates) -> Point:
    # Not-a-number is let through: a world that has blown up must still make a picture.
    if len(value) != 3:
        raise ValueError(f"a point needs three coordinates (x, y, z) in metres, got {value!r}")
    return float(value[0]), float(value[1]), float(value[2])


def _color(value: Sequence[int]) -> Color:
    color = tuple(int(channel) for channel in value)
    if len(color) not in (3, 4) or not all(0 <= channel <= 255 for channel in color):
        raise ValueError(f"a colour is (r, g, b) or (r, g, b, a), each 0 to 255, got {value!r}")
    return color


def _length(name: str, value: float) -> float:
    if value < 0.0:
        raise ValueError(f"{name} is {value}; it is a length and must be 0 or more")
    return float(value)
