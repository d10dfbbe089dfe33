"""A load that crosses the bridge while every link stays taut: a smooth motion that can be solved.

While all cables carry tension the bridge is a system with equality constraints, so its motion is an
ordinary differential equation and any engine can be held against the same solution.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.references import equilibrium
from benchmarks.scenes import Array, ParticleScene, bridge, bridge_mass

LOAD = 10.0
FIRST_BAY, LAST_BAY = 1.0, 4.0


def load_masses(stretches: int, *, z: float) -> Array:
    """Particle masses [kg], shape (stretches, 12), while a load crosses the deck at `z`.

    The load starts and stops smoothly; its place is held during each stretch of time, so that every
    step size divides into the same motion.
    """
    done = (np.arange(stretches) + 0.5) / stretches
    bays = FIRST_BAY + (LAST_BAY - FIRST_BAY) * done**2 * (3.0 - 2.0 * done)
    return np.stack([bridge_mass(x=float(x), z=z, load=LOAD) for x in bays])


def loaded_bridge(*, z: float) -> ParticleScene:
    """The bridge at rest under the load where it starts its way."""
    scene = bridge(mass=bridge_mass(x=FIRST_BAY, z=z, load=LOAD))
    return replace(scene, position=equilibrium(scene).position)


def taut_motion(
    scene: ParticleScene, masses: Array, stretch: float, *, tolerance: float = 1e-12
) -> tuple[Array, Array]:
    """Motion of a scene of which every rod and cable is taut, with masses that change in steps.

    J M^-1 J^T lambda = J (g - c v) + |rate|^2 gives the tensions per length lambda, with J the
    gradients of half the squared lengths; positions and velocities follow by DOP853.

    Args:
        scene: Start, links, gravity and damping; its masses are not read.
        masses: Particle masses [kg] during each stretch of time, shape (stretches, particles).
        stretch: Time between changes of mass [s].
        tolerance: Relative and absolute tolerance of the integration.

    Returns:
        Positions [m] and velocities [m/s] at the end of each stretch, each of shape (stretches,
        particles, 3).

    Raises:
        ArithmeticError: A cable goes slack, so the motion is another one.
    """
    count = len(scene.mass)
    incidence, anchor, length = scene.spans()
    rows = len(length)
    gravity, damping = np.asarray(scene.gravity), -np.log(scene.damping)

    def acceleration(position: Array, velocity: Array, mass: Array) -> tuple[Array, Array]:
        span, rate = incidence @ position - anchor, incidence @ velocity
        jacobian = (incidence[:, :, None] * span[:, None, :]).reshape(rows, 3 * count)
        weight = jacobian / np.repeat(mass, 3)
        free = (gravity - damping * velocity).ravel()
        wanted = jacobian @ free + (rate**2).sum(axis=1)
        density = np.linalg.solve(weight @ jacobian.T, wanted)
        return (free - weight.T @ density).reshape(count, 3), density

    state = np.stack([scene.position, scene.velocity])
    visited: list[Array] = []
    for mass in masses:

        def change(_: float, flat: Array, mass: Array = mass) -> Array:
            position, velocity = flat.reshape(2, count, 3)
            return np.stack([velocity, acceleration(position, velocity, mass)[0]]).ravel()

        solution = solve_ivp(
            change, (0.0, stretch), state.ravel(), method="DOP853", rtol=tolerance, atol=tolerance
        )
        state = solution.y[:, -1].reshape(2, count, 3)
        pull = acceleration(state[0], state[1], mass)[1][len(scene.rods) + len(scene.pins) :]
        if pull.size and pull.min() < 0.0:
            raise ArithmeticError(
                f"A cable goes slack {(len(visited) + 1) * stretch:.3g} s after the start: this "
                "solution holds for taut cables alone. Move the load more slowly."
            )
        visited.append(state)
    position, velocity = np.stack(visited, axis=1)
    return position, velocity
