"""Bodies that touch: what slides, rolls, bounces, stands and passes blows on, all against closed forms.

- A block on an incline slides with g (sin a - mu cos a).
- A ball that is set down sliding loses mu g of its speed and gains spin until it rolls with 5/7 of it.
- A ball that falls rebounds with e of its speed, at times that follow from that.
- Stacks of ten boxes stand, one under a top a thousand times as heavy.
- Newton's cradle: the first ball swings as the pendulum whose angle is below 0, the last as if above.

MuJoCo and Drake, where it is installed, are not asked to bounce: neither knows restitution.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ellipj, ellipk

import steelyard as sy
from benchmarks.laboratory.peers import drake_bodies, mujoco_bodies, pymunk_bodies
from benchmarks.laboratory.problem import Motion, Peer, Problem, energy, trajectory
from benchmarks.scenes import Array

STRETCH, STEPS = 0.1, (3, 6, 12, 24)
GRAVITY = 9.81
SLOPE, FRICTION = math.radians(20), 0.2
RADIUS, SPEED = 0.5, 3.0
HEIGHT, REBOUND = 1.0, 0.8
BALL, STRING, SWING, BALLS = 0.05, 1.0, 0.3, 5


def sliding_block(*, friction: float = FRICTION, gravity: float = GRAVITY) -> sy.Scene:
    """A metre's cube on an incline, which is the ground of a tilted world."""
    scene = sy.Scene(gravity=(gravity * math.sin(SLOPE), -gravity * math.cos(SLOPE), 0.0))
    scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Ground(friction=friction))
    return scene


def rolling_ball(*, friction: float = FRICTION, shape: Any = None) -> sy.Scene:
    """A ball that is set down without spin."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    part = sy.Sphere(RADIUS) if shape is None else shape
    scene.add(sy.Body(position=(0, RADIUS, 0), velocity=(SPEED, 0, 0), parts=part))
    scene.add(sy.Ground(friction=friction))
    return scene


def bouncing_body(*, restitution: float = REBOUND, height: float = HEIGHT) -> sy.Scene:
    """A ball that falls."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    scene.add(sy.Body(position=(0, height + RADIUS, 0), parts=sy.Sphere(RADIUS)))
    scene.add(sy.Ground(restitution=restitution))
    return scene


def stack(
    top: float = 1.0, *, tall: float = 0.0, aside: float = 0.0, ground: float = 0.0
) -> sy.Scene:
    """Ten cubes of a metre, the last ``top`` times as dense; each taller, and shifted from that below, by so much."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    for i in range(10):
        density = 1000.0 * (top if i == 9 else 1.0)
        part = sy.Part(shape=sy.Box((0.5, 0.5 + 0.5 * tall, 0.5)), density=density)
        place = (aside * i, (0.5 + i) * (1.0 + tall) + ground, 0)
        scene.add(sy.Body(position=place, parts=part))
    scene.add(sy.Ground(friction=0.6, height=ground))
    scene.add(sy.Collisions(friction=0.6))
    return scene


def cradle(*, restitution: float = 1.0, string: float = STRING, swing: float = SWING) -> sy.Scene:
    """Five balls that touch, each on a string about a place of its own; the first is pulled aside."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    for i in range(BALLS):
        angle = -swing if i == 0 else 0.0
        scene.add(
            sy.Body(
                position=(2.0 * BALL * i, 0, 0),
                pivot=(0, string, 0),
                orientation=(math.cos(angle / 2), 0, 0, math.sin(angle / 2)),
                parts=sy.Sphere(BALL),
            )
        )
    scene.add(sy.Collisions(restitution=restitution, friction=0.0))
    return scene


def planar_motion(place: Array, velocity: Array, angle: Array, spin: Array) -> Motion:
    """Landmarks of bodies in the plane: places and velocities (looks, bodies, 3), angles and spins (looks, bodies)."""
    zero, one = np.zeros_like(angle), np.ones_like(angle)
    cosine, sine = np.cos(angle), np.sin(angle)
    arms = np.stack(
        [
            np.stack(axis, axis=-1)
            for axis in (
                (zero, zero, zero), (cosine, sine, zero), (-sine, cosine, zero), (zero, zero, one),
            )
        ],
        axis=2,
    )  # fmt: skip
    turning = np.zeros_like(arms)
    turning[..., 2] = spin[:, :, None]
    shape = (len(place), -1, 3)
    places = place[:, :, None] + arms
    speeds = velocity[:, :, None] + np.cross(turning, arms)
    return Motion(places.reshape(shape), speeds.reshape(shape))


