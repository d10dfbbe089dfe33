"""Impacts inside a step: the cubic through its ends, and flight under quadratic drag to 1e-8 m at 60 Hz."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steelyard as sy

Array = np.ndarray

SPEED = 40.0 * math.sqrt(0.5)


def drag_world(integrator: Any, dt: float, *, quadratic: float = 0.01) -> sy.World:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 0, 0), velocity=(SPEED, SPEED, 0)))
    scene.add(sy.Drag(quadratic=quadratic))
    return sy.World(scene, method=sy.Method(integrator, dt=dt))


def fly(world: sy.World) -> tuple[float, Array]:
    """Time and place of the impact."""
    dt = world.method.dt
    world.step(1)
    for step in range(1, 100_000):
        x, v = world.particles.position.copy(), world.particles.velocity.copy()
        world.step(1)
        time, place = sy.step_impact(
            x, v, world.particles.position, world.particles.velocity, dt=dt
        )
        if math.isfinite(time[0, 0]):
            return step * dt + float(time[0, 0]), place[0, 0]
    raise AssertionError("never lands")


@pytest.fixture(scope="module")
def impact() -> tuple[float, float]:
    """Time and x of the impact of 40 m/s at 45 degrees with drag of .01/m."""

    def rate(t: float, y: Array) -> list[float]:
        speed = math.hypot(y[2], y[3])
        return [y[2], y[3], -0.01 * speed * y[2], -9.81 - 0.01 * speed * y[3]]

    def low(t: float, y: Array) -> float:
        return y[1] if t > 1.0 else 1.0

    low.terminal = True  # type: ignore[attr-defined]
    start = [0.0, 0.0, SPEED, SPEED]
    # The root is refined below, as the solver's own stops at its dense output.
    run = solve_ivp(rate, (0, 10), start, "DOP853", rtol=1e-13, atol=1e-13, events=low)
    time, state = run.t[-1], run.y[:, -1]
    for _ in range(3):
        state = solve_ivp(rate, (0, time), start, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        time -= state[1] / state[3]
    return time, state[0]


@pytest.mark.parametrize("integrator", [sy.RungeKutta4(), sy.ExponentialRungeKutta()], ids=str)
def test_quadratic_drag_lands_within_1e_8_at_60_hz(
    integrator: Any, impact: tuple[float, float]
) -> None:
    time, place = fly(drag_world(integrator, 1.0 / 60.0))
    assert impact[1] == pytest.approx(78.146996, abs=1e-6)
    assert place[0] == pytest.approx(impact[1], abs=1e-8)
    assert time == pytest.approx(impact[0], abs=1e-8)
    assert abs(place[1]) < 1e-12
    # Seen to fail: a drag off by 1e-9 of itself is caught.
    _, other = fly(drag_world(integrator, 1.0 / 60.0, quadratic=0.01 * (1 + 1e-9)))
    assert abs(other[0] - place[0]) > 1e-8


def test_the_impact_is_of_order_4(impact: tuple[float, float]) -> None:
    counts = np.array([10, 20, 40, 80])
    errors = [abs(fly(drag_world(sy.RungeKutta4(), 1.0 / n))[1][0] - impact[1]) for n in counts]
    # The place in the last step is arbitrary, and with it what the cubic adds.
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope > 3.5, errors


def test_a_cubic_path_is_met_exactly() -> None:
    # y = (t - .3) (t - 2) (t + 1) falls through 0 at .3.
    def height(t: float) -> tuple[float, float]:
        y = (t - 0.3) * (t - 2.0) * (t + 1.0)
        return y, (t - 2.0) * (t + 1.0) + (t - 0.3) * (2.0 * t - 1.0)

    (y0, v0), (y1, v1) = height(0.0), height(1.0)
    assert sy.hermite_fall_time(y0, v0, y1, v1, 1.0) == pytest.approx(0.3, abs=1e-15)
    assert sy.hermite(y0, v0, y1, v1, 1.0, 0.5) == pytest.approx(height(0.5), abs=1e-15)


def test_times_and_places_of_many() -> None:
    before = np.array([[[0, 1, 0], [0, 1, 0]], [[0, -1, 0], [0, 0.5, 2]]], dtype=float)
    speed = np.zeros((2, 2, 3))
    speed[..., 1] = -1.0
    after = before + 2.0 * speed
    time, place = sy.step_impact(before, speed, after, speed, dt=2.0, height=0.25)
    assert time.shape == (2, 2)
    np.testing.assert_allclose(time[0], 0.75, atol=1e-15)
    assert np.isinf(time[1, 0])
    assert np.isnan(place[1, 0]).all()
    np.testing.assert_allclose(place[0, 0], (0, 0.25, 0), atol=1e-15)


def test_what_it_refuses() -> None:
    x = np.zeros((2, 3))
    with pytest.raises(ValueError, match="dt"):
        sy.step_impact(x, x, x, x, dt=0.0)
    with pytest.raises(ValueError, match=r"shape \(\.\.\., 3\)"):
        sy.step_impact(x, x, x[:1], x, dt=1.0)
    with pytest.raises(ValueError, match=r"shape \(\.\.\., 3\)"):
        sy.step_impact(x[:, :2], x[:, :2], x[:, :2], x[:, :2], dt=1.0)
