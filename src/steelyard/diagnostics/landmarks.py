"""Places that tell where everything is: what errors of a motion are measured at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene.shapes import rotation_matrix

if TYPE_CHECKING:
    from ..world import World


def landmarks(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Particles, then of each body its origin and the ends of its unit axes (1 m along x, y and z).

    Returns:
        Positions [m] and velocities [m/s], each (worlds, particles + 4 bodies, 3).
    """
    particles = world.particles
    if not world.scene.bodies:
        return particles.position, particles.velocity
    bodies = world.bodies
    axes = np.swapaxes(rotation_matrix(bodies.orientation), -1, -2)
    arms = np.concatenate([np.zeros_like(axes[:, :, :1]), axes], axis=2)
    places = bodies.position[:, :, None] + arms
    speeds = bodies.velocity[:, :, None] + np.cross(bodies.angular_velocity[:, :, None], arms)
    shape = (world.worlds, -1, 3)
    return (
        np.concatenate([particles.position, places.reshape(shape)], axis=1),
        np.concatenate([particles.velocity, speeds.reshape(shape)], axis=1),
    )
