"""The automatic choice: it holds what it promises, says why, and refuses what cannot be had."""

from __future__ import annotations

import math

import numpy as np
import pytest

import steelyard as sy
from steelyard.candidates import cost_table

G = 9.81


def spring(omega: float = 5.0) -> sy.Scene:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    particle = scene.add(sy.Particle(position=(0.5, 0.0, 0.0), mass=2.0))
    scene.add(sy.AnchoredSpring(particle, (0.0, 0.0, 0.0), 2.0 * omega**2, 0.0))
    return scene


def pendulum() -> sy.Scene:
    scene = sy.Scene()
    bob = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(bob, anchor=(0.0, 0.0, 0.0)))
    return scene


def shot() -> sy.Scene:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0.0, 1.0, 0.0), velocity=(20.0, 20.0, 0.0), damping=0.9))
    return scene


def ball() -> sy.Scene:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0.0, 1.0, 0.0)))
    scene.add(sy.Ground(restitution=0.8))
    return scene


def test_every_candidate_has_a_cost() -> None:
    assert {candidate.name for candidate in sy.CANDIDATES} <= set(cost_table())
    model = sy.World(spring()).model
    count = len(sy.CANDIDATES[0].work(spring(), model, 0.01))
    for name, coefficients in cost_table().items():
        assert len(coefficients) == count, name
        assert min(coefficients) >= 0.0 and max(coefficients) > 0.0, name


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6, 1e-8])
def test_a_spring_keeps_within_the_tolerance(tolerance: float) -> None:
    horizon = 2.0
    choice = sy.choose_method(spring(), tolerance=tolerance, horizon=horizon)
    world = sy.World(spring(), method=choice.method)
    worst = 0.0
    for step in range(1, round(horizon / choice.method.dt) + 1):
        world.step()
        truth = 0.5 * math.cos(5.0 * step * choice.method.dt)
        worst = max(worst, abs(world.particles.position[0, 0, 0] - truth))
    assert worst <= tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_pendulum_keeps_within_the_tolerance(tolerance: float) -> None:
    choice = sy.choose_method(pendulum(), tolerance=tolerance)
    world = sy.World(pendulum(), method=choice.method)
    fine = sy.World(pendulum(), method=sy.Method(sy.Rattle(), sy.Direct(), dt=1e-5))
    world.step(round(1.0 / choice.method.dt))
    fine.step(100_000)  # of second order: within 1e-9
    distance = np.linalg.norm(world.particles.position - fine.particles.position)
    assert distance <= tolerance


def test_free_flight_is_flown_in_closed_form() -> None:
    choice = sy.choose_method(shot(), tolerance=1e-9, horizon=3.0)
    assert isinstance(choice.method.integrator, sy.ClosedForm)
    assert choice.error < 1e-11


def test_a_tighter_tolerance_costs_no_less() -> None:
    costs = [sy.choose_method(pendulum(), tolerance=10.0**-k).cost for k in range(2, 7)]
    assert costs == sorted(costs)


def test_the_cheapest_that_holds_it_wins_and_all_are_explained() -> None:
    choice = sy.choose_method(pendulum(), tolerance=1e-4)
    holding = [entry for entry in choice.considered if entry.dt is not None]
    assert choice.cost == min(entry.cost for entry in holding)
    assert all(entry.error <= 1e-4 for entry in holding)
    assert {entry.name for entry in choice.considered} == {
        candidate.name for candidate in sy.candidates(pendulum())
    }
    text = str(choice)
    for entry in choice.considered:
        assert entry.name in text
        assert entry.verdict in text


def test_methods_that_cannot_step_a_scene_are_no_candidates() -> None:
    names = {candidate.name for candidate in sy.candidates(ball())}
    assert "RATTLE, direct" in names
    assert "RK4" not in names
    assert "closed form" not in {candidate.name for candidate in sy.candidates(spring())}


def test_a_wrong_engine_is_no_reference() -> None:
    """Two sweeps that agree with themselves do not hold a chain; the residual and the direct run say so."""
    scene = sy.Scene()
    before = None
    for k in range(8):
        particle = scene.add(
            sy.Particle(position=(0.2 * (k + 1), 0.0, 0.0), mass=1.0 + 99.0 * (k == 7))
        )
        scene.add(
            sy.RodConstraint(particle, anchor=(0.0, 0.0, 0.0))
            if before is None
            else sy.Rod(before, particle)
        )
        before = particle
    choice = sy.choose_method(scene, tolerance=1e-4, horizon=0.5)
    assert "x 4" not in choice.considered[0].name


