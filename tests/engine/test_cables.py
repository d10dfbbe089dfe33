"""Cables under every solver: slack they do nothing, taut they only pull, and they snap by Newton's law."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import steelyard as sy
from benchmarks.scenes import bridge
from tests.engine.builders import (
    METHODS,
    STAGED,
    from_particle_scene,
    method,
    residual_limit,
    swung,
)


@pytest.mark.parametrize("name", METHODS)
def test_a_slack_cable_does_nothing(name: str) -> None:
    bare, held = sy.Scene(), sy.Scene()
    for scene in (bare, held):
        p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 2.0, 0.0), damping=0.9))
        if scene is held:
            scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 5.0, restitution=0.5))
    free, slack = (swung(scene, name, dt=0.01, seconds=0.5) for scene in (bare, held))
    # Only the rounding of v + 0 / dt may differ.
    np.testing.assert_allclose(slack.particles.position, free.particles.position, rtol=1e-14)
    np.testing.assert_allclose(slack.particles.velocity, free.particles.velocity, rtol=1e-14)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_a_cable_that_snaps_taut_rebounds_with_its_restitution(
    name: str, restitution: float
) -> None:
    # Newton's law of impact along the cable, the motion across it kept. The cable turns by 1.5 mrad in
    # the step, so the direction is checked as the cable lies when it snaps.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(0.95, 0.0, 0.0), velocity=(2.0, 0.0, 0.0), mass=3.0))
    scene.add(sy.Cable(a, b, 1.0, restitution=restitution))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(6)
    velocity = world.particles.velocity[0, :, 0]
    # v' = v + (1 + e) m_r v_rel / m; m_r = 3/4 kg, v_rel = 3 m/s.
    impulse = (1.0 + restitution) * 0.75 * 3.0
    np.testing.assert_allclose(velocity, [-1.0 + impulse, 2.0 - impulse / 3.0], atol=1e-11)
    np.testing.assert_allclose(world.momentum, [[5.0, 0.0, 0.0]], atol=1e-12)
    assert np.linalg.norm(np.diff(world.particles.position[0], axis=0)) <= 1.0 + 1e-11


@pytest.mark.parametrize("name", STAGED)
def test_a_falling_weight_is_caught_by_its_cable_and_hangs(name: str) -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), mass=2.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 0.5))
    world = sy.World(scene, method=method(name, dt=0.01))
    for _ in range(100):
        world.step()
        assert world.residual[0, 0] <= 1e-12
    np.testing.assert_allclose(world.particles.position[0, 0], [0.0, -0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(world.particles.velocity[0, 0], 0.0, atol=1e-12)
    # The whole step's pull in symplectic Euler's one stage, half of it in RATTLE's first.
    share = 2.0 if isinstance(world.method.integrator, sy.Rattle | sy.ImpactRattle) else 1.0
    tension = share * world[cable].multiplier[0] * 0.5 / 0.01**2
    # 1e-12 of the length is 2 m 1e-12 L / dt^2 = 2e-8 N.
    assert tension == pytest.approx(2.0 * 9.81, abs=1e-7)


@pytest.mark.parametrize("name", STAGED)
def test_cables_only_pull(name: str) -> None:
    # A bridge thrown about in every world in its own way: cables slacken and snap all the time.
    scene = from_particle_scene(bridge(), cable_restitution=0.3)
    cables = scene.of(sy.Cable, sy.CableConstraint)
    world = sy.World(scene, worlds=11, method=method(name, dt=0.01))
    rng = np.random.default_rng(0)
    world.particles.velocity[:] = 2.0 * rng.standard_normal(world.particles.velocity.shape)
    slack = taut = 0
    for _ in range(150):
        world.step()
        tension = np.stack([world[cable].multiplier for cable in cables], axis=1)
        assert tension.min() >= 0.0
        assert np.abs(world.residual).max() <= residual_limit(name)
        slack += (tension == 0.0).sum()
        taut += (tension > 0.0).sum()
    assert min(slack, taut) > 5000
    np.testing.assert_array_equal(world.health, 0)


def test_letting_one_cable_go_takes_up_another() -> None:
    # Turned back by its left cable with full restitution, the weight runs into the right one within
    # a step or two, at which the left one still carries the last step's tension.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(2.5, 0.3, 0.0)))
    for x in (-1.0, 1.0):
        scene.add(sy.CableConstraint(p, (x, 0.0, 0.0), 1.01, restitution=1.0))
    world = sy.World(scene, method=method("Rattle-Direct", dt=0.01))
    for _ in range(200):
        world.step()
        assert world.residual.max() <= 1e-12
    assert world.health[0] == 0


@pytest.mark.parametrize("name", STAGED)
def test_a_winch_hoists_at_its_rate(name: str) -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, -2.0, 0.0), mass=3.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 2.0, winch=True))
    world = sy.World(scene, worlds=2, method=method(name, dt=0.01))
    world[cable].rate = [-0.5, 0.25]
    world.step(100)
    np.testing.assert_allclose(world[cable].length, [1.5, 2.25], rtol=1e-13)
    expected = [[[0.0, -1.5, 0.0]], [[0.0, -2.25, 0.0]]]
    np.testing.assert_allclose(world.particles.position, expected, rtol=0, atol=5e-12)
    speed = [[[0.0, 0.5, 0.0]], [[0.0, -0.25, 0.0]]]
    np.testing.assert_allclose(world.particles.velocity, speed, rtol=0, atol=1e-9)


def test_random_masses_leave_every_pair_of_a_net_within_reach() -> None:
    # All pairs of five particles joined by cables a little longer than their distance: many ways to be
    # taut at once, and redundant when all are.
    rng = np.random.default_rng(3)
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    net = [scene.add(sy.Particle(position=x)) for x in rng.uniform(-0.5, 0.5, (5, 3))]
    for a, b in combinations(net, 2):
        reach = 1.02 * float(np.linalg.norm(np.subtract(a.position, b.position)))
        scene.add(sy.Cable(a, b, reach))
    world = sy.World(scene, worlds=16, method=method("Rattle-Direct", dt=0.01))
    world.particles.mass = rng.uniform(0.3, 3.0, (16, 5))
    world.particles.velocity[:] = rng.standard_normal((16, 5, 3))
    momentum = world.momentum.copy()
    for _ in range(100):
        world.step()
        assert world.residual.max() <= 1e-12
    np.testing.assert_array_equal(world.health, 0)
    np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-11)
