"""Cost and error on the same motions as MuJoCo: one process, one core, in turns.

For each scene a work-precision diagram: every method at every step of a ladder, its error against a
trusted solution and its CPU time per simulated second and world. The targets are held against the
setting of MuJoCo at dt .01 to which our advantage is smallest; our point is the cheapest of which
no error (position by rms and at most, length of links, energy where conserved) is larger.

MuJoCo steps one world per model, with everything in its caches; this engine steps 1024 worlds that
differ. Both are called once per stretch of time between looks. Figures beside the targets say how
the ratio changes where that differs: worlds side by side in one model, a call per step, a single
world, and errors counted from each engine's own motion at small steps, which forgives MuJoCo's soft
links.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import record
from benchmarks.cases import ROUNDING, distance
from benchmarks.contests import CONTESTS, DT, LINKED, PEERS_LINKED, WORLDS, Contest
from benchmarks.figures import Announce, Figure
from benchmarks.flights import EngineFlight, Flight, PeerFlight, PeerMethod
from benchmarks.rest import settle
from benchmarks.work_precision import Point, draw

STAGES = ("platform", "bridge", "ballistic", "bridge at rest")


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure all contests and write against_mujoco.json and .png to `output`.

    Args:
        quick: One step, few worlds and one repeat: shows that it runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with each of `STAGES` as it begins.
    """
    figures: list[Figure] = []
    results: dict[str, Any] = {}
    points: dict[str, list[Point]] = {}
    for name, contest in CONTESTS.items():
        announce(name)
        points[name] = measure(contest, quick=quick)
        comparisons = [compare(contest, points[name], peer) for peer in contest.peers]
        figures += summarise(name, contest, points[name], comparisons)
        results[name] = {
            "points": [point.record() for point in points[name]],
            "comparisons": comparisons,
        }
    announce("bridge at rest")
    ours, theirs = settle(LINKED["Rattle, Direct"](DT), PEERS_LINKED)
    heights = [rest.height for rest in theirs.values()]
    figures += [
        Figure(name="bridge at rest: height error", measured=ours.height, unit="m"),
        Figure(name="bridge at rest: MuJoCo's least height error", measured=min(heights), unit="m"),
        Figure(name="bridge at rest: MuJoCo's largest", measured=max(heights), unit="m"),
    ]
    results["bridge at rest"] = {
        "Rattle, Direct": ours.record(),
        **{name: rest.record() for name, rest in theirs.items()},
    }
    payload = {
        "quick": quick,
        "worlds": WORLDS,
        "dt": DT,
        "units": {"rms, most, own_limit": "m", "per_step, per_second": "us"},
        "figures": [figure.record() for figure in figures],
        "scenes": results,
    }
    record.write("against_mujoco", payload, directory=output)
    batch = {
        name: [point for point in found if point.mode == "batch"] for name, found in points.items()
    }
    title = f"Cost against error: {WORLDS} worlds, one core (large marks: dt = {DT:g} s)"
    draw(batch, output / "against_mujoco.png", title=title, dt=DT)
    return figures


def measure(contest: Contest, *, quick: bool) -> list[Point]:
    """Score and time every method at every step of its ladder, all in turns."""
    worlds, rounds, repeats = (16, 1, 1) if quick else (WORLDS, 8, 7)
    case = contest.case(worlds)
    equal = round(case.stretch / DT)
    flights: dict[tuple[str, float, str], Flight] = {}
    for name, method in contest.methods.items():
        for steps in (equal,) if quick else contest.steps:
            dt = case.stretch / steps
            flights[name, dt, "batch"] = EngineFlight(case, method(dt), worlds=worlds)
    for name, peer in contest.peers.items():
        for steps in (equal,) if quick else contest.peer_steps:
            dt = case.stretch / steps
            flights[name, dt, "batch"] = PeerFlight(case, peer, dt=dt, rounds=rounds)
    dt = case.stretch / equal
    name, method = next(iter(contest.methods.items()))
    for mode, count, by_step in (
        ("step by step", worlds, True),
        ("one world", 1, False),
        ("one world, step by step", 1, True),
    ):
        flights[name, dt, mode] = EngineFlight(case, method(dt), worlds=count, step_by_step=by_step)
    name, peer = next(iter(contest.peers.items()))
    stepped = PeerFlight(case, peer, dt=dt, rounds=rounds, step_by_step=True)
    flights[name, dt, "step by step"] = stepped
    flights[name, dt, "side by side"] = PeerFlight(case, peer, dt=dt, copies=contest.crowd)

    trajectories = {key: flight.trajectory() for key, flight in flights.items()}
    soft = case.solution
    if contest.limit_steps is not None:
        limit = equal * 4 if quick else contest.limit_steps
        finest = PeerFlight(case, PeerMethod(integrator="RK4"), dt=case.stretch / limit)
        soft = finest.trajectory()[0]
    times = record.interleave(
        {repr(key): flight for key, flight in flights.items()}, repeats=repeats
    )
    points = []
    for (name, dt, mode), flight in flights.items():
        position, velocity = trajectories[name, dt, mode]
        peer_method = contest.peers.get(name)
        # Other links follow the step: the limit of their motion is the solution itself.
        stays_soft = peer_method is not None and peer_method.links == "default"
        points.append(
            Point(
                method=name,
                dt=dt,
                mode=mode,
                score=case.score(position, velocity),
                per_second=1e6 * times[repr((name, dt, mode))] / flight.simulated,
                own_limit=distance(position, soft if stays_soft else case.solution),
                peer=peer_method is not None,
            )
        )
    return points


