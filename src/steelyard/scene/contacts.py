"""Contact generators: what particles and bodies can touch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar

import numpy as np

from . import checks
from .body import Body
from .particle import Particle, check_particles

_SURFACE: dict[str, checks.Rule] = {
    "restitution": checks.Limit(least=0.0, most=1.0, remedy="1 loses no energy."),
    "friction": checks.Limit(least=0.0, remedy="0 is frictionless."),
}
_LENGTH = checks.Limit(least=0.0, remedy="Leave it out where none is modelled.")
_BRAKES: dict[str, checks.Rule] = {"spinning_friction": _LENGTH, "rolling_friction": _LENGTH}


def _declare_brakes(generator: Ground | Collisions) -> tuple[str, ...]:
    """Names of the friction of spinning and rolling where one of them is given; the other is 0 then."""
    if all(getattr(generator, name) is None for name in _BRAKES):
        return ()
    for name in _BRAKES:
        if getattr(generator, name) is None:
            setattr(generator, name, 0.0)
    checks.numbers(generator, *_BRAKES)
    return tuple(_BRAKES)


@dataclass(eq=False, kw_only=True)
class Ground:
    """Half-space that particles and bodies cannot enter.

    Args:
        height: distance [m] of the plane from the origin along its normal.
        normal: direction out of the ground; made a unit vector.
        restitution: rebound speed over impact speed, in [0, 1].
        friction: Coulomb coefficient, at least 0.
        rolling_friction: length [m]: the torque against rolling is at most this times the normal force; None, as by
            default, where none is modelled.
        spinning_friction: the same against turning about the normal.
        particles: particles and bodies that can touch it; all movable ones of the scene by default. Each costs
            three rows in a solver: name only those that can get there.
    """

    height: float = 0.0
    normal: checks.Vector = (0.0, 1.0, 0.0)
    restitution: float = 0.0
    friction: float = 0.0
    rolling_friction: float | None = None
    spinning_friction: float | None = None
    particles: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = (
        _SURFACE
        | _BRAKES
        | {
            "height": checks.Limit(remedy="Give the plane's distance from the origin."),
            "normal": checks.Direction(remedy="Use (0, 1, 0) for up."),
        }
    )

    def __post_init__(self) -> None:
        checks.numbers(self, "height", "restitution", "friction")
        self.brakes = _declare_brakes(self)
        checks.vectors(self, "normal")
        normal = self.LIMITS["normal"].check("Ground", "normal", np.asarray(self.normal))
        self.normal = tuple(normal.tolist())
        check_particles(self, "particles", others=(Body,))


@dataclass(eq=False, kw_only=True)
class LinePlatform:
    """A line segment on which particles with a radius rest and roll off, as a thin round bar.

    Args:
        start: one end [m].
        end: the other end [m].
        radius: thickness [m] of the bar, added to the particle's own radius; one of them above 0.
        restitution: rebound speed over impact speed, in [0, 1].
        friction: Coulomb coefficient, at least 0.
        particles: those that can touch it; all movable ones of the scene by default.
    """

    start: checks.Vector
    end: checks.Vector
    radius: float = 0.0
    restitution: float = 0.0
    friction: float = 0.0
    particles: Sequence[Particle] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = _SURFACE | {
        "radius": checks.Limit(least=0.0, remedy="Use 0 for a bare line."),
    }

    def __post_init__(self) -> None:
        checks.vectors(self, "start", "end")
        check_span(np.asarray(self.start), np.asarray(self.end))
        checks.numbers(self, "radius", "restitution", "friction")
        check_particles(self, "particles")


def check_span(start: np.ndarray, end: np.ndarray) -> None:
    """Refuse a line platform of no length; both ends (3,) or (3, worlds).

    Raises:
        ValueError: the ends are at the same place, or further apart than a float can tell.
    """
    starts, ends = np.broadcast_arrays(start.reshape(3, -1), end.reshape(3, -1))
    with np.errstate(over="ignore"):
        spans = np.linalg.norm(ends - starts, axis=0)
    bad = ~(np.isfinite(spans) & (spans > 0.0))
    if bad.any():
        w = int(bad.argmax())
        where = f" in world {w}" if len(bad) > 1 else ""
        raise ValueError(
            f"LinePlatform: start is {tuple(starts[:, w].tolist())} and end is "
            f"{tuple(ends[:, w].tolist())}{where}, distance from start to end {float(spans[w])!r}; "
            "it must be finite and greater than 0. Move an end."
        )


def check_thickness(radius: float, particles: Iterable[Particle]) -> None:
    """Refuse a line platform that one of its particles can never touch.

    Raises:
        ValueError: neither the bar nor the particle has a radius.
    """
    for particle in particles:
        if radius == 0.0 and particle.radius == 0.0:
            raise ValueError(
                f"LinePlatform: radius is {radius} and that of the particle at "
                f"{particle.position} is 0.0; one of them must be greater than 0, or they never "
                "touch. Give one a radius, or name only particles that have one."
            )


@dataclass(eq=False, kw_only=True)
class Collisions:
    """Particles, as balls of their radius, and bodies, none of which can enter another.

    Every pair of particles costs three rows in their solvers: name only those that can meet. Two balls whose centres
    coincide push each other up and down. Of bodies the last one that names both says how they meet.

    Args:
        restitution: rebound speed over approach speed, in [0, 1].
        friction: Coulomb coefficient, at least 0. A particle does not turn: friction acts at its centre.
        rolling_friction: length [m]: the torque against rolling is at most this times the normal force; None, as by
            default, where none is modelled.
        spinning_friction: the same against turning about the normal.
        particles: particles and bodies that can meet; all of the scene by default.
    """

    restitution: float = 0.0
    friction: float = 0.0
    rolling_friction: float | None = None
    spinning_friction: float | None = None
    particles: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = _SURFACE | _BRAKES

    def __post_init__(self) -> None:
        checks.numbers(self, "restitution", "friction")
        self.brakes = _declare_brakes(self)
        check_particles(self, "particles", others=(Body,))

    def pairs_of(self, everything: Sequence[Any]) -> list[tuple[Any, Any]]:
        """Pairs that can meet, given all particles and bodies of the scene; the first of each is movable."""
        chosen = everything if self.particles is None else self.particles
        return [
            (a, b) if a.movable else (b, a)
            for a, b in combinations(chosen, 2)
            if a.movable or b.movable
        ]

    def check(self, everything: Sequence[Any]) -> None:
        """Refuse what can never happen.

        Raises:
            ValueError: no pair, two particles without a radius, or a body without a part.
        """
        chosen = list(everything if self.particles is None else self.particles)
        movable = sum(thing.movable for thing in chosen)
        if len(chosen) < 2 or movable == 0:
            raise ValueError(
                f"Collisions: {len(chosen)} particles make 0 pairs; it must be at least 1, of which one can move. "
                "Name two particles."
            )
        for thing in chosen:
            check_parts("Collisions", thing)
        points = [thing for thing in chosen if isinstance(thing, Particle) and thing.radius == 0.0]
        points.sort(key=lambda point: not point.movable)
        if len(points) > 1 and points[0].movable:
            raise ValueError(
                f"Collisions: radius is 0.0 for the particles at {points[0].position} and {points[1].position}; one of "
                "them must be greater than 0, or they never touch. Give one a radius."
            )


def check_parts(owner: str, thing: Particle | Body) -> None:
    """Refuse a body that nothing can touch.

    Raises:
        ValueError: it has no part.
    """
    if isinstance(thing, Body) and not thing.parts:
        raise ValueError(
            f"{owner}: the body at {thing.position} has 0 parts; it must have at least 1, or nothing touches it. Give "
            "parts=Sphere(...), or name the other things."
        )


@dataclass(eq=False)
class ContactGenerator:
    """Contacts written by the user.

    ``function(position_a, position_b, time)`` is called before each step with arrays of shape
    (worlds, pairs, 3) [m] and times of shape (worlds,) [s]; ``position_b`` repeats ``position_a``
    where the pair's second member is None (scenery). It returns ``(normal, penetration)`` of shapes
    (worlds, pairs, 3) and (worlds, pairs) [m]: the unit normal points from b (or scenery) to a; a
    penetration of 0 or less is no contact, whatever its normal. A world in which a contact is not
    finite is flagged in ``world.health`` and goes on without it. A numba function of the same
    arrays may be given; it is called the same way.

    Args:
        function: the generator.
        pairs: (particle, particle or None) that it may bring into contact.
        restitution: rebound speed over approach speed, in [0, 1].
        friction: Coulomb coefficient, at least 0.
    """

    function: Callable[..., Any]
    pairs: Sequence[tuple[Particle, Particle | None]]
    restitution: float = 0.0
    friction: float = 0.0

    LIMITS: ClassVar = _SURFACE

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(
                f"ContactGenerator: function is {self.function!r}; it must be callable as "
                "function(position_a, position_b, time). Pass the function itself, not its result."
            )
        try:
            pairs = tuple((a, b) for a, b in self.pairs)
        except (TypeError, ValueError):
            pairs = ()
        if not pairs or not all(_is_pair(a, b) for a, b in pairs):
            raise ValueError(
                f"ContactGenerator: pairs is {self.pairs!r}; it must be at least one pair "
                "(Particle, another Particle or None for scenery). Name the pairs that may touch."
            )
        self.pairs = pairs
        checks.numbers(self, "restitution", "friction")

    def evaluate(
        self, position_a: np.ndarray, position_b: np.ndarray, time: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Contacts at the places of the pairs, (worlds, pairs, 3) [m], and times (worlds,) [s].

        Returns:
            Normals (worlds, pairs, 3), penetrations (worlds, pairs) [m], and in which worlds a
            contact was not finite (worlds,); it is none here.

        Raises:
            ValueError: what the function returned has not these shapes, or a normal is no unit
                vector.
        """
        shape = position_a.shape
        given = self.function(position_a, position_b, time)
        try:
            normal, depth = map(checks.floats, given)
        except (TypeError, ValueError):
            normal = depth = None
        if normal is None or depth is None or (normal.shape, depth.shape) != (shape, shape[:2]):
            parts = given if isinstance(given, tuple | list) else (given,)
            raise ValueError(
                "ContactGenerator: the function returned "
                f"{' and '.join(map(checks.described, parts))}; it must return (normal, "
                f"penetration) of shapes {shape} and {shape[:2]} (worlds, pairs). Return one "
                "contact per pair."
            )
        touching = ~(depth <= 0.0)
        finite = np.isfinite(normal).all(axis=2)
        broken = touching & ~(finite & np.isfinite(depth))
        size = np.linalg.norm(normal, axis=2)
        wrong = touching & ~broken & ~(np.abs(size - 1.0) < 1e-6)
        if wrong.any():
            w, k = np.unravel_index(wrong.argmax(), wrong.shape)
            raise ValueError(
                f"ContactGenerator: the normal of pair {k} in world {w} is "
                f"{tuple(normal[w, k].tolist())} of length {size[w, k]:g}; it must be a unit "
                "vector. Divide it by its length."
            )
        # Kernels compute with the normal of what does not touch too, before they mask it.
        normal = np.where(finite[..., None], normal, (0.0, 1.0, 0.0))
        return normal, np.where(broken, 0.0, depth), broken.any(axis=1)


def _is_pair(a: Any, b: Any) -> bool:
    return isinstance(a, Particle) and (b is None or isinstance(b, Particle)) and a is not b


Contacts = Ground | LinePlatform | ContactGenerator
