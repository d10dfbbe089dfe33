"""A task as a Gymnasium environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, Task

Observation = NDArray[np.float32]


class TaskEnv(gym.Env[Any, Any]):
    """One world of a task. Subclasses name the task; ``gymnasium.make`` adds the time limit.

    Args:
        render_mode: None, "human" or "rgb_array".
        **task: arguments of the task: difficulty, method, physics_rate, control_rate, tolerance.
    """

    task_class: ClassVar[type[Task]]
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}

    def __init__(self, *, render_mode: str | None = None, **task: Any) -> None:
        check_render_mode(type(self).__name__, render_mode)
        self.render_mode = render_mode
        self.task = self.task_class(1, **task)
        self.metadata = {**type(self).metadata, "render_fps": round(self.task.control_rate)}
        self.observation_space = self.task.observation_space()
        self.action_space = self.task.action_space()
        self._names = tuple(f"reward_{name}" for name in self.task.terms)
        self._all = np.ones(1, dtype=np.bool_)
        # Kernels get this one array: a read-only or strided one would make numba compile them anew.
        self._actions = np.zeros((1, *self.task.action_shape), dtype=np.float32)
        self._seeded = False
        self._renderer: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. ``seed`` starts the world's random stream anew; without, it goes on."""
        super().reset(seed=seed)
        if seed is not None or not self._seeded:
            chosen = int(self.np_random.integers(2**63)) if seed is None else seed
            self.task.seed(self._all, [chosen])
            self._seeded = True
        self.task.rewards[:] = 0.0
        self.task.flags[:] = False
        self.task.start(self._all)
        if self.render_mode == "human":
            self.render()
        return self.task.observations[0].copy(), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One control step; the physics takes ``physics_rate / control_rate`` steps.

        Raises:
            ValueError: an action of another shape.
            ResetNeeded: no episode has begun.
        """
        task = self.task
        if not self._seeded or np.shape(action) != task.action_shape:
            raise step_error(self, self._seeded, np.shape(action), task.action_shape)
        self._actions[0] = action
        task.step(self._actions)
        if self.render_mode == "human":
            self.render()
        return (
            task.observations[0].copy(),
            task.rewards.item(0, 0),
            task.flags.item(TERMINATED, 0),
            False,
            self._info(),
        )

    def _info(self) -> dict[str, Any]:
        task = self.task
        info = dict(zip(self._names, task.rewards[1:, 0].tolist(), strict=True))
        info["is_success"] = task.flags.item(SUCCESS, 0)
        info["physics_error"] = task.flags.item(PHYSICS_ERROR, 0)
        return info

    def snapshot(self) -> tuple[Any, ...]:
        """Copy of the whole state, random stream included, for ``restore``."""
        return self.task.snapshot()

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Continue from a snapshot of this environment."""
        self.task.restore(snapshot)

    def render(self) -> NDArray[np.uint8] | None:
        """A frame (height, width, 3) in mode "rgb_array"; a window in mode "human"."""
        if self.render_mode is None:
            warn_of_no_mode(self)
            return None
        if self._renderer is None:
            self._renderer = make_renderer(self.task, self.render_mode)
        frame: NDArray[np.uint8] | None = self._renderer.render(self.task.drawing(0))
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None}


def check_render_mode(owner: str, mode: str | None) -> None:
    """Raise ValueError for a mode that is not supported."""
    if mode not in (None, "human", "rgb_array"):
        raise ValueError(
            f"{owner}: render_mode is {mode!r}; it must be None, 'human' or 'rgb_array'."
        )


def warn_of_no_mode(owner: object) -> None:
    """Say why there is nothing to see."""
    gym.logger.warn(
        f"{type(owner).__name__}.render: render_mode is None; make the environment with "
        'render_mode="rgb_array" or "human".'
    )


def step_error(
    owner: object, begun: bool, given: tuple[int, ...], shape: tuple[int, ...]
) -> Exception:
    """What is wrong with a step: no episode has begun, or the actions have another shape."""
    name = type(owner).__name__
    if not begun:
        return gym.error.ResetNeeded(f"{name}.step: no episode has begun. Call reset first.")
    return ValueError(
        f"{name}.step: the actions have shape {given}; it must be {shape}. "
        "Give a number for every action."
    )


def make_renderer(task: Task, mode: str) -> Any:
    """A renderer with the task's camera; pygame is imported only now."""
    from steelyard_envs.rendering import Camera, Renderer

    return Renderer(
        render_mode=mode, render_fps=round(task.control_rate), camera=Camera(**task.camera)
    )
