"""The methods that the charts compare: those that the engine chooses from."""

from __future__ import annotations

from collections.abc import Iterator

import steelyard as sy
from benchmarks.laboratory.problem import Problem


def named(name: str) -> sy.Candidate:
    """The entry of a name."""
    return next(entry for entry in sy.CANDIDATES if entry.name == name)


def single(row: str) -> dict[str, str]:
    """Methods to leave out where there is one row to solve: more sweeps change nothing."""
    reason = f"one {row}: the first sweep settles it"
    return {f"RATTLE, Gauss-Seidel x {passes}": reason for passes in (16, 64)}


def able(problem: Problem, scene: sy.Scene) -> Iterator[sy.Candidate]:
    """The methods that can step a scene of a problem, but those that it omits."""
    return (entry for entry in sy.candidates(scene) if entry.name not in problem.omitted)
