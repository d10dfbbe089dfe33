"""Environments for the tests whose every observation and reward is known beforehand."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

POINT_ID = "SteelyardTest/Point-v0"


def register() -> None:
    """Register the point to be trained on."""
    if POINT_ID not in gym.registry:
        gym.register(
            POINT_ID,
            entry_point=f"{__name__}:PointEnv",
            vector_entry_point=f"{__name__}:PointVectorEnv",
            max_episode_steps=10,
        )


class ScriptedVectorEnv(VectorEnv):
    """Row r ends episode e after `3 + (r + e) % 4` steps: terminated, truncated or both in turn.

    The observation is (row, episode, step) and the reward of step s is s. Observations, rewards and
    infos live in the same memory all the time, which the next call overwrites.
    """

    def __init__(
        self,
        num_envs: int,
        *,
        autoreset_mode: AutoresetMode = AutoresetMode.SAME_STEP,
        final_obs_per_row: bool = False,
        render_mode: str | None = None,
    ) -> None:
        self.num_envs = num_envs
        self.autoreset_mode = autoreset_mode
        self.render_mode = render_mode
        self.metadata = {"autoreset_mode": autoreset_mode, "render_modes": ["rgb_array"]}
        self.single_observation_space = Box(0.0, 100.0, (3,), np.float32)
        self.single_action_space = Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._final_obs_per_row = final_obs_per_row
        self._obs = np.zeros((num_envs, 3), np.float32)
        self._final_obs = np.zeros((num_envs, 3), np.float32)
        self._reward = np.zeros(num_envs)
        self._final_step = np.zeros(num_envs)
        self.seeds: list[int | None] = []
        self.options: list[dict[str, Any] | None] = []

    @staticmethod
    def episode_length(row: int, episode: int) -> int:
        return 3 + (row + episode) % 4

    @staticmethod
    def ending(row: int, episode: int) -> tuple[bool, bool]:
        """Return whether the episode terminates, and whether it is truncated."""
        return [(True, False), (False, True), (True, True)][(row + episode) % 3]

    def reset(self, *, seed=None, options=None):
        self.seeds.append(seed)
        self.options.append(options)
        mask = (options or {}).get("reset_mask")
        if mask is None:
            self._obs[:] = 0.0
            self._obs[:, 0] = np.arange(self.num_envs)
        else:
            self._begin(mask)
        return self._obs, {"start": self._obs[:, 1]}

    def _begin(self, mask: np.ndarray) -> None:
        self._obs[mask, 1] += 1
        self._obs[mask, 2] = 0

    def step(self, actions):
        assert actions.shape == (self.num_envs, 1)
        self._obs[:, 2] += 1
        rows, episodes, steps = self._obs.astype(int).T
        self._reward[:] = steps
        over = steps == 3 + (rows + episodes) % 4
        kind = (rows + episodes) % 3
        terminated, truncated = over & (kind != 1), over & (kind != 0)
        info: dict[str, Any] = {"reward_step": self._reward, "is_success": steps % 2 == 0}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and over.any():
            self._final_obs[:] = self._obs
            self._final_step[:] = steps
            self._begin(over)
            final_obs: Any = self._final_obs
            if self._final_obs_per_row:
                final_obs = np.full(self.num_envs, None, dtype=object)
                for row in np.flatnonzero(over):
                    final_obs[row] = self._final_obs[row]
            info |= {"final_obs": final_obs, "_final_obs": over, "_final_info": over}
            info["final_info"] = {
                "reward_step": self._final_step,
                "is_success": steps % 2 == 0,
                "place": self._final_obs[:, 1:],
                "only_odd_rows": rows,
                "_only_odd_rows": rows % 2 == 1,
            }
        return self._obs, self._reward, terminated, truncated, info

    def render(self):
        return tuple(np.full((2, 2, 3), row, np.uint8) for row in range(self.num_envs))

    def total(self, scale: float) -> float:
        return scale * self.num_envs

    def chosen(self, scale: float, indices: list[int]) -> list[float]:
        return [scale * index for index in indices]


class PointVectorEnv(VectorEnv):
    """A point on a line is to stay near the middle; it starts anywhere and is lost beyond 1.

    Reward `1 - position²`; success is an episode that reaches the time limit. Row i draws its
    starts from a generator seeded `seed + i`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int = 10,
        gain: float = 0.3,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        if autoreset_mode is not AutoresetMode.SAME_STEP:
            raise NotImplementedError(f"{autoreset_mode} is not needed by the tests")
        self.num_envs = num_envs
        self.max_episode_steps = max_episode_steps
        self.gain = gain
        self.render_mode = render_mode
        self.autoreset_mode = autoreset_mode
        self.metadata = self.metadata | {"autoreset_mode": autoreset_mode}
        self.single_observation_space = Box(-2.0, 2.0, (1,), np.float32)
        self.single_action_space = Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed=None, options=None):
        seeds = [None if seed is None else seed + row for row in range(self.num_envs)]
        self._random = [np.random.default_rng(row_seed) for row_seed in seeds]
        self._position = np.zeros(self.num_envs)
        self._steps = np.zeros(self.num_envs, int)
        self._begin(np.ones(self.num_envs, bool))
        return self._position[:, None].astype(np.float32), {}

    def _begin(self, mask: np.ndarray) -> None:
        for row in np.flatnonzero(mask):
            self._position[row] = self._random[row].uniform(-0.9, 0.9)
        self._steps[mask] = 0

    def step(self, actions):
        self._position += self.gain * np.asarray(actions)[:, 0]
        self._steps += 1
        reward = 1.0 - self._position**2
        terminated = np.abs(self._position) > 1.0
        truncated = self._steps >= self.max_episode_steps
        success = truncated & ~terminated
        info: dict[str, Any] = {"is_success": success, "physics_error": np.zeros_like(success)}
        done = terminated | truncated
        if done.any():
            final_obs = self._position[:, None].astype(np.float32)
            info = info | {"final_obs": final_obs, "final_info": dict(info)}
            self._begin(done)
        return self._position[:, None].astype(np.float32), reward, terminated, truncated, info


class PointEnv(gym.Env):
    """One point, without a time limit of its own."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, *, gain: float = 0.3, render_mode: str | None = None) -> None:
        self.gain = gain
        self.render_mode = render_mode
        self.observation_space = Box(-2.0, 2.0, (1,), np.float32)
        self.action_space = Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._position = float(np.random.default_rng(seed).uniform(-0.9, 0.9))
        return np.array([self._position], np.float32), {}

    def step(self, action):
        self._position += self.gain * float(action[0])
        terminated = abs(self._position) > 1.0
        obs = np.array([self._position], np.float32)
        return obs, 1.0 - self._position**2, terminated, False, {"is_success": not terminated}

    def render(self):
        frame = np.full((34, 66, 3), 255, np.uint8)
        column = int(np.clip(32 + 25 * self._position, 2, 62))
        frame[12:20, column - 2 : column + 3] = (11, 98, 164)
        return frame


class PointController:
    """Walk straight back to the middle."""

    def reset(self, num_envs: int) -> None:
        self.num_envs = num_envs

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        assert obs.shape == (self.num_envs, 1)
        return np.clip(-obs / 0.3, -1.0, 1.0)
