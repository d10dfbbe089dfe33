"""What holds for every environment: types, bounds, infos, rewards, actions, and no hidden state."""

import itertools
import math
import random
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from tests.envs.environments import (
    IDS,
    begin,
    go_on,
    play,
    some_actions,
    specialisations,
    task_class,
    variants,
)

LARGE = float(np.finfo(np.float32).max)


@pytest.mark.parametrize(("env_id", "difficulty", "method"), variants())
def test_checkers_find_nothing(env_id, difficulty, method):
    env = gym.make(env_id, difficulty=difficulty, method=method)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
        sb3_check_env(env, warn=True, skip_render_check=False)


@pytest.mark.parametrize(("env_id", "difficulty", "method"), variants())
def test_everything_returned_keeps_its_type_and_bounds(env_id, difficulty, method):
    env = gym.make(env_id, difficulty=difficulty, method=method, disable_env_checker=True)
    keys = {f"reward_{term}" for term in task_class(env_id).terms}
    keys |= {"is_success", "physics_error"}
    observation, info = env.reset(seed=3)
    assert info.keys() == keys
    for action in some_actions(env_id, 1200, seed=difficulty):
        check_observation(env, observation)
        observation, reward, terminated, truncated, info = env.step(action)
        assert (type(reward), type(terminated), type(truncated)) == (float, bool, bool)
        check_info(info, keys)
        terms = [value for key, value in info.items() if key.startswith("reward_")]
        # A handful of additions, each rounded once.
        assert reward == pytest.approx(sum(terms), rel=1e-14, abs=1e-14)
        assert not info["physics_error"]
        if terminated or truncated:
            check_observation(env, observation)
            observation, info = env.reset()
            check_info(info, keys)


def check_observation(env, observation):
    assert type(observation) is np.ndarray
    assert observation.dtype == np.float32
    assert observation in env.observation_space


def check_info(info, keys):
    assert info.keys() == keys
    for key, value in info.items():
        assert type(value) is (float if key.startswith("reward_") else bool)
        assert math.isfinite(value)


@pytest.mark.parametrize("env_id", IDS)
def test_spaces_are_those_of_the_tables(env_id):
    env, task = gym.make(env_id), task_class(env_id)
    _, lows, highs, _ = zip(*task.observation_table, strict=True)
    assert env.observation_space == gym.spaces.Box(
        np.array(lows, np.float32), np.array(highs, np.float32), dtype=np.float32
    )
    assert np.isfinite(lows).all() and np.isfinite(highs).all()
    actions = len(task.action_table)
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (actions,), np.float32)
    for names in ([row[0] for row in task.observation_table], task.action_table, task.terms):
        assert all(names) and len(set(names)) == len(names)


@pytest.mark.parametrize("env_id", IDS)
def test_no_observation_always_shows_the_same(env_id):
    env, seen = gym.make(env_id), []
    for seed in range(5):
        env.reset(seed=seed)
        for action in some_actions(env_id, 400, seed=seed, hold=25):
            observation, _, terminated, truncated, _ = env.step(action)
            seen.append(observation)
            if terminated or truncated:
                env.reset()
    names = [row[0] for row in task_class(env_id).observation_table]
    spread = np.ptp(seen, axis=0)
    assert not [name for name, size in zip(names, spread, strict=True) if size == 0.0]


@pytest.mark.parametrize("env_id", IDS)
def test_extreme_actions_do_no_harm(env_id):
    env = gym.make(env_id, disable_env_checker=True)
    chosen = np.random.default_rng(7)
    wild = np.array([np.nan, np.inf, -np.inf, LARGE, -LARGE, 1e-45, -0.0, 1.0, -1.0], np.float32)
    observation, _ = env.reset(seed=7)
    for _ in range(1500):
        action = chosen.choice(wild, env.action_space.shape)
        observation, reward, terminated, truncated, info = env.step(action)
        check_observation(env, observation)
        assert math.isfinite(reward) and not info["physics_error"]
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(
    ("given", "same"),
    [
        (2.5, 1.0),
        (-1.0000001, -1.0),
        (np.inf, 1.0),
        (-np.inf, -1.0),
        (LARGE, 1.0),
        (np.nan, 0.0),
    ],
)
def test_actions_out_of_range_are_clipped_and_nan_is_none(env_id, given, same):
    env, count = gym.make(env_id, disable_env_checker=True), len(task_class(env_id).action_table)
    for axis in range(count):
        actions = some_actions(env_id, 60)
        actions[20:40, axis] = given
        clipped = actions.copy()
        clipped[20:40, axis] = same
        assert play(env, actions, seed=1) == play(env, clipped, seed=1)


