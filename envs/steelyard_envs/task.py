"""Task: one batch of one environment's worlds, shared by the single and the vector environment."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import steelyard as sy

# Rows of ``Task.flags``.
TERMINATED, TRUNCATED, SUCCESS, PHYSICS_ERROR = range(4)

Array = NDArray[Any]


class Task(ABC):
    """Scene, control, observation, reward, termination and randomisation of one environment.

    A subclass lies in one file with its kernels; it works for one world and for thousands. Kernels get
    whole arrays and loop over worlds, so a control step is one call whatever the number of worlds.

    Args:
        num_envs: number of worlds.
        difficulty: level, one of ``levels``.
        method: name of the physics method, one of ``methods``; None for the default.
        physics_rate: physics steps per second, a whole multiple of ``control_rate``; None for the
            default, or the next multiple above it.
        control_rate: control steps per second; None for the default.
        tolerance: instead of a method and a physics rate: the cheapest pair that was measured to hold this
            error [m], see ``measured``.
        max_steps: control steps after which an episode is truncated; 0 leaves that to a wrapper.

    Attributes:
        observations: (num_envs, observations) float32, written by each step.
        rewards: (1 + terms, num_envs) float64: the reward, then its terms.
        flags: (4, num_envs) bool: terminated, truncated, success, physics error.
    """

    #: Names, lows, highs and units of the observations.
    observation_table: ClassVar[tuple[tuple[str, float, float, str], ...]]
    #: Names of the actions; each runs from -1 to 1.
    action_table: ClassVar[tuple[str, ...]]
    #: Names of the reward terms.
    terms: ClassVar[tuple[str, ...]]
    levels: ClassVar[tuple[int, ...]] = (1, 2, 3)
    methods: ClassVar[tuple[str, ...]]
    default_physics_rate: ClassVar[float]
    default_control_rate: ClassVar[float] = 50.0
    #: Method, physics rate [1/s], error [m] and cost of a control step over the default's, as measured: the largest
    #: distance of a particle from a fine run within 1 s of random actions at the easiest level, the worst of 32 worlds.
    measured: ClassVar[tuple[tuple[str, float, float, float], ...]]
    #: Rows of ``values``: what the task keeps per world.
    value_rows: ClassVar[int]

    def __init__(
        self,
        num_envs: int,
        *,
        difficulty: int = 2,
        method: str | None = None,
        physics_rate: float | None = None,
        control_rate: float | None = None,
        tolerance: float | None = None,
        max_steps: int = 0,
    ) -> None:
        name = type(self).__name__
        if tolerance is not None:
            method, least = self.physics_for(tolerance, method, physics_rate)
        else:
            least = self.default_physics_rate
        self.difficulty = _choice(name, "difficulty", difficulty, self.levels)
        chosen = self.methods[0] if method is None else method
        self.method = _choice(name, "method", chosen, self.methods)
        control = self.default_control_rate if control_rate is None else float(control_rate)
        if physics_rate is not None:
            physics = float(physics_rate)
        elif control > 0:
            # The smallest multiple of the control rate that is no slower than what is needed.
            physics = control * max(1, math.ceil(least / control - 1e-9))
        else:
            physics = least
        ratio = physics / control if control > 0 else 0.0
        if not (1 <= ratio < math.inf and abs(ratio - round(ratio)) < 1e-9):
            raise ValueError(
                f"{name}: physics_rate is {physics!r} and control_rate {control!r}; the physics rate must be a "
                "whole multiple of a control rate above 0. Use 50 and 50, or 200 and 50."
            )
        self.num_envs = num_envs
        self.control_rate = control
        self.physics_rate = physics
        self.substeps = round(ratio)
        self.world = self.build()
        padded = self.world.state.shape[1]
        self.values = np.zeros((self.value_rows, padded))
        self.streams = np.zeros((2, num_envs), dtype=np.uint64)
        self.rewards = np.zeros((1 + len(self.terms), num_envs))
        self.flags = np.zeros((4, num_envs), dtype=np.bool_)
        self.observations = np.zeros((num_envs, len(self.observation_table)), dtype=np.float32)
        self.settings = np.asarray(
            [1.0 / control, float(max_steps), *self.level_settings()], dtype=np.float64
        )
        self.layout = np.asarray(self.rows(), dtype=np.int64)

    @classmethod
    def physics_for(
        cls, tolerance: float, method: str | None = None, physics_rate: float | None = None
    ) -> tuple[str, float]:
        """Name and rate [1/s] of the cheapest physics that was measured to hold a tolerance [m].

        Raises:
            ValueError: a method or a rate is given as well, or nothing that was measured holds it.
        """
        if method is not None or physics_rate is not None:
            raise ValueError(
                f"{cls.__name__}: a tolerance of {tolerance!r} is given beside a method or a physics rate, which "
                "follow from it. Give one or the other."
            )
        holding = [row for row in cls.measured if row[2] <= tolerance]
        if not holding:
            best = min(cls.measured, key=lambda row: row[2])
            raise ValueError(
                f"{cls.__name__}: tolerance is {tolerance!r} m; the least error that was measured is {best[2]:g} m, "
                f"of {best[0]!r} at {best[1]:g} Hz. Ask for that, or give a method and a higher physics_rate."
            )
        cheapest = min(holding, key=lambda row: row[3])
        return cheapest[0], cheapest[1]

    @abstractmethod
    def build(self) -> sy.World:
        """The world, stepped by ``self.method`` at ``self.physics_rate``."""

    @abstractmethod
    def level_settings(self) -> tuple[float, ...]:
        """Numbers that the kernels need at this difficulty; they come after the control step and limit."""

    @abstractmethod
    def rows(self) -> tuple[int, ...]:
        """Rows of the world's state that the kernels need."""

    @abstractmethod
    def start(self, mask: Array) -> None:
        """Begin a new episode in the worlds of ``mask`` (num_envs,) bool and observe them."""

    @abstractmethod
    def step(self, actions: Array) -> int:
        """One control step of all worlds.

        Args:
            actions: (num_envs, actions) float32; out of range is clipped, NaN counts as 0.

        Returns:
            Number of worlds whose episode ended.
        """

    @abstractmethod
    def drawing(self, index: int) -> sy.draw.Drawing:
        """What world ``index`` looks like."""

    @property
    @abstractmethod
    def camera(self) -> dict[str, Any]:
        """Arguments of the camera."""

    def seed(self, chosen: Array | list[int], seeds: Array | Sequence[int]) -> None:
        """Give worlds the random streams of ``seeds``, from their beginning.

        Args:
            chosen: mask (num_envs,) bool, or indices, of the worlds.
            seeds: one for each of them, at least 0; those above 64 bits, as Gymnasium draws them,
                count modulo 2**64.

        Raises:
            ValueError: a seed below 0.
        """
        if not isinstance(seeds, np.ndarray):
            if min(seeds, default=0) < 0:
                raise ValueError(
                    f"{type(self).__name__}: a seed is {min(seeds)}; it must be 0 or more. Use 0."
                )
            seeds = np.array([int(entry) % 2**64 for entry in seeds], dtype=np.uint64)
        self.streams[0, chosen] = seeds
        self.streams[1, chosen] = 0

    def snapshot(self) -> tuple[Any, ...]:
        """Copy of the whole state: physics, task, random streams and outputs."""
        return self.world.snapshot(), tuple(array.copy() for array in self._arrays())

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Put back a snapshot of this task."""
        world, copies = snapshot
        self.world.restore(world)
        for array, copy in zip(self._arrays(), copies, strict=True):
            array[:] = copy

    def _arrays(self) -> tuple[Array, ...]:
        """Everything but the physics that a snapshot keeps."""
        return (self.values, self.streams, self.rewards, self.flags, self.observations)

    @property
    def action_shape(self) -> tuple[int]:
        """Shape of one world's action."""
        return (len(self.action_table),)

    @classmethod
    def observation_space(cls) -> gym.spaces.Box:
        """Bounds of one world's observation."""
        low = np.array([row[1] for row in cls.observation_table], dtype=np.float32)
        high = np.array([row[2] for row in cls.observation_table], dtype=np.float32)
        return gym.spaces.Box(low, high, dtype=np.float32)

    @classmethod
    def action_space(cls) -> gym.spaces.Box:
        """Actions run from -1 to 1."""
        return gym.spaces.Box(-1.0, 1.0, (len(cls.action_table),), dtype=np.float32)


def _choice(owner: str, name: str, value: Any, allowed: tuple[Any, ...]) -> Any:
    if value not in allowed:
        options = ", ".join(map(repr, allowed))
        raise ValueError(f"{owner}: {name} is {value!r}; it must be one of {options}.")
    return value
