"""One contract for every solver, on the same scenes: order, rods, momentum, tolerances and flags."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import pendulum
from benchmarks.scenes import tumbling_platform
from tests.engine.builders import (
    METHODS,
    RESOLVED,
    STAGED,
    from_particle_scene,
    method,
    residual_limit,
    swung,
)


def hanging_chain(links: int = 4) -> sy.Scene:
    """Rods in a row from the origin, released level; the particles grow heavier outwards."""
    scene = sy.Scene()
    chain = [
        scene.add(sy.Particle(position=(0.5 * (k + 1), 0.0, 0.0), mass=1.0 + k))
        for k in range(links)
    ]
    scene.add(sy.RodConstraint(chain[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(chain):
        scene.add(sy.Rod(a, b))
    return scene


# Convergence


@pytest.mark.parametrize("name", METHODS)
def test_pendulum_converges_to_its_closed_form_with_the_order_claimed(name: str) -> None:
    scene = sy.Scene()
    bob = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(bob, (0.0, 0.0, 0.0)))
    angle, _ = pendulum([1.0], length=1.0)
    exact = [np.sin(angle[0]), -np.cos(angle[0]), 0.0]
    error = []
    for dt in (1 / 400, 1 / 800):
        world = swung(scene, name, dt=dt, seconds=1.0)
        assert np.abs(world.residual).max() < 1e-11
        error.append(np.abs(world.particles.position[0, 0] - exact).max())
    # The next term of the error changes the ratio by less than 2 % at these steps.
    assert error[0] / error[1] == pytest.approx(2.0 ** world.method.integrator.order(), rel=0.02)


@pytest.mark.parametrize("name", STAGED)
def test_chain_converges_with_the_order_claimed(name: str) -> None:
    ends = []
    for dt in (1 / 400, 1 / 800, 1 / 1600):
        world = swung(hanging_chain(), name, dt=dt, seconds=0.5)
        assert np.abs(world.residual).max() < 1e-8
        assert world.health[0] == 0
        ends.append(world.particles.position[0].copy())
    change = [np.abs(a - b).max() for a, b in pairwise(ends)]
    assert change[0] / change[1] == pytest.approx(2.0 ** world.method.integrator.order(), rel=0.02)


def test_gauss_seidel_approaches_direct_sweep_by_sweep() -> None:
    # On a chain of n each sweep leaves the share cos^2(pi / 2n) of the error, and more with the heavy end.
    exact = swung(hanging_chain(), "Rattle-Direct", dt=0.01, seconds=0.5)
    apart, left = [], []
    for passes in (5, 20, 80, 320):
        solver = sy.GaussSeidel(passes=passes)
        world = sy.World(hanging_chain(), method=sy.Method(sy.Rattle(), solver, dt=0.01))
        world.step(50)
        apart.append(np.abs(world.particles.position - exact.particles.position).max())
        left.append(np.abs(world.residual).max())
    assert all(b < 0.5 * a for a, b in pairwise(apart))
    assert all(b < 0.5 * a for a, b in pairwise(left[:-1]))
    assert apart[-1] < 1e-10


# Rods


@pytest.mark.parametrize("name", METHODS)
def test_free_structure_keeps_its_momentum_and_its_shape(name: str) -> None:
    world = sy.World(from_particle_scene(tumbling_platform()), method=method(name, dt=0.01))
    momentum, spin = world.momentum.copy(), world.angular_momentum.copy()
    for _ in range(10):
        world.step(10)
        assert np.abs(world.residual).max() <= residual_limit(name)
        np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-11)
        if name in STAGED:
            # Impulses along rods turn nothing; the resolver's corrections of places do.
            np.testing.assert_allclose(world.angular_momentum, spin, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", METHODS)
def test_free_structure_falls_as_one(name: str) -> None:
    scene = from_particle_scene(replace(tumbling_platform(), gravity=(0.3, -9.81, 0.0)))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(50)
    # Every method steps the velocity of free fall exactly.
    np.testing.assert_allclose(world.momentum, [[16 * 0.15, -16 * 4.905, 0.0]], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", METHODS)
def test_a_rod_pushes_its_ends_apart_with_opposite_impulses(name: str) -> None:
    # Two particles forced together along their rod: it lets neither gain on the other, and what one gains
    # in momentum the other loses.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(1.0, 0.0, 0.0), velocity=(-2.0, 0.0, 0.0), mass=3.0))
    scene.add(sy.Rod(a, b))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(2)
    np.testing.assert_allclose(
        world.particles.velocity[0], [[-1.25, 0.0, 0.0], [-1.25, 0.0, 0.0]], rtol=0, atol=1e-9
    )
    assert np.abs(world.residual).max() < 1e-11


@pytest.mark.parametrize("name", METHODS)
def test_a_rod_to_an_immovable_particle_is_a_rod_to_a_point(name: str) -> None:
    positions = []
    for immovable in (True, False):
        scene = sy.Scene()
        p = scene.add(sy.Particle(position=(1.0, 0.5, 0.2), velocity=(0.0, 0.0, 1.0)))
        if immovable:
            end = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), inverse_mass=0.0))
            scene.add(sy.Rod(p, end))
        else:
            scene.add(sy.RodConstraint(p, (0.0, 0.0, 0.0)))
        world = swung(scene, name, dt=0.01, seconds=0.5)
        positions.append(world.particles.position[0, 0].copy())
        if immovable:
            np.testing.assert_array_equal(world.particles.position[0, 1], 0.0)
    np.testing.assert_allclose(positions[0], positions[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", STAGED)
def test_redundant_rods_change_nothing(name: str) -> None:
    # Of the platform's 15 rods 12 hold it; with the three between the outer corners left out, the
    # same motion follows.
    source = replace(tumbling_platform(), gravity=(0.0, -9.81, 0.0))
    isostatic = [rod for rod in source.rods if set(rod[:2]) not in ({0, 5}, {1, 2}, {2, 5})]
    worlds = []
    for rods in (source.rods, tuple(isostatic)):
        scene = from_particle_scene(replace(source, rods=rods))
        integrator, solver = STAGED[name]
        if isinstance(solver, sy.GaussSeidel):
            solver = sy.GaussSeidel(passes=600)
        world = sy.World(scene, method=sy.Method(integrator, solver, dt=0.01))
        world.step(50)
        worlds.append(world)
    assert len(isostatic) == 12
    a, b = (world.particles.position for world in worlds)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    assert np.abs(worlds[1].residual).max() < 1e-9


def test_world_says_which_rods_the_others_imply() -> None:
    world = sy.World(from_particle_scene(tumbling_platform()))
    assert "15 rods implied by others or by a rigid cluster" in repr(world)


# Settings and flags


def test_tolerance_bounds_the_residual() -> None:
    loose = sy.Method(sy.Rattle(), sy.Direct(tolerance=1e-5), dt=0.01)
    world = sy.World(hanging_chain(), method=loose)
    worst = 0.0
    for _ in range(100):
        world.step()
        worst = max(worst, np.abs(world.residual).max())
    assert 1e-9 < worst <= 1e-5
    assert world.health[0] == 0


def test_too_few_passes_are_flagged_until_reset() -> None:
    hasty = sy.Method(sy.Rattle(), sy.Direct(passes=1), dt=0.02)
    world = sy.World(hanging_chain(), worlds=3, method=hasty)
    world.particles.velocity[1] = 0.0
    world.step(20)
    np.testing.assert_array_equal(world.health, 2)
    world.reset(np.array([False, True, False]))
    np.testing.assert_array_equal(world.health, [2, 0, 2])


def test_a_broken_world_touches_no_other_and_recovers_by_reset() -> None:
    # World 0 and world 8 share a lane of the work arrays, one block apart.
    scene = sy.Scene()
    bob = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(bob, (0.0, 0.0, 0.0)))
    scene.add(sy.Ground(height=-0.5, friction=0.5))
    for name in METHODS:
        world = sy.World(scene, worlds=17, method=method(name, dt=0.01))
        world.particles.position[0] = np.nan
        world.step(2)
        world.step(2)
        assert np.isfinite(world.particles.position[1:]).all(), name
        np.testing.assert_array_equal(world.health, [1] + [0] * 16, err_msg=name)
        world.reset(np.arange(17) == 0)
        fresh = sy.World(scene, method=method(name, dt=0.01))
        world.step(3)
        fresh.step(3)
        np.testing.assert_array_equal(
            world.particles.position[0], fresh.particles.position[0], err_msg=name
        )
        np.testing.assert_array_equal(world.health, 0, err_msg=name)


@pytest.mark.parametrize("name", RESOLVED)
def test_worst_first_does_as_many_resolutions_as_asked(name: str) -> None:
    # One resolution for two overstretched cables: the faster one is made good, the other is left.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    for z, speed in ((0.0, 1.0), (5.0, 2.0)):
        p = scene.add(sy.Particle(position=(1.0, 0.0, z), velocity=(speed, 0.0, 0.0)))
        scene.add(sy.CableConstraint(p, (0.0, 0.0, z), 1.0))
    integrator, _ = RESOLVED[name]
    once = sy.Method(integrator, sy.WorstFirst(iterations=1), dt=0.01)
    world = sy.World(scene, method=once)
    world.step()
    np.testing.assert_allclose(world.residual, [[0.01, 0.0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(world.particles.velocity[0, :, 0], [1.0, 0.0], atol=1e-15)
