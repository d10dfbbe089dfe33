"""Closed-form flight and its impact against 60-digit references."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import projectile, projectile_impact
from tests.engine.refusals import refused

Array = np.ndarray

# Drag that rounding hardly knows of, the scenes' own values, and drag that stops a shot at once.
DAMPING = [1.0 - 1e-15, 1.0 - 1e-9, 0.9999, 0.99, 0.9, 0.5, 1e-3, 1e-12]
SHOT = np.array([3.0, 28.0, -1.0])
PULL = np.array([0.5, -9.81, 0.25])


def flying(*, damping: float, dt: float) -> sy.World:
    scene = sy.Scene()
    scene.add(
        sy.Particle(position=(1, 2, 3), velocity=SHOT, acceleration=PULL, damping=damping, mass=4.0)
    )
    return sy.World(scene, method=sy.Method(sy.ClosedForm(), dt=dt))


# The integrator


@pytest.mark.parametrize("damping", [1.0, *DAMPING])
@pytest.mark.parametrize(("steps", "dt"), [(1, 5.0), (300, 1.0 / 60.0), (2, 1e-4)])
def test_flight_is_the_closed_form(damping: float, steps: int, dt: float) -> None:
    world = flying(damping=damping, dt=dt)
    world.step(steps)
    place, speed = projectile((1, 2, 3), SHOT, acceleration=PULL, damping=damping, time=steps * dt)
    # Sums of up to 300 parts of at most 140 m and 30 m/s; steps x dt rounds once.
    np.testing.assert_allclose(world.particles.position[0, 0], place, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(world.particles.velocity[0, 0], speed, rtol=1e-12, atol=1e-12)


def test_flight_with_other_values_in_every_world() -> None:
    world = flying(damping=0.99, dt=0.5)
    scene = world.scene
    world = sy.World(scene, worlds=3, method=world.method)
    damping = np.array([1.0, 0.9, 0.2])
    world.particles.damping = damping[:, None]
    world.particles.position[:, 0, 1] = (0.0, 10.0, 20.0)
    world.step(4)
    for w, share in enumerate(damping.tolist()):
        place, speed = projectile(
            (1, 10.0 * w, 3), SHOT, acceleration=PULL, damping=share, time=2.0
        )
        np.testing.assert_allclose(world.particles.position[w, 0], place, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(world.particles.velocity[w, 0], speed, rtol=1e-14, atol=1e-14)


def test_only_movable_particles_fly() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(1, 2, 3), inverse_mass=0.0, damping=0.5))
    scene.add(sy.Particle(position=(0, 0, 0)))
    world = sy.World(scene, method=sy.Method(sy.ClosedForm(), dt=1.0))
    world.step(2)
    np.testing.assert_array_equal(world.particles.position[0, 0], (1, 2, 3))
    np.testing.assert_allclose(world.particles.position[0, 1], (0, -2 * 9.81, 0), rtol=1e-15)


@pytest.mark.parametrize(
    ("velocity", "pull", "damping", "time", "z"),
    [
        ((0, 0, 35), -1.0, 0.99, 1.75, 60.7),
        ((0, 30, 40), -20.0, 0.99, 3.07, 120.8),
        ((0, 0, 10), 0.6, 0.9, 5.02, 39.0),
    ],
    ids=["pistol", "artillery", "fireball"],
)
def test_the_shots_of_the_ballistic_scene(
    velocity: Any, pull: float, damping: float, time: float, z: float
) -> None:
    # The source's own figures, for its own integrator at 60 Hz: a step is .6 m of flight.
    scene = sy.Scene()
    scene.add(
        sy.Particle(
            position=(0, 1.5, 0), velocity=velocity, acceleration=(0, pull, 0), damping=damping
        )
    )
    world = sy.World(scene, method=sy.Method(sy.ClosedForm(), dt=time))
    world.step(1)
    assert world.particles.position[0, 0, 2] == pytest.approx(z, abs=1.0)


# The impact


def impact(
    *, height: float, rise: float, pull: float = -9.81, damping: float = 1.0
) -> tuple[float, Array]:
    """Impact of a particle that starts at (0, height, 0) with velocity (3, rise, -1)."""
    time, place = sy.flight_impact(
        np.array([0.0, height, 0.0]),
        np.array([3.0, rise, -1.0]),
        acceleration=(0.5, pull, 0.25),
        damping=damping,
    )
    return float(time), place


def test_the_projectile_of_the_catalogue() -> None:
    speed = 40.0 * math.sqrt(0.5)
    time, place = sy.flight_impact((0, 0, 0), (speed, speed, 0), damping=0.99)
    assert float(time) == pytest.approx(5.7117715712, abs=5e-11)
    exact, there = projectile_impact(
        (0, 0, 0), (speed, speed, 0), acceleration=(0, -9.81, 0), damping=0.99
    )
    assert float(time) == pytest.approx(exact, rel=1e-12)
    np.testing.assert_allclose(place, there, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("damping", DAMPING)
def test_impact_is_lambert_w(damping: float) -> None:
    # Speeds of 1000 m/s downwards are far beyond the terminal speed g/c for d of .9 and less.
    heights = [0.0, 1e-6, 1.5, 300.0]
    rises = [1e-3, 28.0, 1000.0, 0.0, -1e-3, -5.0, -1000.0]
    for height, rise, pull in itertools.product(heights, rises, [-9.81, -0.01, -200.0]):
        if height == 0.0 and rise <= 0.0:
            continue
        time, place = impact(height=height, rise=rise, pull=pull, damping=damping)
        exact, there = projectile_impact(
            (0, height, 0), (3, rise, -1), acceleration=(0.5, pull, 0.25), damping=damping
        )
        case = f"height {height}, rise {rise}, pull {pull}"
        assert time == pytest.approx(exact, rel=1e-12), case
        # The place is a sum of start, speed x time and pull x time^2, which may cancel.
        parts = np.array([3.0, abs(rise), 1.0]) * exact + np.array([0.5, -pull, 0.25]) * exact**2
        parts[1] += height
        assert (np.abs(place - there) <= 1e-12 * parts).all(), case


@pytest.mark.parametrize("rise", [28.0, 0.0, -5.0])
def test_impact_without_drag_is_the_root_of_a_parabola(rise: float) -> None:
    time, place = impact(height=1.5, rise=rise)
    exact = (rise + math.sqrt(rise**2 + 2 * 9.81 * 1.5)) / 9.81
    assert time == pytest.approx(exact, rel=1e-14)
    there = (3 * exact + 0.25 * exact**2, 0.0, -exact + 0.125 * exact**2)
    np.testing.assert_allclose(place, there, rtol=1e-13, atol=1e-13)


def test_the_faintest_drag_is_no_drag() -> None:
    faint = impact(height=1.5, rise=28.0, damping=1.0 - 1.2e-16)
    none = impact(height=1.5, rise=28.0)
    assert faint[0] == pytest.approx(none[0], rel=1e-14)
    np.testing.assert_allclose(faint[1], none[1], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("damping", [1.0, 0.99, 0.5])
def test_a_world_stepped_to_the_impact_is_there(damping: float) -> None:
    time, place = sy.flight_impact((1, 2, 3), SHOT, acceleration=PULL, damping=damping, height=-1.5)
    world = flying(damping=damping, dt=float(time))
    world.step(1)
    np.testing.assert_allclose(world.particles.position[0, 0], place, rtol=1e-12, atol=1e-12)
    assert place[1] == pytest.approx(-1.5, abs=1e-12)


def test_a_particle_on_the_level_falls_through_at_once_or_after_its_flight() -> None:
    assert impact(height=0.0, rise=0.0)[0] == 0.0
    assert impact(height=0.0, rise=-5.0)[0] == 0.0
    assert impact(height=0.0, rise=5.0)[0] == pytest.approx(10.0 / 9.81, rel=1e-14)


@pytest.mark.parametrize("damping", [1.0, 0.9])
def test_a_particle_that_starts_below_and_rises_through_the_level_falls_through_it_later(
    damping: float,
) -> None:
    time, place = impact(height=-1.0, rise=10.0, damping=damping)
    if damping == 1.0:
        assert time == pytest.approx((10.0 + math.sqrt(100.0 - 2 * 9.81)) / 9.81, rel=1e-13)
    there, speed = projectile(
        (0, -1, 0), (3, 10, -1), acceleration=(0.5, -9.81, 0.25), damping=damping, time=time
    )
    assert speed[1] < 0.0
    np.testing.assert_allclose(place, there, rtol=1e-12, atol=1e-12)
    assert place[1] == pytest.approx(0.0, abs=1e-12)


# Without gravity a particle covers v/c in all: here with what share of that left at the level.
LEFT = [0.9, 0.5, 0.1, 1e-3, 1e-6, 1e-9]


@pytest.mark.parametrize("damping", [0.99, 0.9, 0.5, 0.01, 1e-6])
@pytest.mark.parametrize("left", LEFT)
def test_impact_without_gravity(left: float, damping: float) -> None:
    # h = v (1 - e^(-ct)) / c.
    c = -math.log(damping)
    rise = -10.0
    height = (1.0 - left) * -rise / c
    time, place = impact(height=height, rise=rise, pull=0.0, damping=damping)
    # The height's rounding, 1e-16 of it, is 1e-16 / left of the speed that is left.
    assert time == pytest.approx(-math.log(left) / c, rel=1e-12 + 1e-15 / left)
    assert place[1] == pytest.approx(0.0, abs=1e-12 * height)


def test_impact_without_gravity_and_drag() -> None:
    assert impact(height=2.0, rise=-10.0, pull=0.0)[0] == pytest.approx(0.2, rel=1e-15)


@pytest.mark.parametrize("damping", [1.0, 0.9, 0.1])
def test_thrown_down_against_an_upward_acceleration(damping: float) -> None:
    # A fireball of the ballistic scene, which floats up, thrown at the ground.
    time, place = impact(height=1.0, rise=-10.0, pull=0.6, damping=damping)
    assert math.isfinite(time)
    there, speed = projectile(
        (0, 1, 0), (3, -10, -1), acceleration=(0.5, 0.6, 0.25), damping=damping, time=time
    )
    assert speed[1] < 0.0
    np.testing.assert_allclose(place, there, rtol=1e-12, atol=1e-12)
    assert place[1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "flight",
    [
        {"height": 1.0, "rise": 0.0, "pull": 0.0},
        {"height": 1.0, "rise": 5.0, "pull": 0.0, "damping": 0.9},
        {"height": 1.0, "rise": 5.0, "pull": 0.6},
        {"height": 0.0, "rise": 5.0, "pull": 0.6, "damping": 0.9},
        # It turns .083 m and .08 m above the level.
        {"height": 0.5, "rise": -1.0, "pull": 1.2},
        {"height": 0.5, "rise": -1.0, "pull": 1.2, "damping": 0.9},
        # It stops at v/c = 9.49 m, short of the level.
        {"height": 9.6, "rise": -1.0, "pull": 0.0, "damping": 0.9},
    ],
)
def test_never(flight: dict[str, float]) -> None:
    time, place = impact(**flight)
    assert time == math.inf
    assert np.isnan(place).all()


# Batches


def test_shapes_broadcast_and_every_entry_is_its_own() -> None:
    rng = np.random.default_rng(5)
    position = rng.uniform(0.5, 5.0, (4, 1, 3))
    velocity = rng.uniform(-20.0, 20.0, (5, 3))
    time, place = sy.flight_impact(position, velocity, damping=0.9)
    assert time.shape == (4, 5)
    assert place.shape == (4, 5, 3)
    for i, j in itertools.product(range(4), range(5)):
        alone, there = sy.flight_impact(position[i, 0], velocity[j], damping=0.9)
        assert alone.shape == ()
        np.testing.assert_array_equal(time[i, j], alone)
        np.testing.assert_array_equal(place[i, j], there)


def test_an_empty_batch() -> None:
    time, place = sy.flight_impact(np.zeros((0, 3)), np.zeros((0, 3)))
    assert time.shape == (0,)
    assert place.shape == (0, 3)


def test_one_that_never_falls_leaves_the_others() -> None:
    time, place = sy.flight_impact(
        (0, 1, 0), [(0, -1, 0), (0, 1, 0), (0, -2, 0)], acceleration=(0, 0, 0)
    )
    np.testing.assert_allclose(time, [1.0, math.inf, 0.5], rtol=1e-15)
    assert np.isnan(place[1]).all()
    np.testing.assert_allclose(place[[0, 2]], 0.0, rtol=0, atol=1e-15)


def test_inputs_are_left_as_they_are() -> None:
    position, velocity = np.array([[0.0, 1.0, 0.0]]), np.array([[1.0, 2.0, 3.0]])
    sy.flight_impact(position, velocity)
    np.testing.assert_array_equal(position, [[0.0, 1.0, 0.0]])
    np.testing.assert_array_equal(velocity, [[1.0, 2.0, 3.0]])


# Refusals


@pytest.mark.parametrize(
    "settings",
    [
        {"damping": 0.0},
        {"damping": 1.1},
        {"damping": math.nan},
        {"damping": np.array([0.9, 0.8])},
        {"height": math.nan},
        {"height": math.inf},
        {"acceleration": (0.0, math.nan, 0.0)},
        {"acceleration": (0.0, -9.81)},
        {"acceleration": -9.81},
    ],
    ids=str,
)
def test_a_flight_that_cannot_be(settings: dict[str, Any]) -> None:
    with refused("flight_impact", *settings):
        sy.flight_impact((0, 0, 0), (1, 1, 0), **settings)


@pytest.mark.parametrize(
    ("position", "velocity"),
    [((1, 2), (1, 2)), (1.0, 1.0), (np.zeros((2, 3)), np.zeros((3, 3))), ("abc", (1, 2, 3))],
    ids=lambda value: str(np.shape(value)),
)
def test_a_flight_of_the_wrong_shape(position: Any, velocity: Any) -> None:
    with refused("flight_impact", "position", "velocity", "(..., 3)"):
        sy.flight_impact(position, velocity)


def test_a_world_that_has_broken_down_has_no_impact() -> None:
    # NaN in, NaN out: one broken world of a batch must not stop the others.
    time, place = sy.flight_impact(
        [(0, 1, 0), (0, math.nan, 0), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, math.nan, 0)]
    )
    assert np.isnan(time).tolist() == [False, True, True]
    assert np.isnan(place[1:]).all()
    assert time[0] == pytest.approx(math.sqrt(2 / 9.81), rel=1e-14)
