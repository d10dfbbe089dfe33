"""A world that stops being finite ends its episode, says so, and harms nothing else."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from tests.envs.environments import IDS, play, some_actions, task_class

# The same lane of the next block of eight worlds, row 12, must not suffer either.
ROWS, BROKEN = 14, 4


def poison(task, world, part, value):
    """Spoil one world's whole state, or one number of a position or velocity."""
    if part == "all":
        task.world.state[:, world] = value
    else:
        task.world.state[task.world.row("particles", part) + 1, world] = value


POISONS = [(part, bad) for part in ("all", "position", "velocity") for bad in (np.nan, np.inf)]


@pytest.mark.parametrize(("part", "value"), POISONS)
@pytest.mark.parametrize("env_id", IDS)
def test_single(env_id, part, value):
    for method in task_class(env_id).methods:
        env = gym.make(env_id, method=method)
        actions = some_actions(env_id, 80)
        wanted = play(env, actions, seed=1)
        env.reset(seed=0)
        env.step(actions[0])
        poison(env.unwrapped.task, 0, part, value)
        observation, reward, terminated, truncated, info = env.step(actions[1])
        assert observation in env.observation_space
        assert np.isfinite(reward) and np.isfinite(list(info.values())).all()
        assert reward <= 0.0, "breaking the physics must not pay"
        assert terminated and not truncated
        assert info["physics_error"] and not info["is_success"]
        assert play(env, actions, seed=1) == wanted


@pytest.mark.parametrize(("part", "value"), POISONS)
@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_one_row_of_many(env_id, mode, part, value):
    for method in task_class(env_id).methods:
        check_one_row_of_many(env_id, mode, part, value, method)


def check_one_row_of_many(env_id, mode, part, value, method):
    kwargs = {"autoreset_mode": mode, "max_episode_steps": 25, "method": method}
    envs, twin = gym.make_vec(env_id, ROWS, **kwargs), gym.make_vec(env_id, ROWS, **kwargs)
    actions = some_actions(env_id, 60, rows=ROWS)
    others = np.arange(ROWS) != BROKEN
    envs.reset(seed=3), twin.reset(seed=3)
    for step, action in enumerate(actions):
        if step == 10:
            poison(envs.task, BROKEN, part, value)
        observation, reward, terminated, truncated, info = envs.step(action)
        assert observation in envs.observation_space
        assert np.isfinite(reward).all()
        wanted = twin.step(action)
        np.testing.assert_array_equal(observation[others], wanted[0][others])
        for mine, its in zip((reward, terminated, truncated), wanted[1:4], strict=True):
            np.testing.assert_array_equal(mine[others], its[others])
        final = info.get("final_info", info)
        if step == 10:
            assert terminated[BROKEN] and not truncated[BROKEN]
            assert final["physics_error"].tolist() == (~others).tolist()
            assert not final["is_success"][BROKEN]
            assert reward[BROKEN] <= 0.0
            if mode is AutoresetMode.SAME_STEP:
                assert info["final_obs"][BROKEN] in envs.single_observation_space
        else:
            assert not final["physics_error"].any(), "the next episode is sound"
        if mode is AutoresetMode.DISABLED:
            envs.reset(options={"reset_mask": terminated | truncated})
            twin.reset(options={"reset_mask": wanted[2] | wanted[3]})
        if step == 11 and mode is AutoresetMode.NEXT_STEP:
            assert reward[BROKEN] == 0.0 and not terminated[BROKEN]


@pytest.mark.parametrize("env_id", IDS)
def test_all_rows_at_once_and_again_and_again(env_id):
    envs = gym.make_vec(env_id, ROWS, autoreset_mode=AutoresetMode.SAME_STEP)
    actions = some_actions(env_id, 40, rows=ROWS)
    envs.reset(seed=0)
    for action in actions:
        envs.task.world.state[:] = np.nan
        observation, reward, terminated, truncated, info = envs.step(action)
        assert observation in envs.observation_space and np.isfinite(reward).all()
        assert terminated.all() and not truncated.any()
        assert info["final_info"]["physics_error"].all()
    seeded = envs.reset(seed=5)[0]
    np.testing.assert_array_equal(seeded, gym.make_vec(env_id, ROWS).reset(seed=5)[0])


@pytest.mark.parametrize("env_id", IDS)
def test_a_broken_world_can_be_drawn(env_id):
    env = gym.make(env_id, render_mode="rgb_array")
    env.reset(seed=0)
    poison(env.unwrapped.task, 0, "all", np.nan)
    env.step(np.zeros(env.action_space.shape, np.float32))
    assert env.render().shape[2] == 3
    env.close()
