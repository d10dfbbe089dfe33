"""A bungee drop: free fall, then a spring that acts only when stretched; order is lost across the kink.

In closed form: parabola to the length l, harmonic motion about l + m g / k while taut, matched at the events;
without damping the fall repeats for ever.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.peers import mujoco_document
from benchmarks.laboratory.problem import Motion, Problem, energy, trajectory
from benchmarks.scenes import Array

MASS, LENGTH, STIFFNESS, GRAVITY, STRETCH = 70.0, 10.0, 200.0, 9.81, 0.1
#: Height below the anchor at the start [m]: a bungee of no length has no direction.
START = 1.0


def drop(
    *, gravity: float = GRAVITY, stiffness: float = STIFFNESS, length: float = LENGTH, kind: type = sy.AnchoredBungee
) -> sy.Scene:  # fmt: skip
    """A jumper under an anchor at the origin."""
    scene = sy.Scene(gravity=(0.0, -gravity, 0.0))
    jumper = scene.add(sy.Particle(position=(0, -START, 0), mass=MASS))
    scene.add(kind(jumper, (0, 0, 0), stiffness, length))
    return scene


def reference(times: Array) -> Motion:
    """The closed form at the times [s]."""
    omega, sag = math.sqrt(STIFFNESS / MASS), MASS * GRAVITY / STIFFNESS
    fall = math.sqrt(2.0 * (LENGTH - START) / GRAVITY)
    speed = GRAVITY * fall
    # Depth below l is sag + amplitude cos(omega t - phase), from speed downwards at depth 0.
    amplitude = math.hypot(sag, speed / omega)
    phase = math.pi - math.atan2(speed / omega, sag)
    taut = 2.0 * phase / omega
    motion = np.zeros((2, len(times), 1, 3))
    for k, time in enumerate(times):
        t = float(time) % (2.0 * fall + taut)
        if t < fall:
            depth, rate = START + 0.5 * GRAVITY * t * t, GRAVITY * t
        elif t < fall + taut:
            angle = omega * (t - fall) - phase
            depth = LENGTH + sag + amplitude * math.cos(angle)
            rate = -amplitude * omega * math.sin(angle)
        else:
            up = 2.0 * fall + taut - t
            depth, rate = START + 0.5 * GRAVITY * up * up, -GRAVITY * up
        motion[:, k, 0, 1] = -depth, -rate
    return Motion(*motion)


def problems() -> tuple[Problem, ...]:
    """The drop for 10 s: two falls."""
    looks = tuple(range(1, 101))
    true = reference(STRETCH * np.array(looks))

    def of(position: Array, velocity: Array) -> Array:
        stretch = np.maximum(np.linalg.norm(position[:, 0], axis=1) - LENGTH, 0.0)
        kinetic = 0.5 * MASS * (velocity[:, 0] ** 2).sum(axis=1)
        height = MASS * GRAVITY * position[:, 0, 1]
        return np.asarray(kinetic + height + 0.5 * STIFFNESS * stretch**2)

    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}"
    gravity="0 {-GRAVITY} 0"><flag contact="disable"/></option><worldbody><site name="anchor"/>
    <body pos="0 {-START} 0"><joint type="slide" axis="0 1 0"/><geom size=".01" mass="{MASS}"/>
    <site name="p"/></body></worldbody><tendon><spatial stiffness="{STIFFNESS}"
    springlength="0 {LENGTH}"><site site="anchor"/><site site="p"/></spatial></tendon></mujoco>"""
    return (
        Problem(
            name="bungee",
            scene=drop,
            stretch=STRETCH,
            looks=looks,
            measures=(trajectory(true), energy(true, of, scale=MASS * GRAVITY * LENGTH)),
            steps=(3, 6, 12, 24, 48, 96, 192, 384, 768),
            peers=mujoco_document(document, particles=["p"]),
            peer_steps=(6, 24, 96, 384),
            best="velocity Verlet",
            wrong={
                "gravity points up": partial(drop, gravity=-GRAVITY),
                "stiffness 1 % off": partial(drop, stiffness=1.01 * STIFFNESS),
                "pushes when short": partial(drop, kind=sy.AnchoredSpring),
                "length 1 cm off": partial(drop, length=LENGTH + 0.01),
            },
        ),
    )