def test_what_nothing_reaches_is_refused_with_the_best_there_is() -> None:
    with pytest.raises(ValueError, match=r"1e-15 over 2 s .*best that can be had is \d.*Ask for"):
        sy.choose_method(ball(), tolerance=1e-15, horizon=2.0)


def test_world_takes_a_tolerance() -> None:
    world = sy.World(spring(), worlds=3, tolerance=1e-4)
    assert world.choice is not None
    assert world.method == world.choice.method
    assert "chosen for 0.0001" in repr(world)
    assert sy.World(spring(), method=world.method).choice is None
    with pytest.raises(ValueError, match="both a method and a tolerance"):
        sy.World(spring(), tolerance=1e-4, method=world.method)


@pytest.mark.parametrize(
    "setting", [{"tolerance": 0.0}, {"tolerance": math.nan}, {"horizon": -1.0}]
)
def test_senseless_settings_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"choose_method: .* must be"):
        sy.choose_method(spring(), **{"tolerance": 1e-3, **setting})


def test_kinks_are_counted() -> None:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    ball = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0), mass=2.0))
    # Between bungees that begin to pull at 0.5 m to either side: half a period of pi sqrt(m/k) there, 1 s in between.
    for end in (-1.0, 1.0):
        scene.add(sy.AnchoredBungee(ball, (end, 0.0, 0.0), 2.0 * math.pi**2, 1.5))
    assert sy.kinks_per_second(scene, 40.0) == pytest.approx(1.0, abs=0.05)
    assert sy.kinks_per_second(spring(), 1.0) == 0.0


def test_a_block_runs_as_often_as_its_worst_world_has_kinks() -> None:
    resolving = next(c for c in sy.CANDIDATES if c.name == "RK4, kinks inside")
    plain = next(c for c in sy.CANDIDATES if c.name == "RK4")
    assert plain.runs(2.0) == resolving.runs(0.0) == 1.0
    rng = np.random.default_rng(0)
    for events in (0.05, 0.5, 3.0):
        counts = rng.poisson(events, (100_000, 8)).max(axis=1)
        turns = np.minimum(counts, resolving.integrator.divisions).mean()
        assert resolving.runs(events) == pytest.approx(1.0 + 3.0 * turns, rel=0.02)


@pytest.mark.parametrize("steps", [20, 23, 33, 44, 60])
def test_any_number_of_steps_is_compared_with_the_reference(steps: int) -> None:
    from steelyard import choice

    whole = choice._whole(steps)
    looks = choice._looks(whole)
    assert steps <= whole <= 1.05 * steps
    assert whole % looks == 0 and 20 <= looks < 40
    assert choice._down(whole) == whole


def stack(top: float) -> sy.Scene:
    """Four boxes, the last so many times as heavy."""
    scene = sy.Scene()
    for i in range(4):
        part = sy.Part(shape=sy.Box((0.5, 0.5, 0.5)), density=1000.0 * (top if i == 3 else 1.0))
        scene.add(sy.Body(position=(0, 0.5 + i, 0), parts=part))
    scene.add(sy.Ground(friction=0.6))
    scene.add(sy.Collisions(friction=0.6))
    return scene


def test_bodies_that_touch_get_a_solver_that_holds_them() -> None:
    choice = sy.choose_method(stack(300.0), tolerance=1e-5, horizon=1.0)
    assert choice.considered[0].name == "bodies, proximal Newton"
    verdicts = {entry.name: entry for entry in choice.considered}
    assert verdicts["bodies, Gauss-Seidel x 10"].dt is None
    world = sy.World(stack(300.0), tolerance=1e-5)
    world.step(round(1.0 / world.method.dt))
    np.testing.assert_allclose(world.bodies.position[0, :, 1], [0.5, 1.5, 2.5, 3.5], atol=1e-5)


def test_impacts_of_bodies_are_known_to_no_more_than_steps_can_tell() -> None:
    """Impacts may fall alike in a step and in its half: that is no proof of either."""
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 1.5, 0), parts=sy.Sphere(0.5)))
    scene.add(sy.Ground(restitution=0.8))
    choice = sy.choose_method(scene, tolerance=1e-2, horizon=1.0)
    world = sy.World(scene, method=choice.method)
    world.step(round(1.0 / choice.method.dt))
    fall = math.sqrt(2.0 / 9.81)
    speed, since = 0.8 * 9.81 * fall, 1.0 - fall
    assert world.bodies.position[0, 0, 1] == pytest.approx(
        0.5 + speed * since - 0.5 * 9.81 * since**2, abs=1e-2
    )
    with pytest.raises(ValueError, match="out of reach"):
        sy.choose_method(scene, tolerance=1e-9, horizon=1.0)
