"""A task as a native Gymnasium vector environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from steelyard_envs.single import check_render_mode, make_renderer
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED, Task

Array = NDArray[Any]


class TaskVectorEnv(gym.vector.VectorEnv[Array, Array, Array]):
    """Many worlds of a task, stepped together. Row i equals the single environment seeded ``seed + i``.

    Args:
        num_envs: number of worlds, at least 1.
        max_episode_steps: control steps after which an episode is truncated; None for no limit.
        autoreset_mode: when a finished row begins anew: NEXT_STEP, SAME_STEP (then ``final_obs`` and
            ``final_info`` are in the info) or DISABLED (``reset(options={"reset_mask": mask})``).
        render_mode: None, "human" (the first world) or "rgb_array" (every world).
        **task: arguments of the task: difficulty, method, physics_rate, control_rate.
    """

    task_class: ClassVar[type[Task]]
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        name = type(self).__name__
        check_render_mode(name, render_mode)
        if num_envs < 1 or int(num_envs) != num_envs:
            raise ValueError(
                f"{name}: num_envs is {num_envs!r}; it must be a whole number, at least 1."
            )
        self.num_envs = int(num_envs)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.render_mode = render_mode
        self.task = self.task_class(self.num_envs, max_steps=max_episode_steps or 0, **task)
        self.metadata = {
            **type(self).metadata,
            "render_fps": round(self.task.control_rate),
            "autoreset_mode": self.autoreset_mode,
        }
        self.single_observation_space = self.task.observation_space()
        self.single_action_space = self.task.action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._names = tuple(f"reward_{term}" for term in self.task.terms)
        self._done = np.zeros(self.num_envs, dtype=np.bool_)
        self._all = np.ones(self.num_envs, dtype=np.bool_)
        self._all.flags.writeable = False
        self._seeded = False
        self._renderer: Any = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin episodes in all rows, or in those of ``options["reset_mask"]`` (num_envs,) bool.

        Args:
            seed: row i gets ``seed + i``, or its entry of a list; without, random streams go on.
            options: ``{"reset_mask": mask}`` or None.

        Raises:
            ValueError: a mask or list of seeds of another shape.
        """
        super().reset(seed=seed if isinstance(seed, int) else None)
        mask = self._mask(options)
        self._seed(seed, mask)
        self.task.rewards[:, mask] = 0.0
        self.task.flags[:, mask] = False
        self.task.start(mask)
        self._done &= ~mask
        return self.task.observations.copy(), self._info()

    def _mask(self, options: dict[str, Any] | None) -> Array:
        if not options or "reset_mask" not in options:
            return self._all.copy()
        mask = np.asarray(options["reset_mask"])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(
                f"{type(self).__name__}.reset: reset_mask has shape {mask.shape} and type {mask.dtype}; it must be "
                f"({self.num_envs},) bool. Set True for the rows to reset."
            )
        return mask

    def _seed(self, seed: int | list[int | None] | None, mask: Array) -> None:
        if isinstance(seed, int | np.integer):
            self.task.seed(self._all, np.arange(self.num_envs) + int(seed))
        elif seed is not None:
            if len(seed) != self.num_envs:
                raise ValueError(
                    f"{type(self).__name__}.reset: {len(seed)} seeds are given; there are {self.num_envs} rows. "
                    "Give one per row, None to go on."
                )
            chosen = np.array([entry is not None for entry in seed]) & mask
            self.task.seed(chosen, np.array([s for s, c in zip(seed, chosen, strict=True) if c]))
        elif not self._seeded:
            self.task.seed(self._all, self.np_random.integers(2**63, size=self.num_envs))
        self._seeded = True

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """One control step of every row; finished rows begin anew as the autoreset mode says.

        Raises:
            ValueError: actions of another shape.
        """
        given = np.ascontiguousarray(actions, dtype=np.float32)
        if given.shape != self.action_space.shape:
            raise ValueError(
                f"{type(self).__name__}.step: actions have shape {given.shape}; it must be "
                f"{self.action_space.shape}. Give one action per row."
            )
        task = self.task
        again = self._done if self.autoreset_mode == AutoresetMode.NEXT_STEP else None
        if again is not None and again.any():
            streams = task.streams[:, again]
            task.step(given)
            # What a finished row did in this step is dropped, the random numbers it drew included.
            task.streams[:, again] = streams
            task.rewards[:, again] = 0.0
            task.flags[:, again] = False
            task.start(again)
            ended = 1
        else:
            ended = task.step(given)
        terminated = task.flags[TERMINATED].copy()
        truncated = task.flags[TRUNCATED].copy()
        reward = task.rewards[0].copy()
        if not ended:
            self._done[:] = False
            return task.observations.copy(), reward, terminated, truncated, self._info()
        done = terminated | truncated
        info: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and done.any():
            info = self._final(done)
            task.rewards[:, done] = 0.0
            task.flags[:, done] = False
            task.start(done)
        self._done = done
        return task.observations.copy(), reward, terminated, truncated, {**self._info(), **info}

    def _final(self, done: Array) -> dict[str, Any]:
        """Last observations and infos of the finished rows, in Gymnasium's form."""
        final = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(done):
            final[row] = self.task.observations[row].copy()
        info = {
            key: np.where(done, value, False if value.dtype == np.bool_ else 0.0)
            for key, value in self._info().items()
            if not key.startswith("_")
        }
        masks = {f"_{key}": done.copy() for key in info}
        return {
            "final_obs": final,
            "_final_obs": done.copy(),
            "final_info": info | masks,
            "_final_info": done.copy(),
        }

    def _info(self) -> dict[str, Any]:
        task = self.task
        info: dict[str, Any] = {}
        for k, name in enumerate(self._names):
            info[name] = task.rewards[1 + k].copy()
            info[f"_{name}"] = self._all
        for name, row in (("is_success", SUCCESS), ("physics_error", PHYSICS_ERROR)):
            info[name] = task.flags[row].copy()
            info[f"_{name}"] = self._all
        return info

    def snapshot(self) -> tuple[Any, ...]:
        """Copy of the whole state, random streams included, for ``restore``."""
        return self.task.snapshot(), self._done.copy()

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Continue from a snapshot of this environment."""
        task, self._done = snapshot[0], snapshot[1].copy()
        self.task.restore(task)

    def render(self) -> tuple[Any, ...] | None:
        """A frame (height, width, 3) per world in mode "rgb_array"; a window in mode "human"."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = make_renderer(self.task, self.render_mode)
        shown = range(1 if self.render_mode == "human" else self.num_envs)
        return tuple(self._renderer.render(self.task.drawing(w)) for w in shown)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}
