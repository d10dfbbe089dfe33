"""Shapes of bodies: what fills which space, apart from where it is; one shape may serve many bodies.

Every shape has its centre of mass at its own origin and its principal axes along x, y and z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import checks

_LENGTH = checks.Limit(above=0.0, remedy="Give metres.")
_DENSITY = checks.Limit(above=0.0, remedy="Give kg/m^3; water has 1000.")


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Args:
        radius: [m], above 0.
    """

    radius: float

    def __post_init__(self) -> None:
        _check(self, "radius")

    @property
    def volume(self) -> float:
        """[m^3]."""
        return 4.0 / 3.0 * math.pi * self.radius**3

    @property
    def moments(self) -> np.ndarray:
        """Principal moments of inertia at density 1 [m^5], (3,)."""
        return np.full(3, 0.4 * self.volume * self.radius**2)


@dataclass(frozen=True)
class Box:
    """A cuboid.

    Args:
        half_size: half the edges [m] along x, y and z, above 0.
    """

    half_size: checks.Vector

    def __post_init__(self) -> None:
        half = checks.vector("Box", "half_size", self.half_size)
        for value in half:
            checks.number("Box", "half_size", value, _LENGTH)
        object.__setattr__(self, "half_size", half)

    @property
    def volume(self) -> float:
        """[m^3]."""
        return float(8.0 * np.prod(self.half_size))

    @property
    def moments(self) -> np.ndarray:
        """Principal moments of inertia at density 1 [m^5], (3,): V (b^2 + c^2)/3 with half edges a, b, c."""
        squares = np.square(self.half_size)
        return np.asarray(self.volume * (squares.sum() - squares) / 3.0)


@dataclass(frozen=True)
class Capsule:
    """A cylinder along y with half balls at its ends.

    Args:
        radius: [m], above 0.
        half_length: from the centre to the centre of a half ball [m], above 0.
    """

    radius: float
    half_length: float

    def __post_init__(self) -> None:
        _check(self, "radius", "half_length")

    @property
    def _parts(self) -> tuple[float, float]:
        """Volumes of the cylinder and of the ball [m^3]."""
        area = math.pi * self.radius**2
        return 2.0 * area * self.half_length, 4.0 / 3.0 * area * self.radius

    @property
    def volume(self) -> float:
        """[m^3]."""
        return sum(self._parts)

    @property
    def moments(self) -> np.ndarray:
        """Principal moments of inertia at density 1 [m^5], (3,).

        Across, a half ball counts about its own centre of mass, 3 r/8 from its flat side, and from there about the
        capsule's.
        """
        cylinder, ball = self._parts
        r, h = self.radius, self.half_length
        along = cylinder * r**2 / 2.0 + ball * 0.4 * r**2
        across = cylinder * (r**2 / 4.0 + h**2 / 3.0) + ball * (0.4 * r**2 + h**2 + 0.75 * h * r)
        return np.array([across, along, across])


@dataclass(frozen=True)
class Hollow:
    """A shape with another cut out of it about the same centre.

    Args:
        outer: what is filled.
        inner: what is empty, of the same kind, smaller in one measure at least and larger in none.
    """

    outer: Solid
    inner: Solid

    def __post_init__(self) -> None:
        for name in ("outer", "inner"):
            _check_kind("Hollow", name, getattr(self, name), SHAPES[:3])
        outer, inner = (np.hstack(list(vars(shape).values())) for shape in (self.outer, self.inner))
        within = type(self.outer) is type(self.inner) and bool((inner <= outer).all())
        if not within or bool((inner == outer).all()):
            raise ValueError(
                f"Hollow: inner is {self.inner!r}; it must be of the kind of {self.outer!r} and smaller. Give a "
                "smaller one."
            )

    @property
    def volume(self) -> float:
        """[m^3]."""
        return self.outer.volume - self.inner.volume

    @property
    def moments(self) -> np.ndarray:
        """Principal moments of inertia at density 1 [m^5], (3,)."""
        return self.outer.moments - self.inner.moments


Solid = Sphere | Box | Capsule
Shape = Sphere | Box | Capsule | Hollow
SHAPES = (Sphere, Box, Capsule, Hollow)


def _check(shape: Sphere | Capsule, *names: str) -> None:
    for name in names:
        value = checks.number(type(shape).__name__, name, getattr(shape, name), _LENGTH)
        object.__setattr__(shape, name, value)


def _check_kind(owner: str, name: str, value: object, kinds: tuple[type, ...]) -> None:
    if not isinstance(value, kinds):
        names = ", ".join(kind.__name__ for kind in kinds)
        raise TypeError(f"{owner}: {name} is {value!r}; it must be one of {names}. Give one.")


@dataclass(frozen=True, kw_only=True)
class Part:
    """A shape at its place in a body.

    Args:
        shape: what it is.
        offset: its centre [m], in the frame in which the body's parts are given.
        orientation: its turn in that frame, a quaternion (w, x, y, z) of any length but 0.
        density: [kg/m^3], above 0.
    """

    shape: Shape
    offset: checks.Vector = (0.0, 0.0, 0.0)
    orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    density: float = 1000.0

    def __post_init__(self) -> None:
        _check_kind("Part", "shape", self.shape, SHAPES)
        object.__setattr__(self, "offset", checks.vector("Part", "offset", self.offset))
        turn = checks.quaternion("Part", "orientation", self.orientation)
        object.__setattr__(self, "orientation", turn)
        density = checks.number("Part", "density", self.density, _DENSITY)
        object.__setattr__(self, "density", density)

    def moved(self, by: np.ndarray) -> Part:
        """The same elsewhere."""
        return replace(self, offset=np.array(self.offset) + by)

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.density * self.shape.volume

    @property
    def inertia(self) -> np.ndarray:
        """Inertia about its own centre [kg m^2], (3, 3), in the frame in which the parts are given."""
        turn = rotation_matrix(np.array(self.orientation))
        return np.asarray(turn @ np.diag(self.density * self.shape.moments) @ turn.T)


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """The rotation of unit quaternions (..., 4), (w, x, y, z), as matrices (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The turn b and then a, quaternions (..., 4)."""
    (aw, ax, ay, az), (bw, bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by + ay * bw + az * bx - ax * bz,
            aw * bz + az * bw + ax * by - ay * bx,
        ],
        axis=-1,
    )


def steiner(mass: float, arm: np.ndarray) -> np.ndarray:
    """What a mass [kg] at ``arm`` (3,) [m] adds to an inertia, m (d.d - d d^T): the theorem of parallel axes."""
    return np.asarray(mass * (arm @ arm * np.eye(3) - np.outer(arm, arm)))


def mass_properties(parts: Sequence[Part]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2] of parts together."""
    masses = np.array([part.mass for part in parts])
    offsets = np.array([part.offset for part in parts])
    mass = float(masses.sum())
    centre = masses @ offsets / mass
    inertia = np.zeros((3, 3))
    for part, m, d in zip(parts, masses, offsets - centre, strict=True):
        inertia += part.inertia + steiner(m, d)
    return mass, centre, inertia
