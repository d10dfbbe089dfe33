"""The laboratory: its measures against wrong engines, its arithmetic, and that all of it runs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pymunk")

import steelyard as sy
from benchmarks.laboratory import measurement, methods, problems, report, tables
from benchmarks.laboratory.engines import BrokenRunError, EngineRun, PeerRun
from benchmarks.laboratory.measurement import Point
from benchmarks.laboratory.problem import Motion, Problem, worst

PROBLEMS = {problem.name: problem for name in problems.NAMES for problem in problems.load(name)}


def fine_step(problem: Problem) -> float:
    """The least step of the ladder [s]."""
    return problem.stretch / problem.steps[-1]


def motion(problem: Problem, scene: sy.Scene, entry: sy.Candidate) -> Motion:
    """What an entry makes of a scene."""
    return EngineRun(problem, scene, entry.at(fine_step(problem))).motion()


def best(problem: Problem) -> tuple[sy.Scene, sy.Candidate]:
    """The form and the entry that a problem names."""
    for form, build in problem.forms.items():
        if problem.best.startswith(f"{form}, "):
            return build(), methods.named(problem.best.removeprefix(f"{form}, "))
    return problem.scene(), methods.named(problem.best)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_wrong_engine_is_caught(name: str) -> None:
    problem = PROBLEMS[name]
    right = worst(problem.errors(motion(problem, *best(problem))))
    assert right < problem.follows
    defects = {defect: build() for defect, build in problem.wrong.items()}
    told = 0
    for defect, scene in defects.items():
        able = {candidate.name: candidate for candidate in sy.candidates(scene)}
        held = any(candidate.solver for candidate in able.values())
        entry = able.get(problem.best) or able["RATTLE, direct" if held else "velocity Verlet"]
        try:
            found = worst(problem.errors(motion(problem, scene, entry)))
        except BrokenRunError:
            continue  # it says so itself, and proves nothing of the measures
        assert found > 20.0 * right, (defect, found, right)
        told += 1
    assert told >= 3


@pytest.mark.parametrize(
    "name", ["pendulum", "platform", "buoyancy", "bungee", "projectile, parabola"]
)
def test_a_wrong_order_of_update_is_caught(name: str) -> None:
    # Positions before velocities, as in the source: of first order, and it feeds energy in.
    problem = PROBLEMS[name]
    right = worst(problem.errors(motion(problem, *best(problem))))
    names = {entry.name for entry in methods.able(problem, problem.scene())}
    held = "explicit Euler" not in names
    entry = methods.named("explicit Euler, worst first" if held else "explicit Euler")
    assert worst(problem.errors(motion(problem, problem.scene(), entry))) > 100.0 * right


@pytest.mark.parametrize("name", PROBLEMS)
def test_peers_start_where_the_problem_does(name: str) -> None:
    problem = PROBLEMS[name]
    method = best(problem)[1].at(problem.stretch)
    places, speeds = sy.landmarks(sy.World(problem.scene(), method=method))
    assert problem.looks == tuple(sorted(set(problem.looks)))
    for peer in problem.peers.values():
        stepper = peer(problem.stretch / problem.steps[0])
        position, velocity = stepper.state()
        np.testing.assert_allclose(position, places[0], rtol=0, atol=1e-12)
        size = 1.0 + np.abs(speeds).max()
        np.testing.assert_allclose(velocity, speeds[0], rtol=0, atol=1e-12 * size)


def test_runs_start_anew_and_batches_hold_the_problem_in_their_first_world() -> None:
    problem = PROBLEMS["platform"].quick()
    entry = methods.named("RATTLE, direct")
    dt = problem.stretch / problem.steps[0]
    batch = EngineRun(problem, problem.scene(), entry.at(dt), worlds=16, rounds=2)
    alone = EngineRun(problem, problem.scene(), entry.at(dt))
    first = batch.motion()
    batch()
    np.testing.assert_array_equal(batch.motion().position, first.position)
    np.testing.assert_array_equal(alone.motion().position, first.position)
    assert not np.array_equal(batch.world.particles.position[1], first.position[-1])
    assert batch.simulated == pytest.approx(32 * problem.duration)
    peer = PeerRun(problem, next(iter(problem.peers.values())), dt=dt)
    np.testing.assert_array_equal(peer.motion().position, peer.motion().position)


def test_a_failure_says_why() -> None:
    problem = PROBLEMS["spring, omega 1e+06, zeta 0"]
    with pytest.raises(BrokenRunError, match="non-finite"):
        motion(problem, problem.scene(), methods.named("velocity Verlet"))
    with pytest.raises(ValueError, match="does not divide"):
        EngineRun(problem, problem.scene(), methods.named("velocity Verlet").at(0.03))


def point(method: str, dt: float, error: float, cost: float, *, peer: bool = False) -> Point:
    return Point(
        method=method,
        dt=dt,
        peer=peer,
        worlds=1 if peer else 16,
        errors={"trajectory": error, "energy": 0.5 * error},
        failure=None,
        per_second=cost,
    )


def test_order_is_the_slope_of_the_error_where_it_is_neither_lost_nor_rounding() -> None:
    curve = [point("a", dt, 2.0 * dt**2, 1.0 / dt) for dt in (1.0, 0.1, 0.01, 1e-7)]
    assert measurement.order(curve) == pytest.approx(2.0)
    assert measurement.order(curve[:1]) is None
    assert measurement.order([point("a", dt, 1e-14, 1.0) for dt in (0.1, 0.01)]) is None


def test_by_tolerance_names_the_cheapest_on_both_sides_and_who_wins() -> None:
    points = [
        point("a", 0.1, 1e-2, 1.0),
        point("b", 0.1, 1e-4, 5.0),
        point("MuJoCo", 0.1, 1e-3, 10.0, peer=True),
        point("MuJoCo", 0.01, 1e-6, 40.0, peer=True),
    ]
    rows = {row["tolerance"]: row for row in measurement.by_tolerance(points)}
    assert rows[1e-2]["ours"]["method"] == "a" and rows[1e-2]["ratio"] == 10.0
    assert rows[1e-3]["ours"]["method"] == "b" and rows[1e-3]["ratio"] == 2.0
    assert rows[1e-6]["ours"] is None and rows[1e-6]["ratio"] is None
    assert 1e-7 not in rows


def test_quick_run_writes_results_and_pictures(tmp_path: Path) -> None:
    names = ("bungee", "pendulum")
    seen: list[str] = []
    report.run(names, quick=True, output=tmp_path, announce=seen.append, overview=True)
    assert {path.stem for path in tmp_path.glob("*.png")} == {*names, "overview"}
    for picture in tmp_path.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")
    for name in names:
        document = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
        assert document["quick"] is True and document["provenance"]["commit"]
        for variant in document["variants"].values():
            assert variant["points"] and variant["measures"]
    assert len(seen) == sum(len(problems.load(name)) for name in names)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name in problems.NAMES if name not in ("bungee", "pendulum")]
)
def test_quick_run_of_every_problem(name: str, tmp_path: Path) -> None:
    report.run((name,), quick=True, output=tmp_path, announce=lambda _: None, overview=False)
    document = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    for variant in document["variants"].values():
        assert any(not entry["peer"] for entry in variant["points"])


def test_a_problem_with_two_steps_is_quick() -> None:
    problem = PROBLEMS["pendulum"]
    assert len(problem.quick().steps) == 2 and len(problem.quick().peer_steps or ()) == 1
    assert replace(problem, steps=(3,)).quick().steps == (3,)


def test_tables_say_who_wins_and_the_page_is_made_of_the_results(tmp_path: Path) -> None:
    ours = {"method": "a", "dt": 0.01, "per_second": 2.0, "worst": 1e-3}
    peer = {"method": "MuJoCo", "dt": 0.001, "per_second": 500.0, "worst": 1e-3}
    rows = [
        {"tolerance": 1e-2, "ours": ours, "peer": peer, "ratio": 250.0},
        {"tolerance": 1e-4, "ours": ours, "peer": {**peer, "per_second": 1.0}, "ratio": 0.5},
        {"tolerance": 1e-6, "ours": None, "peer": peer, "ratio": None},
    ]
    machine = {"cpu": "a core"}
    made = {"command": "c", "commit": "d" * 40, "machine": machine, "versions": {"numpy": "2"}}
    document = {"provenance": made, "variants": {"spring": {"by_tolerance": rows}}}
    (tmp_path / "spring.json").write_text(json.dumps(document), encoding="utf-8")
    lines = tables.cheapest(tmp_path).splitlines()
    assert lines[-1] == (
        "| spring | a at 100 Hz: 2 µs; MuJoCo 250x | a at 100 Hz: 2 µs; **MuJoCo at 1,000 Hz: 1 µs wins: 0.5x** "
        "| **only MuJoCo at 1,000 Hz: 500 µs** | none |"
    )
    page = tables.PAGE.read_text(encoding="utf-8")
    assert "`c`, commit dddddddddddd, one core of a core, numpy 2." in tables.render(page, tmp_path)
    # The page in the repository is that of the results in it.
    assert tables.render(page) == page
    for name in problems.NAMES:
        assert f"charts/{name}.png" in page and (tables.CHARTS / f"{name}.png").exists()
