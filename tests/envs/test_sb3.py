"""Native vector environments through the adapter to stable-baselines3, against single ones."""

import functools

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from steelyard_agents.make import make_vec_env
from steelyard_agents.sb3_vec_env import SB3VecEnv
from tests.envs.environments import IDS, some_actions

ROWS, LIMIT = 9, 40


def adapted(env_id, rows, mode, **kwargs):
    return SB3VecEnv(gym.make_vec(env_id, rows, autoreset_mode=mode, **kwargs))


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
@pytest.mark.parametrize("env_id", IDS)
def test_rows_are_single_environments_in_a_dummy_vec_env(env_id, mode):
    mine = adapted(env_id, ROWS, mode, max_episode_steps=LIMIT)
    make = functools.partial(gym.make, env_id, max_episode_steps=LIMIT)
    its = DummyVecEnv([lambda: Monitor(make())] * ROWS)
    assert (mine.observation_space, mine.action_space) == (its.observation_space, its.action_space)
    mine.seed(50), its.seed(50)
    np.testing.assert_array_equal(mine.reset(), its.reset())
    kinds = []
    for action in some_actions(env_id, 4 * LIMIT, rows=ROWS):
        observation, reward, done, infos = mine.step(action)
        wanted = its.step(action)
        np.testing.assert_array_equal(observation, wanted[0])
        np.testing.assert_array_equal(reward, wanted[1])
        np.testing.assert_array_equal(done, wanted[2])
        assert (observation.dtype, reward.dtype) == (wanted[0].dtype, wanted[1].dtype)
        for info, single in zip(infos, wanted[3], strict=True):
            if "terminal_observation" not in single:
                assert info == {}
                continue
            compare_ends(info, single)
            kinds.append(info["TimeLimit.truncated"])
    assert len(kinds) >= 3 * ROWS
    assert any(kinds)


def compare_ends(mine, its):
    """Monitor rounds returns to six places; its clock is its own."""
    assert mine.keys() == its.keys()
    assert mine["terminal_observation"].tobytes() == its["terminal_observation"].tobytes()
    assert mine["episode"]["r"] == pytest.approx(its["episode"]["r"], abs=5.1e-7)
    assert mine["episode"]["l"] == its["episode"]["l"]
    for key in its.keys() - {"terminal_observation", "episode"}:
        assert mine[key] == its[key] and type(mine[key]) is type(its[key]), key


@pytest.mark.parametrize("env_id", IDS)
def test_both_kinds_of_ending_reach_sb3(env_id):
    """A world that breaks terminates, the others run out of time, at the very same step too."""
    env = adapted(env_id, 4, AutoresetMode.SAME_STEP, max_episode_steps=6, difficulty=1)
    env.seed(0)
    env.reset()
    rest = np.zeros((4, *env.action_space.shape), np.float32)
    for step in range(6):
        if step == 3:
            env.env.task.world.state[:, 1] = np.nan
        if step == 5:
            env.env.task.world.state[:, 2] = np.nan
        _, _, done, infos = env.step(rest)
        assert done.tolist() == [step == 5, step == 3, step == 5, step == 5]
        if step == 3:
            assert infos[1]["TimeLimit.truncated"] is False and infos[1]["physics_error"] is True
            assert infos[1]["terminal_observation"] in env.observation_space
    assert [info.get("TimeLimit.truncated") for info in infos] == [True, None, False, True]


@pytest.mark.parametrize("env_id", IDS)
def test_make_vec_env_takes_the_native_environment(env_id):
    env = make_vec_env(env_id, 3, seed=7, step_info_keys=["physics_error"])
    assert type(env) is SB3VecEnv
    assert type(env.env).__name__ == gym.spec(env_id).vector_entry_point.partition(":")[2]
    np.testing.assert_array_equal(env.reset(), gym.make_vec(env_id, 3).reset(seed=7)[0])
    assert [info["physics_error"] for info in env.step(np.zeros((3, *env.action_space.shape)))[3]]
    assert env.get_attr("render_mode") == [None] * 3
    env.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
@pytest.mark.parametrize("env_id", IDS)
def test_ppo_learns_for_a_few_hundred_steps(env_id, mode):
    env = VecNormalize(adapted(env_id, 8, mode, max_episode_steps=LIMIT))
    model = PPO("MlpPolicy", env, n_steps=32, batch_size=64, n_epochs=2, seed=0, device="cpu")
    before = [weights.detach().clone() for weights in model.policy.parameters()]
    model.learn(512)
    assert model.num_timesteps == 512
    after = list(model.policy.parameters())
    assert all(bool(weights.isfinite().all()) for weights in after)
    assert any(bool((new != old).any()) for new, old in zip(after, before, strict=True))
    assert np.isfinite(env.obs_rms.mean).all() and np.isfinite(env.ret_rms.var)
    assert len(model.ep_info_buffer) >= 8
    assert {info["l"] for info in model.ep_info_buffer} <= set(range(1, LIMIT + 1))


@pytest.mark.parametrize("env_id", IDS)
def test_ppo_gives_the_same_weights_again(env_id):
    weights = []
    for _ in range(2):
        env = adapted(env_id, 8, AutoresetMode.SAME_STEP)
        model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=1, seed=3, device="cpu")
        weights.append(model.learn(256).policy.state_dict())
    assert all(bool((weights[0][name] == weights[1][name]).all()) for name in weights[0])
