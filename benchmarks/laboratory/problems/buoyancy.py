"""A float that bobs, never wholly under nor out of the water: harmonic, omega^2 = rho g A / m."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.peers import mujoco_document
from benchmarks.laboratory.problem import Motion, Problem, energy, trajectory
from benchmarks.scenes import Array

MASS, GRAVITY, DENSITY, HALF_DEPTH, VOLUME, SURFACE = 2.0, 9.81, 1000.0, 0.5, 0.004, 1.0
STRETCH, SPEED = 0.1, 0.6
STIFFNESS = DENSITY * GRAVITY * VOLUME / (2.0 * HALF_DEPTH)
#: Where the lift carries the weight: rho V (h + d - y) / (2 d) = m.
REST = SURFACE + HALF_DEPTH - 2.0 * HALF_DEPTH * MASS / (DENSITY * VOLUME)


def float_scene(
    *, gravity: float = GRAVITY, density: float = DENSITY, surface: float = SURFACE
) -> sy.Scene:
    """A float at its equilibrium, kicked upwards."""
    scene = sy.Scene(gravity=(0.0, -gravity, 0.0))
    body = scene.add(sy.Particle(position=(0, REST, 0), velocity=(0, SPEED, 0), mass=MASS))
    scene.add(
        sy.Buoyancy(
            body,
            surface=surface,
            half_depth=HALF_DEPTH,
            volume=VOLUME,
            density=density,
            gravity=GRAVITY,
        )
    )
    return scene


def reference(times: Array) -> Motion:
    """The closed form at the times [s]."""
    omega = math.sqrt(STIFFNESS / MASS)
    motion = np.zeros((2, len(times), 1, 3))
    motion[0, :, 0, 1] = REST + SPEED / omega * np.sin(omega * times)
    motion[1, :, 0, 1] = SPEED * np.cos(omega * times)
    return Motion(*motion)


def problems() -> tuple[Problem, ...]:
    """The float for 10 s."""
    looks = tuple(range(1, 101))
    true = reference(STRETCH * np.array(looks))

    def of(position: Array, velocity: Array) -> Array:
        away = position[:, 0] - [0.0, REST, 0.0]
        return np.asarray(
            0.5 * (MASS * velocity[:, 0] ** 2 + STIFFNESS * away**2 * [0, 1, 0]).sum(axis=1)
        )

    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}" gravity="0 0 0">
    <flag contact="disable"/></option><worldbody><body pos="0 {REST} 0">
    <joint type="slide" axis="0 1 0" stiffness="{STIFFNESS}"/><geom size=".01" mass="{MASS}"/>
    <site name="p"/></body></worldbody></mujoco>"""
    peers = mujoco_document(document, particles=["p"], velocity=np.array([SPEED]))
    return (
        Problem(
            name="buoyancy",
            scene=float_scene,
            stretch=STRETCH,
            looks=looks,
            measures=(trajectory(true), energy(true, of, scale=0.5 * MASS * SPEED**2)),
            steps=(3, 6, 12, 24, 48, 96, 192, 384, 768),
            peers={f"{name}, slide with a spring": peer for name, peer in peers.items()},
            peer_steps=(6, 24, 96),
            best="velocity Verlet",
            wrong={
                "gravity points up": partial(float_scene, gravity=-GRAVITY),
                "density 1 % off": partial(float_scene, density=1.01 * DENSITY),
                "surface 1 cm off": partial(float_scene, surface=SURFACE + 0.01),
                "lift of a body wholly under": partial(float_scene, surface=SURFACE + 10.0),
            },
        ),
    )
