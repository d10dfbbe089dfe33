"""Rider: a load that moves over a deck of particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import checks
from .particle import Particle


@dataclass(eq=False)
class Rider:
    """A particle held at barycentric coordinates of others: x = sum of weight_i x_i.

    The weights are prescribed: ``world[rider].weights`` (worlds, deck) sets them, ``world[rider].rates`` [1/s] and
    ``world[rider].accelerations`` [1/s^2] of the same shape move them as the world steps. A rate that jumps is a
    blow; an acceleration is a force. The rider presses on the
    deck with its full inertia; spreading its mass over the deck particles instead is cheaper and neglects
    the inertia of its motion over the deck (see ``steelyard.scenes.lumped_masses``).

    Args:
        particle: the load.
        deck: the particles that may carry it; any number, of which a few have weight at a time.
        weights: start weights, one per deck particle, sum 1; equal by default.

    Raises:
        ValueError: no deck, the load is part of the deck, or weights that do not sum to 1.
    """

    particle: Particle
    deck: Sequence[Particle]
    weights: checks.Vector | None = None

    def __post_init__(self) -> None:
        self.deck = tuple(self.deck)
        if (
            not self.deck
            or self.particle in self.deck
            or len(set(map(id, self.deck))) != len(self.deck)
        ):
            raise ValueError(
                f"Rider: deck has {len(self.deck)} particles; it must have at least 1, each once, and not "
                "the load itself. Give the particles that carry the load."
            )
        if not self.particle.movable:
            raise ValueError(
                "Rider: inverse_mass of the load is 0; it must be above 0. Give it a mass."
            )
        given = (
            np.full(len(self.deck), 1.0 / len(self.deck)) if self.weights is None else self.weights
        )
        weights = np.asarray(given, dtype=np.float64)
        total = float(weights.sum())
        if weights.shape != (len(self.deck),) or not abs(total - 1.0) < 1e-9:
            raise ValueError(
                f"Rider: weights are {given!r} (sum {total!r}); one per deck particle with sum 1 is "
                "needed. Use bilinear weights of the load's place."
            )
        self.weights = tuple(weights.tolist())