@pytest.mark.parametrize("env_id", IDS)
def test_no_action_is_ignored(env_id):
    env = gym.make(env_id)
    for axis, name in enumerate(task_class(env_id).action_table):
        actions = np.zeros((100, *env.action_space.shape), np.float32)
        played = []
        for value in (-1.0, 1.0):
            actions[:, axis] = value
            played.append(play(env, actions, seed=0))
        assert played[0] != played[1], name


@pytest.mark.parametrize("env_id", IDS)
def test_nothing_returned_is_written_again(env_id):
    env = gym.make(env_id)
    kept = [env.reset(seed=0)]
    for action in some_actions(env_id, 200):
        observation, *ending, info = env.step(action)
        kept.append((observation, info))
        if ending[1] or ending[2]:
            kept.append(env.reset())
    copies = [(observation.copy(), dict(info)) for observation, info in kept]
    play(env, some_actions(env_id, 200, seed=9), seed=9)
    for (observation, info), (was, info_was) in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(observation, was)
        assert info == info_was
    assert len({id(info) for _, info in kept}) == len(kept)
    for index, (observation, _) in enumerate(kept):
        assert observation.base is None and observation.flags.writeable
        assert not any(np.shares_memory(observation, other) for other, _ in kept[:index])


@pytest.mark.parametrize("env_id", IDS)
def test_an_environment_leaves_what_it_is_given_alone(env_id):
    env = gym.make(env_id)
    env.reset(seed=0)
    action = np.full(env.action_space.shape, np.nan, np.float32)
    env.step(action)
    assert np.isnan(action).all()
    options = {"anything": 1}
    env.reset(options=options)
    assert options == {"anything": 1}


@pytest.mark.parametrize("env_id", IDS)
def test_actions_of_any_number_type_and_layout_are_the_same_and_compile_nothing(env_id):
    env = gym.make(env_id, disable_env_checker=True)
    signs = np.sign(some_actions(env_id, 40)).astype(np.float32)
    wanted = play(env, signs, seed=2)
    frozen = signs.copy()
    frozen.flags.writeable = False
    strided = np.repeat(signs, 3, axis=1)[:, ::3]
    before = specialisations()
    for actions in (frozen, strided, signs.astype(float), signs.astype(int), signs.tolist()):
        assert play(env, actions, seed=2) == wanted
    assert specialisations() == before


@pytest.mark.parametrize("env_id", IDS)
def test_actions_of_another_shape_are_refused(env_id):
    env = gym.make(env_id, disable_env_checker=True)
    env.reset(seed=0)
    count = env.action_space.shape[0]
    for shape in [(), (count + 1,), (count - 1,), (1, count), (0,)]:
        with pytest.raises(ValueError) as caught:
            env.step(np.zeros(shape, np.float32))
        assert str(shape) in str(caught.value) and str((count,)) in str(caught.value)
        assert type(env.unwrapped).__name__ in str(caught.value)


@pytest.mark.parametrize("env_id", IDS)
def test_stepping_before_the_first_reset_is_refused(env_id):
    env = gym.make(env_id, disable_env_checker=True).unwrapped
    with pytest.raises(gym.error.ResetNeeded, match=r"[Cc]all reset"):
        env.step(env.action_space.sample())


