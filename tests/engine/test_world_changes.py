"""Forces, links and particles added and removed between steps, with the state kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from tests.engine.full_scene import (
    METHODS,
    assert_same_bits,
    control,
    every_method,
    full_scene,
    state,
)
from tests.engine.refusals import no_contact, no_force

ADDED: dict[str, Callable[[dict[str, Any]], Any]] = {
    "Gravity": lambda t: sy.Gravity((1, 0, 0)),
    "Drag": lambda t: sy.Drag(linear=0.2, particles=[t["p1"]]),
    "Spring": lambda t: sy.Spring(t["p0"], t["p3"], 5.0, 1.0),
    "Bungee": lambda t: sy.Bungee(t["p2"], t["p4"], 5.0, 1.0),
    "AnchoredSpring": lambda t: sy.AnchoredSpring(t["p2"], (0, 0, 0), 5.0, 1.0),
    "Buoyancy": lambda t: sy.Buoyancy(t["p2"], 0.0, 0.5, 1e-4),
    "UserForce": lambda t: sy.UserForce(no_force),
    "Cable": lambda t: sy.Cable(t["p1"], t["p4"], 9.0),
    "CableConstraint": lambda t: sy.CableConstraint(t["p2"], (0, 0, 0), 9.0),
    "Ground": lambda t: sy.Ground(height=-5.0, particles=[t["p0"]]),
    "LinePlatform": lambda t: sy.LinePlatform(
        start=(0, -9, 0), end=(1, -9, 0), radius=0.1, particles=[t["p0"]]
    ),
    "ContactGenerator": lambda t: sy.ContactGenerator(no_contact, [(t["p0"], None)]),
    "Particle": lambda t: sy.Particle(position=(7, 7, 7), velocity=(1, 2, 3)),
}


def running(method: sy.Method) -> tuple[sy.World, dict[str, Any]]:
    scene, things = full_scene(method)
    world = sy.World(scene, worlds=10, method=method)
    control(world, things)
    world.step(20)
    return world, things


def rows(world: sy.World, particles: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Copies of the positions and velocities of some particles."""
    order = {id(p): k for k, p in enumerate(world.scene.particles)}
    chosen = [order[id(p)] for p in particles]
    return (
        world.particles.position[:, chosen].copy(),
        world.particles.velocity[:, chosen].copy(),
    )


@every_method
@pytest.mark.parametrize("kind", ADDED)
def test_adding_and_removing_keeps_the_state(kind: str, method: sy.Method) -> None:
    world, things = running(method)
    before = state(world, things)
    count = len(world.scene.particles)
    thing = world.add(ADDED[kind](things))
    after = state(world, things)
    for name, value in before.items():
        kept = after[name][:, :count] if name in ("position", "velocity") else after[name]
        np.testing.assert_array_equal(kept, value, err_msg=name)
    if kind == "Particle":
        position, velocity = rows(world, [thing])
        np.testing.assert_array_equal(position[:, 0], np.broadcast_to((7, 7, 7), (10, 3)))
        np.testing.assert_array_equal(velocity[:, 0], np.broadcast_to((1, 2, 3), (10, 3)))
    world.remove(thing)
    assert_same_bits(state(world, things), before)
    with pytest.raises(KeyError):
        world[thing]


@every_method
def test_a_world_that_gained_and_lost_things_goes_on_as_if_nothing_had_been(
    method: sy.Method,
) -> None:
    world, things = running(method)
    twin, same = running(method)
    added = [world.add(ADDED[kind](things)) for kind in ADDED]
    for thing in reversed(added):
        world.remove(thing)
    world.step(20)
    twin.step(20)
    assert_same_bits(state(world, things), state(twin, same))


