"""User-written forces and contacts: called for all worlds, between the kernels of a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .model.parameters import PARTICLES
from .scene import checks
from .scene.contacts import ContactGenerator
from .scene.forces import UserForce

if TYPE_CHECKING:
    from .world import World


def evaluate_forces(world: World, later: float = 0.0) -> None:
    """Write the sum of all user-written forces to the state, at its time plus ``later`` [s]."""
    forces = world.scene.of(UserForce)
    if not forces:
        return
    position, velocity = world.particles.position, world.particles.velocity
    total = np.zeros(position.shape)
    for force in forces:
        given = force.evaluate(position, velocity, world.time + later)
        if world.scene.planar:
            checks.in_plane("UserForce", "force", given.reshape(-1))
        if force.particles is None:
            total += given
        else:
            chosen = [world._index(p) for p in force.particles]
            total[:, chosen] += given[:, chosen]
    world._view(PARTICLES, "user")[:] = total.reshape(world.worlds, -1)


def generate_contacts(world: World) -> None:
    """Write all user-written contacts to the state; flag worlds in which one is not finite."""
    for generator in world.scene.of(ContactGenerator):
        a = [world._index(pair[0]) for pair in generator.pairs]
        b = [world._index(pair[1] or pair[0]) for pair in generator.pairs]
        position = world.particles.position
        normal, depth, broken = generator.evaluate(
            position[:, a], position[:, b], world.time.copy()
        )
        if world.scene.planar:
            checks.in_plane("ContactGenerator", "normal", normal[~broken].reshape(-1))
        world._view(PARTICLES, "nonfinite")[broken] = 1.0
        for k in range(len(a)):
            rows = world._view(generator, f"pair {k}")
            rows[:, :3] = normal[:, k]
            rows[:, 3] = depth[:, k]
