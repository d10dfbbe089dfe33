"""Forces as a person writes them; their kernels are the files of the same names in ``steelyard.forces``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import checks
from .particle import Particle


def _stiffness(owner: str, value: float) -> float:
    return checks.number(
        owner, "stiffness", value, above=0.0, remedy="Give newtons per metre of stretch."
    )


def _rest(owner: str, value: float) -> float:
    return checks.number(owner, "rest_length", value, least=0.0, remedy="Give metres.")


def _distinct(owner: str, a: Particle, b: Particle) -> None:
    if a is b:
        raise ValueError(f"{owner}: a and b are the same particle; it needs two. Give another.")


@dataclass(eq=False)
class Gravity:
    """F = m g on each of its particles; immovable ones feel nothing (Millington, *Game Physics*, ch. 5).

    Args:
        acceleration: g [m/s^2], added to what the scene's gravity gives.
        particles: those it acts on; all of the scene by default.
    """

    acceleration: checks.Vector
    particles: Sequence[Particle] | None = None

    def __post_init__(self) -> None:
        self.acceleration = checks.vector("Gravity", "acceleration", self.acceleration)


@dataclass(eq=False)
class Drag:
    """F = -(k1 |u| + k2 |u|^2) u/|u| with u the velocity relative to the wind.

    Args:
        linear: k1 [N s/m], at least 0.
        quadratic: k2 [N s^2/m^2], at least 0.
        wind: velocity of the air [m/s].
        particles: those it acts on; all of the scene by default.
    """

    linear: float = 0.0
    quadratic: float = 0.0
    wind: checks.Vector = (0.0, 0.0, 0.0)
    particles: Sequence[Particle] | None = None

    def __post_init__(self) -> None:
        remedy = "Negative drag would feed energy in; use 0 for none."
        self.linear = checks.number("Drag", "linear", self.linear, least=0.0, remedy=remedy)
        self.quadratic = checks.number(
            "Drag", "quadratic", self.quadratic, least=0.0, remedy=remedy
        )
        self.wind = checks.vector("Drag", "wind", self.wind)


@dataclass(eq=False)
class Spring:
    """F = -k (l - l0) n on ``a``, the opposite on ``b``; n points from b to a.

    Args:
        a: one end.
        b: the other end.
        stiffness: k [N/m], above 0.
        rest_length: l0 [m], at least 0.
    """

    a: Particle
    b: Particle
    stiffness: float
    rest_length: float

    def __post_init__(self) -> None:
        _distinct(type(self).__name__, self.a, self.b)
        self.stiffness = _stiffness(type(self).__name__, self.stiffness)
        self.rest_length = _rest(type(self).__name__, self.rest_length)


@dataclass(eq=False)
class Bungee(Spring):
    """A spring that acts only when longer than its rest length."""


@dataclass(eq=False)
class AnchoredSpring:
    """F = -k (l - l0) n, n from the anchor to the particle.

    Args:
        particle: the moving end.
        anchor: the fixed end [m]; may be assigned between steps.
        stiffness: k [N/m], above 0.
        rest_length: l0 [m], at least 0.
    """

    particle: Particle
    anchor: checks.Vector
    stiffness: float
    rest_length: float

    def __post_init__(self) -> None:
        self.anchor = checks.vector(type(self).__name__, "anchor", self.anchor)
        self.stiffness = _stiffness(type(self).__name__, self.stiffness)
        self.rest_length = _rest(type(self).__name__, self.rest_length)


@dataclass(eq=False)
class AnchoredBungee(AnchoredSpring):
    """An anchored spring that acts only when longer than its rest length."""


@dataclass(eq=False)
class StiffSpring:
    """Anchored damped spring of zero rest length, m x'' = -k x - c x', stepped by its exact solution.

    Stable and exact for every stiffness, damping and step; other forces on the particle count as constant
    over a step. A particle has at most one, and no link, rider or contact.

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

    def __post_init__(self) -> None:
        self.anchor = checks.vector("StiffSpring", "anchor", self.anchor)
        self.stiffness = _stiffness("StiffSpring", self.stiffness)
        self.damping = checks.number(
            "StiffSpring", "damping", self.damping, least=0.0, remedy="Use 0 for no damping."
        )


@dataclass(eq=False)
class Buoyancy:
    """Lift of a liquid with a level surface: rho V g below, 0 above, linear over the height 2 d between.

    F_y = rho V g (h + d - y) / (2 d) for y in [h - d, h + d].

    Args:
        particle: the float.
        surface: h, height of the surface [m].
        half_depth: d [m], above 0: the float is wholly under at y = h - d.
        volume: V [m^3], above 0.
        density: rho [kg/m^3] of the liquid, above 0.
        gravity: g [m/s^2], above 0.
    """

    particle: Particle
    surface: float
    half_depth: float
    volume: float
    density: float = 1000.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        self.surface = checks.number("Buoyancy", "surface", self.surface, remedy="Give metres.")
        for name in ("half_depth", "volume", "density", "gravity"):
            value = checks.number(
                "Buoyancy", name, getattr(self, name), above=0.0, remedy="Give SI units."
            )
            setattr(self, name, value)


@dataclass(eq=False)
class UserForce:
    """A force written by the user.

    ``function(position, velocity, time)`` is called at each evaluation with arrays of shapes
    (worlds, particles, 3) [m], [m/s] and (worlds,) [s] and returns the forces [N], shape
    (worlds, particles, 3). A numba function of the same arrays may be given; it is called the same way.
    Where it depends on velocity, velocity Verlet is first order in that part.

    Args:
        function: the force.
        particles: those it acts on; all of the scene by default.
        energy: optional ``energy(position) -> (worlds,)`` [J], counted by ``world.energy``.
    """

    function: Callable[..., Any]
    particles: Sequence[Particle] | None = None
    energy: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ValueError(
                f"UserForce: function is {self.function!r}; it must be callable as "
                "function(position, velocity, time). Pass the function itself, not its result."
            )


Force = (
    Gravity
    | Drag
    | Spring
    | Bungee
    | AnchoredSpring
    | AnchoredBungee
    | StiffSpring
    | Buoyancy
    | UserForce
)
