"""Two particles collide head on: v' = v - (1 + e) m_r v_rel / m, at the time when they touch."""

from __future__ import annotations

from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.methods import single
from benchmarks.laboratory.peers import pymunk_space
from benchmarks.laboratory.problem import Measure, Motion, Peer, Problem, energy, trajectory
from benchmarks.scenes import Array

MASSES, SPEEDS, RADIUS, GAP, STRETCH = (1.0, 3.0), (2.0, -1.0), 0.1, 1.07, 0.1


def scene(
    *, restitution: float, masses: tuple[float, float] = MASSES, speed: float = SPEEDS[0]
) -> sy.Scene:
    """Two balls that approach along x."""
    made = sy.Scene(gravity=(0.0, 0.0, 0.0))
    for x, v, mass in zip((0.0, GAP + 2 * RADIUS), (speed, SPEEDS[1]), masses, strict=True):
        made.add(sy.Particle(position=(x, 0, 0), velocity=(v, 0, 0), mass=mass, radius=RADIUS))
    made.add(sy.Collisions(restitution=restitution))
    return made


def reference(restitution: float, times: Array) -> Motion:
    """The motion at the times [s]."""
    start = np.array([0.0, GAP + 2 * RADIUS])
    before = np.array(SPEEDS)
    mass = np.array(MASSES)
    touching = GAP / (before[0] - before[1])
    impulse = (1 + restitution) * (before[0] - before[1]) / (1 / mass).sum()
    after = before + np.array([-impulse, impulse]) / mass
    late = (times > touching)[:, None]
    position = start + before * np.minimum(times, touching)[:, None]
    position = position + after * np.maximum(times - touching, 0.0)[:, None]
    velocity = np.where(late, after, before)
    motion = np.zeros((2, len(times), 2, 3))
    motion[:, :, :, 0] = position, velocity
    return Motion(*motion)


def problems() -> tuple[Problem, ...]:
    """Restitution 0, .5 and 1."""
    return tuple(map(_problem, (0.0, 0.5, 1.0)))


def _problem(restitution: float) -> Problem:
    # The balls touch after .357 s, on no step of the ladder.
    looks = (2, 5, 8, 10)
    true = reference(restitution, STRETCH * np.array(looks))

    def of(position: Array, velocity: Array) -> Array:
        return np.asarray(0.5 * (velocity**2).sum(axis=2) @ np.array(MASSES))

    def momentum(motion: Motion) -> float:
        def total(velocity: Array) -> Array:
            return np.einsum("p,tpc->tc", np.array(MASSES), velocity)

        return float(np.abs(total(motion.velocity) - total(true.velocity)).max())

    build = partial(scene, restitution=restitution)
    return Problem(
        name=f"collision, e {restitution:g}",
        scene=build,
        stretch=STRETCH,
        looks=looks,
        measures=(
            trajectory(true),
            energy(true, of, scale=0.5 * float((np.array(SPEEDS) ** 2) @ np.array(MASSES))),
            Measure(name="momentum", unit="kg m/s", error=momentum),
        ),
        steps=(3, 6, 24, 96),
        peers=_pymunk(restitution),
        omitted=single("contact"),
        best="RATTLE, impacts inside, direct",
        wrong={
            "restitution .1 off": partial(scene, restitution=abs(restitution - 0.1)),
            "masses swapped": partial(build, masses=MASSES[::-1]),
            "a ball of another speed": partial(build, speed=0.9 * SPEEDS[0]),
        },
    )


def _pymunk(restitution: float) -> dict[str, Peer]:
    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        bodies = []
        for x, mass, speed in zip((0.0, GAP + 2 * RADIUS), MASSES, SPEEDS, strict=True):
            body = pymunk.Body(mass, 1.0)
            body.position, body.velocity = (x, 0.0), (speed, 0.0)
            ball = pymunk.Circle(body, RADIUS)
            ball.elasticity = restitution**0.5
            made.add(body, ball)
            bodies.append(body)
        return made, bodies

    return pymunk_space(space)