@pytest.mark.parametrize("env_id", IDS)
def test_levels_and_methods_are_different(env_id):
    task, actions = task_class(env_id), some_actions(env_id, 150)
    assert len(task.levels) >= 3
    assert len(task.methods) >= 2
    for name, choices in (("difficulty", task.levels), ("method", task.methods)):
        played = [play(gym.make(env_id, **{name: choice}), actions, seed=4) for choice in choices]
        for index, outcomes in enumerate(played):
            assert outcomes not in played[:index], (name, choices[index])
    assert gym.make(env_id).unwrapped.task.method == task.methods[0]
    assert gym.make(env_id).unwrapped.task.difficulty == task.levels[1]


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(("physics", "control"), [(None, None), (400, 50), (200, 25), (100, 100)])
def test_a_control_step_takes_the_time_that_the_rates_say(env_id, physics, control):
    env = gym.make(env_id, physics_rate=physics, control_rate=control)
    task = env.unwrapped.task
    assert task.control_rate == (control or task.default_control_rate)
    assert env.metadata["render_fps"] == round(task.control_rate)
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(env.action_space.shape, np.float32))
    # At most 40 additions to a time below a second, each rounded to half of 1.1e-16 of it.
    assert task.world.time[0] == pytest.approx(5 / task.control_rate, abs=5e-15)


@pytest.mark.parametrize("env_id", IDS)
def test_time_limit_truncates(env_id):
    env = gym.make(env_id, max_episode_steps=4, difficulty=task_class(env_id).levels[0])
    env.reset(seed=0)
    rest = np.zeros(env.action_space.shape, np.float32)
    endings = [env.step(rest)[2:4] for _ in range(4)]
    assert endings == [(False, False)] * 3 + [(False, True)]


@pytest.mark.parametrize("env_id", IDS)
def test_rendering(env_id):
    env = gym.make(env_id, render_mode="rgb_array")
    env.reset(seed=0)
    frames = []
    for action in some_actions(env_id, 3):
        frames.append(env.render())
        env.step(action)
    height, width, channels = frames[0].shape
    assert height >= 200 and width >= 200 and channels == 3
    assert frames[0].dtype == np.uint8
    assert np.unique(frames[0].reshape(-1, 3), axis=0).shape[0] > 50
    assert (frames[0] != frames[2]).any()
    assert not np.shares_memory(frames[0], frames[1])
    env.close()
    env.close()


@pytest.mark.parametrize("env_id", IDS)
def test_a_window_follows_every_step_and_changes_nothing(env_id):
    pygame = pytest.importorskip("pygame")
    shown, hidden = gym.make(env_id, render_mode="human"), gym.make(env_id)
    assert begin(shown, seed=5) == begin(hidden, seed=5)
    pictures = []
    for action in some_actions(env_id, 10):
        # Nobody has to call render in this mode.
        pictures.append(pygame.surfarray.array3d(pygame.display.get_surface()))
        assert go_on(shown, [action]) == go_on(hidden, [action])
    assert all((a != b).any() for a, b in itertools.pairwise(pictures))
    assert shown.render() is None
    shown.close()
    shown.close()


@pytest.mark.parametrize("env_id", IDS)
def test_rendering_without_a_mode_says_what_to_do(env_id):
    env = gym.make(env_id, disable_env_checker=True).unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="rgb_array"):
        assert env.render() is None


@pytest.mark.parametrize("env_id", IDS)
def test_global_random_numbers_are_neither_used_nor_drawn(env_id):
    env, actions, played = gym.make(env_id), some_actions(env_id, 150), []
    for seed in (0, 1):
        np.random.seed(seed)
        random.seed(seed)
        before = np.random.get_state(legacy=True), random.getstate()
        played.append(play(env, actions, seed=6))
        after = np.random.get_state(legacy=True), random.getstate()
        assert str(before) == str(after)
    assert played[0] == played[1]


@pytest.mark.parametrize("env_id", IDS)
def test_starts_without_a_seed_do_not_hang_on_global_random_numbers(env_id):
    starts = []
    for _ in range(2):
        np.random.seed(0)
        random.seed(0)
        before = np.random.get_state(legacy=True), random.getstate()
        starts.append(begin(gym.make(env_id)))
        starts.append(gym.make_vec(env_id, 1).reset()[0].tobytes())
        after = np.random.get_state(legacy=True), random.getstate()
        assert str(before) == str(after)
    assert len(set(starts)) == 4
