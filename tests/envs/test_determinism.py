"""Same seed, same bits: after anything, in any process, in copies and from snapshots."""

import copy
import functools
import hashlib
import os
import pickle
import subprocess
import sys

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode

from tests.envs.environments import IDS, begin, go_on, play, some_actions, task_class

STEPS = 150


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("level", [0, 1, -1])
def test_same_seed_same_bits_whatever_went_before(env_id, level):
    kwargs = {"difficulty": task_class(env_id).levels[level]}
    actions = some_actions(env_id, STEPS)
    wanted = play(gym.make(env_id, **kwargs), actions, seed=11)
    env = gym.make(env_id, **kwargs)
    for seed in range(3):
        # Episodes cut off at different places, some of them in the middle of something.
        play(env, some_actions(env_id, 37 * (seed + 1) ** 2, seed=seed), seed=seed)
        assert play(env, actions, seed=11) == wanted
    env.reset()
    go_on(env, np.ones((53, *env.action_space.shape), np.float32))
    assert play(env, actions, seed=11) == wanted


@pytest.mark.parametrize("env_id", IDS)
def test_every_seed_and_every_reset_starts_another_episode(env_id):
    env = gym.make(env_id)
    starts = [begin(env, seed=seed) for seed in (*range(20), 2**31, 2**32, 2**63, 2**64 - 1)]
    starts += [begin(env) for _ in range(20)]
    starts += [begin(gym.make(env_id)) for _ in range(3)]
    assert len(set(starts)) == len(starts)


@pytest.mark.parametrize("env_id", IDS)
def test_a_reset_without_a_seed_goes_on_with_the_stream(env_id):
    env = gym.make(env_id)
    first = [begin(env, seed=3), begin(env), begin(env)]
    assert [begin(env, seed=3), begin(env), begin(env)] == first


@pytest.mark.parametrize("env_id", IDS)
def test_seeds_that_gymnasium_draws_can_be_given_again(env_id):
    """An environment reset without a seed has one of 128 bits in `np_random_seed`."""
    env = gym.make(env_id)
    env.reset()
    seed = env.unwrapped.np_random_seed
    assert seed > 2**64
    assert begin(env, seed=seed) == begin(gym.make(env_id), seed=seed)


@pytest.mark.parametrize("env_id", IDS)
def test_seeds_below_0_are_refused(env_id):
    with pytest.raises(gym.error.Error, match="-1"):
        gym.make(env_id).reset(seed=-1)


@pytest.mark.parametrize("env_id", IDS)
def test_two_environments_do_not_touch_each_other(env_id):
    actions = some_actions(env_id, STEPS)
    wanted = play(gym.make(env_id), actions, seed=1), play(gym.make(env_id), actions, seed=2)
    first, second = gym.make(env_id), gym.make(env_id)
    outcomes = [begin(first, seed=1)], [begin(second, seed=2)]
    for action in actions:
        for env, seen in zip((first, second), outcomes, strict=True):
            seen += go_on(env, [action])
    assert outcomes == wanted


PROGRAM = f"""
import hashlib
import gymnasium as gym
from tests.envs.environments import IDS, play, some_actions
for env_id in IDS:
    outcomes = play(gym.make(env_id), some_actions(env_id, {STEPS}), seed=5)
    print(hashlib.sha256(repr(outcomes).encode()).hexdigest())
"""


@pytest.mark.parametrize("hash_seed", ["1", "2"])
def test_another_process_gives_the_same_bits(hash_seed):
    environment = os.environ | {
        "PYTHONHASHSEED": hash_seed,
        "PYTHONPATH": os.pathsep.join(path for path in (*sys.path, os.getcwd()) if path),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    wanted = []
    for env_id in IDS:
        outcomes = play(gym.make(env_id), some_actions(env_id, STEPS), seed=5)
        wanted.append(hashlib.sha256(repr(outcomes).encode()).hexdigest())
    assert done.stdout.split() == wanted


COPIES = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: pickle.loads(cloudpickle.dumps(env)),
}


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("env_id", IDS)
def test_a_copy_goes_on_bit_for_bit_and_on_its_own(env_id, duplicate):
    for method in task_class(env_id).methods:
        env = gym.make(env_id, method=method)
        play(env, some_actions(env_id, 43), seed=8)
        twin, third = duplicate(env), duplicate(duplicate(env))
        actions = some_actions(env_id, STEPS, seed=1)
        wanted = go_on(env, actions)
        assert go_on(twin, actions) == wanted
        assert go_on(third, actions) == wanted
        assert play(twin, actions, seed=2) == play(env, actions, seed=2)


