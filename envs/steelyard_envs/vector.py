"""A task as a native Gymnasium vector environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

import steelyard as sy
from steelyard_envs.single import check_render_mode, make_renderer, step_error, warn_of_no_mode
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED, Task

Array = NDArray[Any]


@sy.kernel
def _forget(mask, kept, streams, rewards, flags):
    """Drop what the worlds of a mask did in a step: rewards, flags, and the random numbers drawn since ``kept``."""
    for w in range(mask.shape[0]):
        if mask[w]:
            for row in range(streams.shape[0]):
                streams[row, w] = kept[row, w]
            for row in range(rewards.shape[0]):
                rewards[row, w] = 0.0
            for row in range(flags.shape[0]):
                flags[row, w] = False


class TaskVectorEnv(gym.vector.VectorEnv[Array, Array, Array]):
    """Many worlds of a task, stepped together. Row i equals the single environment seeded ``seed + i``.

    Args:
        num_envs: number of worlds, at least 1.
        max_episode_steps: control steps after which an episode is truncated; None for no limit.
        autoreset_mode: when a finished row begins anew: NEXT_STEP, SAME_STEP (then ``final_obs``
            and ``final_info`` are in the info) or DISABLED: a finished row goes on until
            ``reset(options={"reset_mask": mask})``.
        render_mode: None, "human" (the first world, at every step) or "rgb_array" (every world).
        **task: arguments of the task: difficulty, method, physics_rate, control_rate, tolerance.
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
        names = (*(f"reward_{term}" for term in self.task.terms), "is_success", "physics_error")
        self._keys = (*names, *(f"_{name}" for name in names))
        self._done = np.zeros(self.num_envs, dtype=np.bool_)
        self._all = np.ones(self.num_envs, dtype=np.bool_)
        # Kernels get this one array: a read-only or strided one would make numba compile them anew.
        self._actions = np.zeros((self.num_envs, *self.task.action_shape), dtype=np.float32)
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
            ResetNeeded: the first reset is of some rows only.
        """
        super().reset(seed=int(seed) if isinstance(seed, int | np.integer) else None)
        mask = self._mask(options)
        self._seed(seed, mask)
        self.task.rewards[:, mask] = 0.0
        self.task.flags[:, mask] = False
        self.task.start(mask)
        self._done &= ~mask
        if self.render_mode == "human":
            self.render()
        return self.task.observations.copy(), self._info(mask)

    def _mask(self, options: dict[str, Any] | None) -> Array:
        if not options or "reset_mask" not in options:
            return self._all.copy()
        mask = np.array(options["reset_mask"])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(
                f"{type(self).__name__}.reset: reset_mask has shape {mask.shape} and type {mask.dtype}; it must be "
                f"({self.num_envs},) bool. Set True for the rows to reset."
            )
        if not (self._seeded or mask.all()):
            raise gym.error.ResetNeeded(
                f"{type(self).__name__}.reset: reset_mask leaves out rows in which no episode has "
                "begun. Reset all rows first."
            )
        return mask

    def _seed(self, seed: int | list[int | None] | None, mask: Array) -> None:
        """Start the random streams of ``mask`` as ``seed`` says; at first, all of them."""
        if isinstance(seed, int | np.integer):
            first = np.uint64(int(seed) % 2**64)
            self.task.seed(mask, (np.arange(self.num_envs, dtype=np.uint64) + first)[mask])
        elif seed is not None and len(seed) != self.num_envs:
            raise ValueError(
                f"{type(self).__name__}.reset: {len(seed)} seeds are given; there are {self.num_envs} rows. "
                "Give one per row, None to go on."
            )
        else:
            if not self._seeded:
                self.task.seed(self._all, self.np_random.integers(2**63, size=self.num_envs))
            if seed is not None:
                pairs = [(k, s) for k, s in enumerate(seed) if mask[k] and s is not None]
                self.task.seed([k for k, _ in pairs], [s for _, s in pairs])
        self._seeded = True

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """One control step of every row; finished rows begin anew as the autoreset mode says.

        Raises:
            ValueError: actions of another shape.
            ResetNeeded: no episode has begun.
        """
        task = self.task
        given = self._actions
        if not self._seeded or np.shape(actions) != given.shape:
            raise step_error(self, self._seeded, np.shape(actions), given.shape)
        given[:] = actions
        again = self._done if self.autoreset_mode == AutoresetMode.NEXT_STEP else None
        if again is not None and again.any():
            streams = task.streams.copy()
            task.step(given)
            _forget(again, streams, task.streams, task.rewards, task.flags)
            task.start(again)
            ended = 1
        else:
            ended = task.step(given)
        terminated = task.flags[TERMINATED].copy()
        truncated = task.flags[TRUNCATED].copy()
        reward = task.rewards[0].copy()
        info: dict[str, Any] = {}
        if ended:
            done = self._done = terminated | truncated
            if self.autoreset_mode == AutoresetMode.SAME_STEP and done.any():
                info = self._final(done)
                task.rewards[:, done] = 0.0
                task.flags[:, done] = False
                task.start(done)
        if self.render_mode == "human":
            self.render()
        return task.observations.copy(), reward, terminated, truncated, self._info() | info

    def _final(self, done: Array) -> dict[str, Any]:
        """Last observations and infos of the finished rows, in Gymnasium's form."""
        final = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(done):
            final[row] = self.task.observations[row].copy()
        return {
            "final_obs": final,
            "_final_obs": done.copy(),
            "final_info": self._info(done),
            "_final_info": done.copy(),
        }

    def _info(self, rows: Array | None = None) -> dict[str, Any]:
        """Reward terms and flags of all rows, or of ``rows`` (num_envs,) bool, in Gymnasium's form; others are 0."""
        task = self.task
        terms = task.rewards[1:].copy()
        flags = task.flags.copy()
        if rows is None:
            rows = self._all
        else:
            terms *= rows
            flags &= rows
        present = np.empty((len(self._keys) // 2, self.num_envs), dtype=np.bool_)
        present[:] = rows
        values = (*terms, flags[SUCCESS], flags[PHYSICS_ERROR], *present)
        return dict(zip(self._keys, values, strict=True))

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
            warn_of_no_mode(self)
            return None
        if self._renderer is None:
            self._renderer = make_renderer(self.task, self.render_mode)
        if self.render_mode == "human":
            self._renderer.render(self.task.drawing(0))
            return None
        return tuple(self._renderer.render(self.task.drawing(w)) for w in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}
