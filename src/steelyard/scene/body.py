"""Body: a rigid body, and points that are fixed in one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np

from . import checks
from .particle import Particle
from .shapes import SHAPES, Part, Shape, mass_properties, rotation_matrix, steiner

_REMEDY = "Use inverse_mass=0 for a body that nothing can move."


@dataclass(eq=False, kw_only=True)
class Body:
    """A rigid body, free or immovable.

    Its frame has its origin at the centre of mass, or at the pivot of a body that has one; parts that are given
    elsewhere are moved there (``origin`` tells from where).

    Args:
        position: start position of the frame's origin [m].
        orientation: start orientation, a quaternion (w, x, y, z) of any length but 0, that turns the body's axes into
            those of the world.
        velocity: start velocity of the centre of mass [m/s]; 0 of a body with a pivot.
        angular_velocity: start angular velocity [rad/s], along the axes of the world.
        parts: what it is made of: shapes, or ``Part`` for those with a place, an orientation or a density of their own.
        mass: mass [kg], above 0; that of the parts by default. Given with parts, it scales their inertia.
        inertia: moments of inertia [kg m^2] about the centre of mass along the body's axes, (3,), or the matrix (3, 3);
            that of the parts by default. Without parts the centre of mass is where the given frame has its origin.
        pivot: point [m] in the frame in which the parts are given that stands still in the world: the body only turns
            about it, without friction, as a top or a pendulum does. What holds it there is not told.
        inverse_mass: 0 makes the body immovable: no force moves or turns it.
        acceleration: constant acceleration [m/s^2] of this body in place of the scene's gravity.
        damping: fraction of the velocity kept after one second, in (0, 1].
        angular_damping: fraction of the angular velocity kept after one second, in (0, 1].

    Raises:
        TypeError: a part is no shape.
        ValueError: a value out of range, neither parts nor inertia, or an inertia that no body has.
    """

    position: checks.Vector
    orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    velocity: checks.Vector = (0.0, 0.0, 0.0)
    angular_velocity: checks.Vector = (0.0, 0.0, 0.0)
    parts: Sequence[Shape | Part] | Shape | Part = ()
    mass: float | None = None
    inertia: Any = None
    pivot: checks.Vector | None = None
    inverse_mass: float | None = None
    acceleration: checks.Vector | None = None
    damping: float = 1.0
    angular_damping: float = 1.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "mass": checks.Limit(above=0.0, invertible=True, remedy=_REMEDY),
        "inverse_mass": checks.Limit(least=0.0, invertible=True, remedy=_REMEDY),
        "damping": Particle.LIMITS["damping"],
        "angular_damping": Particle.LIMITS["damping"],
    }

    def __post_init__(self) -> None:
        checks.vectors(self, "position", "velocity", "angular_velocity")
        self.orientation = checks.quaternion("Body", "orientation", self.orientation)
        if self.acceleration is not None:
            checks.vectors(self, "acceleration")
        checks.numbers(self, "damping", "angular_damping")
        if self.pivot is not None:
            checks.vectors(self, "pivot")
        parts = self._given_parts()
        centre = mass_properties(parts)[1] if parts else np.zeros(3)
        origin = centre if self.pivot is None else np.array(self.pivot)
        #: The frame's origin in the frame in which the parts were given [m].
        self.origin = tuple(origin.tolist())
        #: The centre of mass in the body's frame [m]: 0 but for a body with a pivot.
        self.arm = tuple((centre - origin).tolist())
        self.parts = tuple(part.moved(-origin) for part in parts)
        if self.inverse_mass is not None:
            self._immovable()
        else:
            self._weigh()
        if self.pivot is not None and any(self.velocity):
            raise ValueError(
                f"Body: velocity is {self.velocity} with a pivot at {self.pivot}, which stands still; it must be 0. "
                "Give angular_velocity."
            )

    def _given_parts(self) -> list[Part]:
        """The parts as such."""
        given = [self.parts] if isinstance(self.parts, (*SHAPES, Part)) else self.parts
        try:
            return [part if isinstance(part, Part) else Part(shape=part) for part in given]
        except TypeError:
            raise TypeError(
                f"Body: parts is {self.parts!r}; it must be a shape, a Part or a list of these. Give one."
            ) from None

    def _immovable(self) -> None:
        if self.inverse_mass != 0.0 or self.mass is not None:
            raise ValueError(
                f"Body: inverse_mass is {self.inverse_mass!r} and mass {self.mass!r}; inverse_mass must be 0, for a "
                "body that nothing can move, and alone. Give the mass of one that moves."
            )
        if any(self.velocity) or any(self.angular_velocity):
            raise ValueError(
                f"Body: velocity is {self.velocity} and angular_velocity {self.angular_velocity} but inverse_mass is "
                "0; an immovable body must have velocity 0. Give it a mass, or assign its position between steps."
            )
        self.inverse_mass = 0.0
        self.inertia = np.zeros((3, 3))

    def _weigh(self) -> None:
        parts: Any = self.parts
        if not parts and self.inertia is None:
            raise ValueError(
                "Body: it has 0 parts and no inertia; how it turns must be known. Give parts=Sphere(...), or inertia."
            )
        inertia = np.zeros((3, 3))
        if parts:
            mass, _, inertia = mass_properties(parts)
            if self.mass is not None:
                inertia = inertia * (self.mass / mass)
            else:
                self.mass = mass
        self.mass = 1.0 if self.mass is None else self.mass
        checks.numbers(self, "mass")
        self.inverse_mass = 1.0 / self.mass
        if self.inertia is not None:
            inertia = inertia_matrix("Body", self.inertia)
        self.inertia = inertia + steiner(self.mass, np.array(self.arm))

    @property
    def placed(self) -> tuple[Part, ...]:
        """The parts, each at its place in the body's frame."""
        return cast(tuple[Part, ...], self.parts)

    @property
    def angular_momentum(self) -> np.ndarray:
        """Angular momentum at the start about the frame's origin [kg m^2/s], along the world's axes, (3,)."""
        turn = rotation_matrix(np.array(self.orientation))
        return np.asarray(turn @ self.inertia @ turn.T @ np.array(self.angular_velocity))

    @property
    def movable(self) -> bool:
        """Whether forces can move it."""
        return bool(self.inverse_mass)

    def at(self, place: checks.Vector) -> BodyPoint:
        """The point of the body at a place in its frame [m], from the origin along the body's axes."""
        return BodyPoint(self, place)


