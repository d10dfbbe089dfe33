"""Three equal pendulums let go level, 2 s: where each particle is, in a motion on the way to chaos."""

from __future__ import annotations

from benchmarks.laboratory.problem import Problem
from benchmarks.laboratory.problems.linked_pendulums import chain_problem


def problems() -> tuple[Problem, ...]:
    """The triple pendulum."""
    return (
        chain_problem(
            "triple pendulum",
            "triple",
            steps=(3, 6, 12, 24, 48, 96, 192, 384, 1024),
            peer_steps=(3, 6, 12, 24, 48, 96),
        ),
    )
