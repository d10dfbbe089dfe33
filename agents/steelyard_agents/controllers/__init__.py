"""Hand-written controllers: a few lines of honest control theory or ballistics per environment.

A controller has `reset(num_envs)` and is called with observations, shape (n, obs_dim) float32, for
actions, shape (n, act_dim) float32. It knows the constants of its environment's docstring and sees
nothing of a world but the observations.
"""

import importlib
from typing import Protocol, cast

import numpy as np

# Module and class by id; imported when asked for, so that one environment's physics is not
# compiled for the sake of another.
CONTROLLERS = {
    "steelyard/Platform-v0": ("platform", "PlatformController"),
    "steelyard/Ballistic-v0": ("ballistic", "BallisticController"),
    "steelyard/Bridge-v0": ("bridge", "BridgeController"),
}


class Controller(Protocol):
    """What every controller offers."""

    def reset(self, num_envs: int) -> None:
        """Forget everything: `num_envs` rows start a new episode."""

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Return an action per row."""


def load(env_id: str) -> Controller:
    """Return a new controller for `env_id`.

    Raises:
        LookupError: No controller is written for that id; the message names those that are.
    """
    if env_id not in CONTROLLERS:
        raise LookupError(
            f"there is no controller for {env_id!r}; there are controllers for "
            f"{', '.join(CONTROLLERS)}"
        )
    module, name = CONTROLLERS[env_id]
    found = importlib.import_module(f"{__name__}.{module}")
    return cast(Controller, getattr(found, name)())