def energy_of(scene: sy.Scene) -> Callable[[Array, Array], Array]:
    """Kinetic energy and that of gravity [J] of bodies at each look, from their landmarks."""
    mass = np.array([body.mass for body in scene.bodies])
    inertia = np.array([body.inertia for body in scene.bodies])
    arm = np.array([body.arm for body in scene.bodies])
    moving = np.array([body.pivot is None for body in scene.bodies], dtype=np.float64)

    def of(position: Array, velocity: Array) -> Array:
        place = position.reshape(len(position), -1, 4, 3)
        speed = velocity.reshape(len(position), -1, 4, 3)
        axes = place[:, :, 1:] - place[:, :, :1]
        spin = 0.5 * np.cross(axes, speed[:, :, 1:] - speed[:, :, :1]).sum(axis=2)
        own = np.einsum("tbkc,tbc->tbk", axes, spin)
        turning = 0.5 * np.einsum("tbi,bij,tbj->t", own, inertia, own)
        going = 0.5 * np.einsum("b,tbc,tbc->t", mass * moving, speed[:, :, 0], speed[:, :, 0])
        centre = place[:, :, 0] + np.einsum("tbkc,bk->tbc", axes, arm)
        return np.asarray(turning + going - np.einsum("b,c,tbc->t", mass, scene.gravity, centre))

    return of


def _alone(
    time: Array, x: Array, y: Array, vx: Array, vy: Array, angle: Any = 0.0, spin: Any = 0.0
) -> Motion:
    """Of one body."""
    zero = np.zeros_like(time)
    place = np.stack([x + zero, y + zero, zero], axis=-1)[:, None]
    velocity = np.stack([vx + zero, vy + zero, zero], axis=-1)[:, None]
    return planar_motion(place, velocity, (angle + zero)[:, None], (spin + zero)[:, None])


def sliding(time: Array) -> Motion:
    """The block."""
    rate = GRAVITY * (math.sin(SLOPE) - FRICTION * math.cos(SLOPE))
    return _alone(time, 0.5 * rate * time**2, np.array(0.5), rate * time, np.array(0.0))


def rolling(time: Array) -> Motion:
    """The ball: sliding up to 2 v/(7 mu g), rolling from then on."""
    loss = FRICTION * GRAVITY
    since = 2.0 * SPEED / (7.0 * loss)
    early, late = np.minimum(time, since), np.maximum(time - since, 0.0)
    final = 5.0 / 7.0 * SPEED
    x = SPEED * early - 0.5 * loss * early**2 + final * late
    spin = -2.5 * loss / RADIUS * early
    angle = -1.25 * loss / RADIUS * early**2 - final / RADIUS * late
    return _alone(time, x, np.array(RADIUS), SPEED - loss * early, np.array(0.0), angle, spin)


def bouncing(time: Array) -> Motion:
    """The ball, from impact to impact."""
    y, vy = np.empty_like(time), np.empty_like(time)
    for k, t in enumerate(time):
        speed, since = math.sqrt(2.0 * GRAVITY * HEIGHT), math.sqrt(2.0 * HEIGHT / GRAVITY)
        if t < since:
            y[k], vy[k] = HEIGHT - 0.5 * GRAVITY * t**2, -GRAVITY * t
            continue
        while True:
            speed *= REBOUND
            flight = 2.0 * speed / GRAVITY
            if t < since + flight:
                break
            since += flight
        y[k], vy[k] = (
            speed * (t - since) - 0.5 * GRAVITY * (t - since) ** 2,
            speed - GRAVITY * (t - since),
        )
    return _alone(time, np.array(0.0), RADIUS + y, np.array(0.0), vy)


def standing(time: Array) -> Motion:
    """The stacks."""
    place = np.zeros((len(time), 10, 3))
    place[:, :, 1] = 0.5 + np.arange(10)
    still = np.zeros((len(time), 10))
    return planar_motion(place, np.zeros_like(place), still, still)


