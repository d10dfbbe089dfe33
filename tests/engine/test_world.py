"""Worlds: views, time, parameters per world, health, conserved quantities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from tests.engine.full_scene import METHODS, control, every_method, full_scene, state

Array = np.ndarray


def two_particles(**settings: Any) -> tuple[sy.World, sy.Particle, sy.Particle]:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(1, 2, 3), velocity=(4, 5, 6), mass=2.0))
    b = scene.add(sy.Particle(position=(-1, 0, 1), mass=0.5, damping=0.9))
    return sy.World(scene, **settings), a, b


# Views


def test_views_are_world_first_writable_and_no_copies() -> None:
    world, _, _ = two_particles(worlds=5)
    for name in ("position", "velocity"):
        view = getattr(world.particles, name)
        assert view.shape == (5, 2, 3)
        assert view.dtype == np.float64
        view[3, 1] = (7, 8, 9)
        again = getattr(world.particles, name)
        np.testing.assert_array_equal(again[3, 1], (7, 8, 9))
        assert np.shares_memory(view, again)
    np.testing.assert_array_equal(world.particles.position[0], [(1, 2, 3), (-1, 0, 1)])
    world.step()
    assert world.particles.position[3, 1, 0] == pytest.approx(7 + 7 / 60, abs=0.02)


def test_a_view_follows_the_steps() -> None:
    world, _, _ = two_particles(worlds=2)
    view = world.particles.position
    before = view.copy()
    world.step()
    assert (view != before)[:, 0].all()


def test_controls_are_views() -> None:
    scene, things = full_scene(METHODS["rattle direct"])
    world = sy.World(scene, worlds=3)
    assert world[things["winch"]].length.shape == (3,)
    assert world[things["rider"]].weights.shape == (3, 2)
    world[things["winch"]].rate[1] = 0.6
    world[things["rider"]].rates[2] = (-0.3, 0.3)
    world.step(10)
    np.testing.assert_allclose(world[things["winch"]].length, [2.05, 2.15, 2.05], rtol=1e-14)
    np.testing.assert_allclose(
        world[things["rider"]].weights, [[0.75, 0.25], [0.75, 0.25], [0.7, 0.3]], rtol=1e-14
    )


def test_parameters_read_as_they_were_given() -> None:
    world, _, _ = two_particles(worlds=3)
    np.testing.assert_array_equal(world.gravity, (0.0, -9.81, 0.0))
    np.testing.assert_array_equal(world.particles.mass, (2.0, 0.5))
    np.testing.assert_array_equal(world.particles.inverse_mass, (0.5, 2.0))
    np.testing.assert_array_equal(world.particles.damping, (1.0, 0.9))
    world.particles.mass = [[1.0, 2.0], [3.0, 4.0], [5.0, 8.0]]
    assert world.particles.mass.shape == (3, 2)
    world.gravity = np.ones((3, 3))
    assert world.gravity.shape == (3, 3)
    world.gravity = (0, 0, 1)
    assert world.gravity.shape == (3,)


# Time


@every_method
def test_time_is_the_number_of_steps(method: sy.Method) -> None:
    world, _, _ = two_particles(worlds=3, method=method)
    assert world.time.shape == (3,)
    world.step(60)
    world.reset(np.array([False, True, False]))
    world.step()
    # 61 additions of 1/60, each rounded by at most 1.1e-16.
    np.testing.assert_allclose(world.time, [61 / 60, 1 / 60, 61 / 60], rtol=0, atol=61 * 1.2e-16)


def test_no_step_is_no_change() -> None:
    world, _, _ = two_particles()
    before = world.particles.position.copy()
    world.step(0)
    np.testing.assert_array_equal(world.particles.position, before)
    assert world.time[0] == 0.0


# Parameters per world


@every_method
def test_parameters_per_world_equal_worlds_that_were_built_with_them(method: sy.Method) -> None:
    masses = [(1.0, 2.0, 0.5), (3.0, 0.1, 1.0), (1.0, 1.0, 3.0)]
    dampings = [1.0, 0.5, 0.9]
    gravities = [(0.0, -9.81, 0.0), (0.5, -1.62, 0.0), (0.0, -11.0, 1.0)]

    def build(mass: Any, damping: float, gravity: Any, *, worlds: int = 1) -> sy.World:
        scene = sy.Scene(gravity=gravity)
        places = [(0, 2, 0), (1, 2, 0), (1, 1, 0)]
        p = [
            scene.add(sy.Particle(position=x, velocity=(1, 0, 0.5), mass=m, damping=damping))
            for x, m in zip(places, mass, strict=True)
        ]
        scene.add(sy.RodConstraint(p[0], (0, 4, 0)))
        scene.add(sy.Rod(p[0], p[1]))
        scene.add(sy.Cable(p[1], p[2], 1.01, restitution=0.3))
        scene.add(sy.Spring(p[0], p[2], 50.0, 1.0))
        scene.add(sy.Drag(linear=0.1, quadratic=0.1))
        scene.add(sy.Gravity((0.1, 0, 0)))
        scene.add(sy.Ground(restitution=0.4, friction=0.5))
        return sy.World(scene, worlds=worlds, method=method)

    world = build(masses[0], 1.0, gravities[0], worlds=3)
    world.particles.mass = masses
    world.particles.damping = np.repeat(dampings, 3).reshape(3, 3)
    world.gravity = gravities
    world.step(60)
    for w in range(3):
        alone = build(masses[w], dampings[w], gravities[w])
        alone.step(60)
        np.testing.assert_array_equal(world.particles.position[w], alone.particles.position[0])
        np.testing.assert_array_equal(world.particles.velocity[w], alone.particles.velocity[0])
        assert world.energy[w] == alone.energy[0]


def test_gravity_reaches_only_particles_without_an_acceleration_of_their_own() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 0, 0)))
    scene.add(sy.Particle(position=(0, 0, 0), acceleration=(0, 0, 2)))
    world = sy.World(scene, worlds=2)
    world.gravity = [(1, 0, 0), (0, 4, 0)]
    np.testing.assert_array_equal(
        world.particles.acceleration, [[(1, 0, 0), (0, 0, 2)], [(0, 4, 0), (0, 0, 2)]]
    )
    world.step(60)
    np.testing.assert_allclose(
        world.particles.velocity, world.particles.acceleration, rtol=1e-13, atol=0
    )
    world.gravity = (0, 0, 0)
    np.testing.assert_array_equal(world.particles.acceleration[:, 0], 0.0)


def test_damping_may_be_assigned_where_there_was_none() -> None:
    world, _, _ = two_particles(worlds=2)
    world.gravity = (0, 0, 0)
    world.particles.damping = [[1.0, 1.0], [0.25, 1.0]]
    world.step(60)
    np.testing.assert_allclose(world.particles.velocity[:, 0, 0], [4.0, 1.0], rtol=1e-13)


# Health


@every_method
@pytest.mark.parametrize("written", [False, True], ids=["plain", "user-written"])
def test_a_broken_world_touches_no_other(method: sy.Method, written: bool) -> None:
    """Also none in another block of the batch that shares its lane."""

    def run(*, broken: bool) -> tuple[sy.World, dict[str, Array]]:
        scene, things = full_scene(method, written=written)
        world = sy.World(scene, worlds=27, method=method)
        control(world, things)
        world.step(10)
        if broken:
            world.particles.position[2, 0, 1] = np.nan
            world.particles.velocity[12, 3] = np.inf
        world.step(20)
        return world, state(world, things)

    world, found = run(broken=True)
    _, sound = run(broken=False)
    others = np.delete(np.arange(27), [2, 12])
    assert (world.health[[2, 12]] & 1).all()
    for name, value in found.items():
        np.testing.assert_array_equal(value[others], sound[name][others], err_msg=name)
    assert not (world.health[others] & 1).any()


@every_method
def test_a_broken_world_is_sound_again_after_its_reset(method: sy.Method) -> None:
    scene, _ = full_scene(method)
    world = sy.World(scene, worlds=4, method=method)
    world.step(20)
    world.particles.velocity[1:3] = np.nan
    world.step()
    np.testing.assert_array_equal(world.health & 1, [0, 1, 1, 0])
    world.reset(np.array([False, True, False, False]))
    fresh = sy.World(scene, method=method)
    world.step(20)
    fresh.step(20)
    np.testing.assert_array_equal(world.health & 1, [0, 0, 1, 0])
    np.testing.assert_array_equal(world.particles.position[1], fresh.particles.position[0])


def test_health_is_a_byte_per_world() -> None:
    world, _, _ = two_particles(worlds=3)
    world.step()
    assert world.health.dtype == np.uint8
    assert world.health.tolist() == [0, 0, 0]


@pytest.mark.parametrize("start", [math.nan, math.inf, 1e308], ids=str)
def test_what_overflows_is_flagged(start: float) -> None:
    world, _, _ = two_particles(worlds=3)
    world.particles.velocity[1, 0, 2] = start
    world.particles.position[1, 0, 2] = start
    world.step(60)
    assert world.health.tolist() == [0, 1, 0]


def test_constraints_that_cannot_be_met_are_flagged() -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0, 0, 0)))
    left = scene.add(sy.CableConstraint(p, (-1, 0, 0), 1.1))
    scene.add(sy.CableConstraint(p, (1, 0, 0), 1.1))
    world = sy.World(scene, worlds=3)
    world.step(5)
    assert world.health.tolist() == [0, 0, 0]
    world[left].anchor = [(-1, 0, 0), (-3, 0, 0), (-1, 0, 0)]
    world.step()
    assert world.health[[0, 2]].tolist() == [0, 0]
    assert world.health[1] != 0


def test_a_tolerance_that_was_missed_is_flagged() -> None:
    def pendulum(solver: sy.Direct) -> sy.World:
        scene = sy.Scene(gravity=(0, 0, 0))
        p = scene.add(sy.Particle(position=(1, 0, 0), velocity=(0, -5, 0)))
        scene.add(sy.RodConstraint(p, (0, 0, 0)))
        world = sy.World(scene, worlds=3, method=sy.Method(sy.Rattle(), solver))
        world.particles.velocity[[0, 2]] = 0.0
        world.particles.position[[0, 2]] = (0, -1, 0)
        world.step()
        return world

    hurried = pendulum(sy.Direct(passes=1))
    assert hurried.health.tolist() == [0, 2, 0]
    # What one pass leaves: a fourth power of the .08 m that the rod turns.
    assert 1e-12 < abs(hurried.residual[1, 0]) < 1e-4
    patient = pendulum(sy.Direct())
    assert patient.health.tolist() == [0, 0, 0]
    assert abs(patient.residual[1, 0]) < 1e-12


def test_a_winch_wound_past_its_end_is_flagged() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 2, 0)))
    b = scene.add(sy.Particle(position=(1, 2, 0)))
    winch = scene.add(sy.Cable(a, b, 1.0, winch=True))
    world = sy.World(scene, worlds=3)
    world[winch].rate = [0.0, -100.0, 0.1]
    world.step(3)
    assert world.health[[0, 2]].tolist() == [0, 0]
    assert world.health[1] != 0


@pytest.mark.parametrize("name", ["length", "rate", "acceleration"])
def test_a_winch_that_is_not_finite_is_flagged(name: str) -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 2, 0)))
    b = scene.add(sy.Particle(position=(1, 2, 0)))
    winch = scene.add(sy.Cable(a, b, 1.0, winch=True))
    world = sy.World(scene, worlds=3)
    getattr(world[winch], name)[1] = math.nan
    world.step(3)
    assert world.health[[0, 2]].tolist() == [0, 0]
    assert world.health[1] != 0
