"""Single springs, one per world, for the tests of their motion and of its limits."""

from __future__ import annotations

from typing import Any

import numpy as np

import steelyard as sy

Array = np.ndarray


def spring_world(
    integrator: Any,
    square: Any,
    *,
    dt: float = 1.0 / 60.0,
    damping: float = 1.0,
    start: Any = ((1.0, 0.0),),
) -> sy.World:
    """Springs of rest length 0 in one world per start (x, v) and value of k/m."""
    square, start = np.atleast_1d(square), np.asarray(start)
    worlds = max(len(square), len(start))
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(0, 0, 0), mass=2.0, damping=damping))
    spring = scene.add(sy.AnchoredSpring(p, (0, 0, 0), 1.0, 0.0))
    world = sy.World(scene, worlds=worlds, method=sy.Method(integrator, dt=dt))
    world[spring].stiffness = np.broadcast_to(2.0 * square, (worlds,))
    world.particles.position[:, 0, 0], world.particles.velocity[:, 0, 0] = start.T
    return world


def states(world: sy.World) -> Array:
    """(x, v) of every world, shape (worlds, 2)."""
    return np.stack([world.particles.position[:, 0, 0], world.particles.velocity[:, 0, 0]], axis=1)