def inertia_matrix(owner: str, value: Any) -> np.ndarray:
    """Moments (3,) or a matrix (3, 3) of inertia [kg m^2] as a matrix.

    Raises:
        ValueError: of another shape, not symmetric, or of no body: its principal moments must be above 0 and none may
            be larger than the sum of the others.
    """
    given = checks.floats(value)
    good = given is not None and given.shape in ((3,), (3, 3)) and bool(np.isfinite(given).all())
    matrix = np.zeros((3, 3))
    if good and given is not None:
        matrix = np.diag(given) if given.ndim == 1 else given.copy()
        good = bool(np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0))
    if good:
        low, middle, high = np.linalg.eigvalsh(matrix).tolist()
        good = low > 0.0 and high <= (low + middle) * (1.0 + 1e-9)
    if not good:
        raise ValueError(
            f"{owner}: inertia is {value!r}; it must be three moments or a symmetric matrix (3, 3) [kg m^2] whose "
            "principal moments are above 0 and each at most the sum of the others. Give parts: it follows from them."
        )
    return matrix


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """A point fixed in a body, where forces can act as on a particle: the end of a spring, a float, a thruster.

    Args:
        body: the body.
        place: place in its frame [m], from the origin along the body's axes.
    """

    body: Body
    place: checks.Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        checks.instance("BodyPoint", "body", self.body, Body, remedy="Give one.")
        object.__setattr__(self, "place", checks.vector("BodyPoint", "place", self.place))
