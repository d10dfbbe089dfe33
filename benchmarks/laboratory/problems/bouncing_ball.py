"""A ball dropped on the ground, restitution .5, .8 and 1: peaks e^(2k) h, at rest after sqrt(2h/g)(1+e)/(1-e)."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.methods import single
from benchmarks.laboratory.peers import mujoco_document, pymunk_space
from benchmarks.laboratory.problem import Motion, Peer, Problem, energy, trajectory
from benchmarks.scenes import Array

HEIGHT, MASS, GRAVITY, STRETCH, DURATION = 1.0, 1.0, 9.81, 0.1, 4.0


def scene(*, restitution: float, gravity: float = GRAVITY, height: float = HEIGHT) -> sy.Scene:
    """A particle above the ground."""
    made = sy.Scene(gravity=(0.0, -gravity, 0.0))
    made.add(sy.Particle(position=(0, height, 0), mass=MASS))
    made.add(sy.Ground(restitution=restitution))
    return made


def reference(restitution: float, times: Array) -> Motion:
    """The motion at the times [s]: parabolas between the impacts, then rest."""
    motion = np.zeros((2, len(times), 1, 3))
    fall = math.sqrt(2.0 * HEIGHT / GRAVITY)
    for k, time in enumerate(times):
        if time < fall:
            motion[:, k, 0, 1] = HEIGHT - 0.5 * GRAVITY * time**2, -GRAVITY * time
            continue
        left, speed = float(time) - fall, restitution * GRAVITY * fall
        while speed > 1e-12 and left >= 2.0 * speed / GRAVITY:
            left -= 2.0 * speed / GRAVITY
            speed *= restitution
        if speed > 1e-12:
            motion[:, k, 0, 1] = speed * left - 0.5 * GRAVITY * left**2, speed - GRAVITY * left
    return Motion(*motion)


def problems() -> tuple[Problem, ...]:
    """Restitution .5, .8 and 1."""
    return tuple(map(_problem, (0.5, 0.8, 1.0)))


def _problem(restitution: float) -> Problem:
    looks = tuple(range(1, round(DURATION / STRETCH) + 1))
    true = reference(restitution, STRETCH * np.array(looks))

    def of(position: Array, velocity: Array) -> Array:
        height = MASS * GRAVITY * position[:, 0, 1]
        return np.asarray(0.5 * MASS * (velocity[:, 0] ** 2).sum(axis=1) + height)

    build = partial(scene, restitution=restitution)
    return Problem(
        name=f"bouncing ball, e {restitution:g}",
        scene=build,
        stretch=STRETCH,
        looks=looks,
        measures=(trajectory(true), energy(true, of, scale=MASS * GRAVITY * HEIGHT)),
        steps=(6, 12, 24, 48, 96, 192, 384),
        peers=_peers(restitution),
        peer_steps=(6, 24, 96, 384),
        omitted=single("contact"),
        best="RATTLE, impacts inside, direct",
        wrong={
            "gravity points up": partial(build, gravity=-GRAVITY),
            "restitution .1 off": partial(scene, restitution=restitution - 0.1),
            "never rebounds": partial(scene, restitution=0.0),
            "dropped from elsewhere": partial(build, height=1.1 * HEIGHT),
        },
    )


def _peers(restitution: float) -> dict[str, Peer]:
    # MuJoCo has no restitution: a contact is a spring whose damping ratio z gives
    # e = exp(-pi z / sqrt(1 - z^2)). A bounce is made to last ten steps.
    log = -math.log(restitution)
    # A damping of exactly zero would be read as MuJoCo's other way to state a contact.
    ratio = max(log / math.hypot(math.pi, log), 1e-9)
    radius = 0.01

    def document(dt: float, integrator: str) -> str:
        omega = math.pi / (10.0 * dt)
        return f"""<mujoco><option timestep="{dt}" integrator="{integrator}"
    gravity="0 {-GRAVITY} 0"/><worldbody>
    <geom type="plane" size="0 0 1" pos="0 {-radius} 0" zaxis="0 1 0"
     solref="{-(omega**2)!r} {-2.0 * ratio * omega!r}" solimp="1 1 .001" friction="0 0 0"/>
    <body pos="0 {HEIGHT} 0"><joint type="slide" axis="0 1 0"/>
    <geom size="{radius}" mass="{MASS}" solref="{-(omega**2)!r} {-2.0 * ratio * omega!r}"
     solimp="1 1 .001" friction="0 0 0"/><site name="p"/></body></worldbody></mujoco>"""

    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        made.gravity = (0.0, -GRAVITY)
        body = pymunk.Body(MASS, 1.0)
        body.position = (0.0, HEIGHT)
        ball = pymunk.Circle(body, radius)
        floor = pymunk.Segment(made.static_body, (-10, -1 - radius), (10, -1 - radius), 1.0)
        ball.elasticity = floor.elasticity = math.sqrt(restitution)
        made.add(body, ball, floor)
        return made, [body]

    return {**mujoco_document(document, particles=["p"]), **pymunk_space(space)}
