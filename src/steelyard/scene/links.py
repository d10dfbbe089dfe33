"""Links: rods of fixed length, cables of maximum length, between particles or to a fixed point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import checks
from .particle import Particle, check_ends

_LENGTH = checks.Limit(above=0.0, remedy="Give the distance in metres that the link holds.")
_ROD: dict[str, checks.Rule] = {"length": _LENGTH}
# A world calls the length that a cable has now ``length``, as that of a rod.
_CABLE: dict[str, checks.Rule] = {
    "max_length": _LENGTH,
    "length": _LENGTH,
    "restitution": checks.Limit(least=0.0, most=1.0, remedy="0 is no rebound, 1 loses no energy."),
}


def _distance(a: Particle, other: checks.Vector) -> float:
    return float(np.linalg.norm(np.subtract(a.position, other)))


@dataclass(eq=False)
class Rod:
    """Holds two particles at a fixed distance.

    Args:
        a: one particle.
        b: the other particle.
        length: distance [m], above 0; by default the distance of the start positions.
    """

    a: Particle
    b: Particle
    length: float | None = None

    LIMITS: ClassVar = _ROD

    def __post_init__(self) -> None:
        check_ends(self, "a", "b")
        if self.length is None:
            self.length = _distance(self.a, self.b.position)
        checks.numbers(self, "length")


@dataclass(eq=False)
class RodConstraint:
    """Holds a particle at a fixed distance from a point.

    Args:
        particle: the particle.
        anchor: the point [m]; may be assigned between steps.
        length: distance [m], above 0; by default the distance at the start.
    """

    particle: Particle
    anchor: checks.Vector
    length: float | None = None

    LIMITS: ClassVar = _ROD

    def __post_init__(self) -> None:
        check_ends(self, "particle")
        checks.vectors(self, "anchor")
        if self.length is None:
            self.length = _distance(self.particle, self.anchor)
        checks.numbers(self, "length")


@dataclass(eq=False)
class Cable:
    """Keeps two particles from going further apart than a maximum length.

    Args:
        a: one particle.
        b: the other particle.
        max_length: greatest distance [m], above 0.
        restitution: speed of parting over speed of approach when the cable snaps taut, in [0, 1].
        winch: whether ``world[cable].rate`` [m/s] and ``world[cable].acceleration`` [m/s^2]
            lengthen it as the world steps; a rate that jumps is a blow. One wound up to nothing is
            flagged in ``world.health``.
    """

    a: Particle
    b: Particle
    max_length: float
    restitution: float = 0.0
    winch: bool = False

    LIMITS: ClassVar = _CABLE

    def __post_init__(self) -> None:
        check_ends(self, "a", "b")
        checks.numbers(self, "max_length", "restitution")


@dataclass(eq=False)
class CableConstraint:
    """Keeps a particle within a maximum distance of a point.

    Args:
        particle: the particle.
        anchor: the point [m]; may be assigned between steps.
        max_length: greatest distance [m], above 0.
        restitution: speed of parting over speed of approach when the cable snaps taut, in [0, 1].
        winch: whether ``world[cable].rate`` [m/s] and ``world[cable].acceleration`` [m/s^2]
            lengthen it as the world steps; a rate that jumps is a blow. One wound up to nothing is
            flagged in ``world.health``.
    """

    particle: Particle
    anchor: checks.Vector
    max_length: float
    restitution: float = 0.0
    winch: bool = False

    LIMITS: ClassVar = _CABLE

    def __post_init__(self) -> None:
        check_ends(self, "particle")
        checks.vectors(self, "anchor")
        checks.numbers(self, "max_length", "restitution")


Link = Rod | RodConstraint | Cable | CableConstraint