@pytest.mark.parametrize("env_id", IDS)
def test_a_copy_of_an_environment_that_was_never_reset_can_be_used(env_id):
    env = pickle.loads(pickle.dumps(gym.make(env_id)))
    actions = some_actions(env_id, 20)
    assert play(env, actions, seed=2) == play(gym.make(env_id), actions, seed=2)


@pytest.mark.parametrize("env_id", IDS)
def test_a_copy_draws_for_itself(env_id):
    env = gym.make(env_id, render_mode="rgb_array")
    env.reset(seed=0)
    frame = env.render()
    for duplicate in COPIES.values():
        twin = duplicate(env)
        np.testing.assert_array_equal(twin.render(), frame)
        twin.close()
    np.testing.assert_array_equal(env.render(), frame)
    env.close()


@pytest.mark.parametrize("env_id", IDS)
def test_closing_one_window_leaves_the_other(env_id):
    env = gym.make(env_id, render_mode="human")
    env.reset(seed=0)
    twin = copy.deepcopy(env)
    twin.render()
    twin.close()
    go_on(env, some_actions(env_id, 3))
    env.close()


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_a_copy_of_a_vector_environment_goes_on_bit_for_bit(env_id, mode, duplicate):
    envs = gym.make_vec(env_id, 9, max_episode_steps=30, autoreset_mode=mode)
    envs.reset(seed=4)
    actions = some_actions(env_id, STEPS, rows=9)
    for action in actions[:47]:
        envs.step(action)
    twin = duplicate(envs)
    wanted = [repr(envs.step(action)) for action in actions[47:]]
    assert [repr(twin.step(action)) for action in actions[47:]] == wanted
    assert repr(twin.reset()) == repr(envs.reset())


@pytest.mark.parametrize("context", ["fork", "spawn"])
@pytest.mark.parametrize("env_id", IDS)
def test_subprocesses_give_the_same_bits(env_id, context):
    make = functools.partial(gym.make, f"steelyard_envs:{env_id}")
    actions = some_actions(env_id, 40, rows=2)
    envs = AsyncVectorEnv([make, make], context=context)
    try:
        observations = [envs.reset(seed=21)[0]]
        rewards = []
        for action in actions:
            observation, reward, *_ = envs.step(action)
            observations.append(observation)
            rewards.append(reward)
    finally:
        envs.close()
    native = gym.make_vec(env_id, 2)
    wanted = [native.reset(seed=21)[0]]
    for action, reward in zip(actions, rewards, strict=True):
        observation, native_reward, *_ = native.step(action)
        wanted.append(observation)
        np.testing.assert_array_equal(reward, native_reward)
    np.testing.assert_array_equal(observations, wanted)


@pytest.mark.parametrize("env_id", IDS)
def test_a_snapshot_brings_everything_back(env_id):
    for method in task_class(env_id).methods:
        env = gym.make(env_id, method=method, max_episode_steps=-1)
        play(env, some_actions(env_id, 61), seed=9)
        snapshot = env.unwrapped.snapshot()
        actions = some_actions(env_id, STEPS, seed=3)
        wanted = go_on(env, actions), begin(env), begin(env)
        play(env, some_actions(env_id, 20, seed=4), seed=10)
        for _ in range(2):
            env.unwrapped.restore(snapshot)
            assert (go_on(env, actions), begin(env), begin(env)) == wanted


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_a_snapshot_of_a_vector_environment_brings_everything_back(env_id, mode):
    envs = gym.make_vec(env_id, 9, max_episode_steps=30, autoreset_mode=mode)
    envs.reset(seed=4)
    actions = some_actions(env_id, STEPS, rows=9)
    # Taken right after rows have ended, too: what begins next belongs to the state.
    for taken in (12, 30, 31):
        envs.reset(seed=taken)
        for action in actions[:taken]:
            envs.step(action)
        snapshot = envs.snapshot()
        wanted = [repr(envs.step(action)) for action in actions[taken:]], repr(envs.reset())
        for _ in range(2):
            envs.restore(snapshot)
            seen = [repr(envs.step(action)) for action in actions[taken:]], repr(envs.reset())
            assert seen == wanted


@pytest.mark.parametrize("env_id", IDS)
def test_a_snapshot_of_another_environment_is_refused(env_id):
    env, other = gym.make(env_id).unwrapped, gym.make(env_id, control_rate=25).unwrapped
    env.reset(seed=0), other.reset(seed=0)
    before = begin(env, seed=3)
    with pytest.raises(ValueError, match="snapshot"):
        env.restore(other.snapshot())
    assert begin(env, seed=3) == before
