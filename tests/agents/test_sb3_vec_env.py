"""Every trap between Gymnasium's vector environments and stable-baselines3's."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.utils import obs_as_tensor
from stable_baselines3.common.vec_env import VecEnvWrapper, VecNormalize

from steelyard_agents.sb3_vec_env import SB3VecEnv
from tests.agents.toy_envs import PointVectorEnv, ScriptedVectorEnv

ROWS = 7
STEPS = 200
MODES = [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED]


def actions(rows: int = ROWS) -> np.ndarray:
    return np.zeros((rows, 1), np.float32)


def script() -> list[list[dict]]:
    """Return what stable-baselines3 must see in each step of each row, written down plainly."""
    expected = []
    episode, step = [0] * ROWS, [0] * ROWS
    for _ in range(STEPS):
        line = []
        for row in range(ROWS):
            step[row] += 1
            length = ScriptedVectorEnv.episode_length(row, episode[row])
            seen = {"reward": step[row], "done": step[row] == length}
            if seen["done"]:
                terminated, truncated = ScriptedVectorEnv.ending(row, episode[row])
                seen["terminal_observation"] = [row, episode[row], step[row]]
                seen["TimeLimit.truncated"] = truncated and not terminated
                seen["return"], seen["length"] = length * (length + 1) / 2, length
                episode[row], step[row] = episode[row] + 1, 0
            seen["obs"] = [row, episode[row], step[row]]
            line.append(seen)
        expected.append(line)
    return expected


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("final_obs_per_row", [False, True])
def test_every_step_is_what_the_script_says(mode, final_obs_per_row):
    env = SB3VecEnv(
        ScriptedVectorEnv(ROWS, autoreset_mode=mode, final_obs_per_row=final_obs_per_row)
    )
    env.reset()
    history = [env.step(actions()) for _ in range(STEPS)]
    # Compared only now, when the environment has overwritten its memory many times.
    episodes = 0
    for (obs, rewards, dones, infos), line in zip(history, script(), strict=True):
        for row, seen in enumerate(line):
            assert obs[row].tolist() == seen["obs"]
            assert rewards[row] == seen["reward"]
            assert dones[row] == seen["done"]
            if not seen["done"]:
                assert infos[row] == {}
                continue
            episodes += 1
            info = infos[row]
            assert info["terminal_observation"].tolist() == seen["terminal_observation"]
            assert info["TimeLimit.truncated"] is seen["TimeLimit.truncated"]
            assert info["episode"]["r"] == seen["return"]
            assert info["episode"]["l"] == seen["length"]
            assert info["episode"]["t"] >= 0.0
            assert info["is_success"] is (seen["length"] % 2 == 0)
            assert info["reward_step"] == seen["length"]
    assert episodes > 250


@pytest.mark.parametrize("mode", MODES)
def test_nothing_handed_out_shares_memory_with_anything(mode):
    native = ScriptedVectorEnv(ROWS, autoreset_mode=mode)
    env = SB3VecEnv(native, step_info_keys=["reward_step"])
    arrays = [env.reset()]
    for _ in range(30):
        obs, rewards, dones, infos = env.step(actions())
        arrays += [obs, rewards, dones]
        for info in infos:
            arrays += [info[key] for key in ("terminal_observation", "place") if key in info]
        # stable-baselines3 adds bootstrapped values to the rewards it is given.
        rewards += 100.0
    arrays += [native._obs, native._reward, native._final_obs]
    for index, array in enumerate(arrays):
        assert not any(np.shares_memory(array, other) for other in arrays[index + 1 :])
    assert len(set(map(id, infos))) == ROWS


def test_dtypes_are_those_of_stable_baselines3():
    obs, rewards, dones, _ = stepped(SB3VecEnv(ScriptedVectorEnv(ROWS)))
    assert (obs.dtype, rewards.dtype, dones.dtype) == (np.float32, np.float32, bool)


def stepped(env):
    env.reset()
    return env.step(actions(env.num_envs))


def test_masked_info_goes_only_to_the_rows_that_have_it():
    env = SB3VecEnv(ScriptedVectorEnv(ROWS))
    env.reset()
    seen = 0
    for _ in range(30):
        for row, info in enumerate(env.step(actions())[3]):
            if "episode" in info:
                assert ("only_odd_rows" in info) == (row % 2 == 1)
                seen += 1
            assert not any(key.startswith("_") or key.startswith("final_") for key in info)
    assert seen > 20


def test_step_infos_come_on_request():
    env = SB3VecEnv(ScriptedVectorEnv(ROWS), step_info_keys=["reward_step"])
    env.reset()
    for line in script()[:40]:
        infos = env.step(actions())[3]
        assert [info["reward_step"] for info in infos] == [seen["reward"] for seen in line]
    unknown = SB3VecEnv(ScriptedVectorEnv(ROWS), step_info_keys=["reward_height"])
    with pytest.raises(ValueError, match=r"reward_height.*'is_success', 'reward_step'"):
        stepped(unknown)


def test_next_step_autoreset_is_refused_with_the_remedy():
    native = gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="vector_entry_point")
    with pytest.raises(ValueError, match=r"SAME_STEP.*make_vec_env"):
        SB3VecEnv(native)


def test_unknown_autoreset_mode_is_refused():
    native = ScriptedVectorEnv(2)
    native.metadata, native.autoreset_mode = {}, None
    with pytest.raises(ValueError, match="autoreset_mode"):
        SB3VecEnv(native)


def test_missing_final_observation_is_an_error():
    native = ScriptedVectorEnv(1, autoreset_mode=AutoresetMode.DISABLED)
    native.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
    native.autoreset_mode = None
    env = SB3VecEnv(native)
    env.reset()
    env.step(actions(1))
    env.step(actions(1))
    with pytest.raises(RuntimeError, match="final_obs"):
        env.step(actions(1))


def test_gymnasiums_own_vector_env_gives_the_same_as_single_environments():
    """SyncVectorEnv gives final observations per row and final infos with masks."""
    native = gym.make_vec(
        "CartPole-v1",
        num_envs=3,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
    )
    env = SB3VecEnv(native)
    env.seed(5)
    obs = env.reset()
    singles = [gym.make("CartPole-v1") for _ in range(3)]
    for row, single in enumerate(singles):
        assert (single.reset(seed=5 + row)[0] == obs[row]).all()
    chosen, episodes = np.random.default_rng(0), 0
    for _ in range(150):
        action = chosen.integers(2, size=3)
        obs, rewards, dones, infos = env.step(action)
        for row, single in enumerate(singles):
            last, reward, terminated, truncated, _ = single.step(action[row])
            assert (rewards[row], dones[row]) == (reward, terminated or truncated)
            if dones[row]:
                episodes += 1
                assert (infos[row]["terminal_observation"] == last).all()
                last, _ = single.reset()
            assert (obs[row] == last).all()
    assert episodes > 10


@pytest.mark.parametrize("normalize", [False, True])
def test_ppo_bootstraps_the_value_at_truncation_and_only_there(normalize):
    recorder = Recorder(SB3VecEnv(ScriptedVectorEnv(ROWS)))
    env = VecNormalize(recorder, norm_reward=False, clip_obs=1e9) if normalize else recorder
    model = PPO("MlpPolicy", env, n_steps=40, batch_size=ROWS * 40, gamma=0.9, seed=0, device="cpu")
    _, callback = model._setup_learn(ROWS * 40)
    assert model.collect_rollouts(model.env, callback, model.rollout_buffer, 40)
    kinds = set()
    for step, line in enumerate(script()[:40]):
        for row, seen in enumerate(line):
            stored = model.rollout_buffer.rewards[step, row]
            bootstrap = 0.0
            if seen.get("TimeLimit.truncated"):
                last = recorder.infos[step][row]["terminal_observation"][None]
                value = model.policy.predict_values(obs_as_tensor(last, model.device))
                bootstrap = 0.9 * value.item()
                assert abs(bootstrap) > 1e-3
            kinds.add(seen.get("TimeLimit.truncated"))
            # float32 arithmetic on numbers up to 6
            assert stored == pytest.approx(seen["reward"] + bootstrap, abs=2e-6)
    assert kinds == {None, False, True}


class Recorder(VecEnvWrapper):
    """Keeps the infos of all steps, which VecNormalize, outside of it, normalises in place."""

    def __init__(self, env):
        super().__init__(env)
        self.infos: list[list[dict]] = []

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        result = self.venv.step_wait()
        self.infos.append(result[3])
        return result


def test_seeds_reach_the_rows_once():
    native = ScriptedVectorEnv(ROWS)
    env = SB3VecEnv(native)
    assert env.seed(11) == [11 + row for row in range(ROWS)]
    env.reset()
    env.reset()
    assert native.seeds == [11, None]
    assert env.seed(None)[0] is not None


def test_options_reach_the_environment_once():
    native = ScriptedVectorEnv(ROWS)
    env = SB3VecEnv(native)
    env.set_options({"wind": 3.0})
    env.reset()
    env.reset()
    assert native.options == [{"wind": 3.0}, None]
    with pytest.raises(ValueError, match="one dictionary"):
        env.set_options([{}] * ROWS)


@pytest.mark.parametrize("mode", MODES)
def test_reset_infos_are_those_of_the_latest_reset(mode):
    env = SB3VecEnv(ScriptedVectorEnv(ROWS, autoreset_mode=mode))
    env.reset()
    assert env.reset_infos == [{"start": 0.0}] * ROWS
    for _ in range(3):
        env.step(actions())
    if mode is AutoresetMode.DISABLED:  # rows 0 and 4 have ended, and only their infos changed
        assert [info["start"] for info in env.reset_infos] == [1, 0, 0, 0, 1, 0, 0]


def test_render_mode_is_known_and_frames_are_tiled():
    env = SB3VecEnv(ScriptedVectorEnv(4, render_mode="rgb_array"))
    assert env.render_mode == "rgb_array"
    assert env.render().shape == (4, 4, 3)
    assert [frame[0, 0, 0] for frame in env.get_images()] == [0, 1, 2, 3]
    assert SB3VecEnv(ScriptedVectorEnv(4)).render_mode is None


def test_attributes_by_indices():
    native = ScriptedVectorEnv(4)
    env = SB3VecEnv(native)
    assert env.get_attr("autoreset_mode", [0, 2]) == [AutoresetMode.SAME_STEP] * 2
    assert env.get_attr("observation_space", 3) == [native.single_observation_space]
    assert env.get_attr("num_envs") == [4] * 4
    assert env.has_attr("num_envs") and not env.has_attr("wings")
    env.set_attr("wind", 2.0)
    assert native.wind == 2.0
    env.set_attr("wind", 3.0, range(4))
    assert native.wind == 3.0
    with pytest.raises(ValueError, match="one object"):
        env.set_attr("wind", 4.0, [1])
    assert native.wind == 3.0
    with pytest.raises(IndexError):
        env.get_attr("wind", 4)


def test_attributes_are_set_below_wrappers():
    native = ScriptedVectorEnv(4)
    env = SB3VecEnv(gym.wrappers.vector.ClipReward(native, 0.0, 1.0))
    env.set_attr("wind", 2.0)
    assert native.wind == 2.0
    assert env.get_attr("wind", 0) == [2.0]


def test_methods_by_indices():
    env = SB3VecEnv(ScriptedVectorEnv(4))
    assert env.env_method("total", 2.0) == [8.0] * 4
    assert env.env_method("chosen", 2.0, indices=[1, 3]) == [2.0, 6.0]
    with pytest.raises(ValueError, match="one object"):
        env.env_method("total", 2.0, indices=[1])


def test_monitors_part_is_played():
    env = SB3VecEnv(ScriptedVectorEnv(4))
    assert env.env_is_wrapped(Monitor, [0, 1]) == [True, True]
    assert env.env_is_wrapped(gym.wrappers.TimeLimit) == [False] * 4


def test_evaluate_policy_takes_monitors_record_without_a_warning(recwarn):
    env = VecNormalize(SB3VecEnv(ScriptedVectorEnv(4)), training=False)
    model = PPO("MlpPolicy", env, n_steps=4, batch_size=16, device="cpu")
    recwarn.clear()
    returns, lengths = evaluate_policy(model, env, n_eval_episodes=4, return_episode_rewards=True)
    assert sorted(lengths) == [3, 4, 5, 6]
    assert sorted(returns) == [6, 10, 15, 21]
    assert not recwarn.list


def test_step_wait_needs_actions():
    env = SB3VecEnv(ScriptedVectorEnv(1))
    env.reset()
    with pytest.raises(RuntimeError, match="step_async"):
        env.step_wait()


def test_close_closes_the_environment():
    native = ScriptedVectorEnv(1)
    SB3VecEnv(native).close()
    assert native.closed


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_where_the_original_stands(duplicate):
    env = SB3VecEnv(PointVectorEnv(ROWS, autoreset_mode=AutoresetMode.SAME_STEP))
    env.seed(3)
    env.reset()
    chosen = np.random.default_rng(0).uniform(-1, 1, (60, ROWS, 1)).astype(np.float32)
    for action in chosen[:25]:
        env.step(action)
    twin = duplicate(env)
    episodes = 0
    for action in chosen[25:]:
        mine, its = env.step(action), twin.step(action)
        for ours, theirs in zip(mine[:3], its[:3], strict=True):
            assert (ours == theirs).all()
        for ours, theirs in zip(mine[3], its[3], strict=True):
            if "episode" in ours:
                episodes += 1
                assert ours["episode"]["r"] == theirs["episode"]["r"]
                assert ours["episode"]["l"] == theirs["episode"]["l"]
    assert episodes > 10