@every_method
def test_what_was_added_acts_as_if_it_had_been_there(method: sy.Method) -> None:
    """A world with the thing from the start, put into the same state, moves the same way."""

    def build(*, early: bool) -> sy.World:
        scene = sy.Scene()
        a = scene.add(sy.Particle(position=(0, 1, 0), velocity=(1, 0, 0), damping=0.9))
        b = scene.add(sy.Particle(position=(1, 1, 0), mass=2.0))
        things = [
            sy.AnchoredSpring(a, (0, 3, 0), 20.0, 1.0),
            sy.Drag(linear=0.3, quadratic=0.1),
            sy.Rod(a, b, 1.0),
            sy.Ground(height=-1.0, restitution=0.5, friction=0.2),
        ]
        for thing in things if early else []:
            scene.add(thing)
        world = sy.World(scene, worlds=2, method=method)
        for thing in [] if early else things:
            world.add(thing)
        world.particles.position[1, :, 1] += 0.5
        return world

    early, late = build(early=True), build(early=False)
    early.step(40)
    late.step(40)
    np.testing.assert_array_equal(early.particles.position, late.particles.position)
    np.testing.assert_array_equal(early.particles.velocity, late.particles.velocity)


@every_method
@pytest.mark.parametrize("name", ["rod", "cable", "ground", "spring", "drag", "stiff spring"])
def test_removing_a_thing_keeps_the_rest(name: str, method: sy.Method) -> None:
    world, things = running(method)
    before = state(world, things)
    world.remove(things.pop(name))
    left = state(world, things)
    for key, value in left.items():
        np.testing.assert_array_equal(value, before[key], err_msg=key)
    world.step(5)
    assert not (world.health & 1).any()


@every_method
def test_removing_a_particle_keeps_the_others(method: sy.Method) -> None:
    world, things = running(method)
    others = [p for p in world.scene.particles if p is not things["p2"]]
    position, velocity = rows(world, others)
    mass = world.particles.mass.copy()
    gone = next(k for k, p in enumerate(world.scene.particles) if p is things["p2"])
    world.remove(things.pop("cable"))
    world.remove(things.pop("ground"))
    world.remove(things["p2"])
    assert world.particles.position.shape == (10, len(others), 3)
    found = rows(world, others)
    np.testing.assert_array_equal(found[0], position)
    np.testing.assert_array_equal(found[1], velocity)
    np.testing.assert_array_equal(world.particles.mass, np.delete(mass, gone))
    world.step(10)
    assert not (world.health & 1).any()


def test_a_particle_that_was_added_falls_like_one_of_the_scene() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, 2, 3)))
    world = sy.World(scene, worlds=3)
    world.step(10)
    world.add(sy.Particle(position=(5, 6, 7), velocity=(1, 0, 0), damping=0.5, mass=3.0))
    world.add(sy.Particle(position=(1, 1, 1), acceleration=(0, 0, 1)))
    np.testing.assert_array_equal(world.particles.mass, [1.0, 3.0, 1.0])
    np.testing.assert_array_equal(world.particles.damping, [1.0, 0.5, 1.0])
    world.step(60)
    fresh = sy.Scene()
    fresh.add(sy.Particle(position=(5, 6, 7), velocity=(1, 0, 0), damping=0.5, mass=3.0))
    fresh.add(sy.Particle(position=(1, 1, 1), acceleration=(0, 0, 1)))
    alone = sy.World(fresh)
    alone.step(60)
    for w in range(3):
        np.testing.assert_array_equal(world.particles.position[w, 1:], alone.particles.position[0])


# Assigned parameters


def _assigned(per_world: bool) -> tuple[sy.World, sy.World]:
    """Two equal worlds with assigned gravity, mass and damping; the first gains a force of zero."""
    pair = []
    for _ in range(2):
        scene = sy.Scene()
        for k in range(4):
            scene.add(sy.Particle(position=(k, 0, 0), velocity=(1, 1, 1)))
        world = sy.World(scene, worlds=3)
        each = np.array([1.0, 0.5, 0.25])[:, None] if per_world else np.array(0.5)
        world.gravity = each * np.array([1.0, 2.0, 3.0])
        world.particles.damping = each * np.array([1.0, 0.9, 0.8, 0.7])
        world.particles.mass = each * np.array([1.0, 2.0, 3.0, 4.0])
        pair.append(world)
    return pair[0], pair[1]