def swinging(time: Array) -> Motion:
    """The cradle: a pendulum of moment 2/5 r^2 + l^2, whose swing either end has in turn."""
    rate = math.sqrt(GRAVITY * STRING / (0.4 * BALL**2 + STRING**2))
    k = math.sin(0.5 * SWING)
    # From rest at -SWING: the elliptic solution, begun a quarter of a period before its middle.
    sn, cn, _, _ = ellipj(rate * time - ellipk(k * k), k * k)
    angle, spin = 2.0 * np.arcsin(k * sn), 2.0 * k * rate * cn
    angles, spins = np.zeros((len(time), BALLS)), np.zeros((len(time), BALLS))
    for ball, ours in ((0, angle < 0.0), (BALLS - 1, angle > 0.0)):
        angles[ours, ball], spins[ours, ball] = angle[ours], spin[ours]
    # The frame of a body with a pivot stands at that.
    place = np.zeros((len(time), BALLS, 3))
    place[:, :, 0] = 2.0 * BALL * np.arange(BALLS)
    return planar_motion(place, np.zeros_like(place), angles, spins)


def problems() -> tuple[Problem, ...]:
    """All six."""

    def problem(
        name: str,
        scene: Any,
        motion: Any,
        last: int,
        scale: float,
        peers: Any,
        wrong: Any,
        *,
        every: int = 1,
        follows: float = 3e-4,
    ) -> Problem:
        looks = tuple(range(every, last + 1, every))
        true = motion(STRETCH * np.array(looks, dtype=np.float64))
        return Problem(
            name=name,
            scene=scene,
            stretch=STRETCH,
            looks=looks,
            measures=(trajectory(true), energy(true, energy_of(scene()), scale=scale)),
            steps=STEPS,
            peers=peers,
            best="bodies, proximal Newton",
            wrong=wrong,
            follows=follows,
        )

    def off(*top: float) -> dict[str, Any]:
        return {
            "boxes a millimetre too tall": partial(stack, *top, tall=1e-3),
            "a lean": partial(stack, *top, aside=1e-3),
            "ground a millimetre too low": partial(stack, *top, ground=-1e-3),
        }

    def others(scene: sy.Scene) -> dict[str, Peer]:
        return mujoco_bodies(scene) | drake_bodies(scene) | pymunk_bodies(scene)

    mass, ball = 1000.0, 1000.0 * 4.0 / 3.0 * math.pi * RADIUS**3
    small = 1000.0 * 4.0 / 3.0 * math.pi * BALL**3
    return (
        problem(
            "sliding block", sliding_block, sliding, 15, mass * GRAVITY,
            others(sliding_block()),
            {
                "friction 1 % off": partial(sliding_block, friction=1.01 * FRICTION),
                "gravity 1 % off": partial(sliding_block, gravity=1.01 * GRAVITY),
                "no friction": partial(sliding_block, friction=0.0),
            },
        ),
        problem(
            "rolling ball", rolling_ball, rolling, 15, 0.5 * ball * SPEED**2,
            others(rolling_ball()),
            {
                "friction 1 % off": partial(rolling_ball, friction=1.01 * FRICTION),
                "no friction": partial(rolling_ball, friction=0.0),
                "moment of a box": partial(rolling_ball, shape=sy.Box((RADIUS, RADIUS, RADIUS))),
            },
        ),
        problem(
            "bouncing body", bouncing_body, bouncing, 20, ball * GRAVITY * HEIGHT,
            pymunk_bodies(bouncing_body()),
            {
                "no rebound": partial(bouncing_body, restitution=0.0),
                "nothing lost": partial(bouncing_body, restitution=1.0),
                "twice the height": partial(bouncing_body, height=2.0 * HEIGHT),
            },
            follows=2e-2,
        ),
        problem(
            "stack of ten", stack, standing, 20, 10.0 * mass * GRAVITY,
            others(stack()),
            off(),
            every=10,
        ),
        problem(
            "stack, top 1000 x heavier", partial(stack, 1000.0), standing, 20, 1010.0 * mass * GRAVITY,
            others(stack(1000.0)),
            off(1000.0),
            every=10,
        ),
        problem(
            "Newton's cradle", cradle, swinging, 20, small * GRAVITY * STRING * (1.0 - math.cos(SWING)), {},
            {
                "no rebound": partial(cradle, restitution=0.0),
                "half the string": partial(cradle, string=0.5 * STRING),
                "half the swing": partial(cradle, swing=0.5 * SWING),
            },
            follows=1e-2,
        ),
    )  # fmt: skip
