"""A pendulum let go at 90 degrees, 10 s: rod error, energy, phase. Reference: Jacobi's elliptic functions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.engine_scenes import build
from benchmarks.laboratory.methods import single
from benchmarks.laboratory.peers import mujoco_document, mujoco_particles, pymunk_space
from benchmarks.laboratory.problem import (
    Motion,
    Problem,
    energy,
    links,
    particle_energy,
    trajectory,
)
from benchmarks.references import pendulum as solution
from benchmarks.scenes import Array, ParticleScene

LENGTH, MASS, STRETCH = 1.0, 1.0, 0.1


def scene(*, gravity: float = 9.81, length: float = LENGTH) -> ParticleScene:
    """A particle on a rod, level with its anchor at the origin."""
    return ParticleScene(
        position=np.array([[length, 0.0, 0.0]]),
        velocity=np.zeros((1, 3)),
        mass=np.array([MASS]),
        pins=((0, (0.0, 0.0, 0.0), length),),
        gravity=(0.0, -gravity, 0.0),
    )


def reference(times: Array) -> Motion:
    """The closed form at the times [s]."""
    angle, rate = solution(times, length=LENGTH)
    zero = np.zeros_like(angle)
    position = LENGTH * np.stack([np.sin(angle), -np.cos(angle), zero], axis=1)
    velocity = (LENGTH * rate)[:, None] * np.stack([np.cos(angle), np.sin(angle), zero], axis=1)
    return Motion(position[:, None], velocity[:, None])


def problems() -> tuple[Problem, ...]:
    """The pendulum for 10 s."""
    looks = tuple(range(1, 101))
    true = reference(STRETCH * np.array(looks))
    described = scene()
    weight = MASS * 9.81 * LENGTH
    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}"
    gravity="0 -9.81 0"><flag contact="disable"/></option><worldbody><body>
    <joint type="hinge" axis="0 0 1"/>
    <inertial pos="{LENGTH} 0 0" mass="{MASS}" diaginertia="1e-12 1e-12 1e-12"/>
    <site name="p" pos="{LENGTH} 0 0"/></body></worldbody></mujoco>"""

    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        made.gravity = (0.0, -9.81)
        body = pymunk.Body(MASS, 1.0)
        body.position = (LENGTH, 0.0)
        made.add(body, pymunk.PinJoint(made.static_body, body))
        return made, [body]

    hinge = mujoco_document(document, particles=["p"])
    return (
        Problem(
            name="pendulum",
            scene=lambda: build(described),
            stretch=STRETCH,
            looks=looks,
            measures=(
                trajectory(true),
                energy(true, particle_energy(described), scale=weight),
                links(described),
            ),
            steps=(3, 6, 12, 24, 48, 96, 192, 384, 1024),
            peers={
                **{f"{name}, hinge": peer for name, peer in hinge.items()},
                **{
                    name: peer
                    for name, peer in mujoco_particles(described).items()
                    if name.endswith("Euler, tight links") or name.endswith("RK4, default links")
                },
                **pymunk_space(space),
            },
            peer_steps=(3, 6, 12, 24, 48, 96),
            omitted=single("link"),
            best="RATTLE, direct",
            wrong={
                "gravity points up": lambda: build(scene(gravity=-9.81)),
                "gravity 1 % off": lambda: build(scene(gravity=0.99 * 9.81)),
                "rod 1 mm long": lambda: build(
                    replace(described, pins=((0, (0.0, 0.0, 0.0), LENGTH + 1e-3),))
                ),
                "no rod": lambda: build(replace(described, pins=())),
            },
        ),
    )
