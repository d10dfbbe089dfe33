"""Forces as a person writes them; their kernels have the same names in ``steelyard.forces``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from . import checks
from .body import Body, BodyPoint
from .particle import Particle, check_ends, check_particles

_STIFFNESS = checks.Limit(above=0.0, remedy="Give newtons per metre of stretch.")
_SPRING: dict[str, checks.Rule] = {
    "stiffness": _STIFFNESS,
    "rest_length": checks.Limit(least=0.0, remedy="Give metres."),
}
_DRAG = checks.Limit(least=0.0, remedy="Less would feed energy in; use 0 for none.")
_POSITIVE = checks.Limit(above=0.0)
_NONE_OR_MORE = checks.Limit(least=0.0, remedy="Use 0 for none.")


@dataclass(eq=False)
class Gravity:
    """F = m g on each of its particles and bodies; immovable ones feel nothing.

    Source: Millington, *Game Physics Engine Development*, ch. 5.

    Args:
        acceleration: g [m/s^2], added to what the scene's gravity gives.
        particles: particles and bodies that it acts on; all of the scene by default.
    """

    acceleration: checks.Vector
    particles: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {}

    def __post_init__(self) -> None:
        checks.vectors(self, "acceleration")
        check_particles(self, "particles", others=(Body,))


@dataclass(eq=False)
class Drag:
    """F = -(k1 |u| + k2 |u|^2) u/|u| with u the velocity relative to the wind.

    On a body it acts at the centre of mass and turns nothing; a body with a pivot takes none.

    Args:
        linear: k1 [N s/m], at least 0.
        quadratic: k2 [N s^2/m^2], at least 0.
        wind: velocity of the air [m/s].
        particles: particles and bodies that it acts on; all of the scene by default.
    """

    linear: float = 0.0
    quadratic: float = 0.0
    wind: checks.Vector = (0.0, 0.0, 0.0)
    particles: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {"linear": _DRAG, "quadratic": _DRAG}

    def __post_init__(self) -> None:
        checks.numbers(self, "linear", "quadratic")
        checks.vectors(self, "wind")
        check_particles(self, "particles", others=(Body,))


@dataclass(eq=False)
class Spring:
    """F = -k (l - l0) n on ``a``, the opposite on ``b``; n points from b to a.

    Args:
        a: one end: a particle, or a point of a body (``body.at(...)``).
        b: the other end.
        stiffness: k [N/m], above 0.
        rest_length: l0 [m], at least 0.
    """

    a: Particle | BodyPoint
    b: Particle | BodyPoint
    stiffness: float
    rest_length: float

    LIMITS: ClassVar = _SPRING

    def __post_init__(self) -> None:
        check_ends(self, "a", "b", others=(BodyPoint,))
        checks.numbers(self, "stiffness", "rest_length")


@dataclass(eq=False)
class Bungee(Spring):
    """A spring that acts only when longer than its rest length."""


@dataclass(eq=False)
class AnchoredSpring:
    """F = -k (l - l0) n, n from the anchor to the particle.

    Args:
        particle: the moving end: a particle, or a point of a body (``body.at(...)``).
        anchor: the fixed end [m]; may be assigned between steps.
        stiffness: k [N/m], above 0.
        rest_length: l0 [m], at least 0.
    """

    particle: Particle | BodyPoint
    anchor: checks.Vector
    stiffness: float
    rest_length: float

    LIMITS: ClassVar = _SPRING

    def __post_init__(self) -> None:
        check_ends(self, "particle", others=(BodyPoint,))
        checks.vectors(self, "anchor")
        checks.numbers(self, "stiffness", "rest_length")


@dataclass(eq=False)
class AnchoredBungee(AnchoredSpring):
    """An anchored spring that acts only when longer than its rest length."""


@dataclass(eq=False)
class StiffSpring:
    """Anchored damped spring of zero rest length, m x'' = -k x - c x', by its exact solution.

    Stable and exact for every stiffness, damping and step; other forces on the particle count as
    constant over a step. A particle has at most one, and no link, rider or contact.

    Args:
        particle: the moving end.
        anchor: the fixed end [m]; may be assigned between steps.
        stiffness: k [N/m], above 0.
        damping: c [N s/m], at least 0.
    """

    particle: Particle
    anchor: checks.Vector
    stiffness: float
    damping: float = 0.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "stiffness": _STIFFNESS,
        "damping": checks.Limit(least=0.0, remedy="Use 0 for no damping."),
    }

    def __post_init__(self) -> None:
        check_ends(self, "particle")
        checks.vectors(self, "anchor")
        checks.numbers(self, "stiffness", "damping")


@dataclass(eq=False)
class Buoyancy:
    """Lift of a liquid with a level surface: rho V g below, 0 above, linear between.

    F_y = rho V g (h + d - y) / (2 d) for y in [h - d, h + d].

    Args:
        particle: the float: a particle, or a point of a body (``body.at(...)``).
        surface: h, height of the surface [m].
        half_depth: d [m], above 0: the float is wholly under at y = h - d.
        volume: V [m^3], above 0.
        density: rho [kg/m^3] of the liquid, above 0.
        gravity: g [m/s^2], above 0.
    """

    particle: Particle | BodyPoint
    surface: float
    half_depth: float
    volume: float
    density: float = 1000.0
    gravity: float = 9.81

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "surface": checks.Limit(remedy="Give metres."),
        "half_depth": _POSITIVE,
        "volume": _POSITIVE,
        "density": _POSITIVE,
        "gravity": _POSITIVE,
    }

    def __post_init__(self) -> None:
        check_ends(self, "particle", others=(BodyPoint,))
        checks.numbers(self, *self.LIMITS)


@dataclass(eq=False, kw_only=True)
class Explosion:
    """An explosion: a pull inwards, then a wave outwards, and hot air that rises (see ``forces.explosion``).

    Each phase acts where its force is above 0. Its edges in time are kinks or jumps: methods have their order between
    them.

    Args:
        place: where it happens [m].
        start: time of the detonation [s]; ``world[explosion].start`` may be assigned, per world.
        implosion_force: pull [N].
        implosion_duration: how long [s], before the wave begins.
        implosion_least: distance below which nothing is pulled [m].
        implosion_most: and above which [m].
        wave_force: push at the front of the wave [N].
        wave_duration: how long it lasts [s], above 0.
        wave_speed: of the front [m/s], at least 0.
        wave_thickness: distance from the front at which there is no push [m], above 0.
        convection_force: lift at the axis [N].
        convection_duration: how long it lasts [s], above 0.
        chimney_radius: distance from the axis at which there is no lift [m], above 0.
        chimney_height: up to which there is [m].
        particles: particles and bodies that it acts on; all of the scene by default.
    """

    place: checks.Vector
    start: float = 0.0
    implosion_force: float = 0.0
    implosion_duration: float = 0.0
    implosion_least: float = 0.0
    implosion_most: float = 0.0
    wave_force: float = 0.0
    wave_duration: float = 1.0
    wave_speed: float = 340.0
    wave_thickness: float = 1.0
    convection_force: float = 0.0
    convection_duration: float = 1.0
    chimney_radius: float = 1.0
    chimney_height: float = 10.0
    particles: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "start": checks.Limit(remedy="Use a time beyond the end for not yet."),
        "implosion_force": _NONE_OR_MORE,
        "implosion_duration": _NONE_OR_MORE,
        "implosion_least": _NONE_OR_MORE,
        "implosion_most": _NONE_OR_MORE,
        "wave_force": _NONE_OR_MORE,
        "wave_duration": _POSITIVE,
        "wave_speed": _NONE_OR_MORE,
        "wave_thickness": _POSITIVE,
        "convection_force": _NONE_OR_MORE,
        "convection_duration": _POSITIVE,
        "chimney_radius": _POSITIVE,
        "chimney_height": _POSITIVE,
    }

    def __post_init__(self) -> None:
        checks.vectors(self, "place")
        checks.numbers(self, *self.LIMITS)
        check_particles(self, "particles", others=(Body,))


@dataclass(eq=False)
class UserForce:
    """A force written by the user.

    ``function(position, velocity, time)`` is called at each evaluation with arrays of shapes
    (worlds, particles, 3) [m], [m/s] and (worlds,) [s] and returns the forces [N], shape
    (worlds, particles, 3). The arrays are copies of its own. A numba function of the same arrays
    may be given; it is called the same way. Where it depends on velocity, velocity Verlet is first
    order in that part.

    Args:
        function: the force.
        particles: those it acts on; all of the scene by default.
        energy: optional ``energy(position) -> (worlds,)`` [J], counted by ``world.energy``.
    """

    function: Callable[..., Any]
    particles: Sequence[Particle] | None = None
    energy: Callable[..., Any] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {}

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(
                f"UserForce: function is {self.function!r}; it must be callable as "
                "function(position, velocity, time). Pass the function itself, not its result."
            )
        if self.energy is not None and not callable(self.energy):
            raise TypeError(
                f"UserForce: energy is {self.energy!r}; it must be None or callable as "
                "energy(position). Pass the function itself, not its result."
            )
        check_particles(self, "particles")

    def evaluate(self, position: np.ndarray, velocity: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Forces [N] on all particles, (worlds, particles, 3), as ``position`` and ``velocity``.

        Raises:
            ValueError: the function returned something else.
        """
        given = self.function(position.copy(), velocity.copy(), time.copy())
        force = checks.floats(given)
        if force is None or force.shape != position.shape:
            raise ValueError(
                f"UserForce: the function returned {checks.described(given)}; it must return an "
                f"array of shape {position.shape} (worlds, particles, 3). Return one force per "
                "particle."
            )
        return force

    def potential(self, position: np.ndarray) -> np.ndarray:
        """Energy [J], (worlds,), at positions (worlds, particles, 3); 0 where it brings none.

        Raises:
            ValueError: the function returned something else.
        """
        shape = position.shape[:1]
        if self.energy is None:
            return np.zeros(shape)
        given = self.energy(position.copy())
        energy = checks.floats(given)
        if energy is None or energy.shape != shape:
            raise ValueError(
                f"UserForce: energy returned {checks.described(given)}; it must return an array of "
                f"shape {shape} (worlds,). Return one number per world."
            )
        return energy


Force = (
    Gravity
    | Drag
    | Spring
    | Bungee
    | AnchoredSpring
    | AnchoredBungee
    | StiffSpring
    | Buoyancy
    | Explosion
    | UserForce
)