def compare(contest: Contest, points: Sequence[Point], peer: str) -> dict[str, Any]:
    """Our cost against one setting of MuJoCo at `DT`.

    Ratios above 1 are in our favour; None says that no step of our ladder has as small an error.
    """
    theirs = _at(points, peer)
    default = next(iter(contest.methods))
    ours = [point for point in points if not point.peer and point.mode == "batch"]
    able = [point for point in ours if point.score.within(theirs.score)]
    plain = [point for point in able if point.method == default]
    own = [point for point in ours if _within_own_limit(point, theirs)]
    equal = _at(points, default)
    best = _cheapest(able)
    return {
        "peer": theirs.record(),
        "ours": best.record() if best else None,
        "cost_ratio": {
            "per second": _ratio(theirs, best),
            "per second, default method": _ratio(theirs, _cheapest(plain)),
            "per second, own limits": _ratio(theirs, _cheapest(own)),
            "per step": theirs.per_step / equal.per_step,
        },
    }


def summarise(
    name: str, contest: Contest, points: Sequence[Point], comparisons: Sequence[Mapping[str, Any]]
) -> list[Figure]:
    """The figures of a contest: each ratio at the setting where our advantage is smallest."""
    words = {
        "per second": "MuJoCo's cost over ours per simulated second, at no larger error",
        "per second, default method": "the same, our default method",
        "per second, own limits": "the same, errors from each engine's own small-step limit",
        "per step": f"MuJoCo's cost over ours per step, dt {DT:g}",
    }
    judged = "per step" if contest.at_equal_step else "per second"
    figures = []
    for key, text in words.items():
        if key == "per second, own limits" and contest.limit_steps is None:
            continue
        ratios = [comparison["cost_ratio"][key] for comparison in comparisons]
        # No step of ours as exact as theirs: no advantage is claimed.
        least = min(0.0 if ratio is None else ratio for ratio in ratios)
        target = contest.target if key == judged else None
        figures.append(Figure(name=f"{name}: {text}", measured=least, at_least=target))
    ours, theirs = next(iter(contest.methods)), next(iter(contest.peers))
    for mode, peer_mode, text in (
        ("batch", "side by side", f"{contest.crowd} worlds in each model of MuJoCo"),
        ("step by step", "step by step", "one call per step"),
        ("one world", "batch", "one world"),
        ("one world, step by step", "step by step", "one world, one call per step"),
    ):
        ratio = _at(points, theirs, peer_mode).per_step / _at(points, ours, mode).per_step
        figures.append(Figure(name=f"{name}: the same per step, {text}", measured=ratio))
    return figures


def _at(points: Sequence[Point], method: str, mode: str = "batch") -> Point:
    """The point of a method at `DT`."""
    return next(
        point
        for point in points
        if point.method == method and point.mode == mode and abs(point.dt - DT) < 1e-9
    )


def _cheapest(points: Sequence[Point]) -> Point | None:
    return min(points, key=lambda point: point.per_second, default=None)


def _ratio(theirs: Point, ours: Point | None) -> float | None:
    return None if ours is None else theirs.per_second / ours.per_second


def _within_own_limit(ours: Point, theirs: Point) -> bool:
    return all(
        mine <= max(other, ROUNDING)
        for mine, other in zip(ours.own_limit, theirs.own_limit, strict=True)
    )
