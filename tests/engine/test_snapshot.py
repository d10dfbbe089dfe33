"""Snapshot, restore and reset."""

from __future__ import annotations

import pickle
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


def running(
    method: sy.Method, *, worlds: int = 10, written: bool = False
) -> tuple[sy.World, dict[str, Any]]:
    """A world with everything in it, under control, after 20 steps."""
    scene, things = full_scene(method, written=written)
    world = sy.World(scene, worlds=worlds, method=method)
    control(world, things)
    world.step(20)
    return world, things


def assign(world: sy.World, things: dict[str, Any]) -> None:
    """Other parameters, some for all worlds and some per world."""
    each = np.linspace(0.8, 1.2, world.worlds)
    world.gravity = np.stack([0.0 * each, -9.81 * each, 0.5 * each], axis=1)
    world.particles.damping = 0.9
    world.particles.mass = world.particles.mass * each[:, None]
    world[things["spring"]].stiffness = 30.0 * each
    world[things["cable"]].length = 1.1
    world[things["drag"]].wind = (0.0, 0.0, -2.0)
    world[things["stiff spring"]].damping = 5.0 * each
    world[things["ground"]].friction = 0.1 * each


@every_method
@pytest.mark.parametrize("written", [False, True], ids=["plain", "user-written"])
def test_a_restored_world_goes_on_bit_for_bit(method: sy.Method, written: bool) -> None:
    world, things = running(method, written=written)
    kept = world.snapshot()
    at = state(world, things)
    world.step(30)
    end = state(world, things)
    assert not np.array_equal(at["position"], end["position"])
    for _ in range(2):
        assign(world, things)
        control(world, things)
        world.particles.position[:] += 0.01
        world.step(7)
        world.restore(kept)
        assert_same_bits(state(world, things), at)
        world.step(30)
        assert_same_bits(state(world, things), end)


@every_method
def test_a_pickled_world_goes_on_bit_for_bit(method: sy.Method) -> None:
    world, things = running(method)
    assign(world, things)
    control(world, things)
    world.step(3)
    copy = pickle.loads(pickle.dumps(world))
    np.testing.assert_array_equal(copy.gravity, world.gravity)
    np.testing.assert_array_equal(copy.particles.damping, world.particles.damping)
    world.step(20)
    copy.step(20)
    np.testing.assert_array_equal(copy.particles.position, world.particles.position)
    np.testing.assert_array_equal(copy.particles.velocity, world.particles.velocity)
    np.testing.assert_array_equal(copy.time, world.time)


@every_method
def test_a_snapshot_keeps_assigned_parameters(method: sy.Method) -> None:
    world, things = running(method)
    assign(world, things)
    kept = world.snapshot()
    mass, gravity = world.particles.mass.copy(), world.gravity.copy()
    world.step(30)
    end = state(world, things)
    world.gravity = (0.0, 0.0, 0.0)
    world.particles.mass = world.particles.mass * 3.0
    world[things["spring"]].stiffness = 1.0
    world[things["cable"]].length = 5.0
    world[things["ground"]].friction = 0.0
    world.restore(kept)
    np.testing.assert_array_equal(world.particles.mass, mass)
    np.testing.assert_array_equal(world.gravity, gravity)
    assert world[things["cable"]].length == 1.1
    world.step(30)
    assert_same_bits(state(world, things), end)


def test_a_snapshot_is_a_copy() -> None:
    world, things = running(METHODS["rattle direct"])
    kept = world.snapshot()
    at = state(world, things)
    world.step(5)
    world.particles.position[:] = 7.0
    world.restore(kept)
    world.step(5)
    world.restore(kept)
    assert_same_bits(state(world, things), at)


def test_flags_come_back_with_a_snapshot() -> None:
    world, _ = running(METHODS["rattle direct"])
    sound = world.snapshot()
    world.particles.velocity[3] = np.nan
    world.step()
    broken = world.snapshot()
    assert world.health.tolist() == [0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    world.restore(sound)
    assert not world.health.any()
    world.restore(broken)
    assert world.health[3] == 1


def test_closed_form_flight_is_restored_bit_for_bit() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 1, 0), velocity=(3, 4, 5), damping=0.9))
    world = sy.World(scene, worlds=3, method=sy.Method(sy.ClosedForm()))
    world.step(3)
    kept = world.snapshot()
    world.step(10)
    end = world.particles.position.copy()
    world.particles.damping = np.array([[0.5], [0.6], [0.7]])
    world.step(3)
    world.restore(kept)
    world.step(10)
    np.testing.assert_array_equal(world.particles.position, end)


@every_method
def test_reset_starts_the_chosen_worlds_anew_and_leaves_the_others(method: sy.Method) -> None:
    world, things = running(method)
    twin, same = running(method)
    chosen = np.arange(10) % 3 == 1
    world.reset(chosen)
    scene, fresh_things = full_scene(method)
    fresh = sy.World(scene, worlds=10, method=method)
    for steps in (0, 15):
        world.step(steps)
        twin.step(steps)
        fresh.step(steps)
        found, left, new = state(world, things), state(twin, same), state(fresh, fresh_things)
        for name, value in found.items():
            np.testing.assert_array_equal(value[~chosen], left[name][~chosen], err_msg=name)
            np.testing.assert_array_equal(value[chosen], new[name][chosen], err_msg=name)


def test_reset_without_a_mask_starts_all_worlds_anew() -> None:
    method = METHODS["rattle direct"]
    world, things = running(method)
    world.reset()
    scene, fresh_things = full_scene(method)
    fresh = sy.World(scene, worlds=10, method=method)
    assert_same_bits(state(world, things), state(fresh, fresh_things))
    assert (world.time == 0.0).all()


def test_reset_of_no_world_changes_nothing() -> None:
    world, things = running(METHODS["rattle direct"])
    before = state(world, things)
    world.reset(np.zeros(10, dtype=bool))
    assert_same_bits(state(world, things), before)


def test_reset_keeps_assigned_parameters() -> None:
    world, things = running(METHODS["rattle direct"])
    assign(world, things)
    mass = world.particles.mass.copy()
    world.reset()
    np.testing.assert_array_equal(world.particles.mass, mass)
    np.testing.assert_array_equal(world.particles.damping, np.full(8, 0.9))
    np.testing.assert_array_equal(world.gravity[:, 1], -9.81 * np.linspace(0.8, 1.2, 10))


def test_reset_clears_the_flags_of_the_chosen_worlds_alone() -> None:
    world, _ = running(METHODS["rattle direct"], worlds=4)
    world.particles.velocity[[1, 2]] = np.nan
    world.step()
    assert world.health.tolist() == [0, 1, 1, 0]
    world.reset(np.array([False, True, False, False]))
    assert world.health.tolist() == [0, 0, 1, 0]
    world.step(5)
    assert world.health.tolist() == [0, 0, 1, 0]
    assert np.isfinite(world.particles.position[1]).all()
