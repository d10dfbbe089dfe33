"""Particle: a point with mass."""

from __future__ import annotations

from dataclasses import dataclass

from . import checks


@dataclass(eq=False, kw_only=True)
class Particle:
    """A point mass, or an immovable point.

    Args:
        position: start position [m], three floats.
        velocity: start velocity [m/s], three floats.
        mass: mass [kg], above 0. ``float("inf")`` is refused: use ``inverse_mass=0``.
        inverse_mass: 1/mass [1/kg] instead of ``mass``; 0 makes the particle immovable: no force, link
            or contact moves it.
        acceleration: constant acceleration [m/s^2] of this particle in place of the scene's gravity.
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

    def __post_init__(self) -> None:
        self.position = checks.vector("Particle", "position", self.position)
        self.velocity = checks.vector("Particle", "velocity", self.velocity)
        if self.acceleration is not None:
            self.acceleration = checks.vector("Particle", "acceleration", self.acceleration)
        self.damping = checks.number(
            "Particle",
            "damping",
            self.damping,
            above=0.0,
            most=1.0,
            remedy="Use 1 for no damping; .9 keeps 90 % of the velocity over each second.",
        )
        self.radius = checks.number(
            "Particle", "radius", self.radius, least=0.0, remedy="Use 0 for a point."
        )
        if self.mass is not None and self.inverse_mass is not None:
            raise ValueError(
                f"Particle: both mass ({self.mass!r}) and inverse_mass ({self.inverse_mass!r}) are "
                "given; at most one may be. Give the one you know."
            )
        remedy = "Use inverse_mass=0 for a particle that nothing can move."
        if self.inverse_mass is None:
            mass = 1.0 if self.mass is None else self.mass
            self.mass = checks.number("Particle", "mass", mass, above=0.0, remedy=remedy)
            self.inverse_mass = 1.0 / self.mass
        else:
            self.inverse_mass = checks.number(
                "Particle", "inverse_mass", self.inverse_mass, least=0.0, remedy=remedy
            )
            self.mass = 1.0 / self.inverse_mass if self.inverse_mass > 0.0 else None
        if self.inverse_mass == 0.0 and any(self.velocity):
            raise ValueError(
                f"Particle: velocity is {self.velocity} but inverse_mass is 0; an immovable particle "
                "must have velocity 0. Give it a mass, or assign its position between steps."
            )

    @property
    def movable(self) -> bool:
        """Whether forces can move it: ``inverse_mass > 0``."""
        return bool(self.inverse_mass)
