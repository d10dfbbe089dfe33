"""The methods that the charts compare: one line each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import steelyard as sy
from benchmarks.laboratory.problem import Problem


@dataclass(frozen=True)
class Entry:
    """A method at any step.

    Attributes:
        name: Name in the charts.
        integrator: How it advances.
        solver: What holds links and contacts; None for scenes without any.
    """

    name: str
    integrator: Any
    solver: Any = None

    def at(self, dt: float) -> sy.Method:
        """The method with a step [s]."""
        return sy.Method(self.integrator, self.solver, dt=dt)


METHODS = (
    Entry("explicit Euler", sy.ExplicitEuler()),
    Entry("symplectic Euler", sy.SymplecticEuler()),
    Entry("velocity Verlet", sy.Rattle()),
    Entry("closed form", sy.ClosedForm()),
    Entry("RATTLE, direct", sy.Rattle(), sy.Direct()),
    Entry("velocity Verlet, order 4", sy.ComposedRattle()),
    Entry("velocity Verlet, order 6", sy.ComposedRattle(substeps=9)),
    Entry("RATTLE of order 4, direct", sy.ComposedRattle(), sy.Direct()),
    Entry("RATTLE of order 6, direct", sy.ComposedRattle(substeps=9), sy.Direct()),
    Entry("RATTLE, Gauss-Seidel x 4", sy.Rattle(), sy.GaussSeidel(passes=4)),
    Entry("RATTLE, Gauss-Seidel x 16", sy.Rattle(), sy.GaussSeidel(passes=16)),
    Entry("RATTLE, Gauss-Seidel x 64", sy.Rattle(), sy.GaussSeidel(passes=64)),
    Entry("symplectic Euler, direct", sy.SymplecticEuler(), sy.Direct()),
    Entry("explicit Euler, worst first", sy.ExplicitEuler(), sy.WorstFirst()),
)

HELD = (
    sy.Rod, sy.RodConstraint, sy.Cable, sy.CableConstraint, sy.Rider, sy.Ground, sy.LinePlatform,
    sy.ContactGenerator,
)  # fmt: skip


def named(name: str) -> Entry:
    """The entry of a name."""
    return next(entry for entry in METHODS if entry.name == name)


def single(row: str) -> dict[str, str]:
    """Methods to leave out where there is one row to solve: more sweeps change nothing."""
    reason = f"one {row}: the first sweep settles it"
    return {f"RATTLE, Gauss-Seidel x {passes}": reason for passes in (16, 64)}


def able(problem: Problem, scene: sy.Scene) -> Iterator[Entry]:
    """The methods that can step a scene of a problem; those with a solver only where one is needed."""
    held = bool(scene.of(*HELD))
    for entry in METHODS:
        if held == (entry.solver is not None) and entry.name not in problem.omitted:
            try:
                entry.at(problem.stretch).refuse(scene)
            except ValueError:
                continue
            yield entry
