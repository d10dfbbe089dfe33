"""Ballistic's flight: closed form, errors of the methods, and hits on the swept path."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import steelyard as sy
from steelyard_envs import ballistic_flight as flight
from steelyard_envs import ballistic_kernels as kernels
from steelyard_envs.ballistic import DAMPING, BallisticTask
from tests.envs.ballistic_worlds import (
    AIM,
    DT,
    FIRE,
    GRAVITY,
    HOLD,
    SPEED,
    begun,
    fire_and_wait,
    flown,
    lay,
    put_target,
)

# The flight


@pytest.mark.parametrize("control_rate", [50, 10])
def test_wind_and_drag_in_closed_form(control_rate):
    task = begun(control_rate=control_rate)
    lay(task, **AIM)
    put_target(task, (0.0, 5.0, -50.0))
    for k in range(2 * control_rate):
        task.step(HOLD if k else FIRE)
        place = task.world.particles.position[0, 0]
        np.testing.assert_allclose(place, flown((k + 1) / control_rate, **AIM), rtol=0, atol=1e-12)


def test_drag_is_relative_to_the_air():
    """Against the equation of motion itself, integrated to 1e-12."""
    wind, drag = np.array([-7.0, 0.0, 9.0]), -math.log(DAMPING)

    def motion(_, y):
        return [*y[3:], *(np.array([0.0, GRAVITY, 0.0]) - drag * (y[3:] - wind))]

    start = SPEED * np.array(
        [math.cos(0.6) * math.sin(0.3), math.sin(0.6), math.cos(0.6) * math.cos(0.3)]
    )
    wanted = solve_ivp(
        motion, (0.0, 2.0), [0.0, 1.5, 0.0, *start], method="DOP853", rtol=1e-12, atol=1e-12
    ).y[:, -1]
    task = begun()
    lay(task, **AIM)
    put_target(task, (0.0, 5.0, -50.0))
    fire_and_wait(task, 100)
    particles = task.world.particles
    np.testing.assert_allclose(particles.position[0, 0], wanted[:3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(particles.velocity[0, 0], wanted[3:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("damping", [0.5, 0.8, 0.99, 1.0])
def test_lands_where_flight_impact_says(damping):
    task = begun(damping=damping)
    lay(task, **AIM)
    put_target(task, (0.0, 5.0, -50.0))
    events = fire_and_wait(task)
    drag = -math.log(damping)
    velocity = flown(1.0, azimuth=0.3, elevation=0.6, wind=(0, 0), damping=1 - 1e-16, gravity=0)
    time, place = sy.flight_impact(
        [0.0, 1.5, 0.0], velocity - [0.0, 1.5, 0.0],
        acceleration=(drag * -7.0, GRAVITY, drag * 9.0), damping=damping,
    )  # fmt: skip
    assert np.flatnonzero(events[:, 0]) == [math.floor(time / DT)]
    np.testing.assert_allclose(task.flight[flight.MARK : flight.MARK + 3, 0], place, atol=2e-12)


@pytest.mark.parametrize(
    ("method", "rate", "wanted"),
    [
        ("closed_form", 50, 0.0),
        ("rattle", 50, 7.1e-4),
        ("rattle", 200, 4.4e-5),
        ("source", 50, 0.64),
        ("source", 200, 0.16),
    ],
)
def test_measured_error_of_methods(method, rate, wanted):
    """The figures of the docstring: greatest error of a shot's place in 2.5 s of flight."""
    task = begun(method=method, physics_rate=rate)
    lay(task, **AIM)
    put_target(task, (0.0, 5.0, -50.0))
    worst = 0.0
    for k in range(125):
        task.step(HOLD if k else FIRE)
        error = task.world.particles.position[0, 0] - flown((k + 1) * DT, **AIM)
        worst = max(worst, float(np.linalg.norm(error)))
    print(f"{method} at {rate} Hz: {worst:.2e} m")
    assert worst == pytest.approx(wanted, rel=0.02, abs=1e-12)


@pytest.mark.parametrize("method", BallisticTask.methods)
def test_a_parked_shot_stays_where_it_is(method):
    task = begun(5, method=method)
    lay(task, wind=(3.0, 8.0))
    for _ in range(50):
        task.step(np.repeat(HOLD, 5, axis=0))
    assert (task.world.particles.position == [0.0, 1.5, 0.0]).all()
    assert (task.world.particles.velocity == 0.0).all()
    assert (task.observations[:, 11:19] == 0.0).all()


# Hits


