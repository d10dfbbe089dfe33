"""Small-step XPBD against its own discrete motion: what it damps, what it leaves, what a substep is."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from tests.engine.builders import swung
from tests.engine.refusals import refused


def small_steps(dt: float, substeps: int, iterations: int = 1) -> sy.Method:
    return sy.Method(sy.SymplecticEuler(), sy.Xpbd(substeps=substeps, iterations=iterations), dt=dt)


def chain(links: int = 4) -> sy.Scene:
    """Rods of .5 m in a row from the origin, released level; the particles grow heavier outwards."""
    scene = sy.Scene()
    row = [
        scene.add(sy.Particle(position=(0.5 * (k + 1), 0.0, 0.0), mass=1.0 + k))
        for k in range(links)
    ]
    scene.add(sy.RodConstraint(row[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(row):
        scene.add(sy.Rod(a, b))
    return scene


# Damping


@pytest.mark.parametrize("phase", [0.01, 0.3, 2.0, 50.0, 1e4])
def test_a_spring_loses_energy_as_by_backward_euler(phase: float) -> None:
    # In (w x, v) a step of backward Euler is a rotation over sqrt(1 + a^2), a = h w: the energy falls by 1 + a^2.
    dt, substeps = 1 / 64, 4
    w = phase * substeps / dt
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(1, 0, 0), velocity=(0, 0.5 * w, 0), mass=2.0))
    scene.add(sy.AnchoredSpring(p, (0, 0, 0), 2.0 * w * w, 0.0))
    world = sy.World(scene, method=small_steps(dt, substeps))
    start = float(world.energy[0])
    for step in range(1, 6):
        world.step()
        left = (1.0 + phase * phase) ** -(step * substeps)
        # What is left is a difference of numbers a^2 as large.
        assert world.energy[0] / start == pytest.approx(left, rel=1e-13 * (1.0 + phase**2))


def test_a_pair_on_a_rod_slows_down_by_first_order() -> None:
    # d' is d + h v drawn to length L, v' = (d' - d)/h. With phi the turn of a substep the next one turns by
    # tan(phi') = sin(phi) / (2 - cos(phi)), or phi' = phi - phi^3: dw/dt = -h w^3.
    h, w = 1 / 64, 3.0
    scene = sy.Scene(gravity=(0, 0, 0))
    a = scene.add(sy.Particle(position=(0, 0, 0), velocity=(0, -0.6 * w, 0), mass=2.0))
    b = scene.add(sy.Particle(position=(1, 0, 0), velocity=(0, 0.4 * w, 0), mass=3.0))
    scene.add(sy.Rod(a, b))
    world = sy.World(scene, method=small_steps(h, 1))
    angle, turn = 0.0, math.atan(h * w)
    for _ in range(200):
        angle += turn
        world.step()
        apart = world.particles.position[0, 1] - world.particles.position[0, 0]
        expected = (math.cos(angle), math.sin(angle), 0.0)
        np.testing.assert_allclose(apart, expected, rtol=0, atol=1e-11)
        turn = math.atan2(math.sin(turn), 2.0 - math.cos(turn))
    # Over 200 substeps 1/w^2 has grown by 2 h t.
    t = 200 * h
    assert turn / h == pytest.approx((w**-2 + 2.0 * h * t) ** -0.5, rel=0.01)


# Accuracy


def test_what_one_pass_leaves_falls_with_the_square_of_the_substep() -> None:
    left = [np.abs(swung_by(substeps, 1).residual).max() for substeps in (20, 40, 80, 160)]
    for coarse, fine in pairwise(left):
        assert coarse / fine == pytest.approx(4.0, rel=0.1)


def swung_by(substeps: int, iterations: int) -> sy.World:
    world = sy.World(chain(), method=small_steps(0.02, substeps, iterations))
    world.step(25)
    return world


def test_what_one_pass_leaves_of_a_hanging_load() -> None:
    # At rest a substep's fall h^2 g is undone by pulls that balance: rod k pulls by h^2 g times the mass below it. It
    # is right after its turn; then the next one pulls its end down by h^2 g (mass below that end) / (its mass).
    masses = [1.0, 2.0, 0.5, 4.0]
    scene = sy.Scene()
    row = [
        scene.add(sy.Particle(position=(0, -0.5 * (k + 1), 0), mass=m, damping=1e-4))
        for k, m in enumerate(masses)
    ]
    scene.add(sy.RodConstraint(row[0], (0, 0, 0)))
    for a, b in pairwise(row):
        scene.add(sy.Rod(a, b))
    world = sy.World(scene, method=small_steps(1 / 60, 10))
    world.step(3000)
    left = [9.81 / 600**2 * sum(masses[k + 1 :]) / m for k, m in enumerate(masses)]
    np.testing.assert_allclose(0.5 * world.residual[0], left, rtol=0, atol=1e-12)


def test_more_passes_leave_less_and_more_substeps_still_less() -> None:
    left = [
        np.abs(swung_by(substeps, iterations).residual).max()
        for substeps, iterations in ((10, 1), (10, 4), (40, 1))
    ]
    assert left[1] < 0.5 * left[0]
    # As much work, Macklin et al. 2019.
    assert left[2] < left[1]


def test_a_chain_converges_with_first_order() -> None:
    exact = swung(chain(), "Rattle-Direct", dt=1 / 4800, seconds=0.5).particles.position
    error = [
        np.abs(swung_by(substeps, 1).particles.position - exact).max()
        for substeps in (80, 160, 320)
    ]
    for coarse, fine in pairwise(error):
        assert coarse / fine == pytest.approx(2.0, rel=0.05)


# Springs as constraints


@pytest.mark.parametrize("iterations", [1, 80])
def test_springs_hang_at_rest_where_their_forces_balance(iterations: int) -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, -1, 0), mass=2.0, damping=0.01))
    b = scene.add(sy.Particle(position=(0, -2, 0), mass=3.0, damping=0.01))
    scene.add(sy.AnchoredSpring(a, (0, 0, 0), 1000.0, 0.8))
    scene.add(sy.Spring(a, b, 500.0, 0.6))
    slack = scene.add(sy.AnchoredBungee(b, (0, 0, 0), 300.0, 5.0))
    world = sy.World(scene, method=small_steps(1 / 60, 20, iterations))
    world.step(60 * 20)
    first = 0.8 + 5.0 * 9.81 / 1000.0
    heights = [-first, -first - 0.6 - 3.0 * 9.81 / 500.0]
    # What one pass leaves is of the size of a substep's fall.
    atol = 1e-9 if iterations > 1 else 2.0 * 9.81 / 1200**2
    np.testing.assert_allclose(world.particles.position[0, :, 1], heights, rtol=0, atol=atol)
    # Taut, the bungee holds part of it.
    world[slack].rest_length = 1.45
    world.step(60 * 20)
    y = world.particles.position[0, :, 1]
    assert heights[1] < y[1] < -1.45
    pull = 300.0 * (-y[1] - 1.45), 500.0 * (y[0] - y[1] - 0.6)
    if iterations > 1:
        assert pull[0] + pull[1] == pytest.approx(3.0 * 9.81, rel=1e-6)


def test_a_stiff_network_is_held_at_any_stiffness() -> None:
    scene = sy.Scene()
    row = [scene.add(sy.Particle(position=(0.1 * k, 0, 0))) for k in range(10)]
    scene.add(sy.AnchoredSpring(row[0], (0, 0, 0), 1e12, 0.0))
    for a, b in pairwise(row):
        scene.add(sy.Spring(a, b, 1e12, 0.1))
    world = sy.World(scene, method=small_steps(1 / 60, 20))
    for _ in range(60):
        world.step()
        assert np.abs(np.diff(world.particles.position[0], axis=0)).max() < 0.2


# Riders


def test_a_rider_is_at_the_mean_of_its_deck_where_nothing_else_holds_it() -> None:
    scene = sy.Scene()
    deck = [scene.add(sy.Particle(position=(x, 0.0, 0.0))) for x in (0.0, 1.0, 3.0)]
    load = scene.add(sy.Particle(position=(4.0 / 3.0, 0.0, 0.0), velocity=(0, 2, 1), mass=5.0))
    scene.add(sy.Rider(load, deck))
    world = sy.World(scene, method=small_steps(0.02, 5))
    momentum = world.momentum + 8.0 * 0.2 * np.array([[0.0, -9.81, 0.0]])
    world.step(10)
    x = world.particles.position[0]
    np.testing.assert_allclose(x[3], x[:3].mean(axis=0), rtol=0, atol=1e-13)
    np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-12)


# Substeps


def everything() -> sy.Scene:
    scene = chain()
    a = scene.particles[0]
    lone = scene.add(sy.Particle(position=(3.0, 0.4, 0.0), velocity=(1, -2, 0), damping=0.8))
    scene.add(sy.CableConstraint(lone, (3.0, 2.0, 0.0), 1.8, winch=True, restitution=0.4))
    scene.add(sy.Spring(a, lone, 30.0, 1.0))
    scene.add(sy.Drag(linear=0.2, quadratic=0.1))
    scene.add(sy.Ground(height=-0.3, friction=0.4, restitution=0.3, particles=[lone]))
    sprung = scene.add(sy.Particle(position=(5, 1, 0)))
    scene.add(sy.StiffSpring(sprung, (5, 0, 0), 1e6, 2.0))
    return scene


@pytest.mark.parametrize("written", [False, True])
def test_substeps_are_steps(written: bool) -> None:
    # 1/64 over 4 is exact, so all numbers that follow from the step are the same.
    scene = everything()
    if written:
        scene.add(sy.UserForce(lambda x, v, t: np.sin(5.0 * t)[:, None, None] - 0.1 * v))
    divided = sy.World(scene, method=small_steps(1 / 64, 4))
    plain = sy.World(scene, method=small_steps(1 / 256, 1))
    for world in (divided, plain):
        (cable,) = world.scene.of(sy.CableConstraint)
        world[cable].acceleration = -0.5
    divided.step(40)
    plain.step(160)
    np.testing.assert_array_equal(divided.snapshot().state, plain.snapshot().state)
    assert divided.time[0] == 40 / 64


@sy.kernel
def drive(launch: Any, steps: Any) -> None:
    sy.advance(launch, steps)


def test_kernels_take_substeps_too() -> None:
    called, stepped = (sy.World(everything(), method=small_steps(1 / 60, 7)) for _ in range(2))
    drive(called.launch, 3)
    stepped.step(3)
    np.testing.assert_array_equal(called.snapshot().state, stepped.snapshot().state)


# Refusals


def test_what_it_does_not_work_with() -> None:
    free = sy.Scene()
    free.add(sy.Particle(position=(0, 0, 0)))
    for integrator, scene in (
        (sy.Rattle(), chain()),
        (sy.ExplicitEuler(), free),
        (sy.RungeKutta4(), free),
    ):
        with refused("Xpbd", "SymplecticEuler"):
            sy.World(scene, method=sy.Method(integrator, sy.Xpbd()))
    for settings in ({"substeps": 0}, {"substeps": 1.5}, {"iterations": 0}):
        with refused(next(iter(settings)), "whole number"):
            sy.Method(sy.SymplecticEuler(), sy.Xpbd(**settings))  # type: ignore[arg-type]
