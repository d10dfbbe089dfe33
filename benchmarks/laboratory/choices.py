"""How good the automatic choice is: on every reference problem, at tolerances from 1e-2 to 1e-8.

    python -m benchmarks.laboratory.choices [PROBLEM ...]

For each: the method that ``choose_method`` picks is run and scored by the problem's own errors, and its cost is held
against that of the cheapest method known there. Costs are of the charts, between two rungs of the
ladder by the slope between them; so is the largest step that holds the tolerance with all shorter ones. Where that is
cheaper by more than a fifth, it is run: it counts if it holds there and at three shorter steps.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import steelyard as sy
from benchmarks import record
from benchmarks.laboratory import methods, problems
from benchmarks.laboratory.engines import BrokenRunError, EngineRun
from benchmarks.laboratory.problem import Problem, worst

CHARTS = record.RESULTS / "charts"
RESULTS = record.RESULTS / "choices.json"
TOLERANCES = tuple(10.0**-k for k in range(2, 9))
#: Cost over the best from which on the best must stand a second look: at its step and at some shorter ones.
DEARER = 1.2
NEIGHBOURS = (1.0, 1.07, 1.19, 1.37)
SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.7)


def main(arguments: Sequence[str]) -> None:
    """Judge, print and write results/choices.json; that of some problems is put among what is there of the others."""
    names = [name for name in problems.NAMES if name in arguments] or list(problems.NAMES)
    # Errors count here, not times: the problems share all cores.
    rows = []
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for name, found in zip(names, pool.map(judge_all, names), strict=True):
            print(f"{name}: {len(found)} choices", flush=True)
            rows += found
    if len(names) < len(problems.NAMES):
        judged = {row["problem"] for row in rows}
        kept = json.loads(RESULTS.read_text())["choices"]
        rows = [row for row in kept if row["problem"] not in judged] + rows
    record.write("choices", {"choices": rows}, directory=record.RESULTS)
    table = Table("problem", "tolerance", "choice", "error", "cost over the best", "the best")
    for row in rows:
        table.add_row(
            row["problem"],
            f"{row['tolerance']:.0e}",
            row["choice"] or row["refusal"],
            f"{row['error']:.1e}" if row["error"] is not None else "",
            f"{row['ratio']:.2f}" if row["ratio"] else "",
            row["best"] or "none",
        )
    Console(width=160).print(table)
    chosen = [row for row in rows if row["choice"]]
    ratios = [row["ratio"] for row in chosen if row["ratio"]]
    missed = sum(bool(row["missed"]) for row in rows)
    print(
        f"{len(chosen)} of {len(rows)} chosen, {sum(not row['held'] for row in chosen)} beyond the tolerance; cost "
        f"over the best: median {np.median(ratios):.2f}, largest {max(ratios):.2f}, above 1.2 in "
        f"{sum(ratio > 1.2 for ratio in ratios)}; {missed} refused that a method reaches"
    )


def judge_all(name: str) -> list[dict[str, Any]]:
    """The choices for all variants of a problem."""
    return [
        row for problem in problems.load(name) for row in judge(problem, _points(name, problem))
    ]


def judge(problem: Problem, points: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row per tolerance."""
    rows = []
    for tolerance in TOLERANCES:
        costs = Known(problem, points, tolerance)
        best = costs.best()
        row: dict[str, Any] = {
            "problem": problem.name, "tolerance": tolerance, "choice": None, "refusal": "", "error": None,
            "held": False, "ratio": None, "best": best, "missed": False,
        }  # fmt: skip
        try:
            choice = sy.choose_method(
                problem.scene(),
                tolerance=tolerance,
                horizon=problem.duration,
                since=problem.stretch * problem.looks[0],
            )
        except ValueError as refusal:
            row |= {"refusal": str(refusal), "missed": best is not None}
        else:
            name = choice.considered[0].name
            error = score(problem, choice.method)
            cost = cost_at(points, name, choice.method.dt)
            row |= {
                "choice": name,
                "dt": choice.method.dt,
                "error": error,
                "held": error <= tolerance,
            }
            if best is not None and cost is not None:
                # What holds by luck at one step and not at the next is no method to be measured by.
                best = row["best"] = costs.best(below=cost / DEARER) or best
                row["ratio"] = cost / costs.cost[best] if best in costs.cost else 1.0
        rows.append(row)
    return rows


