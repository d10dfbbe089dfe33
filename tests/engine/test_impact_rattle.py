"""Impacts resolved inside the step: balls and cables against closed forms, order, energy, rest, refusals."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import steelyard as sy
from tests.engine.test_batch import falling_platform

G = 9.81
DT = 1.0 / 60.0


def method(dt: float = DT, impacts: int = 4) -> sy.Method:
    return sy.Method(sy.ImpactRattle(impacts=impacts), sy.Direct(), dt=dt)


def ball(restitution: float, *, friction: float = 0.0, drop: float = 1.0) -> sy.Scene:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0.0, drop, 0.0), velocity=(1.0, 0.0, 0.5)))
    scene.add(sy.Ground(restitution=restitution, friction=friction))
    return scene


def height(restitution: float, time: float, drop: float = 1.0) -> float:
    """Of a ball that is dropped, by its arcs."""
    speed = math.sqrt(2.0 * G * drop)
    if time < speed / G:
        return drop - 0.5 * G * time**2
    time -= speed / G
    speed *= restitution
    while speed > 1e-9 and time > 2.0 * speed / G:
        time -= 2.0 * speed / G
        speed *= restitution
    return speed * time - 0.5 * G * time**2 if speed > 1e-9 else 0.0


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8, 1.0])
def test_a_bouncing_ball_is_exact(restitution: float) -> None:
    world = sy.World(ball(restitution), worlds=3, method=method())
    plain = sy.World(ball(restitution), method=sy.Method(sy.Rattle(), sy.Direct(), dt=DT))
    worst = worst_plain = 0.0
    for k in range(1, 151):
        world.step()
        plain.step()
        true = height(restitution, k * DT)
        worst = max(worst, abs(world.particles.position[1, 0, 1] - true))
        worst_plain = max(worst_plain, abs(plain.particles.position[0, 0, 1] - true))
    assert worst < 1e-10
    assert not world.health.any()
    if restitution > 0.0:
        assert worst_plain > 1e-3


def test_many_bounces_in_one_step_and_rest_after_the_last() -> None:
    # The ball comes to rest within finite time after infinitely many bounces: the limit of four a step is met there.
    world = sy.World(ball(0.3, drop=0.05), method=method())
    world.step(60)
    assert abs(world.particles.position[0, 0, 1]) < 1e-12
    assert abs(world.particles.velocity[0, 0, 1]) < 1e-12
    np.testing.assert_allclose(world.particles.velocity[0, 0, [0, 2]], [1.0, 0.5], rtol=1e-12)


def test_energy_stays_over_a_thousand_elastic_bounces() -> None:
    world = sy.World(ball(1.0), method=method())
    start = world.energy[0]
    world.step(60 * 900)
    assert world.energy[0] == pytest.approx(start, rel=1e-9)


def test_friction_takes_its_share_of_each_bounce() -> None:
    # Coulomb: the tangential speed falls by mu (1 + e) v_n at each bounce, until it is gone.
    restitution, friction = 0.6, 0.05
    world = sy.World(ball(restitution, friction=friction), method=method())
    world.step(60)
    fall = math.sqrt(2.0 * G)
    times = [fall / G]
    while times[-1] < 1.0:
        times.append(times[-1] + 2.0 * restitution ** len(times) * fall / G)
    lost = sum(
        friction * (1.0 + restitution) * restitution**k * fall for k in range(len(times) - 1)
    )
    speed = np.linalg.norm(world.particles.velocity[0, 0, [0, 2]])
    assert speed == pytest.approx(math.hypot(1.0, 0.5) - lost, abs=1e-9)


def tethered(restitution: float) -> sy.Scene:
    """A particle that falls beside its anchor until the cable catches it."""
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.6, 0.2, 0.0), velocity=(0.5, 0.0, 0.3)))
    scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 1.0, restitution=restitution))
    return scene


def caught(restitution: float, end: float) -> np.ndarray:
    """Place at the time ``end``: parabolas between the times at which they reach the sphere of the cable."""
    x, v, now = np.array([0.6, 0.2, 0.0]), np.array([0.5, 0.0, 0.3]), 0.0
    g = np.array([0.0, -G, 0.0])
    while True:

        def over(t: float, x: np.ndarray = x, v: np.ndarray = v) -> float:
            place = x + t * v + 0.5 * t**2 * g
            return float(place @ place - 1.0)

        grid = np.linspace(1e-6, end - now, 20001)
        beyond = [k for k, t in enumerate(grid) if over(t) > 0.0]
        if not beyond:
            t = end - now
            return np.asarray(x + t * v + 0.5 * t**2 * g)
        k = beyond[0]
        t = brentq(over, grid[max(k - 1, 0)] if k else 1e-9, grid[k], xtol=1e-15, rtol=1e-15)
        x = x + t * v + 0.5 * t**2 * g
        v = v + t * g
        n = x / np.linalg.norm(x)
        v = v - (1.0 + restitution) * (v @ n) * n
        now += t


@pytest.mark.parametrize("restitution", [0.8, 0.9, 1.0])
def test_a_cable_that_catches_a_fall(restitution: float) -> None:
    end = 0.9
    world = sy.World(tethered(restitution), method=method())
    world.step(round(end / DT))
    np.testing.assert_allclose(
        world.particles.position[0, 0], caught(restitution, end), rtol=0, atol=1e-9
    )


def sprung(restitution: float) -> sy.Scene:
    """A bouncing pair on a spring, damped: nothing of it is exact between impacts."""
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0.0, 0.5, 0.0), damping=0.8))
    b = scene.add(sy.Particle(position=(0.3, 1.0, 0.0), mass=2.0, damping=0.8))
    scene.add(sy.Spring(a, b, 60.0, 0.6))
    scene.add(sy.Ground(restitution=restitution))
    return scene


def test_second_order_across_impacts() -> None:
    places = []
    for refine in (1, 2, 4, 32):
        world = sy.World(sprung(0.7), method=method(DT / 4 / refine))
        world.step(4 * refine * 50)
        places.append(world.particles.position[0].copy())
    errors = [float(np.abs(place - places[-1]).max()) for place in places[:-1]]
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0
    plain = sy.World(sprung(0.7), method=sy.Method(sy.Rattle(), sy.Direct(), dt=DT / 16))
    plain.step(16 * 50)
    assert np.abs(plain.particles.position[0] - places[-1]).max() > 10.0 * errors[2]


def test_both_feet_land_together() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0.0, 0.7, 0.0)))
    b = scene.add(sy.Particle(position=(1.0, 0.7, 0.0)))
    scene.add(sy.Rod(a, b))
    scene.add(sy.Ground(restitution=0.6))
    world = sy.World(scene, method=method())
    world.step(50)
    true = height(0.6, 50 * DT, drop=0.7)
    np.testing.assert_allclose(world.particles.position[0, :, 1], true, atol=1e-10)


def test_without_impacts_it_is_rattle() -> None:
    places = []
    for integrator in (sy.Rattle(), sy.ImpactRattle()):
        scene = sy.Scene()
        row = [scene.add(sy.Particle(position=(k + 1.0, 0.0, 0.0))) for k in range(3)]
        scene.add(sy.RodConstraint(row[0], (0.0, 0.0, 0.0)))
        for a, b in pairwise(row):
            scene.add(sy.Rod(a, b))
        world = sy.World(scene, worlds=2, method=sy.Method(integrator, sy.Direct(), dt=DT))
        world.step(100)
        places.append(world.particles.position.copy())
    np.testing.assert_array_equal(*places)


def test_it_steps_particles_that_nothing_holds() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 2.0, 3.0), damping=0.5))
    one, other = (
        sy.World(scene, method=sy.Method(integrator, sy.Direct(), dt=DT))
        for integrator in (sy.Rattle(), sy.ImpactRattle())
    )
    for world in (one, other):
        world.step(30)
    np.testing.assert_allclose(other.particles.position, one.particles.position, rtol=1e-13)


@pytest.mark.parametrize("impacts", [0, -1, 1.5])
def test_counts_of_impacts_are_checked(impacts: float) -> None:
    with pytest.raises(ValueError, match="impacts is"):
        sy.ImpactRattle(impacts=impacts)  # type: ignore[arg-type]


def test_what_cannot_be_divided_is_refused() -> None:
    scene = ball(0.5)
    with pytest.raises(ValueError, match="does not work with GaussSeidel"):
        sy.World(scene, method=sy.Method(sy.ImpactRattle(), sy.GaussSeidel()))
    for thing in (sy.Drag(0.1), sy.StiffSpring(sy.Particle(position=(5, 5, 5)), (5, 5, 5), 1.0)):
        other = scene.copy()
        if isinstance(thing, sy.StiffSpring):
            other.add(thing.particle)
        other.add(thing)
        with pytest.raises(ValueError, match=f"cannot step a {type(thing).__name__}"):
            sy.World(other, method=method())


def test_second_order_as_a_frame_of_rods_lands_on_its_feet() -> None:
    places = {}
    for integrator in (sy.Rattle(), sy.ImpactRattle()):
        for rate in (60, 120, 240, 1920):
            world = sy.World(
                falling_platform(), method=sy.Method(integrator, sy.Direct(), dt=1.0 / rate)
            )
            world.step(round(0.8 * rate))
            assert world.health[0] == 0
            places[type(integrator), rate] = world.particles.position[0].copy()
    true = places[sy.ImpactRattle, 1920]
    error = {key: float(np.abs(place - true).max()) for key, place in places.items()}
    assert error[sy.ImpactRattle, 60] < 2e-3
    assert error[sy.ImpactRattle, 60] / error[sy.ImpactRattle, 120] > 3.5
    assert error[sy.ImpactRattle, 120] / error[sy.ImpactRattle, 240] > 3.5
    # The same motion, of first order.
    assert error[sy.Rattle, 60] > 5.0 * error[sy.ImpactRattle, 60]
    assert 4.0 < error[sy.Rattle, 60] / error[sy.Rattle, 1920] < 64.0
