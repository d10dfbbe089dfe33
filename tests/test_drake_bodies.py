"""Rigid scenes in Drake: the bodies, contacts and joints of the scene, and what it is not given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("pydrake")
pytest.importorskip("mujoco")
pytest.importorskip("pymunk")

import steelyard as sy
from benchmarks.laboratory.engines import BrokenRunError, PeerRun
from benchmarks.laboratory.peers import FlownBodies
from benchmarks.laboratory.problem import Problem, worst
from benchmarks.laboratory.problems import load
from benchmarks.peers import drake
from benchmarks.peers.drake_bodies import DrakeFlight

PROBLEMS = {problem.name: problem for problem in load("contact")}


def flown(scene: sy.Scene, dt: float, **way: Any) -> DrakeFlight:
    return drake.flight(scene, dt, way)


def errors(problem: Problem, name: str, dt: float) -> dict[str, float]:
    return problem.errors(PeerRun(problem, problem.peers[name], dt=dt).motion())


def lone_box(height: float, **given: Any) -> sy.Scene:
    scene = sy.Scene(gravity=(0.0, -10.0, 0.0))
    scene.add(sy.Body(position=(0, height, 0), parts=sy.Box((0.5, 0.5, 0.5)), **given))
    scene.add(sy.Ground(friction=0.5))
    return scene


def lumpy() -> sy.Body:
    """A compound that no axis of its own fits."""
    parts = [
        sy.Part(shape=sy.Box((0.1, 0.2, 0.3))),
        sy.Part(shape=sy.Capsule(0.1, 0.3), offset=(0.4, 0.1, 0), orientation=(0.9, 0.1, 0.3, 0.2)),
        sy.Part(shape=sy.Sphere(0.2), offset=(-0.2, 0.3, 0.5), density=2000.0),
    ]
    return sy.Body(
        position=(0.1, 0.2, 0.3),
        orientation=(0.5, 0.5, -0.5, 0.4),
        velocity=(1.0, 2.0, -1.0),
        angular_velocity=(3.0, -2.0, 1.0),
        parts=parts,
    )


def test_a_free_body_flies_as_ours() -> None:
    scene = sy.Scene(gravity=(0.0, -10.0, 0.0))
    scene.add(lumpy())
    world = sy.World(scene, method=sy.Method(sy.Rattle(), dt=1e-3))
    peer = FlownBodies(scene, flown(scene, 1e-2, scheme="runge_kutta5", accuracy=1e-10))
    assert peer.flight.energy == pytest.approx(world.energy[0], rel=1e-12)
    world.step(1000)
    peer.step(100)
    places, speeds = (part[0] for part in sy.landmarks(world))
    found, rates = peer.state()
    # Ours turns freely to rounding; Drake's is held to 1e-10.
    np.testing.assert_allclose(found, places, rtol=0, atol=1e-7)
    np.testing.assert_allclose(rates, speeds, rtol=0, atol=1e-6)


def test_sap_takes_the_steps_that_are_asked_for() -> None:
    # Semi-implicit Euler falls by g dt^2 n (n + 1) / 2.
    scene = sy.Scene(gravity=(0.0, -10.0, 0.0))
    scene.add(sy.Body(position=(0, 0, 0), parts=sy.Sphere(0.1)))
    flight = flown(scene, 1 / 60)
    for _ in range(100):
        flight.step(7)
    assert flight.position[0, 1] == pytest.approx(-10.0 / 3600.0 * 700 * 701 / 2, rel=1e-11)


def test_a_flight_starts_anew() -> None:
    scene = lone_box(0.5)
    for way in drake.WAYS.values():
        flight = flown(scene, 0.01, **way)
        flight.push(np.array([[1.0, 0.0, 0.5]]), np.array([[0.0, 2.0, 0.0]]))
        np.testing.assert_allclose(flight.moving[2], [[1.0, 0.0, 0.5]], rtol=1e-14)
        np.testing.assert_allclose(flight.moving[3], [[0.0, 2.0, 0.0]], rtol=1e-14)
        start = flight.saved()
        flight.step(20)
        first = flight.saved()
        flight.restore(start)
        flight.step(20)
        np.testing.assert_array_equal(flight.saved(), first)


@pytest.mark.parametrize("name", drake.WAYS)
def test_a_block_slides_near_its_closed_form(name: str) -> None:
    # 1.5 s and 1.6 m; SAP glides, by 2 cm at this step, and no friction at all would be 3.6 m off.
    assert errors(PROBLEMS["sliding block"], name, 1 / 60)["trajectory"] < 0.03


def test_a_ball_rolls_the_better_the_more_accurate_cenic_is() -> None:
    rolling = PROBLEMS["rolling ball"]
    fine, coarse = (worst(errors(rolling, f"Drake CENIC 1e-{k}", 1 / 30)) for k in (5, 3))
    assert fine < 0.3 * coarse < 0.01


@pytest.mark.parametrize("name", drake.WAYS)
def test_stacks_stand_as_stiff_as_they_are_made(name: str) -> None:
    # Contacts give by 1e-5 m under the weight of all, which corners share and every box adds to: the tops by less.
    for stack in ("stack of ten", "stack, top 1000 x heavier"):
        assert worst(errors(PROBLEMS[stack], name, 1 / 30)) < 3e-5


def test_penetration_is_depth() -> None:
    assert flown(lone_box(0.6), 0.01).penetration == 0.0
    assert flown(lone_box(0.48), 0.01).penetration == pytest.approx(0.02, rel=1e-6)
    resting = flown(lone_box(0.5), 0.01)
    resting.step(100)
    assert 1e-7 < resting.penetration < 1e-5
    assert resting.energy == pytest.approx(1000.0 * 10.0 * 0.5, rel=1e-4)


def test_a_capsule_lies_and_grounds_may_tilt_and_differ_from_bodies() -> None:
    scene = sy.Scene(gravity=(-5.0, -5.0, 0.0))
    lying = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    for x in (0.0, 0.5):
        place = np.array((x, -x, 0.0)) + (0.3 + 0.1) * np.sqrt(0.5) * np.array((1.0, 1.0, 0.0))
        scene.add(sy.Body(position=tuple(place), orientation=lying, parts=sy.Capsule(0.1, 0.5)))
    scene.add(sy.Ground(normal=(1, 1, 0), height=0.3, friction=0.2))
    scene.add(sy.Collisions(friction=0.6))
    flight = flown(scene, 0.01)
    flight.push(np.tile((0.0, 0.0, 1.0), (2, 1)), np.zeros((2, 3)))
    start = flight.position
    flight.step(40)
    _, _, speed, spin = flight.moving
    # Along its axis a capsule slides: friction of .2 below g = sqrt(50) takes .57 m/s in .4 s. SAP glides a little.
    np.testing.assert_allclose(speed[:, 2], 1.0 - 0.2 * np.sqrt(50.0) * 0.4, atol=0.02)
    np.testing.assert_allclose(spin, 0.0, atol=1e-3)
    np.testing.assert_allclose((flight.position - start)[:, :2].sum(axis=1), 0.0, atol=2e-2)


def test_joints_hold_in_sap_alone() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Body(position=(0, 0, 0), parts=sy.Box((0.1, 0.1, 0.1))))
    b = scene.add(sy.Body(position=(1, 0, 0), parts=sy.Box((0.1, 0.1, 0.1))))
    c = scene.add(sy.Body(position=(2, 0, 0), parts=sy.Box((0.1, 0.1, 0.1))))
    scene.add(sy.BallJoint(a=a, b=b, place=(0.5, 0, 0)))
    scene.add(sy.HingeJoint(a=b, b=c, place=(1.5, 0, 0), axis=(0, 0, 1)))
    flight = flown(scene, 1e-3)
    flight.push(np.zeros((3, 3)), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, -1.0]]))
    flight.step(1000)
    assert 0.0 < flight.gap < 0.02
    _, turns, _, _ = flight.moving
    np.testing.assert_allclose(turns[1][:, 2], turns[2][:, 2], atol=0.05)
    assert np.linalg.norm(turns[0] - turns[1]) > 0.05
    with pytest.raises(ValueError, match="only SAP"):
        flown(scene, 1e-3, scheme="cenic")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pivot": (0, 1, 0)}, "pivot"),
        ({"damping": 0.5}, "damping"),
        ({"parts": sy.Hollow(outer=sy.Sphere(0.2), inner=sy.Sphere(0.1))}, "balls, boxes"),
    ],
)
def test_what_drake_lacks_is_refused(change: dict[str, Any], reason: str) -> None:
    scene = sy.Scene()
    scene.add(sy.Body(**{"position": (0, 0, 0), "parts": sy.Sphere(0.1), **change}))
    scene.add(sy.Ground())
    with pytest.raises(ValueError, match=reason):
        flown(scene, 0.01)


def test_surfaces_that_drake_lacks_are_refused() -> None:
    bouncing = lone_box(1.0)
    bouncing.add(sy.Ground(restitution=0.5, height=-1.0))
    with pytest.raises(ValueError, match="restitution"):
        flown(bouncing, 0.01)
    rough = lone_box(1.0)
    rough.add(sy.Body(position=(0, 3, 0), parts=sy.Sphere(0.1)))
    with pytest.raises(ValueError, match="pass through"):
        flown(rough, 0.01)
    rough.add(sy.Rod(*(rough.add(sy.Particle(position=(x, 9, 0))) for x in (0, 1))))
    with pytest.raises(ValueError, match="Particle; nor Rod"):
        flown(rough, 0.01)
    rough = lone_box(1.0)
    rough.add(sy.Body(position=(0, 3, 0), parts=sy.Sphere(0.1)))
    rough.add(sy.Collisions(friction=0.2))
    with pytest.raises(ValueError, match="mean of two surfaces"):
        flown(rough, 0.01)


@pytest.mark.parametrize("name", drake.WAYS)
def test_what_breaks_drake_breaks_the_run_alone(name: str) -> None:
    # Its assertions would end the process.
    scene = lone_box(0.5, velocity=(1e200, -1e200, 0.0), angular_velocity=(1e200, 1e160, 0.0))
    peer = FlownBodies(scene, drake.flight(scene, 0.01, drake.WAYS[name]))
    with pytest.raises(BrokenRunError):
        peer.step(100)
