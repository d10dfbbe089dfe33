"""The references of the benchmarks against each other and against published figures."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.references import (
    equilibrium,
    oscillator,
    pendulum,
    pendulum_period,
    projectile,
    projectile_impact,
    rigid_motion,
)
from benchmarks.scenes import bridge, bridge_mass, tumbling_platform

REST_HEIGHTS = [3.154078348949, 2.545803446869, 2.007820144332]
LOADED_HEIGHTS = [
    3.125115103065, 3.159341487003, 2.531096935264, 2.551098014095, 2.000987704247, 2.017464253755,
    2.009398198292, 2.010907372938, 2.559441372551, 2.545686972317, 3.186882661512, 3.150940107271,
]  # fmt: skip


def test_bridge_statics() -> None:
    rest = equilibrium(bridge())
    by_pair = REST_HEIGHTS + REST_HEIGHTS[::-1]
    # The figures have 12 decimals.
    np.testing.assert_allclose(rest.position[:, 1], np.repeat(by_pair, 2), rtol=0, atol=1e-12)
    assert rest.residual < 1e-13


def test_loaded_bridge_statics() -> None:
    rest = equilibrium(bridge(mass=bridge_mass(x=2.0, z=0.0)))
    np.testing.assert_allclose(rest.position[:, 1], LOADED_HEIGHTS, rtol=0, atol=1e-12)
    assert rest.support_tension[4] == pytest.approx(106.603154, abs=1e-6)
    assert (rest.rod_tension < 0.0).all()
    assert (rest.cable_tension > 0.0).all()


def test_bridge_mass_is_shared_bilinearly() -> None:
    np.testing.assert_allclose(
        bridge_mass(x=2.5, z=0.5), [1, 1, 1, 1, 3.5, 3.5, 3.5, 3.5, 1, 1, 1, 1]
    )
    assert bridge_mass(x=5.0, z=1.0)[11] == 11.0
    with pytest.raises(ValueError, match="off the deck"):
        bridge_mass(x=5.1, z=0.0)


def test_rigid_motion_keeps_what_a_free_body_keeps() -> None:
    scene = tumbling_platform()
    position, velocity = rigid_motion(scene, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(position[0], scene.position, rtol=0, atol=1e-14)
    momentum = np.einsum("p,tpi->ti", scene.mass, np.cross(position, velocity))
    energy = 0.5 * np.einsum("p,tpi,tpi->t", scene.mass, velocity, velocity)
    size = float(np.linalg.norm(momentum[0]))
    np.testing.assert_allclose(momentum, momentum[[0, 0, 0]], rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-13)
    alone, _ = rigid_motion(scene, [1.0])
    np.testing.assert_allclose(position[1], alone[0], rtol=0, atol=1e-13)
    for a, b, length in scene.rods:
        distance = np.linalg.norm(position[:, a] - position[:, b], axis=1)
        np.testing.assert_allclose(distance, length, rtol=1e-14)


def test_rigid_motion_is_that_of_particles_held_by_rods() -> None:
    # Without a word of rotation: the rods' forces follow from the particles' own accelerations.
    scene = tumbling_platform()
    ends = np.array([(a, b) for a, b, _ in scene.rods])

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        x, v = state.reshape(2, -1, 3)
        jacobian = np.zeros((len(ends), len(x), 3))
        rows = np.arange(len(ends))
        jacobian[rows, ends[:, 0]] = x[ends[:, 0]] - x[ends[:, 1]]
        jacobian[rows, ends[:, 1]] = x[ends[:, 1]] - x[ends[:, 0]]
        flat = jacobian.reshape(len(ends), -1)
        over_mass = flat / np.repeat(scene.mass, 3)
        centripetal = ((v[ends[:, 0]] - v[ends[:, 1]]) ** 2).sum(axis=1)
        tension = np.linalg.lstsq(flat @ over_mass.T, -centripetal, rcond=1e-9)[0]
        return np.concatenate([v.ravel(), over_mass.T @ tension])

    start = np.concatenate([scene.position.ravel(), scene.velocity.ravel()])
    solution = solve_ivp(rate, (0.0, 2.0), start, method="DOP853", rtol=1e-12, atol=1e-13)
    position, velocity = rigid_motion(scene, [2.0])
    x, v = solution.y[:, -1].reshape(2, -1, 3)
    np.testing.assert_allclose(position[0], x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(velocity[0], v, rtol=0, atol=1e-9)


def test_rigid_motion_refuses_what_is_not_rigid() -> None:
    scene = tumbling_platform()
    with pytest.raises(ValueError, match="deform"):
        rigid_motion(replace(scene, velocity=scene.velocity + np.eye(6, 3)), [1.0])
    with pytest.raises(ValueError, match=r"damping is 0\.9"):
        rigid_motion(replace(scene, damping=0.9), [1.0])


def test_projectile_impact() -> None:
    speed = 40.0 / math.sqrt(2.0)
    time, place = projectile_impact(
        (0.0, 0.0, 0.0), (speed, speed, 0.0), acceleration=(0.0, -9.81, 0.0), damping=0.99
    )
    assert time == pytest.approx(5.7117715712, abs=5e-11)
    position, _ = projectile(
        (0.0, 0.0, 0.0), (speed, speed, 0.0), acceleration=(0, -9.81, 0), damping=0.99, time=time
    )
    # The time is rounded to double, and the height changes by some 28 m/s.
    np.testing.assert_allclose(position, place, rtol=0, atol=3e-14)


def test_projectile_against_its_differential_equation() -> None:
    start = np.array([0.0, 1.5, 0.0, 0.0, 30.0, 40.0])
    acceleration = np.array([0.0, -20.0, 0.0])
    solution = solve_ivp(
        lambda _, s: np.concatenate([s[3:], acceleration + math.log(0.9) * s[3:]]),
        (0.0, 3.0),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    position, velocity = projectile(
        start[:3], start[3:], acceleration=acceleration, damping=0.9, time=3.0
    )
    np.testing.assert_allclose(np.r_[position, velocity], solution.y[:, -1], rtol=0, atol=1e-11)


def test_projectile_without_damping_is_a_parabola() -> None:
    position, velocity = projectile(
        (0, 0, 0), (1, 2, 3), acceleration=(0, -8, 0), damping=1, time=2
    )
    np.testing.assert_array_equal(position, [2.0, -12.0, 6.0])
    np.testing.assert_array_equal(velocity, [1.0, -14.0, 3.0])


@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 10.0])
def test_oscillator_against_its_differential_equation(ratio: float) -> None:
    mass, stiffness = 2.0, 50.0
    damping = 2.0 * ratio * math.sqrt(stiffness * mass)
    solution = solve_ivp(
        lambda _, s: [s[1], -(stiffness * s[0] + damping * s[1]) / mass],
        (0.0, 1.5),
        [0.3, -1.0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    state = oscillator(0.3, -1.0, stiffness=stiffness, damping=damping, mass=mass, time=1.5)
    np.testing.assert_allclose(state, solution.y[:, -1], rtol=0, atol=2e-12)


@pytest.mark.parametrize("stiffness", [1.0, 1e5, 1e10])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 10.0])
def test_oscillator_composes(stiffness: float, ratio: float) -> None:
    # Two steps are one of twice the time, at stiffnesses that no time stepping could follow.
    damping = 2.0 * ratio * math.sqrt(stiffness)
    frequency = math.sqrt(stiffness)
    half = oscillator(1.0, 0.5, stiffness=stiffness, damping=damping, mass=1.0, time=1 / 128)
    once = oscillator(*half, stiffness=stiffness, damping=damping, mass=1.0, time=1 / 128)
    whole = oscillator(1.0, 0.5, stiffness=stiffness, damping=damping, mass=1.0, time=1 / 64)
    # Rounding of the state in the middle.
    np.testing.assert_allclose(once[0], whole[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(once[1], whole[1], rtol=0, atol=1e-15 * frequency)


def test_pendulum_against_its_differential_equation() -> None:
    length = 1.3
    time = np.linspace(0.0, 5.0, 11)
    solution = solve_ivp(
        lambda _, s: [s[1], -9.81 / length * math.sin(s[0])],
        (0.0, 5.0),
        [0.5 * math.pi, 0.0],
        method="DOP853",
        t_eval=time,
        rtol=1e-13,
        atol=1e-13,
    )
    angle, rate = pendulum(time, length=length)
    np.testing.assert_allclose(angle, solution.y[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(rate, solution.y[1], rtol=0, atol=1e-10)


def test_pendulum_period() -> None:
    period = pendulum_period(0.5 * math.pi, length=1.0)
    angle, rate = pendulum([0.25 * period, period], length=1.0)
    np.testing.assert_allclose(angle, [0.0, 0.5 * math.pi], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rate, [-math.sqrt(2.0 * 9.81), 0.0], rtol=0, atol=1e-13)
