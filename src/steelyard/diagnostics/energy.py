"""Energy of every world: kinetic, gravity and whatever the forces store."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene.forces import (
    AnchoredBungee,
    AnchoredSpring,
    Bungee,
    Buoyancy,
    Gravity,
    Spring,
    StiffSpring,
    UserForce,
)
from .spans import spans, values

if TYPE_CHECKING:
    from ..world import World


def kinetic_energy(world: World) -> np.ndarray:
    """Sum of m v^2 / 2 [J], shape (worlds,)."""
    speed = (world.particles.velocity**2).sum(axis=2)
    return 0.5 * (world.particles.mass_or_zero * speed).sum(axis=1)


def potential_energy(world: World) -> np.ndarray:
    """Energy of constant accelerations and of the forces that have one [J], shape (worlds,).

    Drag has none; a user-written force counts where it brings its ``energy``.
    """
    particles = world.particles
    height = (particles.acceleration * particles.position).sum(axis=2)
    total = _springs(world) - (particles.mass_or_zero * height).sum(axis=1)
    for force in world.scene.of(Buoyancy, Gravity, UserForce):
        if isinstance(force, Buoyancy):
            total = total + _buoyancy(world, force)
        elif isinstance(force, Gravity):
            chosen = world.scene.particles if force.particles is None else force.particles
            for p in map(world._index, chosen):
                along = (world[force].acceleration * particles.position[:, p]).sum(axis=-1)
                total = total - particles.mass_or_zero[:, p] * along
        else:
            total = total + force.potential(particles.position)
    return total


def _springs(world: World) -> np.ndarray:
    """k (l - l0)^2 / 2 of all springs; of a bungee only where it is stretched."""
    springs = world.scene.of(Spring, Bungee, AnchoredSpring, AnchoredBungee, StiffSpring)
    if not springs:
        return np.zeros(world.worlds)
    stretch = np.linalg.norm(spans(world, springs), axis=2)
    resting = [k for k, force in enumerate(springs) if not isinstance(force, StiffSpring)]
    if resting:
        stretch[:, resting] -= values(world, [springs[k] for k in resting], "rest_length")
    bungees = [k for k, force in enumerate(springs) if isinstance(force, Bungee | AnchoredBungee)]
    stretch[:, bungees] = np.maximum(stretch[:, bungees], 0.0)
    return np.asarray((0.5 * values(world, springs, "stiffness") * stretch**2).sum(axis=1))


def _buoyancy(world: World, force: Buoyancy) -> np.ndarray:
    """Minus the integral of the lift from high above down to the float."""
    handle = world[force]
    y = world.particles.position[:, world._index(force.particle), 1]
    lift = handle.volume * handle.density * handle.gravity
    half = handle.half_depth
    depth = handle.surface + half - y
    partial = np.clip(depth, 0.0, 2 * half)
    return lift * (partial**2 / (4 * half) + np.maximum(depth - 2 * half, 0.0))


def world_energy(world: World) -> np.ndarray:
    """Kinetic plus potential energy [J], shape (worlds,)."""
    return kinetic_energy(world) + potential_energy(world)
