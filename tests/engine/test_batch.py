"""Same bits for any number of worlds, any number of threads and any row, for every method.

A world's neighbours share registers, loops that run until the slowest is done, and the list of contacts that
are near in any of them. The scenes are chosen so that neighbours do different things at every step:
cables slacken and snap, feet land, slide and lift, and some worlds take many passes where others take one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

import steelyard as sy
from benchmarks.scenes import bridge, tumbling_platform
from tests.engine.builders import (
    COMPOSED,
    LINKED,
    METHODS,
    SMOOTH,
    STEPWISE,
    Array,
    from_particle_scene,
    method,
)

DT = 1 / 60
STEPS = 60
# More than two blocks of eight, with a rest.
KINDS = 19


def landing_bridge() -> sy.Scene:
    """Cables that snap, over ground on which the deck lands."""
    scene = from_particle_scene(bridge(), cable_restitution=0.3)
    scene.add(sy.Ground(height=2.6, restitution=0.2, friction=0.5))
    return scene


def falling_platform() -> sy.Scene:
    """Rods, some redundant, on ground with friction and restitution."""
    scene = from_particle_scene(replace(tumbling_platform(), gravity=(0.0, -9.81, 0.0)))
    scene.add(sy.Ground(restitution=0.3, friction=0.6))
    return scene


def ridden_platform() -> sy.Scene:
    """The same with a load on its deck."""
    scene = falling_platform()
    deck = scene.particles[2:6]
    place = np.mean([p.position for p in deck], axis=0)
    scene.add(sy.Rider(scene.add(sy.Particle(position=place, mass=10.0)), deck))
    return scene


def net() -> sy.Scene:
    """A row of particles that hang from cables of their own and hold each other by cables."""
    scene = sy.Scene()
    row = [
        scene.add(sy.Particle(position=(0.5 * k, 2.0, 0.0), mass=1.0 + k % 3, damping=0.9))
        for k in range(6)
    ]
    scene.add(sy.CableConstraint(row[0], (0.0, 2.5, 0.0), 0.6, restitution=0.5))
    for k, p in enumerate(row[1:], start=1):
        scene.add(sy.Cable(row[k - 1], p, 0.55, restitution=0.5))
        if k % 2:
            scene.add(sy.CableConstraint(p, (0.5 * k, 3.0, 0.2), 1.3, restitution=0.8))
    return scene


def swing() -> sy.Scene:
    """A rigid cluster with a load on its deck, from which rods hang, on a spring."""
    scene = from_particle_scene(replace(tumbling_platform(), gravity=(0.0, -9.81, 0.0)))
    deck = scene.particles[2:6]
    place = np.mean([p.position for p in deck], axis=0)
    scene.add(sy.Rider(scene.add(sy.Particle(position=place, mass=10.0)), deck))
    scene.add(sy.AnchoredSpring(deck[0], (0.0, 6.0, 0.0), 200.0, 2.0))
    last = scene.particles[0]
    for _ in range(3):
        below = np.add(last.position, (0.0, -0.5, 0.1))
        p = scene.add(sy.Particle(position=below, mass=1.0))
        scene.add(sy.Rod(last, p))
        last = p
    return scene


def cage() -> sy.Scene:
    """One particle among six cables of full restitution, of which it meets up to three at once."""
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0)))
    for axis in range(3):
        for side in (-1.0, 1.0):
            anchor = side * np.eye(3)[axis]
            scene.add(sy.CableConstraint(p, anchor, 1.05, restitution=1.0))
    return scene


def touching(a: Array, b: Array, _: Array) -> tuple[Array, Array]:
    """Contacts of spheres of radius .2 m."""
    apart = a - b
    distance = np.linalg.norm(apart, axis=-1)
    return apart / distance[..., None], 0.4 - distance


def wind(position: Array, velocity: Array, time: Array) -> Array:
    """A gust that grows along x, and a drag of its own."""
    gust = np.stack([np.sin(5.0 * time), 0.0 * time, np.cos(3.0 * time)], axis=-1)
    return gust[:, None] * (1.0 + position[..., :1]) - 0.1 * velocity


def balls() -> sy.Scene:
    """Spheres that touch each other, ground and a platform, in a force written by the user."""
    scene = sy.Scene()
    some = [
        scene.add(sy.Particle(position=(0.5 * k, 0.5 + 0.3 * k, 0.1 * k), radius=0.1, mass=1.0 + k))
        for k in range(4)
    ]
    pairs = [(a, b) for k, a in enumerate(some) for b in some[:k]]
    scene.add(sy.ContactGenerator(touching, pairs, restitution=0.5, friction=0.3))
    scene.add(sy.Ground(restitution=0.4, friction=0.4))
    ends = {"start": (-1.0, 0.3, 0.0), "end": (3.0, 0.6, 0.3)}
    scene.add(sy.LinePlatform(**ends, radius=0.05, restitution=0.3, friction=0.2))
    scene.add(sy.UserForce(wind))
    return scene


def springs() -> sy.Scene:
    """Every force, with ground below."""
    scene = sy.Scene()
    a, b, c = (scene.add(sy.Particle(position=(k, 0.4 * k, 0.0), damping=0.95)) for k in range(3))
    scene.add(sy.Spring(a, b, 200.0, 0.8))
    scene.add(sy.Bungee(b, c, 150.0, 1.0))
    scene.add(sy.AnchoredSpring(a, (0.0, 1.0, 0.0), 80.0, 0.5))
    scene.add(sy.AnchoredBungee(c, (2.0, 2.0, 0.0), 90.0, 0.9))
    scene.add(sy.Drag(linear=0.1, quadratic=0.05, wind=(1.0, 0.0, 0.5)))
    scene.add(sy.Buoyancy(b, surface=0.2, half_depth=0.3, volume=0.002))
    scene.add(sy.Gravity((0.5, 0.0, 0.0)))
    scene.add(sy.Ground(height=-0.2, restitution=0.5, friction=0.3))
    return scene


def mesh() -> sy.Scene:
    """Springs stiff and soft between particles, one of them fixed, in wind over water."""
    scene = sy.Scene()
    some = [
        scene.add(sy.Particle(position=(0.5 * (k % 3), 0.4 * (k // 3), 0.1 * k), damping=0.9))
        for k in range(8)
    ]
    some.append(scene.add(sy.Particle(position=(1.0, 0.8, 0.8), inverse_mass=0.0)))
    for k, a in enumerate(some):
        for b in some[k + 1 : k + 4]:
            scene.add(sy.Spring(a, b, 300.0 * (1.0 + k % 4), 0.4))
    scene.add(sy.Bungee(some[0], some[5], 150.0, 0.7))
    scene.add(sy.AnchoredSpring(some[0], (0.0, 1.0, 0.0), 80.0, 0.5))
    scene.add(sy.StiffSpring(some[2], (1.0, 0.0, 0.2), 1e3, 3.0))
    scene.add(sy.Drag(linear=0.1, quadratic=0.05, wind=(1.0, 0.0, 0.5)))
    scene.add(sy.Buoyancy(some[1], surface=0.2, half_depth=0.3, volume=0.002))
    return scene


def blown_mesh() -> sy.Scene:
    """The same in a force written by the user."""
    scene = mesh()
    scene.add(sy.UserForce(wind))
    return scene


def ridden_bridge() -> sy.Scene:
    """Cables under a load that moves, with springs and drag."""
    scene = sy.scenes.bridge(load=200.0, place=(2.0, 0.5))
    some = scene.particles
    scene.add(sy.Spring(some[0], some[11], 50.0, 8.0))
    scene.add(sy.AnchoredSpring(some[4], (0.0, 1.0, 0.0), 80.0, 0.5))
    scene.add(sy.Drag(linear=0.1, quadratic=0.05, wind=(1.0, 0.0, 0.5)))
    return scene


def tumbling() -> sy.Scene:
    """Rods, some redundant, in free fall."""
    return from_particle_scene(replace(tumbling_platform(), gravity=(0.0, -9.81, 0.0)))


SCENES: dict[str, Callable[[], sy.Scene]] = {
    "landing bridge": landing_bridge,
    "falling platform": falling_platform,
    "ridden platform": ridden_platform,
    "net": net,
    "cage": cage,
    "balls": balls,
    "springs": springs,
    "swing": swing,
    "mesh": mesh,
    "blown mesh": blown_mesh,
    "ridden bridge": ridden_bridge,
    "tumbling": tumbling,
}
FOR_LINKED = ("net", "cage", "mesh", "ridden bridge", "tumbling")
FORCES_ALONE = ("mesh", "blown mesh")
NO_IMPACTS = ("swing",)
PAIRS = [
    (scene, name)
    for scene in SCENES
    for name in METHODS
    if scene not in (*FORCES_ALONE, *NO_IMPACTS, "ridden bridge", "tumbling")
    if not (scene == "ridden platform" and name.endswith("WorstFirst"))
    if name in STEPWISE or scene not in ("balls", "springs")
]
PAIRS += [(scene, name) for scene in NO_IMPACTS for name in COMPOSED]
PAIRS += [
    (scene, name)
    for scene in FORCES_ALONE
    for name in SMOOTH
    if SMOOTH[name][0].evaluations or scene != "blown mesh"
]
PAIRS += [(scene, name) for scene in FOR_LINKED for name in LINKED]


def vary(world: sy.World, kinds: Sequence[int]) -> None:
    """Give world k of the batch the state and parameters of ``kinds[k]``."""
    count = len(world.scene.particles)
    draws = [np.random.default_rng([7, kind]) for kind in kinds]
    movable = np.isfinite(world.particles.mass)
    masses = np.array([rng.uniform(0.5, 3.0, count) for rng in draws])
    world.particles.mass = np.where(movable, masses, np.inf)
    world.particles.damping = np.array([rng.uniform(0.7, 1.0, count) for rng in draws])
    speed = np.array([rng.choice([0.3, 1.0, 2.0]) for rng in draws])
    kick = np.array([rng.standard_normal((count, 3)) for rng in draws])
    world.particles.velocity[:] += speed[:, None, None] * kick * movable[:, None]
    world.gravity = np.array([[0.0, rng.uniform(-12.0, -8.0), 0.0] for rng in draws])
    for ground in world.scene.of(sy.Ground):
        world[ground].friction = np.array([[rng.uniform(0.1, 0.8)] for rng in draws])
        world[ground].restitution = np.array([[rng.uniform(0.0, 0.9)] for rng in draws])
    for rider in world.scene.of(sy.Rider):
        rates = np.array([rng.uniform(-0.2, 0.2) for rng in draws])
        signs = np.resize([1.0, -1.0], len(rider.deck))
        world[rider].rates = rates[:, None] * signs


def build(scene: str, name: str, kinds: Sequence[int], *, threads: int = 1) -> sy.World:
    chosen = method(name, dt=DT)
    world = sy.World(SCENES[scene](), worlds=len(kinds), method=chosen, threads=threads)
    vary(world, kinds)
    return world


def bits(world: sy.World) -> Array:
    """The whole state, bit by bit: positions, velocities, multipliers, clocks, flags; (worlds, rows).

    Positions and velocities as they are; of the rest, multipliers of contacts that do not act may be zero
    with either sign, which nothing can tell.
    """
    particles = np.concatenate([world.particles.position, world.particles.velocity], axis=1)
    state = world.snapshot().state[:, : world.worlds].T + 0.0
    whole = np.concatenate([particles.reshape(world.worlds, -1), state], axis=1)
    return np.ascontiguousarray(whole).view(np.int64)


@pytest.mark.parametrize(("scene", "name"), PAIRS)
def test_a_row_is_the_world_alone(scene: str, name: str) -> None:
    batch = build(scene, name, range(KINDS))
    states = []
    for _ in range(STEPS):
        batch.step()
        states.append(bits(batch))
    for kind in range(KINDS):
        alone = build(scene, name, [kind])
        for step in range(STEPS):
            alone.step()
            np.testing.assert_array_equal(
                bits(alone)[0], states[step][kind], err_msg=f"world {kind} at step {step}"
            )
    # The comparison is worth nothing between worlds that do the same, or that have broken down.
    assert len({tuple(row) for row in states[-1].tolist()}) == KINDS
    assert np.isfinite(batch.particles.position).all()


@pytest.mark.parametrize(("scene", "name"), PAIRS)
def test_any_order_of_the_worlds(scene: str, name: str) -> None:
    order = np.random.default_rng(1).permutation(KINDS)
    plain = build(scene, name, range(KINDS))
    mixed = build(scene, name, order.tolist())
    for world in (plain, mixed):
        world.step(STEPS)
    np.testing.assert_array_equal(bits(mixed), bits(plain)[order])


@pytest.mark.parametrize(("scene", "name"), PAIRS)
def test_steps_in_one_call_or_in_many(scene: str, name: str) -> None:
    # Within a call factors and contact frames are carried from step to step; between calls not.
    together, apart = (build(scene, name, range(KINDS)) for _ in range(2))
    together.step(STEPS)
    for _ in range(STEPS):
        apart.step()
    np.testing.assert_array_equal(bits(together), bits(apart))


@pytest.mark.parametrize(
    ("scene", "name"),
    [pair for pair in PAIRS if pair[0] in ("landing bridge", "balls") and pair[1] in METHODS],
)
@pytest.mark.parametrize("threads", [2, 3, 8])
def test_any_number_of_threads(scene: str, name: str, threads: int) -> None:
    one = build(scene, name, range(33))
    many = build(scene, name, range(33), threads=threads)
    for world in (one, many):
        world.step(20)
    np.testing.assert_array_equal(bits(many), bits(one))


@pytest.mark.parametrize(
    ("scene", "name", "worlds"),
    [
        pytest.param(scene, name, worlds, marks=[pytest.mark.slow] * (dear and worlds >= 1000))
        for scene, name, dear in (
            ("ridden platform", "Rattle-Direct", False),
            ("net", "SymplecticEuler-Direct", False),
            ("falling platform", "Rattle-GaussSeidel", False),
            ("landing bridge", "ExplicitEuler-WorstFirst", False),
            ("ridden platform", "SymplecticEuler-Xpbd", False),
            ("landing bridge", "ImpactRattle-Direct", True),
        )
        for worlds in (1, 7, 8, 9, 64, 1000, 4097)
    ],
)
def test_any_number_of_worlds_and_any_row(scene: str, name: str, worlds: int) -> None:
    # World k of the batch is of kind k modulo 19, so each kind comes by every lane.
    kinds = np.arange(worlds) % KINDS
    base = build(scene, name, range(KINDS))
    world = build(scene, name, kinds.tolist(), threads=1 + worlds % 3)
    for each in (base, world):
        each.step(STEPS)
    np.testing.assert_array_equal(bits(world), bits(base)[kinds])


@pytest.mark.parametrize("name", METHODS)
def test_resetting_some_worlds_leaves_the_others(name: str) -> None:
    scene = "cage"
    touched, left = (build(scene, name, range(KINDS)) for _ in range(2))
    mask = np.arange(KINDS) % 3 == 0
    for world in (touched, left):
        world.step(20)
    touched.reset(mask)
    for world in (touched, left):
        world.step(20)
    np.testing.assert_array_equal(bits(touched)[~mask], bits(left)[~mask])
    assert (bits(touched)[mask] != bits(left)[mask]).any(axis=1).all()


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_a_broken_world_leaves_the_others(name: str, bad: float) -> None:
    scene = "landing bridge"
    broken, sound = (build(scene, name, range(KINDS)) for _ in range(2))
    broken.particles.position[3, 0] = bad
    broken.particles.velocity[12, 5] = bad
    for world in (broken, sound):
        world.step(5)
        world.step(5)
    others = ~np.isin(np.arange(KINDS), [3, 12])
    np.testing.assert_array_equal(bits(broken)[others], bits(sound)[others])
    if not np.isfinite(bad):
        np.testing.assert_array_equal(broken.health[[3, 12]] & 1, 1)
