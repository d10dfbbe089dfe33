"""The benchmark programs: what they compare is what they say, and all of them run."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import steelyard as sy
from benchmarks import cases, environments, references, run, scaling, scenes
from benchmarks.engine_scenes import build
from benchmarks.figures import Figure
from benchmarks.moving_load import taut_motion

pytest.importorskip("mujoco")

from benchmarks import against_mujoco, bodies, rest
from benchmarks.contests import CONTESTS, Contest
from benchmarks.flights import EngineFlight, PeerFlight, PeerMethod
from benchmarks.work_precision import Point

DIRECT = sy.Method(sy.Rattle(), sy.Direct(), dt=0.01)


def single_support(angle: float) -> scenes.ParticleScene:
    """A particle on a cable of 2 m, let go at an angle from hanging."""
    position = 2.0 * np.array([[np.sin(angle), -np.cos(angle), 0.0]])
    return scenes.ParticleScene(
        position=position,
        velocity=np.zeros((1, 3)),
        mass=np.ones(1),
        supports=((0, (0.0, 0.0, 0.0), 2.0),),
    )


@pytest.mark.parametrize("scene", [scenes.tumbling_platform(), scenes.bridge(), scenes.artillery()])
def test_build_holds_the_particles_and_links_of_the_scene(scene: scenes.ParticleScene) -> None:
    built = build(scene)
    world = sy.World(built, method=DIRECT)
    np.testing.assert_array_equal(world.particles.position[0], scene.position)
    np.testing.assert_array_equal(world.particles.velocity[0], scene.velocity)
    np.testing.assert_array_equal(world.particles.mass, scene.mass)
    np.testing.assert_array_equal(world.particles.damping, scene.damping)
    assert world.gravity.tolist() == list(scene.gravity)
    links = [
        *built.of(sy.Rod),
        *built.of(sy.Cable),
        *built.of(sy.CableConstraint),
    ]
    lengths = [getattr(link, "length", None) or link.max_length for link in links]
    assert lengths == [link[2] for link in (*scene.rods, *scene.cables, *scene.supports)]
    index = {id(particle): p for p, particle in enumerate(built.particles)}
    assert [(index[id(k.a)], index[id(k.b)]) for k in built.of(sy.Rod, sy.Cable)] == [
        link[:2] for link in (*scene.rods, *scene.cables)
    ]
    assert [(index[id(k.particle)], k.anchor) for k in built.of(sy.CableConstraint)] == [
        link[:2] for link in scene.supports
    ]


def test_long_bridge_with_six_planks_is_the_bridge() -> None:
    short, long = scenes.bridge(), scaling.long_bridge(6)
    np.testing.assert_allclose(long.position, short.position, rtol=0, atol=1e-14)
    assert (long.rods, long.cables, long.damping) == (short.rods, short.cables, short.damping)
    for mine, other in zip(long.supports, short.supports, strict=True):
        assert (mine[0], mine[2]) == (other[0], other[2])
        np.testing.assert_allclose(mine[1], other[1], rtol=0, atol=1e-14)


def test_long_bridge_hangs_on_taut_cables() -> None:
    # equilibrium refuses a scene of which a cable would push.
    assert references.equilibrium(scaling.long_bridge(96)).residual < 1e-11


def test_taut_motion_of_a_particle_on_a_cable_is_a_pendulum() -> None:
    stretch, amplitude = 0.25, 1.0
    position, _ = taut_motion(single_support(amplitude), np.ones((8, 1)), stretch)
    angle, _ = references.pendulum(
        stretch * np.arange(1, 9), length=2.0, amplitude=amplitude, gravity=9.81
    )
    exact = 2.0 * np.stack([np.sin(angle), -np.cos(angle), np.zeros(8)], axis=1)
    # Local errors of 1e-12 grow with time over some hundred steps.
    np.testing.assert_allclose(position[:, 0], exact, rtol=0, atol=1e-9)


def test_taut_motion_refuses_a_cable_that_goes_slack() -> None:
    with pytest.raises(ArithmeticError, match="slack"):
        taut_motion(single_support(2.0), np.ones((1, 1)), 0.1)


def test_moving_load_is_followed_at_second_order() -> None:
    case = cases.bridge(1)
    coarse, fine = (
        case.score(*EngineFlight(case, replace(DIRECT, dt=dt), worlds=1).trajectory())
        for dt in (0.02, 0.01)
    )
    assert coarse.rms / fine.rms == pytest.approx(4.0, rel=0.02)
    assert fine.strain < 1e-12


def test_score_counts_every_error() -> None:
    case = cases.platform(1)
    solved = np.broadcast_to(case.scene.velocity, case.solution.shape)
    exact = case.score(case.solution, solved)
    assert exact.rms == exact.most == 0.0
    assert exact.strain < 1e-12
    # One particle of six, moved 1 mm across: 1e-3 at most, 1e-3 / sqrt(6) by rms.
    moved = case.solution.copy()
    moved[2, 3, 1] += 1e-3
    score = case.score(moved, 1.1 * solved)
    assert score.most == pytest.approx(1e-3, rel=1e-9)
    assert score.rms == pytest.approx(1e-3 / np.sqrt(6.0), rel=1e-9)
    assert 1e-5 < score.strain < 1e-3
    assert score.energy == pytest.approx(0.21, rel=1e-9)
    assert exact.within(score)
    assert not score.within(replace(score, strain=0.5 * score.strain))


@pytest.mark.parametrize("name", list(CONTESTS))
def test_flights_start_anew_and_do_not_depend_on_how_they_are_called(name: str) -> None:
    contest = CONTESTS[name]
    case = contest.case(16)
    method = next(iter(contest.methods.values()))(0.01)
    batch = EngineFlight(case, method, worlds=16)
    first = batch.trajectory()
    batch()
    np.testing.assert_array_equal(batch.trajectory(), first)
    assert not np.array_equal(batch.world.particles.position[1], first[0][-1])
    alone = EngineFlight(case, method, worlds=1)
    np.testing.assert_array_equal(alone.trajectory(), first)
    assert batch.simulated == 16 * alone.simulated == 16 * case.duration
    peer = PeerFlight(case, PeerMethod(), dt=0.01, rounds=2)
    motion = peer.trajectory()
    peer()
    np.testing.assert_array_equal(peer.trajectory(), motion)
    stepped = PeerFlight(case, PeerMethod(), dt=0.01, step_by_step=True)
    np.testing.assert_array_equal(stepped.trajectory(), motion)
    # Side by side the worlds share one solve, which ends at its tolerance.
    crowd = PeerFlight(case, PeerMethod(), dt=0.01, copies=3)
    np.testing.assert_allclose(crowd.trajectory(), motion, rtol=0, atol=1e-6)


def test_flight_refuses_a_step_that_misses_the_looks() -> None:
    case = cases.platform(1)
    with pytest.raises(ValueError, match="does not divide"):
        EngineFlight(case, replace(DIRECT, dt=0.03), worlds=1)


def point(method: str, dt: float, error: float, per_second: float, *, peer: bool = False) -> Point:
    score = cases.Score(rms=error, most=2.0 * error, strain=0.0, energy=0.0)
    return Point(
        method=method,
        dt=dt,
        mode="batch",
        score=score,
        per_second=per_second,
        own_limit=(0.1 * error, 0.2 * error) if peer else (error, 2.0 * error),
        peer=peer,
    )


def test_compare_takes_our_cheapest_point_of_no_larger_error() -> None:
    contest = Contest(
        case=cases.platform,
        methods={"plain": lambda dt: DIRECT, "loose": lambda dt: DIRECT},
        peers={"MuJoCo": PeerMethod()},
        steps=(1,),
        peer_steps=(1,),
        limit_steps=1,
        crowd=1,
        target=1.0,
    )
    points = [
        point("plain", 0.01, 1e-4, 50.0),
        point("plain", 0.02, 4e-4, 30.0),
        point("plain", 0.04, 2e-3, 10.0),
        point("loose", 0.02, 9e-4, 20.0),
        point("MuJoCo", 0.01, 1e-3, 1000.0, peer=True),
    ]
    found = against_mujoco.compare(contest, points, "MuJoCo")
    assert found["ours"]["per_second"] == 20.0
    assert found["cost_ratio"] == {
        "per second": 50.0,
        "per second, default method": pytest.approx(1000.0 / 30.0),
        "per second, own limits": 20.0,
        "per step": 20.0,
    }
    none = against_mujoco.compare(contest, [points[0], replace(points[4], score=cases.Score(
        rms=1e-5, most=1e-5, strain=0.0, energy=0.0))], "MuJoCo")  # fmt: skip
    assert none["ours"] is None and none["cost_ratio"]["per second"] is None


def test_bridge_rests_at_its_statics_where_soft_links_sag() -> None:
    ours, theirs = rest.settle(DIRECT, {"default": PeerMethod()})
    assert ours.height < 1e-9 and ours.speed < 1e-9
    assert 1e-4 < theirs["default"].height < 1e-3


@pytest.mark.parametrize("name", list(scaling.SCENES))
def test_bytes_per_world_are_those_of_the_rows(name: str) -> None:
    scene, method = scaling.SCENES[name]
    world = sy.World(build(scene()), worlds=8, method=method)
    assert world.bytes_per_world == 8 * scaling.needed_rows(scene())
    assert world.snapshot().state.shape[0] == scaling.needed_rows(scene())


def test_worlds_of_the_scaling_benchmark_are_at_different_times() -> None:
    single = sy.World(build(scaling.swinging_bridge(6)), method=DIRECT)
    batch = sy.World(single.scene, worlds=3, method=DIRECT)
    scaling.spread_phases(batch)
    single.step(5)
    np.testing.assert_array_equal(batch.particles.position[1], single.particles.position[0])
    assert not np.array_equal(batch.particles.position[2], batch.particles.position[1])


def test_figure_is_held_against_its_target() -> None:
    assert Figure(name="ratio", measured=51.0, at_least=50.0).met is True
    assert Figure(name="ratio", measured=49.0, at_least=50.0).met is False
    assert Figure(name="start", measured=3.1, unit="s", at_most=3.0).met is False
    assert Figure(name="free", measured=1.0).met is None
    assert Figure(name="start", measured=3.1, unit="s", at_most=3.0).target == "<= 3 s"


def test_a_world_that_gains_energy_is_seen_beside_one_that_loses_more() -> None:
    looks = iter([[10.0, 10.0], [4.0, 0.0], [5.0, -6.0]])
    readings = {"gap": lambda: 1.0, "energy": lambda: np.array(next(looks))}
    # Gains 1 of the 6 that it fell.
    assert bodies.watch(lambda: None, readings, 2) == {"gap": 1.0, "gain": pytest.approx(1 / 6)}


def test_environment_benchmark_on_an_environment_that_is_always_there() -> None:
    cartpole = environments.CARTPOLE
    assert environments.vector_rates(cartpole, num_envs=4, quick=True)[cartpole] > 0.0
    assert environments.single_rates(cartpole, quick=True)[cartpole] > 0.0
    seconds = environments.first_step(cartpole, None)
    parts = [value for name, value in seconds.items() if name != "total"]
    assert seconds["total"] == pytest.approx(sum(parts))
    assert environments.heavy_imports("numba") == ["numba"]
    assert environments.heavy_imports("gymnasium") == []


# They compile what nothing else here does, for a minute in all.
DEAR = ("against_mujoco", "environments", "planar", "undeclared")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in DEAR)) for name in run.BENCHMARKS],
)
def test_quick_run(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.run", name, "--quick", "--output", str(tmp_path)],
        cwd=Path(__file__).parent.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert document["quick"] is True
    assert document["provenance"]["command"].startswith(f"python -m benchmarks.run {name} --quick")
    assert len(document["figures"]) > (1 if name == "undeclared" else 3)
    for picture in tmp_path.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")
    drawn = {
        "against_mujoco": {"against_mujoco"},
        "scaling": {"scaling"},
        "bodies": {"bodies_heap"},
    }
    assert {path.stem for path in tmp_path.glob("*.png")} == drawn.get(name, set())


def test_run_refuses_an_unknown_benchmark(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run.main(["speed"])
    assert "choose from against_mujoco" in capsys.readouterr().err
