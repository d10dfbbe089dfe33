"""Contact generators: what particles can touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import checks
from .particle import Particle


def _surface(owner: str, restitution: float, friction: float) -> tuple[float, float]:
    return (
        checks.number(
            owner, "restitution", restitution, least=0.0, most=1.0, remedy="1 loses no energy."
        ),
        checks.number(owner, "friction", friction, least=0.0, remedy="0 is frictionless."),
    )


@dataclass(eq=False, kw_only=True)
class Ground:
    """Half-space that particles cannot enter.

    Args:
        height: distance [m] of the plane from the origin along its normal.
        normal: direction out of the ground; made a unit vector.
        restitution: rebound speed over impact speed, in [0, 1].
        friction: Coulomb coefficient, at least 0.
        particles: those that can touch it; all movable ones of the scene by default. Each costs three
            rows in a solver: name only those that can get there.
    """

    height: float = 0.0
    normal: checks.Vector = (0.0, 1.0, 0.0)
    restitution: float = 0.0
    friction: float = 0.0
    particles: Sequence[Particle] | None = None

    def __post_init__(self) -> None:
        self.height = checks.number(
            "Ground", "height", self.height, remedy="Give the plane's distance from the origin."
        )
        normal = np.asarray(checks.vector("Ground", "normal", self.normal))
        size = float(np.linalg.norm(normal))
        checks.number("Ground", "length of normal", size, above=0.0, remedy="Use (0, 1, 0) for up.")
        x, y, z = (normal / size).tolist()
        self.normal = (x, y, z)
        self.restitution, self.friction = _surface("Ground", self.restitution, self.friction)


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

    def __post_init__(self) -> None:
        self.start = checks.vector("LinePlatform", "start", self.start)
        self.end = checks.vector("LinePlatform", "end", self.end)
        span = float(np.linalg.norm(np.subtract(self.end, self.start)))
        checks.number(
            "LinePlatform", "distance from start to end", span, above=0.0, remedy="Move an end."
        )
        self.radius = checks.number(
            "LinePlatform", "radius", self.radius, least=0.0, remedy="Use 0 for a bare line."
        )
        self.restitution, self.friction = _surface("LinePlatform", self.restitution, self.friction)


@dataclass(eq=False)
class ContactGenerator:
    """Contacts written by the user.

    ``function(position_a, position_b, time)`` is called before each step with arrays of shape
    (worlds, pairs, 3) [m] and times of shape (worlds,) [s]; ``position_b`` repeats ``position_a`` where the
    pair's second member is None (scenery). It returns ``(normal, penetration)`` of shapes (worlds, pairs, 3)
    and (worlds, pairs) [m]: the unit normal points from b (or scenery) to a; a penetration of 0 or less is
    no contact. A numba function of the same arrays may be given; it is called the same way.

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

    def __post_init__(self) -> None:
        self.pairs = tuple(self.pairs)
        if not callable(self.function) or not self.pairs:
            raise ValueError(
                f"ContactGenerator: function is {self.function!r} with {len(self.pairs)} pairs; it needs "
                "a callable and at least one pair. Name the pairs that may touch."
            )
        self.restitution, self.friction = _surface(
            "ContactGenerator", self.restitution, self.friction
        )


Contacts = Ground | LinePlatform | ContactGenerator
