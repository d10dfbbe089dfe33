"""One engine following a problem: for its errors look by look, and for its cost without looking."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Protocol

import numpy as np

import steelyard as sy
from benchmarks.laboratory.problem import Motion, Peer, Problem

#: Factors of the start velocities, or of gravity where all starts at rest; worlds that are stepped
#: together differ, as worlds in training do.
SPREAD = np.linspace(1.0, 1.2, 16)


class BrokenRunError(ArithmeticError):
    """An engine could not follow the problem."""


class Run(Protocol):
    """An engine with a method and a step."""

    @property
    def simulated(self) -> float:
        """Simulated seconds of one call, over all worlds."""

    def __call__(self) -> None:
        """Follow the problem without looking."""

    def motion(self) -> Motion:
        """Motion of the first world.

        Raises:
            BrokenRunError: it could not be followed.
        """


class EngineRun:
    """This engine.

    Args:
        problem: What to follow.
        scene: Its scene, or another form of it.
        method: How to step.
        worlds: Number of worlds, the first of which is the problem's.
        rounds: Times that a call follows it.
    """

    def __init__(
        self,
        problem: Problem,
        scene: sy.Scene,
        method: sy.Method,
        *,
        worlds: int = 1,
        rounds: int = 1,
    ) -> None:
        self.problem, self.rounds = problem, rounds
        self.counts = _counts(problem, method.dt)
        self.world = sy.World(scene, worlds=worlds, method=method)
        if worlds > 1:
            factor = SPREAD[np.arange(worlds) % len(SPREAD)]
            bodies = self.world.bodies
            moving = [self.world.particles.velocity, bodies.velocity, bodies.angular_momentum]
            if any(part.any() for part in moving):
                for part in moving:
                    part *= factor[:, None, None]
            else:
                self.world.gravity = factor[:, None] * np.asarray(scene.gravity)
        self.start = self.world.snapshot()

    @property
    def simulated(self) -> float:
        """See ``Run``."""
        return self.rounds * self.world.worlds * self.problem.duration

    def __call__(self) -> None:
        """See ``Run``."""
        for _ in range(self.rounds):
            for _ in self._looks():
                pass

    def motion(self) -> Motion:
        """See ``Run``."""
        position, velocity = [], []
        for _ in self._looks():
            places, speeds = self.problem.marks(self.world)
            position.append(places[0].copy())
            velocity.append(speeds[0].copy())
        flags = int(self.world.health[0])
        if flags:
            raise BrokenRunError(
                "non-finite" if flags & 1 else "constraints missed their tolerance"
            )
        return Motion(np.stack(position), np.stack(velocity))

    def _looks(self) -> Iterator[None]:
        self.world.restore(self.start)
        for count in self.counts:
            self.world.step(count)
            yield


class PeerRun:
    """Another engine, one world.

    Args:
        problem: What to follow.
        peer: The engine.
        dt: Step [s].
        rounds: Times that a call follows it.
    """

    def __init__(self, problem: Problem, peer: Peer, *, dt: float, rounds: int = 1) -> None:
        self.problem, self.rounds = problem, rounds
        self.counts = _counts(problem, dt)
        self.stepper = peer(dt)

    @property
    def simulated(self) -> float:
        """See ``Run``."""
        return self.rounds * self.problem.duration

    def __call__(self) -> None:
        """See ``Run``."""
        for _ in range(self.rounds):
            for _ in self._looks():
                pass

    def motion(self) -> Motion:
        """See ``Run``."""
        states = [self.stepper.state() for _ in self._looks()]
        position, velocity = (np.stack(part) for part in zip(*states, strict=True))
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            raise BrokenRunError("non-finite")
        return Motion(position, velocity)

    def _looks(self) -> Iterator[None]:
        self.stepper.reset()
        for count in self.counts:
            self.stepper.step(count)
            yield


def _counts(problem: Problem, dt: float) -> list[int]:
    """Steps up to the first look and from each to the next."""
    per_stretch = round(problem.stretch / dt)
    if abs(per_stretch * dt - problem.stretch) > 1e-9 * problem.stretch:
        raise ValueError(
            f"dt {dt} s does not divide the {problem.stretch} s of {problem.name}: choose one."
        )
    return [per_stretch * (after - before) for before, after in pairwise((0, *problem.looks))]
