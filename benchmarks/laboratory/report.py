"""Results of the laboratory: a JSON file and a picture per problem, and an overview."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import record
from benchmarks.figures import Announce
from benchmarks.laboratory import charts, problems, tables
from benchmarks.laboratory.measurement import Point, by_tolerance, curves, measure, order
from benchmarks.laboratory.problem import Problem

NOTE = (
    "Down and left is better. Large marks: about 1/60 s. Hollow: a single world. "
    "Dashed, dash-dotted or dotted in grey: other engines, one world. One core."
)


def run(
    names: Sequence[str],
    *,
    quick: bool,
    output: Path,
    announce: Announce,
    overview: bool,
    redraw: bool = False,
) -> None:
    """Measure problems and write NAME.json and NAME.png for each to `output`.

    Args:
        names: The problems.
        quick: Two steps and few worlds: shows that all runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with what begins.
        overview: Whether to draw all of them on one page too.
        redraw: Take the points from the results that lie there, and measure nothing.
    """
    output.mkdir(parents=True, exist_ok=True)
    record.provenance()  # the commit of the start, before any result changes the folder
    everything: dict[str, tuple[Problem, Sequence[Point]]] = {}
    for name in names:
        measured = {}
        kept = _stored(output / f"{name}.json") if redraw else {}
        for problem in problems.load(name):
            announce(problem.name)
            points = kept[problem.name] if redraw else measure(problem, quick=quick)
            measured[problem.name] = (problem, points)
        everything.update(measured)
        if not redraw:
            payload = {
                "quick": quick,
                "units": {"per_second": "us per simulated second and world", "dt": "s"},
                "variants": {variant: _plain(*found) for variant, found in measured.items()},
            }
            record.write(name, payload, directory=output)
        charts.draw(
            measured,
            output / f"{name}.png",
            title=f"Cost against error: {name.replace('_', ' ')}",
            note=NOTE,
        )
    if overview:
        title = "Cost against worst error: metres, share of the energy or share of a link's length"
        charts.overview(everything, output / "overview.png", title=title, note=NOTE)
        if not quick and output == tables.CHARTS:
            tables.write()


def _stored(path: Path) -> dict[str, list[Point]]:
    """The points of a results file, by variant."""
    variants = json.loads(path.read_text(encoding="utf-8"))["variants"]
    return {
        variant: [
            Point(**{key: value for key, value in entry.items() if key != "worst"})
            for entry in found["points"]
        ]
        for variant, found in variants.items()
    }


def _plain(problem: Problem, points: Sequence[Point]) -> dict[str, Any]:
    return {
        "duration": problem.duration,
        "measures": {measure.name: measure.unit for measure in problem.measures},
        "omitted": dict(problem.omitted),
        "orders": {name: order(curve) for name, curve in curves(points).items()},
        "by_tolerance": by_tolerance(points),
        "points": [point.record() for point in points],
    }
