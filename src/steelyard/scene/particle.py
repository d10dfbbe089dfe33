"""Particle: a point with mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from . import checks

_REMEDY = "Use inverse_mass=0 for a particle that nothing can move."


@dataclass(eq=False, kw_only=True)
class Particle:
    """A point mass, or an immovable point.

    Args:
        position: start position [m], three floats.
        velocity: start velocity [m/s], three floats.
        mass: mass [kg], above 0. ``float("inf")`` is refused: use ``inverse_mass=0``.
        inverse_mass: 1/mass [1/kg] instead of ``mass``; 0 makes the particle immovable: no force,
            link or contact moves it.
        acceleration: constant acceleration [m/s^2] of this particle in place of the scene's
            gravity.
        damping: fraction of the velocity kept after one second, in (0, 1]; 1 is no damping. It is
            linear drag relative to still air with rate -ln(damping) per second.
        radius: distance [m] at which the particle touches scenery.

    Raises:
        ValueError: mass or damping out of range, or a value that is not finite.
    """

    position: checks.Vector
    velocity: checks.Vector = (0.0, 0.0, 0.0)
    mass: float | None = None
    inverse_mass: float | None = None
    acceleration: checks.Vector | None = None
    damping: float = 1.0
    radius: float = 0.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "mass": checks.Limit(above=0.0, invertible=True, remedy=_REMEDY),
        "inverse_mass": checks.Limit(least=0.0, invertible=True, remedy=_REMEDY),
        "damping": checks.Limit(
            above=0.0,
            most=1.0,
            remedy="Use 1 for no damping; .9 keeps 90 % of the velocity over each second.",
        ),
        "radius": checks.Limit(least=0.0, remedy="Use 0 for a point."),
    }

    def __post_init__(self) -> None:
        checks.vectors(self, "position", "velocity")
        if self.acceleration is not None:
            checks.vectors(self, "acceleration")
        checks.numbers(self, "damping", "radius")
        if self.mass is not None and self.inverse_mass is not None:
            raise ValueError(
                f"Particle: both mass ({self.mass!r}) and inverse_mass ({self.inverse_mass!r}) are "
                "given; at most one may be. Give the one you know."
            )
        if self.inverse_mass is None:
            self.mass = 1.0 if self.mass is None else self.mass
            checks.numbers(self, "mass")
            self.inverse_mass = 1.0 / self.mass
        else:
            checks.numbers(self, "inverse_mass")
            self.mass = 1.0 / self.inverse_mass if self.inverse_mass > 0.0 else None
        if self.inverse_mass == 0.0 and any(self.velocity):
            raise ValueError(
                f"Particle: velocity is {self.velocity} but inverse_mass is 0; an immovable "
                "particle must have velocity 0. Give it a mass, or assign its position between "
                "steps."
            )

    @property
    def movable(self) -> bool:
        """Whether forces can move it: ``inverse_mass > 0``."""
        return bool(self.inverse_mass)


def check_ends(thing: Any, *names: str, others: tuple[type, ...] = ()) -> None:
    """Make sure that attributes of a thing are particles, or of other kinds that will do, each another.

    Raises:
        TypeError: one is neither.
        ValueError: two are the same.
    """
    owner = type(thing).__name__
    ends = [getattr(thing, name) for name in names]
    for name, end in zip(names, ends, strict=True):
        if not isinstance(end, (Particle, *others)):
            kinds = " or ".join(kind.__name__ for kind in (Particle, *others))
            raise TypeError(f"{owner}: {name} is {end!r}; it must be a {kinds}. Give one.")
    if len(set(map(id, ends))) < len(ends):
        raise ValueError(
            f"{owner}: {' and '.join(names)} are the same particle; it needs two. Give another."
        )


def check_particles(thing: Any, name: str, *, others: tuple[type, ...] = ()) -> None:
    """Make an attribute of a thing a tuple of different particles; None, for all, stays.

    Raises:
        TypeError: not a sequence of particles, or of other kinds that will do.
        ValueError: a particle is in it twice.
    """
    owner = type(thing).__name__
    value = getattr(thing, name)
    if value is None:
        return
    try:
        chosen = tuple(value)
    except TypeError:
        chosen = (None,)
    if not all(isinstance(particle, (Particle, *others)) for particle in chosen):
        raise TypeError(
            f"{owner}: {name} is {value!r}; it must be a list of Particles. Put even one in a list."
        )
    if len(set(map(id, chosen))) < len(chosen):
        raise ValueError(
            f"{owner}: {name} has {len(chosen)} particles, one of them twice; it must have each "
            "once, as it would count twice. Leave out the second."
        )
    setattr(thing, name, chosen)
