"""SB3VecEnv: a Gymnasium vector environment as stable-baselines3 wants to see it."""

import inspect
import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import (
    VecEnvIndices,
    VecEnvObs,
    VecEnvStepReturn,
)

Info = dict[str, Any]


class SB3VecEnv(VecEnv):
    """Adapt a native Gymnasium `VectorEnv` to stable-baselines3's `VecEnv`.

    At the end of an episode stable-baselines3 wants the first observation of the next episode from
    `step`, the last one of the old episode as a copy in `infos[row]["terminal_observation"]`, and
    `infos[row]["TimeLimit.truncated"]` where time ran out without a termination: without these the
    value of the last state is bootstrapped wrongly or not at all. Every array handed out is a copy,
    because stable-baselines3 keeps observations over a step and adds to rewards in place, and
    vector environments may write into the same memory at every step.

    Infos are cheap: one dictionary per row, empty unless the row's episode has just ended. Then it
    holds the two entries above, the row's final info, and Monitor's record
    `episode = {"r": return, "l": length, "t": seconds since the adapter was made}`.

    Autoreset modes: SAME_STEP is used as it is; under DISABLED the adapter resets the finished rows
    itself. NEXT_STEP is refused: it spends one more step on the reset, in which the action is
    ignored, and stable-baselines3, which has no mask for it, would learn from that step.

    Args:
        env: The vector environment, in autoreset mode SAME_STEP or DISABLED.
        step_info_keys: Info entries with one value per row, to be copied into every row's info at
            every step (reward terms, for instance). Costs about .1 us per key, row and step.

    Raises:
        ValueError: The environment resets at the next step, or does not say when it resets.
    """

    def __init__(
        self, env: VectorEnv[Any, Any, Any], *, step_info_keys: Sequence[str] = ()
    ) -> None:
        self.env = env  # VecEnv's constructor already asks for an attribute of it
        self._autoreset_mode = _autoreset_mode(env)
        self._step_info_keys = tuple(step_info_keys)
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = env.metadata
        self._actions: np.ndarray | None = None
        self._returns = np.zeros(env.num_envs)
        self._lengths = np.zeros(env.num_envs, dtype=np.int64)
        self._start_time = time.time()

    def reset(self) -> VecEnvObs:
        """Start a new episode in every row and return the observations, shape (rows, ...)."""
        # `seed()` numbers the rows from its argument, as vector environments do from theirs.
        obs, info = self.env.reset(seed=self._seeds[0], options=self._options[0] or None)
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._lengths[:] = 0
        self.reset_infos = [_row_info(info, row, self.num_envs) for row in range(self.num_envs)]
        return _copy(obs)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions, shape (rows, ...), for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step every row; return observations, rewards (float32), dones and infos, all copies."""
        if self._actions is None:
            raise RuntimeError("step_wait() without actions: call step_async(actions) before it")
        actions, self._actions = self._actions, None
        obs, reward, terminated, truncated, info = self.env.step(actions)
        self._returns += reward
        self._lengths += 1
        rewards = np.array(reward, dtype=np.float32)
        dones = np.logical_or(terminated, truncated)
        infos = self._step_infos(info)
        if dones.any():
            rows = np.flatnonzero(dones).tolist()
            self._end_episodes(infos, obs, terminated, info, rows)
            if self._autoreset_mode is AutoresetMode.DISABLED:
                obs, info = self.env.reset(options={"reset_mask": dones.copy()})
            for row in rows:
                self.reset_infos[row] = _row_info(info, row, self.num_envs)
        return _copy(obs), rewards, dones, infos

    def _step_infos(self, info: Info) -> list[Info]:
        """Return one dictionary per row with the entries asked for, shape (rows,)."""
        infos: list[Info] = [{} for _ in range(self.num_envs)]
        for key in self._step_info_keys:
            if key not in info:
                raise ValueError(
                    f"step_info_keys names {key!r}, which this environment's info does not have; "
                    f"choose from {sorted(k for k in info if not k.startswith('_'))}"
                )
            for row_info, value in zip(infos, np.array(info[key]), strict=True):
                row_info[key] = value
        return infos

    def _end_episodes(
        self,
        infos: list[Info],
        obs: VecEnvObs,
        terminated: np.ndarray,
        info: Info,
        rows: list[int],
    ) -> None:
        """Write what stable-baselines3 needs to know of the finished `rows` into `infos`."""
        if self._autoreset_mode is AutoresetMode.SAME_STEP:
            if "final_obs" not in info:
                raise RuntimeError(
                    f"{self.env} says that it resets in the same step, but its info has no "
                    "'final_obs' at the end of an episode: the last observation is lost"
                )
            obs, info = info["final_obs"], info.get("final_info", {})
        seconds = round(time.time() - self._start_time, 6)
        for row in rows:
            infos[row].update(_row_info(info, row, self.num_envs))
            infos[row]["terminal_observation"] = _row_copy(obs, row)
            # A done row that did not terminate ran out of time; one that did both terminated.
            infos[row]["TimeLimit.truncated"] = not terminated[row]
            infos[row]["episode"] = {
                "r": float(self._returns[row]),
                "l": int(self._lengths[row]),
                "t": seconds,
            }
        self._returns[rows] = 0.0
        self._lengths[rows] = 0

    def set_options(self, options: list[dict] | dict | None = None) -> None:
        """Set the options of the next reset, which a vector environment takes for all rows.

        Raises:
            ValueError: `options` is a list with one entry per row.
        """
        if isinstance(options, list):
            raise ValueError(
                f"got a list of {len(options)} options, but a native vector environment takes one "
                "dictionary for all its rows: pass that dictionary"
            )
        super().set_options(options)

    def close(self) -> None:
        """Release the vector environment's resources."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return the frames that the vector environment renders, one per row."""
        frames: Any = self.env.render()
        return [None] * self.num_envs if frames is None else list(frames)

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return the vector environment's attribute, once per row asked for.

        The rows are parts of one object, so each entry is the whole attribute: index an array of
        one value per row yourself. The spaces are those of a single row.
        """
        if attr_name in ("observation_space", "action_space"):
            attr_name = f"single_{attr_name}"
        return [self._attribute(attr_name)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environment, which holds for all rows.

        Raises:
            ValueError: `indices` names only some of the rows.
        """
        if len(set(self._rows(indices))) < self.num_envs:
            raise ValueError(
                f"cannot set {attr_name!r} for rows {self._rows(indices)} alone: the "
                f"{self.num_envs} rows are one object; leave `indices` out, or use an argument of "
                "the environment that takes one value per row"
            )
        setattr(self.env.unwrapped, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of the vector environment once and return its result once per row.

        A method that takes `indices` gets the rows asked for, and returns one result for each.

        Raises:
            ValueError: `indices` names only some of the rows and the method takes no `indices`.
        """
        method, rows = self._attribute(method_name), self._rows(indices)
        if "indices" in inspect.signature(method).parameters:
            return list(method(*method_args, indices=rows, **method_kwargs))
        if len(set(rows)) < self.num_envs:
            raise ValueError(
                f"cannot call {method_name!r} for rows {rows} alone: the {self.num_envs} rows are "
                "one object; leave `indices` out, or give the method an argument `indices`"
            )
        return [method(*method_args, **method_kwargs)] * len(rows)

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Say for each row whether `wrapper_class` is at work: only Monitor's part is played."""
        return [issubclass(wrapper_class, Monitor)] * len(self._rows(indices))

    def _attribute(self, name: str) -> Any:
        """Return an attribute of the outermost wrapper that has it: they do not pass them on."""
        env = self.env
        while isinstance(env, VectorWrapper) and not hasattr(env, name):
            env = env.env
        return getattr(env, name)

    def _rows(self, indices: VecEnvIndices) -> list[int]:
        return [range(self.num_envs)[int(index)] for index in self._get_indices(indices)]


def _autoreset_mode(env: VectorEnv[Any, Any, Any]) -> AutoresetMode:
    """Return when `env` resets its rows; refuse modes that stable-baselines3 cannot use."""
    mode = getattr(env, "autoreset_mode", None) or env.metadata.get("autoreset_mode")
    if mode is None:
        raise ValueError(
            f"{env} does not say when it resets finished rows: set metadata['autoreset_mode'] to "
            "a gymnasium.vector.AutoresetMode"
        )
    mode = AutoresetMode(mode)
    if mode is AutoresetMode.NEXT_STEP:
        raise ValueError(
            f"{env} resets finished rows at the next step, ignoring that step's action, and "
            "stable-baselines3 would learn from it: make the environment with "
            "autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP, or, where it has no such "
            "argument, use steelyard_agents.make.make_vec_env, which then steps single "
            "environments"
        )
    return mode


def _copy(obs: Any) -> Any:
    """Copy a batch of observations, an array or a dictionary of arrays."""
    if isinstance(obs, dict):
        return {key: np.array(value) for key, value in obs.items()}
    return np.array(obs)


def _row_copy(obs: Any, row: int) -> Any:
    """Copy one row's observation out of a batch, or out of an object array of observations."""
    if isinstance(obs, dict):
        return {key: np.array(value[row]) for key, value in obs.items()}
    return _copy(obs[row])


def _row_info(info: Info, row: int, rows: int) -> Info:
    """Return one row's part of a vector environment's info, in plain Python values or copies.

    Gymnasium batches infos by key, with a mask `_key` of the rows that have the entry.
    """
    row_info: Info = {}
    for key, value in info.items():
        if key in ("final_obs", "final_info") or (key.startswith("_") and key[1:] in info):
            continue
        if f"_{key}" in info and not info[f"_{key}"][row]:
            continue
        if isinstance(value, dict):
            row_info[key] = _row_info(value, row, rows)
        elif isinstance(value, np.ndarray) and value.shape[:1] == (rows,):
            entry = value[row]
            row_info[key] = entry.item() if isinstance(entry, np.generic) else np.copy(entry)
        else:
            row_info[key] = value
    return row_info
