"""Environments by id: native where possible, one by one where not."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from steelyard_agents.make import find_spec, make_env, make_vec_env
from steelyard_agents.sb3_vec_env import SB3VecEnv
from tests.agents import toy_envs

toy_envs.register()


def test_native_vector_environment_is_used_with_its_arguments_and_seed():
    env = make_vec_env(toy_envs.POINT_ID, 5, seed=9, env_kwargs={"gain": 0.1})
    assert isinstance(env, SB3VecEnv)
    assert env.get_attr("gain", 0) == [0.1]
    first = env.reset()
    again = make_vec_env(toy_envs.POINT_ID, 3, seed=9).reset()
    assert (first[:3] == again).all()
    assert np.unique(first).size == 5


def test_vector_environment_without_a_choice_of_autoreset_is_left_alone():
    env = make_vec_env("CartPole-v1", 3, seed=0)
    assert isinstance(env, DummyVecEnv)
    assert env.reset().shape == (3, 4)


def test_environment_without_vector_entry_point():
    assert isinstance(make_vec_env("Pendulum-v1", 2, env_kwargs={"g": 1.0}), DummyVecEnv)


def test_module_prefix_is_imported():
    assert find_spec("gymnasium:CartPole-v1").id == "CartPole-v1"
    env = make_env("gymnasium:CartPole-v1", render_mode="rgb_array")
    assert env.render_mode == "rgb_array"


def test_bad_ids_and_numbers_are_refused():
    with pytest.raises(gym.error.Error, match="CartPole"):
        make_vec_env("CartPol-v1", 2)
    with pytest.raises(ValueError, match="num_envs is 0"):
        make_vec_env("CartPole-v1", 0)


def test_importing_the_package_is_light():
    code = (
        "import sys, steelyard_agents;"
        "assert not {'torch', 'stable_baselines3', 'gymnasium', 'numba'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
