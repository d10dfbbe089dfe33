"""A shot at 40 m/s and 45 degrees: parabola, linear drag, quadratic drag; where it comes down.

Parabola and linear drag are closed forms, the impact under linear drag by Lambert's W; quadratic drag is an
ODE solved near the limit of double precision. The impact of a method is where the cubic through the two
frames around it, with their velocities, meets the ground.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

import steelyard as sy
from benchmarks.engine_scenes import build
from benchmarks.laboratory.peers import mujoco_document, mujoco_particles, pymunk_space
from benchmarks.laboratory.problem import (
    Measure,
    Motion,
    Peer,
    Problem,
    energy,
    particle_energy,
    trajectory,
)
from benchmarks.references import RIGID_TOLERANCE, projectile, projectile_impact
from benchmarks.scenes import Array, ParticleScene

STRETCH = 1.0 / 60.0
SPEED = 40.0 / math.sqrt(2.0)
MASS = 2.0
LINEAR, QUADRATIC = 0.99, 0.01


def scene(*, damping: float = 1.0, gravity: float = 9.81, speed: float = SPEED) -> ParticleScene:
    """A particle shot from the origin."""
    return ParticleScene(
        position=np.zeros((1, 3)),
        velocity=np.array([[speed, speed, 0.0]]),
        mass=np.array([MASS]),
        gravity=(0.0, -gravity, 0.0),
        damping=damping,
    )


def dragged(quadratic: float) -> sy.Scene:
    """The same through air; ``quadratic`` [1/m] is the drag per mass and squared speed."""
    built = build(scene())
    built.add(sy.Drag(quadratic=quadratic * MASS))
    return built


def quadratic_drag(times: Array, quadratic: float = QUADRATIC) -> Motion:
    """v' = g - k |v| v at the times [s], by DOP853."""

    def rate(_: float, state: Array) -> Array:
        vx, vy = state[2:]
        drag = quadratic * math.hypot(vx, vy)
        return np.array([vx, vy, -drag * vx, -9.81 - drag * vy])

    solution = solve_ivp(
        rate,
        (0.0, float(times[-1])),
        [0.0, 0.0, SPEED, SPEED],
        method="DOP853",
        t_eval=times,
        rtol=RIGID_TOLERANCE,
        atol=RIGID_TOLERANCE,
        max_step=0.01,
    )
    motion = np.zeros((2, len(times), 1, 3))
    motion[:, :, 0, :2] = solution.y.T.reshape(-1, 2, 2).transpose(1, 0, 2)
    return Motion(*motion)


@cache
def quadratic_impact(quadratic: float = QUADRATIC) -> tuple[float, float]:
    """Time [s] and place [m] of the impact, by Newton's method on the solution."""
    time = 4.5
    for _ in range(6):
        end = quadratic_drag(np.array([time]), quadratic)
        time -= float(end.position[0, 0, 1] / end.velocity[0, 0, 1])
    return time, float(quadratic_drag(np.array([time]), quadratic).position[0, 0, 0])


def impact(place: float) -> Measure:
    """How far from the true place the shot comes down, between the last two looks."""

    def error(motion: Motion) -> float:
        (x0, y0), (x1, y1) = motion.position[-2:, 0, :2]
        (u0, v0), (u1, v1) = motion.velocity[-2:, 0, :2]
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            if _cubic(middle, y0, y1, v0, v1) > 0.0:
                low = middle
            else:
                high = middle
        return float(abs(_cubic(low, x0, x1, u0, u1) - place))

    return Measure(name="impact", unit="m", error=error)


def _cubic(s: float, a: float, b: float, rate_a: float, rate_b: float) -> float:
    """Hermite's cubic over a frame at the share ``s`` of it."""
    t = 1.0 - s
    ends = a * t * t * (1.0 + 2.0 * s) + b * s * s * (1.0 + 2.0 * t)
    return ends + STRETCH * s * t * (rate_a * t - rate_b * s)


def _looks(time: float) -> tuple[int, ...]:
    """Every half second, and the frames around the impact."""
    last = int(time / STRETCH)
    return (*range(30, last, 30), last, last + 1)


