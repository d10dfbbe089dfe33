"""Riders: a load at prescribed weights of the particles that carry it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import rigid_motion
from benchmarks.scenes import ParticleScene, tumbling_platform
from tests.engine.builders import STAGED, Array, from_particle_scene, method

LOAD = 5.0
WEIGHTS = np.array([0.1, 0.2, 0.3, 0.4])


def path(time: float) -> Array:
    """Bilinear weights of a load that circles over the deck of four, shape (4,)."""
    x, z = 0.5 + 0.4 * np.sin(2.0 * time), 0.5 + 0.3 * np.cos(3.0 * time)
    return np.array([(1 - x) * (1 - z), (1 - x) * z, x * (1 - z), x * z])


def ridden_platform(weights: Array) -> tuple[sy.Scene, sy.Rider, ParticleScene]:
    """The tumbling platform with a load on its four upper particles; and all of it as a rigid body."""
    source = tumbling_platform()
    whole = replace(
        source,
        position=np.vstack([source.position, weights @ source.position[2:]]),
        velocity=np.vstack([source.velocity, weights @ source.velocity[2:]]),
        mass=np.append(source.mass, LOAD),
    )
    scene = from_particle_scene(source)
    load = scene.add(sy.Particle(position=whole.position[6], velocity=whole.velocity[6], mass=LOAD))
    rider = scene.add(sy.Rider(load, scene.particles[2:6], weights))
    return scene, rider, whole


def drive(world: sy.World, rider: sy.Rider, steps: int) -> None:
    """Move the load along the path, by rates that bring the weights there step by step."""
    dt = world.method.dt
    for _ in range(steps):
        time = float(world.time[0])
        world[rider].rates = (path(time + dt) - path(time)) / dt
        world.step()


def test_a_load_at_rest_on_a_rigid_platform_is_part_of_it() -> None:
    scene, _, whole = ridden_platform(WEIGHTS)
    exact, _ = rigid_motion(whole, [2.0])
    error = []
    for steps in (200, 400, 800):
        world = sy.World(scene, method=method("Rattle-Direct", dt=2.0 / steps))
        world.step(steps)
        assert world.health[0] == 0
        error.append(np.abs(world.particles.position[0] - exact[0]).max())
    # Second order; the next term of the error is below 1 % of it at these steps.
    np.testing.assert_allclose(np.divide(error[:-1], error[1:]), 4.0, rtol=0.02)
    assert error[0] < 2e-3


def test_a_moving_load_is_second_order() -> None:
    positions = []
    for steps in (100, 200, 400, 800):
        scene, rider, _ = ridden_platform(path(0.0))
        world = sy.World(scene, method=method("Rattle-Direct", dt=2.0 / steps))
        drive(world, rider, steps)
        positions.append(world.particles.position[0].copy())
    change = [np.abs(a - b).max() for a, b in pairwise(positions)]
    np.testing.assert_allclose(np.divide(change[:-1], change[1:]), 4.0, rtol=0.02)


@pytest.mark.parametrize("name", STAGED)
def test_rider_and_deck_push_each_other(name: str) -> None:
    # Newton's third law: whatever the load does, momentum stays to rounding. Angular momentum stays as far
    # as the load is where its weights say: 1e-12 m, times impulses of some 100 N s over 50 steps.
    scene, rider, _ = ridden_platform(path(0.0))
    world = sy.World(scene, method=method(name, dt=0.01))
    momentum, spin = world.momentum.copy(), world.angular_momentum.copy()
    drive(world, rider, 50)
    np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-12)
    if isinstance(world.method.solver, sy.Direct):
        np.testing.assert_allclose(world.angular_momentum, spin, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", STAGED)
def test_a_load_that_walks_along_a_floating_beam(name: str) -> None:
    # The centre of mass stays: the beam of 2 x 2 kg and 3 m moves back by 5/9 of the way walked.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    beam = [scene.add(sy.Particle(position=(x, 0.0, 0.0), mass=2.0)) for x in (0.0, 3.0)]
    scene.add(sy.Rod(*beam))
    load = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), mass=LOAD))
    rider = scene.add(sy.Rider(load, beam, [1.0, 0.0]))
    world = sy.World(scene, method=method(name, dt=0.01))
    world[rider].rates = [-0.5, 0.5]
    for steps in (1, 9, 90):
        world.step(steps)
        back = -LOAD * 1.5 * world.time[0] / 9.0
        expected = [back, 3.0 + back, 1.5 * world.time[0] + back]
        # 100 steps, each of which meets the constraints to 1e-12 (Direct) or better.
        np.testing.assert_allclose(world.particles.position[0, :, 0], expected, rtol=0, atol=1e-10)
        speed = [-LOAD * 1.5 / 9.0, -LOAD * 1.5 / 9.0, 1.5 - LOAD * 1.5 / 9.0]
        np.testing.assert_allclose(world.particles.velocity[0, :, 0], speed, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["Rattle-Direct", "Rattle-GaussSeidel"])
def test_reaction_of_a_fixed_deck_is_the_weight(name: str) -> None:
    scene = sy.Scene()
    corners = [(0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (2.0, 0.0, 0.0), (2.0, 0.0, 2.0)]
    deck = [scene.add(sy.Particle(position=p, inverse_mass=0.0)) for p in corners]
    load = scene.add(sy.Particle(position=WEIGHTS @ np.array(corners), mass=LOAD))
    rider = scene.add(sy.Rider(load, deck, WEIGHTS))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(5)
    # The position stage's impulse is multiplier = mass times displacement, F dt^2 / 2.
    reaction = 2.0 * world[rider].multiplier / 0.01**2
    # An error of 1e-12 m in place is one of 2 m 1e-12 / dt^2 = 1e-7 N.
    np.testing.assert_allclose(reaction, [[0.0, LOAD * 9.81, 0.0]], rtol=0, atol=1e-6)
    np.testing.assert_allclose(world.particles.velocity, 0.0, atol=1e-10)


def test_weights_follow_rates_and_assignments_world_by_world() -> None:
    scene, rider, _ = ridden_platform(WEIGHTS)
    world = sy.World(scene, worlds=3, method=method("Rattle-Direct", dt=0.01))
    rates = np.array([[0.1, -0.1, 0.2, -0.2], [0.0, 0.0, 0.0, 0.0], [-0.3, 0.1, 0.1, 0.1]])
    world[rider].rates = rates
    world.step(20)
    expected = WEIGHTS + 0.2 * rates
    np.testing.assert_allclose(world[rider].weights, expected, rtol=0, atol=1e-15)
    place = np.einsum("wk,wkc->wc", world[rider].weights, world.particles.position[:, 2:6])
    np.testing.assert_allclose(world.particles.position[:, 6], place, rtol=0, atol=2e-12)
    world[rider].weights = np.array([0.25, 0.25, 0.25, 0.25])
    world[rider].rates = 0.0
    world.step()
    place = world.particles.position[:, 2:6].mean(axis=1)
    np.testing.assert_allclose(world.particles.position[:, 6], place, rtol=0, atol=2e-12)
    np.testing.assert_array_equal(world.health, 0)


def test_direct_solves_what_many_sweeps_approach() -> None:
    difference = []
    for passes in (20, 100, 400):
        worlds = []
        for solver in (sy.Direct(), sy.GaussSeidel(passes=passes)):
            scene, rider, _ = ridden_platform(path(0.0))
            world = sy.World(scene, method=sy.Method(sy.Rattle(), solver, dt=0.01))
            drive(world, rider, 50)
            worlds.append(world)
        a, b = (world.particles.position for world in worlds)
        difference.append(np.abs(a - b).max())
    assert difference[0] > 1e-9
    # The direct solver's own tolerance is 1e-12 of a length of up to 7 m in each of 50 steps.
    assert difference[1] < 1e-10
    assert difference[2] < 1e-11
