"""Errors and cost of every method and peer of a problem, at every step of its ladder."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.laboratory import methods
from benchmarks.laboratory.engines import BrokenRunError, EngineRun, PeerRun, Run
from benchmarks.laboratory.problem import Problem, worst

WORLDS, FEWEST = 1024, 16
#: CPU time [s] that one timed call should take at least, and at most.
LEAST, MOST = 0.004, 0.04
REPEATS = 5
#: Errors above are no longer of the motion that was asked for; those below are rounding.
LOST, ROUNDING = 0.3, 1e-11
TOLERANCES = tuple(10.0**-k for k in range(1, 11))


@dataclass(frozen=True, kw_only=True)
class Point:
    """One method at one step.

    Attributes:
        method: Name of the method or peer.
        dt: Step [s].
        peer: Whether it is another engine.
        worlds: Number of worlds stepped together.
        errors: Errors of the first world by measure; None where it failed.
        failure: Why it failed.
        per_second: CPU time per simulated second and world [us]; None where it failed.
    """

    method: str
    dt: float
    peer: bool
    worlds: int
    errors: dict[str, float] | None
    failure: str | None
    per_second: float | None

    @property
    def worst(self) -> float:
        """Largest error; inf where it failed."""
        return math.inf if self.errors is None else worst(self.errors)

    def record(self) -> dict[str, Any]:
        """Plain values for a results file."""
        finite = self.errors is not None and math.isfinite(self.worst)
        return {**asdict(self), "worst": self.worst if finite else None}


def measure(problem: Problem, *, quick: bool = False) -> list[Point]:
    """Score every method and peer at every step, then time them all in turns.

    Cost is that of following the whole motion in a batch of up to 1024 worlds, fewer where that would take
    long: they are stepped in blocks of eight, so the cost of a world does not depend on the number. Every
    method also has a point for a single world, at the middle of its ladder.
    """
    if quick:
        problem = problem.quick()
    found: list[Point] = []
    runs: dict[str, tuple[Point, Run]] = {}

    def enter(name: str, dt: float, peer: bool, build: Callable[..., Run], alone: bool) -> None:
        first = build()
        try:
            errors = problem.errors(first.motion())
            if not all(math.isfinite(error) for error in errors.values()):
                raise BrokenRunError("non-finite")
        except BrokenRunError as failure:
            found.append(_point(name, dt, peer, 1, failure=str(failure)))
            return
        start = time.process_time()
        first()
        single = max(time.process_time() - start, 1e-6)
        if not peer:
            most = 8 if quick else min(WORLDS, max(FEWEST, 8 * int(MOST / single)))
            rounds = max(1, math.ceil(LEAST / (single * most / 8)))
            timed = build(worlds=most, rounds=rounds)
            runs[f"{name} {dt!r}"] = (_point(name, dt, peer, most, errors), timed)
        if peer or alone:
            rounds = max(1, math.ceil(LEAST / single))
            runs[f"{name} {dt!r} alone"] = (
                _point(name, dt, peer, 1, errors),
                build(rounds=rounds),
            )

    for form, scene in {"": problem.scene, **problem.forms}.items():
        for entry in methods.able(problem, scene()):
            name = f"{form}, {entry.name}" if form else entry.name
            if form and name not in (problem.best, f"{form}, velocity Verlet"):
                continue
            for steps in problem.steps:
                dt = problem.stretch / steps

                def ours(
                    dt: float = dt, entry: sy.Candidate = entry, build: Any = scene, **kwargs: int
                ) -> Run:
                    return EngineRun(problem, build(), entry.at(dt), **kwargs)

                middle = problem.steps[len(problem.steps) // 2]
                enter(name, dt, False, ours, steps == middle)
    for name, peer in problem.peers.items():
        for steps in problem.peer_steps or problem.steps:
            dt = problem.stretch / steps

            def theirs(dt: float = dt, peer: Any = peer, **kwargs: int) -> Run:
                return PeerRun(problem, peer, dt=dt, **kwargs)

            enter(name, dt, True, theirs, True)

    times = record.interleave(
        {name: run for name, (_, run) in runs.items()}, repeats=1 if quick else REPEATS
    )
    for name, (point, run) in runs.items():
        found.append(Point(**{**vars(point), "per_second": 1e6 * times[name] / run.simulated}))
    return found


def _point(
    name: str,
    dt: float,
    peer: bool,
    worlds: int,
    errors: dict[str, float] | None = None,
    failure: str | None = None,
) -> Point:
    return Point(
        method=name,
        dt=dt,
        peer=peer,
        worlds=worlds,
        errors=errors,
        failure=failure,
        per_second=None,
    )


def curves(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Points that were timed, by method, from the largest step down; single worlds of ours left out."""
    found: dict[str, list[Point]] = {}
    for point in points:
        if point.per_second is not None and (point.peer or point.worlds > 1):
            found.setdefault(point.method, []).append(point)
    return {name: sorted(curve, key=lambda p: -p.dt) for name, curve in found.items()}


def order(curve: Sequence[Point]) -> float | None:
    """Measured order: slope of the trajectory's error over the step; None where it has none to show.

    Steps at which the motion is lost, or its error is rounding, are left out.
    """
    dt, error = [], []
    for point in curve:
        first = next(iter(point.errors.values())) if point.errors else math.inf
        if ROUNDING < first < LOST:
            dt.append(point.dt)
            error.append(first)
    if len(dt) < 2:
        return None
    slope = float(np.polyfit(np.log(dt), np.log(error), 1)[0])
    # An error that grows as the step falls is rounding that piles up.
    return max(slope, 0.0) if slope > -0.1 else None


def by_tolerance(points: Sequence[Point]) -> list[dict[str, Any]]:
    """For each tolerance the cheapest point of ours and of the peers of which no error is larger.

    `ratio` is the peer's cost over ours: below 1 the peer wins.
    """
    batch = [point for curve in curves(points).values() for point in curve]
    rows = []
    for tolerance in TOLERANCES:
        within = [point for point in batch if point.worst <= tolerance]
        ours = _cheapest([point for point in within if not point.peer])
        theirs = _cheapest([point for point in within if point.peer])
        if ours is None and theirs is None:
            continue
        rows.append(
            {
                "tolerance": tolerance,
                "ours": ours and _brief(ours),
                "peer": theirs and _brief(theirs),
                "ratio": theirs.per_second / ours.per_second  # type: ignore[operator]
                if ours and theirs
                else None,
            }
        )
    return rows


def _cheapest(points: Sequence[Point]) -> Point | None:
    return min(points, key=lambda point: point.per_second or math.inf, default=None)


def _brief(point: Point) -> Mapping[str, Any]:
    return {
        "method": point.method,
        "dt": point.dt,
        "per_second": point.per_second,
        "worst": point.worst,
    }
