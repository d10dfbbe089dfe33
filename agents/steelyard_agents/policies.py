"""Policies that can be evaluated: random, hand-written, and trained ones.

A policy has `reset(num_envs)`, called when all rows start a new episode, and is called with
observations, shape (rows, ...), as the environment gives them, for actions, shape (rows, ...).
"""

import pickle
from pathlib import Path
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
import yaml
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from steelyard_agents.hyperparameters import ALGORITHMS


class Policy(Protocol):
    """What `evaluate` and `record_video` ask of a policy."""

    def reset(self, num_envs: int) -> None:
        """Forget everything: `num_envs` rows start a new episode."""

    def __call__(self, obs: Any) -> np.ndarray:
        """Return an action per row."""


class RandomPolicy:
    """Actions drawn uniformly from the action space.

    Args:
        action_space: The space of a single action.
        seed: Seed of the draws.
    """

    def __init__(self, action_space: gym.Space[Any], *, seed: int) -> None:
        self._action_space = action_space
        self._seed = seed

    def reset(self, num_envs: int) -> None:
        """Draw the same actions again for the same `num_envs`."""
        self._batch = gym.vector.utils.batch_space(self._action_space, num_envs)
        self._batch.seed(self._seed)

    def __call__(self, obs: Any) -> np.ndarray:
        """Return an action per row, whatever the observations."""
        return np.asarray(self._batch.sample())


class TrainedPolicy:
    """A trained model's actions, with the normaliser that it was trained with.

    Args:
        model: The trained model.
        normalizer: The statistics to normalise observations with; None for none.
        deterministic: Take the most likely actions; False to sample them, the same ones after each
            `reset`.
    """

    def __init__(
        self,
        model: BaseAlgorithm,
        normalizer: VecNormalize | None,
        *,
        deterministic: bool = True,
    ) -> None:
        self._model = model
        self._normalizer = normalizer
        self._deterministic = deterministic

    @classmethod
    def load(cls, run: Path, *, algo: str, deterministic: bool | None = None) -> "TrainedPolicy":
        """Load what `train` saved in the folder `run`; by default it acts as its settings say."""
        if deterministic is None:
            (source,) = yaml.safe_load((run / "settings.yml").read_text()).values()
            deterministic = bool(source.get("deterministic", True))
        model = ALGORITHMS[algo].load(run / "model.zip", device="cpu")
        path = run / "vecnormalize.pkl"
        if not path.exists():
            return cls(model, None, deterministic=deterministic)
        # VecNormalize.load would tie the statistics to one vector environment.
        with path.open("rb") as file:
            return cls(model, pickle.load(file), deterministic=deterministic)

    def reset(self, num_envs: int) -> None:
        """Forget the random numbers drawn so far; the model itself remembers nothing."""
        if not self._deterministic:
            self._model.set_random_seed(0)

    def __call__(self, obs: Any) -> np.ndarray:
        """Return an action per row."""
        if self._normalizer is not None:
            obs = self._normalizer.normalize_obs(obs)
        return self._model.predict(obs, deterministic=self._deterministic)[0]


def load_controller(env_id: str) -> Policy | None:
    """Return the hand-written controller of `env_id`, or None if there is none."""
    from steelyard_agents import controllers

    try:
        return controllers.load(env_id)
    except LookupError:
        return None
