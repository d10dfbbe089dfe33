"""Rider: a load that moves over a deck of particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from . import checks
from .particle import Particle, check_ends, check_particles

_MOVED = checks.Total(total=0.0, remedy="What one particle's weight gains, others must lose.")


@dataclass(eq=False)
class Rider:
    """A particle held at barycentric coordinates of others: x = sum of weight_i x_i.

    The weights are prescribed: ``world[rider].weights`` (worlds, deck) sets them,
    ``world[rider].rates`` [1/s] and ``world[rider].accelerations`` [1/s^2] of the same shape move
    them as the world steps. A rate that jumps is a blow; an acceleration is a force. The rider
    presses on the deck with its full inertia; spreading its mass over the deck particles instead is
    cheaper and neglects the inertia of its motion over the deck (see
    ``steelyard.scenes.lumped_masses``).

    Args:
        particle: the load.
        deck: the particles that may carry it; any number, of which a few have weight at a time.
        weights: start weights, one per deck particle, sum 1; equal by default.

    Raises:
        TypeError: the load or a part of the deck is no particle.
        ValueError: no deck, the load is part of the deck, or weights that do not sum to 1.
    """

    particle: Particle
    deck: Sequence[Particle]
    weights: checks.Vector | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "weights": checks.Total(total=1.0, remedy="Use bilinear weights of the load's place."),
        "rates": _MOVED,
        "accelerations": _MOVED,
    }

    def __post_init__(self) -> None:
        check_ends(self, "particle")
        self.deck = () if self.deck is None else self.deck
        check_particles(self, "deck")
        if not self.deck or any(particle is self.particle for particle in self.deck):
            raise ValueError(
                f"Rider: deck has {len(self.deck)} particles; it must have at least 1, each once, "
                "and not the load itself. Give the particles that carry the load."
            )
        if not self.particle.movable:
            raise ValueError(
                "Rider: inverse_mass of the load is 0; it must be above 0. Give it a mass."
            )
        size = len(self.deck)
        given = np.full(size, 1.0 / size) if self.weights is None else self.weights
        weights = checks.floats(given)
        if weights is None or weights.shape != (size,):
            raise ValueError(
                f"Rider: weights is {given!r}; it must be {size} numbers with sum 1, one per deck "
                "particle. Use bilinear weights of the load's place."
            )
        self.weights = tuple(self.LIMITS["weights"].check("Rider", "weights", weights).tolist())
