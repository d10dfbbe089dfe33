"""Ballistic's rules: the gun, what is seen, how an episode ends, what it takes, what it looks like."""

import math

import gymnasium as gym
import numpy as np
import pytest

import steelyard as sy
from steelyard_agents.controllers.ballistic import BallisticController
from steelyard_envs import ballistic_flight as flight
from steelyard_envs import ballistic_kernels as kernels
from steelyard_envs.ballistic import DAMPING, BallisticTask
from steelyard_envs.rendering import Camera, Renderer
from steelyard_envs.rendering.camera import View
from steelyard_envs.task import SUCCESS, TERMINATED, TRUNCATED
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

ID = "steelyard/Ballistic-v0"


# The gun


def test_rates_are_limited_and_the_barrel_stops():
    task = begun(3)
    lay(task)
    commands = np.array([[9.0, -9.0, -1], [-0.5, 0.5, -1], [np.nan, np.nan, np.nan]], np.float32)
    task.step(commands)
    np.testing.assert_allclose(task.observations[:, 0], [DT, -0.5 * DT, 0.0], rtol=1e-6)
    np.testing.assert_allclose(task.observations[:, 1], [-0.5 * DT, 0.25 * DT, 0.0], rtol=1e-6)
    assert (task.observations[:, 3] == 6).all()
    for _ in range(400):
        task.step(commands)
    assert task.values[kernels.AZIMUTH, 0] == kernels.AZIMUTH_MOST
    assert task.values[kernels.AZIMUTH, 1] == -kernels.AZIMUTH_MOST
    assert task.values[kernels.ELEVATION, 0] == kernels.ELEVATION_LEAST
    assert task.values[kernels.ELEVATION, 1] == kernels.ELEVATION_MOST


def test_a_shot_follows_the_aim_that_was_observed():
    task = begun(damping=1.0)
    lay(task, azimuth=0.25, elevation=0.5)
    put_target(task, (0.0, 5.0, -50.0))
    task.step(np.array([[1, 1, 1]], np.float32))
    x, y, z = task.world.particles.position[0, 0]
    assert math.atan2(x, z) == pytest.approx(0.25, abs=1e-12)
    assert math.atan2(y - 1.5 - 0.5 * GRAVITY * DT**2, math.hypot(x, z)) == pytest.approx(0.5)


@pytest.mark.parametrize(("elevation", "flies"), [(-0.25, 0.12), (0.45, 2.2)])
def test_reload(elevation, flies):
    """A shot per second, and none while one flies; six of them."""
    task = begun()
    put_target(task, (0.0, 5.0, -50.0))
    fired = []
    for k in range(900):
        lay(task, elevation=elevation)
        before = task.observations[0].copy()
        task.step(FIRE)
        if task.observations[0, 3] < before[3]:
            fired.append(k)
            assert before[2] == 0.0 and before[11] == 0.0
            assert task.observations[0, 2] == pytest.approx(1.0 - DT)
            assert task.observations[0, 18] == pytest.approx(DT)
    gaps = np.diff(fired)
    down = sy.flight_impact(
        [0.0, 1.5, 0.0], [0.0, SPEED * math.sin(elevation), 0.0],
        acceleration=(0.0, GRAVITY, 0.0), damping=DAMPING,
    )[0]  # fmt: skip
    assert down == pytest.approx(flies, abs=0.1)
    assert (gaps == max(50, math.ceil(down / DT))).all() and len(gaps) == 5


@pytest.mark.parametrize(("shot", "steps"), [("fireball", 250), ("laser", 100 + 33)])
def test_shots_end_after_five_seconds_or_two_hundred_metres(shot, steps):
    task = begun(shot=shot)
    lay(task, elevation=0.3)
    put_target(task, (0.0, 5.0, -50.0))
    events = fire_and_wait(task)
    assert events.max() == flight.MISSED
    if shot == "laser":
        track = [flown(k * DT, azimuth=0, elevation=0.3, wind=(0, 0), speed=100, gravity=0)
                 for k in range(251)]  # fmt: skip
        steps = int(np.argmax([math.hypot(x, z) > 200.0 for x, _, z in track]))
    assert np.flatnonzero(events[:, 0]) == [steps - 1]


# What is seen


def test_the_miss_is_in_range_and_across():
    """Short: where it comes down. Wide: where it passes. Across grows with azimuth."""
    bearing = 0.4
    centre = 60.0 * math.sin(bearing), 2.0, 60.0 * math.cos(bearing)
    task = begun(damping=1.0)
    lay(task, azimuth=bearing)
    put_target(task, centre)
    fire_and_wait(task)
    short = SPEED * math.sqrt(2 * 1.5 / -GRAVITY)
    np.testing.assert_allclose(task.observations[0, 19:22], [short - 60.0, 0.0, -2.0], atol=1e-5)
    task = begun(shot="laser", damping=1.0)
    lay(task, azimuth=bearing + 0.1)
    put_target(task, centre)
    fire_and_wait(task)
    wide = [-60.0 * math.sin(0.1) ** 2, 60.0 * math.sin(0.1) * math.cos(0.1), -0.5]
    np.testing.assert_allclose(task.observations[0, 19:22], wide, atol=1e-5)


