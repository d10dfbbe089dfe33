"""What the triple pendulum and the heavy-ended chains share: measures and peers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.engine_scenes import build
from benchmarks.laboratory.peers import mujoco_document, mujoco_particles, pymunk_space
from benchmarks.laboratory.pendulums import CHAINS, GRAVITY, Pendulums, scene, stored
from benchmarks.laboratory.problem import (
    Peer,
    Problem,
    energy,
    links,
    particle_energy,
    trajectory,
)


def chain_problem(name: str, data: str, *, steps: tuple[int, ...], peer_steps: tuple[int, ...]) -> Problem:  # fmt: skip
    """The problem of a chain whose motion is stored."""
    chain = CHAINS[data]
    described, true = scene(chain), stored(data)
    total = sum(chain.mass) * GRAVITY * chain.length * len(chain.mass)
    heavier = np.array(chain.mass)
    heavier[0] *= 1.1
    tight = mujoco_particles(described, links=("tight",))
    return Problem(
        name=name,
        scene=lambda: build(described),
        stretch=chain.times[0],
        looks=tuple(range(1, len(chain.times) + 1)),
        measures=(
            trajectory(true),
            energy(true, particle_energy(described), scale=total),
            links(described),
        ),
        steps=steps,
        peers={**hinges(chain), "MuJoCo Euler, tight links": tight["MuJoCo Euler, tight links"],
               **pins(chain)},
        peer_steps=peer_steps,
        best="RATTLE, direct",
        wrong={
            "gravity points up": lambda: build(scene(chain, gravity=-GRAVITY)),
            "gravity 1 % off": lambda: build(scene(chain, gravity=0.99 * GRAVITY)),
            "a rod 1 % long": lambda: build(
                replace(described, pins=((0, (0.0, 0.0, 0.0), 1.01 * chain.length),))
            ),
            "a rod missing": lambda: build(replace(described, rods=described.rods[:-1])),
        },
    )  # fmt: skip


def hinges(chain: Pendulums) -> dict[str, Peer]:
    """MuJoCo in minimal coordinates: a hinge per rod."""
    inner = ""
    for k in reversed(range(len(chain.mass))):
        place = "0 0 0" if k == 0 else f"0 {-chain.length!r} 0"
        inner = f"""<body pos="{place}"><joint type="hinge" axis="0 0 1"/>
        <inertial pos="0 {-chain.length!r} 0" mass="{chain.mass[k]!r}"
         diaginertia="1e-12 1e-12 1e-12"/><site name="p{k}" pos="0 {-chain.length!r} 0"/>
        {inner}</body>"""
    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}"
    gravity="0 {-GRAVITY} 0"><flag contact="disable"/></option><worldbody>{inner}</worldbody>
    </mujoco>"""
    names = [f"p{k}" for k in range(len(chain.mass))]
    start = np.zeros(len(chain.mass))
    start[0] = chain.angle
    peers = mujoco_document(document, particles=names, position=start)
    return {f"{name}, hinges": peer for name, peer in peers.items()}


def pins(chain: Pendulums) -> dict[str, Peer]:
    """pymunk with a pin joint per rod."""
    described = scene(chain)

    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        made.gravity = (0.0, -GRAVITY)
        bodies = []
        last = made.static_body
        for place, mass in zip(described.position, chain.mass, strict=True):
            body = pymunk.Body(mass, 1.0)
            body.position = (float(place[0]), float(place[1]))
            made.add(body, pymunk.PinJoint(last, body))
            bodies.append(body)
            last = body
        return made, bodies

    return pymunk_space(space)
