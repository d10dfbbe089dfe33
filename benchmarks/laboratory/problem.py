"""What a reference problem states: a motion with a trusted solution, and the errors that are counted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import steelyard as sy
from benchmarks.scenes import Array, ParticleScene


@dataclass(frozen=True)
class Motion:
    """States at the looks.

    Attributes:
        position: Positions [m], shape (looks, particles, 3).
        velocity: Velocities [m/s], shape (looks, particles, 3).
    """

    position: Array
    velocity: Array


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One kind of error of a motion.

    Attributes:
        name: What is wrong by so much.
        unit: Its unit; "share" of the whole where it has none. An error of 1e-3 is a millimetre, a
            thousandth of the energy or a thousandth of a link's length alike, so that the worst
            measure of a motion is the largest number.
        error: The error of a motion; 0 for the true one, up to rounding.
    """

    name: str
    unit: str
    error: Callable[[Motion], float]


class Stepper(Protocol):
    """Another engine with the motion's start loaded."""

    def reset(self) -> None:
        """Back to the start."""

    def step(self, steps: int) -> None:
        """Advance without looking."""

    def state(self) -> tuple[Array, Array]:
        """Positions [m] and velocities [m/s], shape (particles, 3)."""


#: Another engine, given its step [s].
Peer = Callable[[float], Stepper]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A reference problem.

    Attributes:
        name: Name, also of its files; variants of one problem have a part behind a comma.
        scene: Builds what moves, at the start.
        stretch: Unit of the looks [s]; every step of the ladder divides it.
        looks: When the motion is looked at, in whole stretches, rising.
        measures: The errors that count, the trajectory's first.
        steps: Ladder of steps, as steps per stretch, rising.
        peers: Other engines that can do it, by name; they get the same ladder or `peer_steps`.
        peer_steps: Ladder of the peers where it is another.
        forms: Other ways to write the same physics, by name; each is charted with one method, the one
            that `best` names with it or velocity Verlet.
        marks: Positions and velocities of a world that errors are measured at, (worlds, n, 3) each; for forms
            whose particles and bodies are others than the scene's.
        omitted: Methods that are not charted, with the reason.
        best: Name of a method that follows the motion, for tests.
        wrong: What a defective engine would do, by the defect: scenes that differ from the true one
            by it. The measures must tell each from the true motion.
        follows: Error within which the best method follows at the least step.
    """

    name: str
    scene: Callable[[], sy.Scene]
    stretch: float
    looks: tuple[int, ...]
    measures: tuple[Measure, ...]
    steps: tuple[int, ...]
    peers: Mapping[str, Peer] = field(default_factory=dict)
    peer_steps: tuple[int, ...] | None = None
    forms: Mapping[str, Callable[[], sy.Scene]] = field(default_factory=dict)
    marks: Callable[[sy.World], tuple[Array, Array]] = sy.landmarks
    omitted: Mapping[str, str] = field(default_factory=dict)
    best: str
    wrong: Mapping[str, Callable[[], sy.Scene]]
    follows: float = 3e-4

    @property
    def times(self) -> Array:
        """Times of the looks [s]."""
        return self.stretch * np.array(self.looks, dtype=np.float64)

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.stretch * self.looks[-1]

    def errors(self, motion: Motion) -> dict[str, float]:
        """All errors of a motion, by the name of the measure."""
        return {measure.name: measure.error(motion) for measure in self.measures}

    def quick(self) -> Problem:
        """The same with two steps, to show that all runs."""
        middle = len(self.steps) // 2
        steps = self.steps[max(middle - 1, 0) : middle + 1]
        return replace(self, steps=steps, peer_steps=steps[-1:])


def worst(errors: Mapping[str, float]) -> float:
    """A method is as good as its worst error."""
    return max(errors.values())


# Measures that many problems share


def trajectory(reference: Motion) -> Measure:
    """Largest distance of a particle from where it should be, over the looks."""

    def error(motion: Motion) -> float:
        return float(np.linalg.norm(motion.position - reference.position, axis=2).max())

    return Measure(name="trajectory", unit="m", error=error)


def energy(reference: Motion, of: Callable[[Array, Array], Array], *, scale: float) -> Measure:
    """Largest error of the energy over the looks, as a share of a scale.

    Args:
        reference: The true motion, whose energy may change.
        of: Energy [J] at each look, from positions and velocities.
        scale: What the error is a share of [J].
    """
    true = of(reference.position, reference.velocity)

    def error(motion: Motion) -> float:
        return float(np.abs(of(motion.position, motion.velocity) - true).max() / scale)

    return Measure(name="energy", unit="share", error=error)


def links(scene: ParticleScene) -> Measure:
    """Largest error of a rod's length and largest overstretch of a cable, over its length."""
    incidence, anchor, length = scene.spans()
    rigid = len(scene.rods) + len(scene.pins)

    def error(motion: Motion) -> float:
        spans = np.einsum("lp,tpc->tlc", incidence, motion.position) - anchor
        strain = np.linalg.norm(spans, axis=2) / length - 1.0
        strain[:, :rigid] = np.abs(strain[:, :rigid])
        return float(max(strain.max(), 0.0))

    return Measure(name="links", unit="share", error=error)


def particle_energy(scene: ParticleScene) -> Callable[[Array, Array], Array]:
    """Kinetic energy and that of gravity [J] at each look."""
    gravity = np.asarray(scene.gravity)

    def of(position: Array, velocity: Array) -> Array:
        kinetic = 0.5 * np.einsum("p,tpc,tpc->t", scene.mass, velocity, velocity)
        return np.asarray(kinetic - np.einsum("p,c,tpc->t", scene.mass, gravity, position))

    return of