def test_what_is_seen_of_a_flight():
    task = begun(difficulty=2, seed=4)
    lay(task, **AIM)
    fire_and_wait(task, 30)
    azimuth, _, _, _, reach, bearing, height = task.observations[0, :7].astype(float)
    sight = azimuth + bearing
    along = np.array([math.sin(sight), 0.0, math.cos(sight)])
    across = np.array([math.cos(sight), 0.0, -math.sin(sight)])
    axes = np.array([along, across, [0.0, 1.0, 0.0]])
    centre = reach * along + [0.0, height, 0.0]
    particles = task.world.particles
    wanted = axes @ (particles.position[0, 0] - centre), axes @ particles.velocity[0, 0]
    np.testing.assert_allclose(task.observations[0, 12:18], np.concatenate(wanted), atol=2e-5)
    np.testing.assert_allclose(
        task.observations[0, 9:11], (axes @ [AIM["wind"][0], 0.0, AIM["wind"][1]])[:2], atol=1e-5
    )
    assert task.observations[0, 18] == pytest.approx(30 * DT)


@pytest.mark.parametrize("difficulty", BallisticTask.levels)
def test_levels(difficulty):
    """How the target moves, that it stays in the field, and who sees the wind."""
    worlds = 100
    task = begun(worlds, difficulty=difficulty)
    tracks, speeds = [], []
    for _ in range(600):
        row = task.observations.astype(float)
        sight = row[:, 0] + row[:, 5]
        sine, cosine = np.sin(sight), np.cos(sight)
        tracks.append(row[:, 4, None] * np.stack([sine, cosine], axis=1))
        speeds.append(np.stack([row[:, 7] * sine + row[:, 8] * cosine,
                                row[:, 7] * cosine - row[:, 8] * sine], axis=1))  # fmt: skip
        task.step(np.repeat(HOLD, worlds, axis=0))
    track, speed = np.array(tracks), np.array(speeds)
    # Central differences of a weave of 1.8 m in 6 s are right to w^3 A h^2 / 6 = 1.4e-4 m/s; places
    # of 60 m in float32, angles too, add 1.5e-5 m over 0.04 s.
    np.testing.assert_allclose((track[2:] - track[:-2]) / 0.04, speed[1:-1], atol=6e-4)
    reach = np.linalg.norm(track, axis=2)
    assert reach.min() > 30.0 * math.cos(0.6) - 1.8 and reach.max() < 60.0 + 1.8
    bend = np.abs(speed - speed[0]).max(axis=(0, 2))
    assert [bend.max() < 1e-4, bend.min() > 1.0] == [difficulty < 3, difficulty == 3]
    assert (np.abs(speed).max() > 1.0) == (difficulty > 1)
    seen, most = task.observations[:, 9:11], (10.0, 20.0, 20.0)[difficulty - 1]
    truth = np.hypot(*task.values[[kernels.WIND_X, kernels.WIND_Z], :worlds])
    assert 0.8 * most < truth.max() <= most
    np.testing.assert_allclose(np.hypot(*seen.T), truth if difficulty < 3 else 0.0, atol=1e-5)


# The episode


def test_a_hit_ends_the_episode():
    task = begun(shot="laser", damping=1.0)
    lay(task)
    put_target(task, (0.0, 1.5, 31.0), radius=0.5)
    for k in range(16):
        assert not task.flags[:, 0].any()
        ended = task.step(FIRE)
        assert ended == (k == 15)
    assert task.flags[[TERMINATED, TRUNCATED, SUCCESS], 0].tolist() == [True, False, True]
    assert task.rewards[:, 0].tolist() == [10.0 - 0.005, 5.0, 5.0, 0.0, -0.005]


def test_the_last_miss_ends_the_episode():
    """Not the last shot: it may still hit."""
    task = begun(max_steps=900)
    lay(task, elevation=0.45)
    put_target(task, (0.0, 5.0, -50.0))
    last = 0
    for k in range(900):
        task.step(FIRE)
        last = k if task.rewards[3, 0] < 0.0 else last
        assert task.rewards[0, 0] == pytest.approx(task.rewards[1:, 0].sum())
        if task.flags[TERMINATED, 0]:
            break
    assert task.observations[0, 3] == 0.0 and k - last > 100
    assert task.flags[TERMINATED, 0]
    assert not task.flags[SUCCESS, 0] and not task.flags[TRUNCATED, 0]


