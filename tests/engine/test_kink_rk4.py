"""Kinks of bungees and floats resolved inside the step: order 4 across them, one at a time and several."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from benchmarks.laboratory.problems import bungee


def fall(scene: sy.Scene, integrator: Any, steps: int, *, duration: float) -> np.ndarray:
    """Places at the end of a run of so many steps."""
    world = sy.World(scene, method=sy.Method(integrator, dt=duration / steps))
    world.step(steps)
    assert world.health[0] == 0
    return world.particles.position[0].copy()


def plunge() -> sy.Scene:
    """A float that falls into water, is wholly under for a while and leaps out: four kinks."""
    scene = sy.Scene()
    body = scene.add(sy.Particle(position=(0.0, 2.5, 0.0), velocity=(1.0, 0.0, 0.0), mass=2.0))
    scene.add(sy.Buoyancy(body, surface=1.0, half_depth=0.4, volume=0.006))
    return scene


def pair() -> sy.Scene:
    """Two particles whose bungee goes taut and slack as they spin about one another."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.3, 0.0, 0.0), velocity=(0.5, 1.0, 0.2), mass=1.0))
    b = scene.add(sy.Particle(position=(-0.3, 0.0, 0.1), velocity=(-0.5, -0.8, 0.0), mass=2.0))
    scene.add(sy.Bungee(a, b, 30.0, 0.8))
    return scene


@pytest.mark.parametrize("scene", [bungee.drop, plunge, pair], ids=lambda f: f.__name__)
def test_order_four_across_kinks(scene: Callable[[], sy.Scene]) -> None:
    duration = 4.0
    rungs = (120, 240, 480, 960)
    true = fall(scene(), sy.KinkRungeKutta4(), 16_000, duration=duration)

    def errors(integrator: Any) -> list[float]:
        runs = [fall(scene(), integrator, steps, duration=duration) for steps in rungs]
        return [float(np.linalg.norm(run - true)) for run in runs]

    resolved, plain = errors(sy.KinkRungeKutta4()), errors(sy.RungeKutta4())
    # How a kink lies in its part of the step makes some rungs better than others.
    assert resolved == sorted(resolved, reverse=True)
    assert math.log2(resolved[0] / resolved[-1]) / 3.0 > 3.3
    assert all(p > 30.0 * r for p, r in zip(plain[1:], resolved[1:], strict=True))


def test_a_bungee_drop_at_30_hz_is_the_closed_form() -> None:
    world = sy.World(bungee.drop(), method=sy.Method(sy.KinkRungeKutta4(), dt=1 / 30))
    world.step(300)
    true = bungee.reference(np.array([10.0]))
    assert np.linalg.norm(world.particles.position[0] - true.position[0]) < 1e-5


def test_where_nothing_is_crossed_it_is_rk4_to_the_bit() -> None:
    places = []
    for integrator in (sy.RungeKutta4(), sy.KinkRungeKutta4()):
        scene = sy.Scene()
        body = scene.add(sy.Particle(position=(0.0, 1.0, 0.0), mass=2.0, damping=0.8))
        scene.add(sy.Buoyancy(body, surface=1.0, half_depth=0.6, volume=0.004))
        scene.add(sy.AnchoredBungee(body, (0.0, 2.0, 0.0), 5.0, 0.2))
        scene.add(sy.Drag(linear=0.1, quadratic=0.2, wind=(1.0, 0.0, 0.0)))
        places.append(fall(scene, integrator, 30, duration=0.5))
    np.testing.assert_array_equal(*places)


def test_worlds_of_a_block_cross_at_times_of_their_own() -> None:
    scene = bungee.drop()
    world = sy.World(scene, worlds=11, method=sy.Method(sy.KinkRungeKutta4(), dt=1 / 30))
    heights = -np.linspace(1.0, 9.0, 11)
    world.particles.position[:, 0, 1] = heights
    world.step(60)
    for height, found in zip(heights, world.particles.position[:, 0], strict=True):
        alone = sy.World(scene, method=sy.Method(sy.KinkRungeKutta4(), dt=1 / 30))
        alone.particles.position[0, 0, 1] = height
        alone.step(60)
        np.testing.assert_array_equal(found, alone.particles.position[0, 0])


def test_more_kinks_than_are_resolved_are_stepped_across() -> None:
    """Eleven bungees that turn within one step: the more are resolved, the smaller the error."""

    def cluster() -> sy.Scene:
        scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
        ball = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(3.0, 0.0, 0.0)))
        for k in range(11):
            scene.add(sy.AnchoredBungee(ball, (-1.0, 0.0, 0.0), 50.0, 1.003 + 0.001 * k))
        return scene

    true = fall(cluster(), sy.KinkRungeKutta4(), 2_000, duration=0.02)
    errors = [
        float(np.linalg.norm(fall(cluster(), sy.KinkRungeKutta4(kinks=k), 2, duration=0.02) - true))
        for k in (1, 4, 8, 11)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 1e-5 and errors[-1] < 1e-6


@pytest.mark.parametrize("kinks", [0, -1, 1.5, math.nan])
def test_a_senseless_number_of_kinks_is_refused(kinks: float) -> None:
    with pytest.raises(ValueError, match=r"KinkRungeKutta4: kinks is .*Use 4"):
        sy.KinkRungeKutta4(kinks=kinks)  # type: ignore[arg-type]
