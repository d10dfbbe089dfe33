"""A chain of twenty links let go level, its end 1, 1000 and a million times as heavy as the others, 1 s.

Under a heavy end the light links vibrate across at up to 2 sqrt(T / (m l)) radians a second, some 1,000 and
34,000 here: a step at 60 Hz that does not take account of this geometric stiffness fails.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.laboratory.problem import Problem
from benchmarks.laboratory.problems.linked_pendulums import chain_problem


def problems() -> tuple[Problem, ...]:
    """End masses 1, 1000 and 1e6 times the others."""
    found = []
    for ratio, steps in (
        (1.0, (3, 6, 12, 24, 48, 96, 192)),
        (1e3, (6, 12, 24, 48, 96, 192, 384)),
        (1e6, (6, 24, 96, 384, 1536)),
    ):
        problem = chain_problem(
            f"chain of 20, end x {ratio:g}",
            f"chain_{ratio:g}",
            steps=steps,
            peer_steps=(6, 24, 96),
        )
        dear = {f"RATTLE, Gauss-Seidel x {n}": "far too soft at any step" for n in (4, 16)}
        found.append(problem if ratio == 1.0 else replace(problem, omitted=dear))
    return tuple(found)