def test_nearer_is_better():
    """The closeness of the last shot is what a series of misses earns, whatever went before."""
    task = begun(40)
    put_target(task, (0.0, 5.0, 40.0), radius=0.01)
    near = np.zeros(40)
    for angles in (np.linspace(0.1, 1.4, 40), np.linspace(1.4, 0.1, 40)):
        lay(task)
        task.values[kernels.ELEVATION, :40] = angles
        for k in range(260):
            task.step(np.repeat(HOLD if k else FIRE, 40, axis=0))
            near += task.rewards[2]
        miss = np.sqrt(task.flight[flight.CLOSEST, :40])
        np.testing.assert_allclose(near, 5.0 / (1.0 + miss / 5.0), rtol=1e-12)
    assert near.max() > 3.5 and near.min() < 1.5


def test_snapshot_in_flight():
    """Wind acts through parameters that a restored world must get back."""
    task = begun(3, difficulty=3)
    lay(task, **AIM)
    fire_and_wait(task, 40)
    kept = task.snapshot()
    ends = []
    for _ in range(2):
        task.restore(kept)
        for _ in range(40):
            task.step(np.repeat(HOLD, 3, axis=0))
        ends.append((task.observations.tobytes(), task.world.state.tobytes()))
    assert ends[0] == ends[1]
    fresh = begun(3, difficulty=3)
    lay(fresh, **AIM)
    fire_and_wait(fresh, 80)
    assert fresh.observations.tobytes() == ends[0][0]


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"shot": "arrow"}, "'arrow'; it must be one of pistol, artillery"),
        ({"damping": 0.0}, r"damping is 0.0; it must be in \(0, 1\]"),
        ({"damping": 1.5}, r"damping is 1.5; it must be in \(0, 1\]"),
        ({"damping": math.nan}, r"damping is nan; it must be in \(0, 1\]"),
    ],
)
def test_bad_arguments(kwargs, words):
    with pytest.raises(ValueError, match=words):
        gym.make(ID, **kwargs)


# The controller


def succeeded(policy, *, episodes=100, **kwargs):
    envs = gym.make_vec(ID, episodes, **kwargs)
    observation, _ = envs.reset(seed=1_000_000)
    policy.reset(episodes)
    running, won = np.ones(episodes, bool), np.zeros(episodes, bool)
    while running.any():
        observation, _, terminated, truncated, info = envs.step(policy(observation))
        won |= running & info["is_success"]
        running &= ~(terminated | truncated)
    return won.sum()


class Blind(BallisticController):
    """The controller without some of the observations, and without what it infers of the wind."""

    def __init__(self, *columns):
        super().__init__()
        self.columns = list(columns)

    def __call__(self, obs):
        obs = obs.copy()
        obs[:, self.columns] = 0.0
        return super().__call__(obs)

    def wind(self, obs):
        return obs[:, 9:11]


@pytest.mark.parametrize("shot", list(sy.scenes.SHOTS))
def test_every_kind_of_shot_can_be_aimed(shot):
    assert succeeded(BallisticController(shot), shot=shot, difficulty=2) >= 95


@pytest.mark.parametrize(("difficulty", "hides"), [(2, (9, 10)), (2, (7, 8)), (3, ())])
def test_wind_and_lead_matter(difficulty, hides):
    """Whoever ignores the wind, seen or hidden, or the target's velocity, fails more often."""
    assert succeeded(BallisticController(), difficulty=difficulty) >= 95
    assert succeeded(Blind(*hides), difficulty=difficulty) < 92


# Pictures


def red_place(pixels):
    """Middle of the red pixels, (column, row)."""
    red, green, blue = np.moveaxis(pixels.astype(int), 2, 0)
    rows, columns = np.nonzero((red > green + 70) & (red > blue + 70) & (green < 110))
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("place", [(0.0, 6.0, 45.0), (20.0, 4.0, 40.0), (-25.0, 9.0, 60.0)])
def test_the_target_is_drawn_where_it_is(place):
    pytest.importorskip("pygame")
    task = begun()
    put_target(task, place)
    camera = Camera(**task.camera)
    renderer = Renderer(width=720, height=480, camera=camera)
    view = View(camera, width=720, height=480)
    wanted = view.to_pixels(view.from_world(np.array([place])))[0]
    np.testing.assert_allclose(red_place(renderer.render(task.drawing(0))), wanted, atol=2.0)
    renderer.close()


def test_shot_trail_and_mark_are_drawn_while_there_are_any():
    task = begun()
    lay(task, **AIM)
    put_target(task, (0.0, 6.0, 60.0))
    before = task.drawing(0)
    fire_and_wait(task, 60)
    during = task.drawing(0)
    trail = [line for line in during.lines if line.color[:3] == sy.draw.palette.LOAD]
    assert len(during.lines) - len(before.lines) == len(trail)
    np.testing.assert_allclose(trail[0].start, (0.0, 1.5, 0.0), atol=1e-9)
    np.testing.assert_allclose(trail[-1].end, task.world.particles.position[0, 0])
    np.testing.assert_allclose(trail[20].start, flown(0.6, **AIM), atol=1e-9)
    fire_and_wait(task, 200)
    after = task.drawing(0)
    stake = {line.start for line in after.lines} - {line.start for line in before.lines}
    np.testing.assert_allclose(list(stake), [task.flight[flight.MARK : flight.MARK + 3, 0]])
