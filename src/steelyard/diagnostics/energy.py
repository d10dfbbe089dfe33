"""Energy of every world: kinetic, gravity and whatever the forces store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.body import Body
from ..scene.forces import (
    AnchoredBungee,
    Bungee,
    Buoyancy,
    Gravity,
    StiffSpring,
    UserForce,
)
from ..scene.scene import SPRINGS
from .joints import drive_energy
from .spans import place_of, spans, values

if TYPE_CHECKING:
    from ..world import World


def kinetic_energy(world: World) -> np.ndarray:
    """Sum of m v^2 / 2 of particles, and of that and w.L / 2 of bodies [J], shape (worlds,)."""
    speed = (world.particles.velocity**2).sum(axis=2)
    total = 0.5 * (world.particles.mass_or_zero * speed).sum(axis=1)
    if world.scene.bodies:
        bodies = world.bodies
        total = total + 0.5 * (bodies.mass_or_zero * (bodies.velocity**2).sum(axis=2)).sum(axis=1)
        total = total + 0.5 * (bodies.angular_velocity * bodies.angular_momentum).sum(axis=(1, 2))
    return total


def potential_energy(world: World) -> np.ndarray:
    """Energy of constant accelerations and of the forces that have one [J], shape (worlds,).

    Drag has none; a user-written force counts where it brings its ``energy``.
    """
    particles = world.particles
    height = (particles.acceleration * particles.position).sum(axis=2)
    total = _springs(world) + drive_energy(world) - (particles.mass_or_zero * height).sum(axis=1)
    if world.scene.bodies:
        bodies = world.bodies
        height = (bodies.acceleration * bodies.centre).sum(axis=2)
        total = total - (bodies.mass_or_zero * height).sum(axis=1)
    for force in world.scene.of(Buoyancy, Gravity, UserForce):
        if isinstance(force, Buoyancy):
            total = total + _buoyancy(world, force)
        elif isinstance(force, Gravity):
            everything: list[Any] = [*world.scene.particles, *world.scene.bodies]
            for thing in everything if force.particles is None else force.particles:
                body = isinstance(thing, Body)
                places = world.bodies.centre if body else particles.position
                mass = (world.bodies if body else particles).mass_or_zero
                k = world._index(thing)
                along = (world[force].acceleration * places[:, k]).sum(axis=-1)
                total = total - mass[:, k] * along
        else:
            total = total + force.potential(particles.position)
    return total


def _springs(world: World) -> np.ndarray:
    """k (l - l0)^2 / 2 of all springs; of a bungee only where it is stretched."""
    springs = world.scene.of(*SPRINGS)
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
    y = place_of(world, force.particle)[:, 1]
    lift = handle.volume * handle.density * handle.gravity
    half = handle.half_depth
    depth = handle.surface + half - y
    partial = np.clip(depth, 0.0, 2 * half)
    return lift * (partial**2 / (4 * half) + np.maximum(depth - 2 * half, 0.0))


def world_energy(world: World) -> np.ndarray:
    """Kinetic plus potential energy [J], shape (worlds,)."""
    return kinetic_energy(world) + potential_energy(world)
