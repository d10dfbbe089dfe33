"""Compositions of RATTLE: order with links, riders and damping, reversal, what they hold and what they refuse."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import pendulum
from benchmarks.scenes import tumbling_platform
from tests.engine.builders import Array, from_particle_scene
from tests.engine.refusals import pair, refused

SUBSTEPS = (3, 5, 9)


def chain(damping: float = 1.0) -> sy.Scene:
    """Four unequal links off the level, kicked out of their plane."""
    scene = sy.Scene()
    last = None
    for k, mass in enumerate((1.0, 0.4, 2.0, 0.7)):
        p = scene.add(
            sy.Particle(
                position=(0.3 * (k + 1), -0.4 * (k + 1), 0.0),
                velocity=(0.0, 0.0, 0.5 * k),
                mass=mass,
                damping=damping,
            )
        )
        scene.add(sy.Rod(last, p) if last else sy.RodConstraint(p, (0.0, 0.0, 0.0)))
        last = p
    return scene


def damped_chain() -> sy.Scene:
    """The same, which loses some of its velocity."""
    return chain(0.5)


def sprung_platform() -> sy.Scene:
    """A rigid cluster in free fall, on a spring."""
    scene = from_particle_scene(tumbling_platform())
    scene.gravity = (0.0, -9.81, 0.0)
    scene.add(sy.AnchoredSpring(scene.particles[3], (0.0, 4.0, 0.0), 40.0, 1.0))
    return scene


def ridden_platform() -> sy.Scene:
    """The same with a load that moves over its deck."""
    scene = sprung_platform()
    deck = scene.particles[2:6]
    place = np.mean([p.position for p in deck], axis=0)
    speed = np.mean([p.velocity for p in deck], axis=0)
    scene.add(sy.Rider(scene.add(sy.Particle(position=place, velocity=speed, mass=3.0)), deck))
    return scene


def ridden_ladder() -> sy.Scene:
    """A load that moves over two particles, which a rod joins and springs hold."""
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(-1.0, 0.0, 0.0), mass=2.0))
    b = scene.add(sy.Particle(position=(1.0, 0.0, 0.3), mass=1.0))
    scene.add(sy.Rod(a, b))
    scene.add(sy.AnchoredSpring(a, (-1.0, 2.0, 0.0), 60.0, 1.0))
    scene.add(sy.AnchoredSpring(b, (1.5, 2.0, 0.0), 80.0, 1.5))
    scene.add(sy.Rider(scene.add(sy.Particle(position=(0.0, 0.0, 0.15), mass=3.0)), [a, b]))
    return scene


SCENES: dict[str, Callable[[], sy.Scene]] = {
    each.__name__.replace("_", " "): each
    for each in (chain, damped_chain, sprung_platform, ridden_platform, ridden_ladder)
}


def run(name: str, substeps: int, steps: int, seconds: float = 0.5) -> sy.World:
    """A scene after some time; loads accelerate over what carries them."""
    integrator = sy.ComposedRattle(substeps=substeps)
    # Links to rounding, or what a substep leaves of them would be divided by its length and hide the order.
    solver = sy.Direct(tolerance=1e-15)
    world = sy.World(SCENES[name](), method=sy.Method(integrator, solver, dt=seconds / steps))
    for rider in world.scene.of(sy.Rider):
        count = len(rider.deck)
        world[rider].accelerations = 0.6 * (-1.0) ** np.arange(count)
    world.step(steps)
    return world


def state(world: sy.World) -> Array:
    return np.concatenate([world.particles.position[0], world.particles.velocity[0]])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_order_with_links_and_loads(name: str, substeps: int) -> None:
    # More steps would pile up rounding: that of a substep's places is divided by its length.
    exact = state(run(name, 9, 160))
    counts = np.array([2, 3, 4]) * {3: 30, 5: 10, 9: 5}[substeps]
    errors = [np.abs(state(run(name, substeps, n)) - exact).max() for n in counts.tolist()]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(sy.ComposedRattle(substeps=substeps).order(), abs=0.1), errors


def test_more_substeps_of_order_four_are_worth_their_cost() -> None:
    # At equal cost Suzuki's five leave a tenth of the error of Yoshida's three (5.4 / .58 on a spring).
    exact = state(run("chain", 9, 400))
    three, five = (np.abs(state(run("chain", n, 600 // n)) - exact).max() for n in (3, 5))
    assert five < 0.25 * three


@pytest.mark.parametrize(("substeps", "rate", "limit"), [(5, 120, 2.5e-7), (9, 60, 1e-8)])
def test_a_pendulum_for_ten_seconds(substeps: int, rate: int, limit: float) -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(p, (0.0, 0.0, 0.0)))
    method = sy.Method(sy.ComposedRattle(substeps=substeps), sy.Direct(), dt=1.0 / rate)
    world = sy.World(scene, method=method)
    world.step(10 * rate)
    (angle,), _ = pendulum(np.array([10.0]), length=1.0)
    error = np.linalg.norm(world.particles.position[0, 0] - (np.sin(angle), -np.cos(angle), 0.0))
    assert error < limit
    assert abs(world.residual).max() < 1e-12
    assert world.health[0] == 0


@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_it_retraces_its_steps(substeps: int) -> None:
    scene = chain()
    method = sy.Method(sy.ComposedRattle(substeps=substeps), sy.Direct(tolerance=1e-15), dt=0.01)
    world = sy.World(scene, method=method)
    start = world.particles.position[0].copy()
    world.step(100)
    world.particles.velocity[:] *= -1.0
    world.step(100)
    # Some 1000 substeps with a tolerance of 1e-15, divided by a length of .001 s, where motions part tenfold in 1 s.
    np.testing.assert_allclose(world.particles.position[0], start, rtol=0, atol=1e-9)


@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_momenta_of_a_free_body_stay(substeps: int) -> None:
    scene = from_particle_scene(tumbling_platform())
    world = sy.World(scene, method=sy.Method(sy.ComposedRattle(substeps=substeps), sy.Direct()))
    linear, angular = world.momentum.copy(), world.angular_momentum.copy()
    world.step(600)
    np.testing.assert_allclose(world.momentum, linear, rtol=0, atol=1e-11)
    np.testing.assert_allclose(world.angular_momentum, angular, rtol=0, atol=1e-10)


@pytest.mark.parametrize("damping", [0.999, 0.5, 1e-6])
@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_damping_alone_is_exact(substeps: int, damping: float) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, -2, 3), damping=damping))
    world = sy.World(scene, worlds=2, method=sy.Method(sy.ComposedRattle(substeps=substeps)))
    world.particles.damping = np.array([[damping], [0.9]])
    world.step(90)
    # 90 steps of 18 products and powers at most, as of RATTLE's own test.
    for found, kept in zip(world.particles.velocity[:, 0], (damping, 0.9), strict=True):
        np.testing.assert_allclose(found, np.array([1, -2, 3]) * kept**1.5, rtol=1620 * 2e-16)


@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_the_clock_goes_by_whole_steps(substeps: int) -> None:
    world = run("chain", substeps, 25)
    assert world.time[0] == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize("substeps", SUBSTEPS)
def test_stability_limit_from_both_sides(substeps: int) -> None:
    h = 1.0 / 60.0
    integrator = sy.ComposedRattle(substeps=substeps)
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(1, 0, 0)))
    spring = scene.add(sy.AnchoredSpring(p, (0, 0, 0), 1.0, 0.0))
    world = sy.World(scene, worlds=2, method=sy.Method(integrator, dt=h))
    world[spring].stiffness = (np.array([0.995, 1.005]) * integrator.stable_limit() / h) ** 2
    world.step(600)
    size = np.abs(world.particles.position[:, 0, 0])
    assert size[0] < 100.0 and size[1] > 1e6
    assert not math.isnan(size[0])


def test_what_cannot_run_backwards_is_refused() -> None:
    method = sy.Method(sy.ComposedRattle(), sy.Direct())
    for build in (
        lambda a, b: sy.Cable(a, b, 1.0),
        lambda a, b: sy.CableConstraint(a, (0, 3, 0), 1.0),
        lambda a, b: sy.Ground(),
        lambda a, b: sy.Drag(linear=1.0),
        lambda a, b: sy.StiffSpring(a, (0, 0, 0), 1.0),
    ):
        scene, a, b = pair()
        thing = scene.add(build(a, b))
        with refused("ComposedRattle", type(thing).__name__, "backwards", "Use ", kind=ValueError):
            sy.World(scene, method=method)


@pytest.mark.parametrize("bad", [0, 1, 2, 4, 7, 5.0, "five"])
def test_compositions_that_do_not_exist(bad: object) -> None:
    with refused("substeps", repr(bad), "5", kind=ValueError):
        sy.ComposedRattle(substeps=bad)  # type: ignore[arg-type]
