"""A chain of twenty links let go level, its end 1, 1000 and a million times as heavy as the others, 1 s.

Under a heavy end the light links vibrate across at up to 2 sqrt(T / (m l)) radians a second, some 1,000 and
34,000 here: a step at 60 Hz that does not take account of this geometric stiffness fails.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.laboratory.pendulums import stored
from benchmarks.laboratory.problem import Measure, Motion, Problem
from benchmarks.laboratory.problems.linked_pendulums import chain_problem


def tip_error(true: Motion, motion: Motion) -> float:
    """Largest distance of the heavy end from where it should be [m], over the looks."""
    return float(np.linalg.norm(motion.position[:, -1] - true.position[:, -1], axis=1).max())


def problems() -> tuple[Problem, ...]:
    """End masses 1, 1000 and 1e6 times the others."""
    found = []
    for ratio, steps in (
        (1.0, (3, 6, 12, 24, 48, 96, 192)),
        (1e3, (6, 12, 24, 48, 96, 192, 384)),
        # The last step resolves the vibration of the light links.
        (1e6, (6, 12, 24, 48, 96, 3072)),
    ):
        problem = chain_problem(
            f"chain of 20, end x {ratio:g}",
            f"chain_{ratio:g}",
            steps=steps,
            peer_steps=(6, 24, 96),
        )
        passes = {1.0: (), 1e3: (4, 16), 1e6: (4, 16, 64)}[ratio]
        dear = {f"RATTLE, Gauss-Seidel x {n}": "fails at any step" for n in passes}
        tip = Measure(name="tip", unit="m", error=partial(tip_error, stored(f"chain_{ratio:g}")))
        measures = (problem.measures[0], tip, *problem.measures[1:])
        found.append(replace(problem, omitted=dear, measures=measures))
    return tuple(found)
