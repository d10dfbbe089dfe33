"""Results of the laboratory: a JSON file and a picture per problem, and an overview."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import record
from benchmarks.figures import Announce
from benchmarks.laboratory import charts, problems
from benchmarks.laboratory.measurement import Point, by_tolerance, curves, measure, order
from benchmarks.laboratory.problem import Problem

NOTE = (
    "Down and left is better. Large marks: the step nearest 1/60 s. Hollow: a single world. "
    "Dashed: other engines, one world. One core."
)


def run(
    names: Sequence[str], *, quick: bool, output: Path, announce: Announce, overview: bool
) -> None:
    """Measure problems and write NAME.json and NAME.png for each to `output`.

    Args:
        names: The problems.
        quick: Two steps and few worlds: shows that all runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with what begins.
        overview: Whether to draw all of them on one page too.
    """
    output.mkdir(parents=True, exist_ok=True)
    everything: dict[str, tuple[Problem, Sequence[Point]]] = {}
    for name in names:
        measured = {}
        for problem in problems.load(name):
            announce(problem.name)
            measured[problem.name] = (problem, measure(problem, quick=quick))
        everything.update(measured)
        variants = {variant: _plain(*found) for variant, found in measured.items()}
        payload = {
            "quick": quick,
            "units": {"per_second": "us per simulated second and world", "dt": "s"},
            "variants": variants,
        }
        record.write(name, payload, directory=output)
        charts.draw(
            measured, output / f"{name}.png", title=f"Cost against error: {name}", note=NOTE
        )
    if overview:
        title = "Cost against worst error: metres, share of the energy or share of a link's length"
        charts.overview(everything, output / "overview.png", title=title, note=NOTE)


def _plain(problem: Problem, points: Sequence[Point]) -> dict[str, Any]:
    return {
        "duration": problem.duration,
        "measures": {measure.name: measure.unit for measure in problem.measures},
        "omitted": dict(problem.omitted),
        "orders": {name: order(curve) for name, curve in curves(points).items()},
        "by_tolerance": by_tolerance(points),
        "points": [point.record() for point in points],
    }