def problems() -> tuple[Problem, ...]:
    """Parabola, linear and quadratic drag."""
    flat = 2.0 * SPEED / 9.81
    damped, _ = projectile_impact(
        (0, 0, 0), (SPEED, SPEED, 0), acceleration=(0, -9.81, 0), damping=LINEAR
    )
    landing = projectile(
        (0, 0, 0), (SPEED, SPEED, 0), acceleration=(0, -9.81, 0), damping=LINEAR, time=damped
    )[0][0]
    braked, end = quadratic_impact()
    return (
        _free("projectile, parabola", 1.0, flat, SPEED * flat),
        _free("projectile, linear drag", LINEAR, damped, float(landing)),
        Problem(
            name="projectile, quadratic drag",
            scene=lambda: dragged(QUADRATIC),
            stretch=STRETCH,
            looks=_looks(braked),
            measures=(
                trajectory(quadratic_drag(STRETCH * np.array(_looks(braked)))),
                impact(end),
            ),
            steps=(1, 2, 4, 8, 16, 48),
            peers={**_through_fluid(QUADRATIC), **_pymunk(QUADRATIC, 1.0)},
            best="velocity Verlet",
            wrong={
                "drag left out": lambda: dragged(0.0),
                "drag 1 % off": lambda: dragged(1.01 * QUADRATIC),
                "drag squared once more": lambda: dragged(QUADRATIC * 40.0),
            },
        ),
    )


def _free(name: str, damping: float, time: float, place: float) -> Problem:
    looks = _looks(time)
    states = [
        projectile(
            (0, 0, 0),
            (SPEED, SPEED, 0),
            acceleration=(0, -9.81, 0),
            damping=damping,
            time=STRETCH * look,
        )
        for look in looks
    ]
    position, velocity = (np.array(part)[:, None] for part in zip(*states, strict=True))
    true = Motion(position, velocity)
    described = scene(damping=damping)
    return Problem(
        name=name,
        scene=lambda: build(described),
        stretch=STRETCH,
        looks=looks,
        measures=(
            trajectory(true),
            energy(true, particle_energy(described), scale=MASS * SPEED**2),
            impact(place),
        ),
        steps=(1, 2, 4, 8, 16),
        peers={**mujoco_particles(described), **_pymunk(0.0, damping)},
        best="closed form",
        wrong={
            "gravity points up": lambda: build(scene(damping=damping, gravity=-9.81)),
            "gravity .1 % off": lambda: build(scene(damping=damping, gravity=9.82)),
            "damping .1 % off": lambda: build(scene(damping=0.999 * damping)),
            "positions move first": lambda: build(
                replace(described, velocity=np.array([[SPEED, SPEED + 9.81 / 120, 0.0]]))
            ),
        },
    )


def _through_fluid(quadratic: float) -> dict[str, Peer]:
    """MuJoCo's blunt drag of a ball in a fluid, whose force is density C pi r^2 v^2."""
    radius, blunt = 1e-3, 0.5
    density = quadratic * MASS / (blunt * math.pi * radius**2)
    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}"
    gravity="0 -9.81 0" density="{density!r}"><flag contact="disable"/></option><worldbody><body>
    <freejoint/><geom type="sphere" size="{radius}" mass="{MASS}" fluidshape="ellipsoid"
    fluidcoef="{blunt} 0 0 0 0"/><site name="p"/></body></worldbody></mujoco>"""
    speed = np.array([SPEED, SPEED, 0.0, 0.0, 0.0, 0.0])
    return mujoco_document(document, particles=["p"], velocity=speed)


def _pymunk(quadratic: float, damping: float) -> dict[str, Peer]:
    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        made.gravity, made.damping = (0.0, -9.81), damping
        body = pymunk.Body(MASS, 1.0)
        body.velocity = (SPEED, SPEED)

        def brake(body: pymunk.Body, gravity: tuple, damping: float, dt: float) -> None:
            pymunk.Body.update_velocity(body, gravity, damping, dt)
            velocity = body.velocity
            body.velocity = velocity / (1.0 + quadratic * velocity.length * dt)

        if quadratic > 0.0:
            body.velocity_func = brake
        made.add(body)
        return made, [body]

    return pymunk_space(space)
