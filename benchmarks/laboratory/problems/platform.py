"""The tumbling platform: six particles that fifteen rods make a free rigid body, 2 s.

The fairest test of rods: no symmetry, no force, and the exact motion is that of a rigid body (Euler's
equations near the limit of double precision).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.engine_scenes import build
from benchmarks.laboratory.peers import mujoco_document, mujoco_particles
from benchmarks.laboratory.problem import (
    Motion,
    Peer,
    Problem,
    energy,
    links,
    particle_energy,
    trajectory,
)
from benchmarks.references import rigid_motion
from benchmarks.scenes import Array, ParticleScene, tumbling_platform

STRETCH = 0.1


def problems() -> tuple[Problem, ...]:
    """The platform for 2 s."""
    looks = tuple(range(1, 21))
    scene = tumbling_platform()
    true = Motion(*rigid_motion(scene, STRETCH * np.array(looks)))
    kinetic = float(0.5 * scene.mass @ (scene.velocity**2).sum(axis=1))
    return (
        Problem(
            name="platform",
            scene=lambda: build(scene),
            stretch=STRETCH,
            looks=looks,
            measures=(
                trajectory(true),
                energy(true, particle_energy(scene), scale=kinetic),
                links(scene),
            ),
            steps=(2, 3, 6, 12, 24, 48, 96, 192, 512),
            peers={**free_body(scene), **mujoco_particles(scene)},
            peer_steps=(3, 6, 12, 24, 48, 96),
            forms={"one body": lambda: one_body(scene)},
            marks=partial(corners, scene),
            best="RATTLE, direct",
            wrong={
                "one mass 10 % off": lambda: build(
                    replace(scene, mass=scene.mass * [1, 1, 1.1, 1, 1, 1])
                ),
                "spins the other way": lambda: build(replace(scene, velocity=-scene.velocity)),
                "a rod missing at each corner": lambda: build(replace(scene, rods=scene.rods[3:])),
                "damped": lambda: build(replace(scene, damping=0.99)),
            },
        ),
    )


def rigid(scene: ParticleScene) -> tuple[float, Array, Array, Array, Array]:
    """The particles as one rigid body: mass, centre, arms from it, inertia about it and angular velocity."""
    total = float(scene.mass.sum())
    centre = scene.mass @ scene.position / total
    arm = scene.position - centre
    inertia = np.einsum("p,p,ij->ij", scene.mass, (arm**2).sum(axis=1), np.eye(3)) - np.einsum(
        "p,pi,pj->ij", scene.mass, arm, arm
    )
    spin = np.linalg.solve(inertia, scene.mass @ np.cross(arm, scene.velocity))
    return total, centre, arm, inertia, spin


def one_body(scene: ParticleScene) -> sy.Scene:
    """The rigid body in place of the rods."""
    total, centre, _, inertia, spin = rigid(scene)
    made = sy.Scene(gravity=scene.gravity)
    made.add(
        sy.Body(
            position=centre,
            mass=total,
            inertia=inertia,
            velocity=scene.mass @ scene.velocity / total,
            angular_velocity=spin,
        )
    )
    return made


def corners(scene: ParticleScene, world: sy.World) -> tuple[Array, Array]:
    """Where the particles are, which the one body does not have."""
    if not world.scene.bodies:
        return sy.landmarks(world)
    places, speeds = sy.landmarks(world)
    # The origin and the ends of the unit axes, and so every point of the body.
    arm = np.concatenate([np.zeros((len(scene.mass), 1)), rigid(scene)[2]], axis=1)
    arm[:, 0] = 1.0 - arm.sum(axis=1)
    return arm @ places, arm @ speeds


def free_body(scene: ParticleScene) -> dict[str, Peer]:
    """MuJoCo's one rigid body in place of the rods."""
    total, centre, arm, inertia, spin = rigid(scene)
    entries = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    sites = "".join(
        f'<site name="p{p}" pos="{" ".join(map(repr, place.tolist()))}"/>'
        for p, place in enumerate(arm)
    )
    document = f"""<mujoco><compiler balanceinertia="false"/><option timestep="{{dt}}"
    integrator="{{integrator}}" gravity="0 0 0"><flag contact="disable"/></option><worldbody>
    <body pos="{" ".join(map(repr, centre.tolist()))}"><freejoint/>
    <inertial pos="0 0 0" mass="{total!r}"
     fullinertia="{" ".join(repr(float(x)) for x in entries)}"/>{sites}</body>
    </worldbody></mujoco>"""
    names = [f"p{p}" for p in range(len(arm))]
    # The angular velocity of a free joint is that in the body, which starts unturned.
    start = np.concatenate([scene.mass @ scene.velocity / total, spin])
    peers = mujoco_document(document, particles=names, velocity=start)
    return {f"{name}, free body": peer for name, peer in peers.items()}
