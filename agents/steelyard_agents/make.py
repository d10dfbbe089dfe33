"""Make environments for stable-baselines3 by id, native vector environments where they exist."""

import importlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, load_env_creator
from gymnasium.vector import AutoresetMode
from stable_baselines3.common import env_util
from stable_baselines3.common.vec_env import VecEnv

from steelyard_agents.sb3_vec_env import SB3VecEnv


def find_spec(env_id: str) -> EnvSpec:
    """Return the registered spec of `env_id`, importing the package that registers it.

    Args:
        env_id: An id such as `steelyard/Platform-v0`, or `module:id` for ids of other packages.

    Raises:
        gymnasium.error.Error: No such id; the message names the nearest ones.
        ModuleNotFoundError: The module in `module:id` does not exist.
    """
    module, _, name = env_id.rpartition(":")
    if module:
        importlib.import_module(module)
    elif name.startswith("steelyard/"):
        importlib.import_module("steelyard_envs")
    return gym.spec(name)


def make_vec_env(
    env_id: str,
    num_envs: int,
    *,
    seed: int | None = None,
    env_kwargs: Mapping[str, Any] | None = None,
    step_info_keys: Sequence[str] = (),
) -> VecEnv:
    """Make `num_envs` environments as one stable-baselines3 `VecEnv`.

    Where the id registers a native vector environment that can reset in the same step, it is used
    through `SB3VecEnv`; otherwise single environments are stepped one by one in a `DummyVecEnv`.

    Args:
        env_id: As for `find_spec`.
        num_envs: Number of rows, at least 1.
        seed: Row i starts from `seed + i` at the next reset; None for a random start.
        env_kwargs: Arguments of the environment.
        step_info_keys: As for `SB3VecEnv`; single environments give all their infos anyway.

    Raises:
        ValueError: `num_envs` is less than 1.
    """
    if num_envs < 1:
        raise ValueError(f"num_envs is {num_envs}, but must be at least 1")
    spec = find_spec(env_id)
    kwargs = dict(env_kwargs or {})
    if not _resets_in_same_step(spec):
        return env_util.make_vec_env(spec.id, num_envs, seed=seed, env_kwargs=kwargs)
    native = gym.make_vec(
        spec.id,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        **kwargs,
    )
    env = SB3VecEnv(native, step_info_keys=step_info_keys)
    if seed is not None:
        env.seed(seed)
    return env


def make_env(
    env_id: str, *, env_kwargs: Mapping[str, Any] | None = None, render_mode: str | None = None
) -> gym.Env[Any, Any]:
    """Make one environment, for watching it."""
    return gym.make(find_spec(env_id).id, render_mode=render_mode, **dict(env_kwargs or {}))


def _resets_in_same_step(spec: EnvSpec) -> bool:
    """Say whether `spec` has a vector environment that lets its autoreset mode be chosen."""
    if spec.vector_entry_point is None:
        return False
    creator: Callable[..., Any] = (
        load_env_creator(spec.vector_entry_point)
        if isinstance(spec.vector_entry_point, str)
        else spec.vector_entry_point
    )
    parameters = inspect.signature(creator).parameters
    return "autoreset_mode" in parameters or any(
        parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()
    )