@pytest.mark.parametrize("per_world", [False, True], ids=["shared", "per world"])
def test_assigned_parameters_survive_an_addition(per_world: bool) -> None:
    world, twin = _assigned(per_world)
    world.add(sy.Gravity((0, 0, 0)))
    np.testing.assert_array_equal(world.gravity, twin.gravity)
    np.testing.assert_array_equal(world.particles.damping, twin.particles.damping)
    np.testing.assert_array_equal(world.particles.mass, twin.particles.mass)
    world.step(30)
    twin.step(30)
    np.testing.assert_array_equal(world.particles.position, twin.particles.position)
    np.testing.assert_array_equal(world.particles.velocity, twin.particles.velocity)


@pytest.mark.parametrize("per_world", [False, True], ids=["shared", "per world"])
def test_assigned_parameters_survive_the_removal_of_a_particle(per_world: bool) -> None:
    world, twin = _assigned(per_world)
    world.remove(world.scene.particles[1])
    left = [0, 2, 3]
    np.testing.assert_array_equal(world.gravity, twin.gravity)
    np.testing.assert_array_equal(world.particles.damping, twin.particles.damping[..., left])
    np.testing.assert_array_equal(world.particles.mass, twin.particles.mass[..., left])
    world.step(30)
    twin.step(30)
    np.testing.assert_array_equal(world.particles.position, twin.particles.position[:, left])


@pytest.mark.parametrize("per_world", [False, True], ids=["shared", "per world"])
def test_a_new_particle_feels_the_assigned_gravity(per_world: bool) -> None:
    world, _ = _assigned(per_world)
    world.add(sy.Particle(position=(9, 9, 9)))
    world.add(sy.Particle(position=(9, 9, 9), acceleration=(0, 0, 0)))
    gravity = np.broadcast_to(world.gravity, (3, 3))
    np.testing.assert_array_equal(world.particles.acceleration[:, 4], gravity)
    np.testing.assert_array_equal(world.particles.acceleration[:, 5], np.zeros((3, 3)))


def test_parameters_of_other_things_survive() -> None:
    world, things = running(METHODS["rattle direct"])
    world[things["spring"]].stiffness = np.arange(1.0, 11.0)
    world[things["cable"]].length = 1.2
    world[things["stiff spring"]].anchor = (4.0, 3.6, 0.0)
    world.add(ADDED["Particle"](things))
    world.remove(things["bungee"])
    np.testing.assert_array_equal(world[things["spring"]].stiffness, np.arange(1.0, 11.0))
    assert world[things["cable"]].length == 1.2
    np.testing.assert_array_equal(world[things["stiff spring"]].anchor, (4.0, 3.6, 0.0))


# Whose scene it is


def test_the_scene_of_the_user_and_that_of_the_world_are_two() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 0, 0)))
    world, other = sy.World(scene), sy.World(scene)
    world.add(sy.Gravity((0, 1, 0)))
    scene.add(sy.Drag(linear=1.0))
    assert len(scene.things) == 2
    assert len(world.scene.things) == 2
    assert len(other.scene.things) == 1
    assert scene.particles == world.scene.particles == [a]


def test_a_thing_may_leave_and_come_back() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    a = scene.add(sy.Particle(position=(1, 0, 0)))
    spring = scene.add(sy.AnchoredSpring(a, (0, 0, 0), 10.0, 0.0))
    world = sy.World(scene, method=sy.Method(sy.ExplicitEuler(), dt=2.0**-6))
    world.remove(spring)
    world.step()
    assert world.particles.velocity[0, 0, 0] == 0.0
    world.add(spring)
    world.step()
    assert world.particles.velocity[0, 0, 0] == -10.0 * 2.0**-6
