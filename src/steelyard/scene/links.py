"""Links: rods of fixed length and cables of maximum length, between particles or to a fixed point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import checks
from .particle import Particle


def _length(owner: str, name: str, value: float) -> float:
    return checks.number(
        owner, name, value, above=0.0, remedy="Give the distance in metres that the link holds."
    )


def _restitution(owner: str, value: float) -> float:
    return checks.number(
        owner,
        "restitution",
        value,
        least=0.0,
        most=1.0,
        remedy="0 is no rebound, 1 loses no energy.",
    )


def _distinct(owner: str, a: Particle, b: Particle) -> None:
    if a is b:
        raise ValueError(f"{owner}: a and b are the same particle; a link needs two. Give another.")


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

    def __post_init__(self) -> None:
        _distinct("Rod", self.a, self.b)
        length = _distance(self.a, self.b.position) if self.length is None else self.length
        self.length = _length("Rod", "length", length)


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

    def __post_init__(self) -> None:
        self.anchor = checks.vector("RodConstraint", "anchor", self.anchor)
        length = _distance(self.particle, self.anchor) if self.length is None else self.length
        self.length = _length("RodConstraint", "length", length)


@dataclass(eq=False)
class Cable:
    """Keeps two particles from going further apart than a maximum length.

    Args:
        a: one particle.
        b: the other particle.
        max_length: greatest distance [m], above 0.
        restitution: speed of parting over speed of approach when the cable snaps taut, in [0, 1].
        winch: whether ``world[cable].rate`` [m/s] and ``world[cable].acceleration`` [m/s^2] lengthen it as the
            world steps; a rate that jumps is a blow.
    """

    a: Particle
    b: Particle
    max_length: float
    restitution: float = 0.0
    winch: bool = False

    def __post_init__(self) -> None:
        _distinct("Cable", self.a, self.b)
        self.max_length = _length("Cable", "max_length", self.max_length)
        self.restitution = _restitution("Cable", self.restitution)


@dataclass(eq=False)
class CableConstraint:
    """Keeps a particle within a maximum distance of a point.

    Args:
        particle: the particle.
        anchor: the point [m]; may be assigned between steps.
        max_length: greatest distance [m], above 0.
        restitution: speed of parting over speed of approach when the cable snaps taut, in [0, 1].
        winch: whether ``world[cable].rate`` [m/s] and ``world[cable].acceleration`` [m/s^2] lengthen it as the
            world steps; a rate that jumps is a blow.
    """

    particle: Particle
    anchor: checks.Vector
    max_length: float
    restitution: float = 0.0
    winch: bool = False

    def __post_init__(self) -> None:
        self.anchor = checks.vector("CableConstraint", "anchor", self.anchor)
        self.max_length = _length("CableConstraint", "max_length", self.max_length)
        self.restitution = _restitution("CableConstraint", self.restitution)


Link = Rod | RodConstraint | Cable | CableConstraint