def test_a_fast_shot_cannot_pass_through_a_small_target():
    """100 m/s is 2 m a step; a target of 4 cm lies anywhere between two steps."""
    task = begun(41, shot="laser", damping=1.0)
    lay(task)
    depth = 40.0 + np.linspace(0.0, 2.0, 41)
    put_target(task, (0.0, 1.5, 0.0), radius=0.02)
    task.flight[flight.TARGET + 2, :41] = depth
    events = fire_and_wait(task, 30)
    assert (events.max(axis=0) == flight.HIT).all()
    steps = 2.0 * np.arange(31)
    assert (np.abs(depth[:, None] - steps).min(axis=1) > 0.02).sum() == 39
    # The shot stops on the surface.
    np.testing.assert_allclose(task.flight[flight.MARK + 2, :41], depth - 0.02, atol=1e-12)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("share", "event"), [(1.0 - 1e-9, flight.HIT), (1.0 + 1e-9, flight.MISSED)]
)
def test_grazing(share, event, side):
    """A straight shot past a target: what counts is the radius, to nine digits."""
    task = begun(shot="laser", damping=1.0)
    lay(task)
    put_target(task, (side * share * 0.1, 1.5, 51.234), radius=0.1)
    events = fire_and_wait(task)
    assert events.max() == event
    assert task.flight[flight.CLOSEST, 0] == pytest.approx((share * 0.1) ** 2, rel=1e-12)


def random_meetings(worlds):
    """Shots and weaving targets that nearly meet at a random time of the flight."""
    random = np.random.default_rng(5)
    task = begun(worlds, seed=9, difficulty=3)
    radius = task.settings[kernels.RADIUS]
    cases = []
    for w in range(worlds):
        aim = {
            "azimuth": random.uniform(-0.6, 0.6), "elevation": random.uniform(0.1, 0.9),
            "wind": random.uniform(-10.0, 10.0, 2),
        }  # fmt: skip
        down = brentq(lambda t, aim=aim: flown(t, **aim)[1], 0.1, 10.0, xtol=1e-15)
        meet = down * random.uniform(0.6, 1.0)
        offset = random.normal(size=3)
        offset *= random.uniform(0.0, 1.5) * radius / np.linalg.norm(offset)
        travel, weave = random.uniform(-9.0, 9.0, 2), random.uniform(-2.0, 2.0, 2)
        angle, rate = random.uniform(0.0, 6.0), task.settings[kernels.WEAVE_RATE]
        centre = flown(meet, **aim) + offset
        start = centre - [1, 0, 1] * np.array([travel[0], 0.0, travel[1]]) * meet
        start -= np.array([weave[0], 0.0, weave[1]]) * math.sin(angle + rate * meet)
        cases.append((aim, down, start, travel, weave, angle))
        task.values[[kernels.AZIMUTH, kernels.ELEVATION], w] = aim["azimuth"], aim["elevation"]
        task.values[[kernels.WIND_X, kernels.WIND_Z], w] = aim["wind"]
        rows = slice(flight.TARGET, flight.ANGLE + 1)
        task.flight[rows, w] = [*start, *travel, *weave, angle]
    return task, cases


def test_hits_against_a_dense_search():
    """Closest approach and first touch of 200 meetings, by sampling at 0.1 ms and refining."""
    task, cases = random_meetings(200)
    radius, rate = task.settings[kernels.RADIUS], task.settings[kernels.WEAVE_RATE]
    events = fire_and_wait(task).max(axis=0)
    hits = 0
    for w, (aim, down, start, travel, weave, angle) in enumerate(cases):

        def centre(t, start=start, travel=travel, weave=weave, angle=angle):
            t = np.asarray(t)[..., None]
            way = travel * t + weave * np.sin(angle + rate * t)
            return start + way[..., [0, 0, 1]] * [1.0, 0.0, 1.0]

        def distance(t, aim=aim, centre=centre):
            return np.linalg.norm(flown(t, **aim) - centre(t), axis=-1)

        times = np.append(np.arange(0.0, down, 1e-4), down)
        sampled = distance(times)
        k = int(sampled.argmin())
        around = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
        found = minimize_scalar(distance, bounds=around, method="bounded", options={"xatol": 1e-12})
        least = min(found.fun, sampled[k])
        assert (events[w] == flight.HIT) == (least <= radius)
        if least > radius:
            assert math.sqrt(task.flight[flight.CLOSEST, w]) == pytest.approx(least, abs=1e-9)
            assert np.linalg.norm(task.flight[flight.MISS : flight.MISS + 3, w]) == pytest.approx(
                least, abs=1e-9
            )
            mark = down
        else:
            hits += 1
            first = int((sampled <= radius).argmax()) if (sampled <= radius).any() else k
            mark = brentq(
                lambda t: distance(t) - radius, times[first - 1], times[first], xtol=1e-14
            )
        wanted = flown(mark, **aim)
        np.testing.assert_allclose(task.flight[flight.MARK : flight.MARK + 3, w], wanted, atol=1e-9)
    assert 60 < hits < 180


def test_no_hit_below_the_ground():
    """A shot that comes down just ahead of a target half in the ground does not reach it."""
    task = begun(shot="laser", damping=1.0)
    down = 1.5 / math.tan(0.1)
    lay(task, elevation=-0.1)
    put_target(task, (0.0, -0.1, down + 0.6), radius=0.5)
    events = fire_and_wait(task, 30)
    assert events.max() == flight.MISSED
    np.testing.assert_allclose(
        task.flight[flight.MARK : flight.MARK + 3, 0], [0, 0, down], atol=1e-12
    )
    np.testing.assert_allclose(task.observations[0, 19:22], [-0.6, 0.0, 0.1], atol=1e-6)