def score(problem: Problem, method: sy.Method) -> float:
    """Worst error of a method; inf where it breaks.

    Looks that its step hits are of a run at that step, the others of one at the next shorter step that hits them all.
    """
    dt = problem.stretch / math.ceil(problem.stretch / method.dt - 1e-9)
    steps = math.ceil(problem.duration / method.dt - 1e-9)
    try:
        motion = EngineRun(problem, problem.scene(), _stepping(method, dt)).motion()
        world = sy.World(problem.scene(), method=_stepping(method, problem.duration / steps))
        hits = math.gcd(steps, problem.looks[-1])
        stretches = problem.looks[-1] // hits
        for hit in range(1, hits + 1):
            world.step(steps // hits)
            if world.health[0]:
                return math.inf
            if stretches * hit in problem.looks:
                look = problem.looks.index(stretches * hit)
                places, speeds = problem.marks(world)
                motion.position[look], motion.velocity[look] = places[0], speeds[0]
    except BrokenRunError:
        return math.inf
    return worst(problem.errors(motion))


def _stepping(method: sy.Method, dt: float) -> sy.Method:
    return sy.Method(method.integrator, method.solver, dt=dt)


def cost_at(points: Sequence[Mapping[str, Any]], name: str, dt: float) -> float | None:
    """What a simulated second and world costs at a step [us], between and beyond the rungs of the chart.

    Not by the cost of a step: where events or fast turns divide steps, longer ones cost more.
    """
    costs = {
        point["dt"]: point["per_second"]
        for point in points
        if point["method"] == name and point["per_second"] and point["worlds"] > 1
    }
    if not costs:
        return None
    rungs = sorted(costs)
    if len(rungs) == 1:
        return float(costs[rungs[0]] * rungs[0] / dt)
    k = min(max(int(np.searchsorted(rungs, dt)), 1), len(rungs) - 1)
    low, high = rungs[k - 1], rungs[k]
    slope = math.log(costs[high] / costs[low]) / math.log(high / low)
    return float(costs[low] * (dt / low) ** slope)


class Known:
    """The steps at which each of our methods is known to hold a tolerance on a problem, and their cost.

    Attributes:
        cost: per simulated second and world [us], by method, at the longest step that is not refuted.
    """

    def __init__(
        self, problem: Problem, points: Sequence[Mapping[str, Any]], tolerance: float
    ) -> None:
        self.problem, self.tolerance = problem, tolerance
        self.cost: dict[str, float] = {}
        self._left: dict[str, list[float]] = {}
        self._points = points
        self._stands: set[str] = set()
        for candidate in sy.CANDIDATES:
            steps = longest(points, candidate.name, tolerance)
            cost = cost_at(points, candidate.name, steps[0]) if steps else None
            if cost is not None:
                self._left[candidate.name] = steps
                self.cost[candidate.name] = cost

    def best(self, *, below: float = 0.0) -> str | None:
        """The cheapest method; one that costs less than ``below`` is run, with its neighbours, to see that it holds."""
        while self.cost:
            name = min(self.cost, key=lambda name: self.cost[name])
            if self.cost[name] >= below or name in self._stands or self._holds(name):
                return name
            self._left[name].pop(0)
            if self._left[name]:
                self.cost[name] = cost_at(self._points, name, self._left[name][0]) or math.inf
            else:
                del self.cost[name]
        return None

    def _holds(self, name: str) -> bool:
        candidate = methods.named(name)
        steps = (self._left[name][0] / factor for factor in NEIGHBOURS)
        holds = all(score(self.problem, candidate.at(dt)) <= self.tolerance for dt in steps)
        if holds:
            self._stands.add(name)
        return holds


def longest(points: Sequence[Mapping[str, Any]], name: str, tolerance: float) -> list[float]:
    """Steps [s] at which a method is expected to hold a tolerance, the longest first.

    One between two rungs of the ladder by the slope between them, somewhat shorter ones, then the rungs.
    """
    curve = sorted(
        {
            (point["dt"], point["worst"])
            for point in points
            if point["method"] == name and point["worst"]
        },
        reverse=True,
    )
    for k, (dt, error) in enumerate(curve):
        # One rung that holds between others that do not is luck.
        if all(e <= tolerance for _, e in curve[k:]):
            rungs = [rung for rung, _ in curve[k:]]
            if k > 0 and curve[k - 1][1] > error:
                longer, larger = curve[k - 1]
                slope = math.log(larger / error) / math.log(longer / dt)
                between = min(dt * (tolerance / error) ** (1.0 / slope), longer)
                return [*(share * between for share in SHARES if share * between > dt), *rungs]
            return rungs
    return []


def _points(name: str, problem: Problem) -> list[dict[str, Any]]:
    found = json.loads((CHARTS / f"{name}.json").read_text())["variants"]
    points: list[dict[str, Any]] = found[problem.name]["points"]
    return [point for point in points if not point["peer"]]


if __name__ == "__main__":
    main(sys.argv[1:])
