"""Every registered environment, and ways to play it whose outcomes compare bit for bit."""

import functools
import sys

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numba.core.dispatcher import Dispatcher

from steelyard_envs.registration import ENVIRONMENTS

# Time limit of episodes where many of them are wanted [control steps].
LIMIT = 40
IDS = tuple(row[0] for row in ENVIRONMENTS)


def task_class(env_id):
    return load_env_creator(gym.spec(env_id).entry_point).task_class


def variants():
    """Every id with every level of difficulty and every method."""
    return [
        (env_id, difficulty, method)
        for env_id in IDS
        for difficulty in task_class(env_id).levels
        for method in task_class(env_id).methods
    ]


def some_actions(env_id, steps, *, rows=None, seed=0, hold=10):
    """Random actions, each held for some steps, as white noise hardly moves anything.

    Shape (steps, actions), or (steps, rows, actions).
    """
    row = task_class(env_id).action_space().shape
    shape = row if rows is None else (rows, *row)
    blocks = np.random.default_rng(seed).uniform(-1.0, 1.0, (-(-steps // hold), *shape))
    return np.repeat(blocks, hold, axis=0)[:steps].astype(np.float32)


def specialisations():
    """Argument types for which the environments' kernels are compiled or loaded so far."""
    return {
        (module.__name__, name): tuple(kernel.signatures)
        for module in list(sys.modules.values())
        if module.__name__.startswith("steelyard_envs.")
        for name, kernel in vars(module).items()
        if isinstance(kernel, Dispatcher)
    }


def begin(env, **kwargs):
    observation, info = env.reset(**kwargs)
    return observation.tobytes(), tuple(info.items())


def go_on(env, actions):
    """Outcomes of steps, and of a reset without a seed after each episode."""
    outcomes = []
    for action in actions:
        observation, *ending, info = env.step(action)
        outcomes.append((observation.tobytes(), *ending, tuple(info.items())))
        if ending[1] or ending[2]:
            outcomes.append(begin(env))
    return outcomes


def play(env, actions, *, seed):
    """Outcomes of a seeded reset and all that follows."""
    return [begin(env, seed=seed), *go_on(env, actions)]


def native(env_id, rows, mode=AutoresetMode.NEXT_STEP, **kwargs):
    kwargs = {"max_episode_steps": LIMIT} | kwargs
    return gym.make_vec(
        env_id, rows, vectorization_mode="vector_entry_point", autoreset_mode=mode, **kwargs
    )


def singles(env_id, rows, mode=AutoresetMode.NEXT_STEP, **kwargs):
    make = functools.partial(gym.make, env_id, **{"max_episode_steps": LIMIT} | kwargs)
    return SyncVectorEnv([make] * rows, autoreset_mode=mode)


def assert_same(mine, its):
    """Same types, shapes, keys and bits."""
    assert data_equivalence(mine, its, exact=True), (mine, its)
