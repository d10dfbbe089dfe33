"""Collisions of balls: the law of collision, resolved times, piles, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import steelyard as sy
from tests.engine.builders import METHODS, STEPWISE, method, residual_limit, undivided

G = 9.81


def pair(restitution: float, friction: float = 0.0) -> sy.Scene:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(
        sy.Particle(position=(-0.5, 0.02, 0.0), velocity=(2.0, 0.0, 0.0), mass=1.0, radius=0.15)
    )
    scene.add(
        sy.Particle(position=(0.5, 0.0, 0.0), velocity=(-1.0, 0.3, 0.1), mass=3.0, radius=0.05)
    )
    scene.add(sy.Collisions(restitution=restitution, friction=friction))
    return scene


def collided(name: str, restitution: float, friction: float = 0.0) -> tuple[np.ndarray, sy.World]:
    """The pair just after it has collided, and its normal where the method looks for contacts."""
    world = sy.World(pair(restitution, friction), method=undivided(name, dt=1 / 120))
    before = world.particles.velocity[0].copy()
    for _ in range(120):
        apart = np.subtract(*world.particles.position[0])
        world.step()
        if np.abs(world.particles.velocity[0] - before).max() > 1e-6:
            if name.endswith("WorstFirst"):
                # It looks for contacts after the motion.
                apart = apart + world.method.substep * np.subtract(*before)
            return apart / np.linalg.norm(apart), world
    raise AssertionError("the balls pass through each other")


@pytest.mark.parametrize("name", STEPWISE)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_law_of_collision(name: str, restitution: float) -> None:
    # v' = v - (1 + e) m_r (v_rel . n) n / m.
    normal, world = collided(name, restitution)
    a, b = np.array([2.0, 0.0, 0.0]), np.array([-1.0, 0.3, 0.1])
    impulse = (1.0 + restitution) * 0.75 * ((a - b) @ normal) * normal
    expected = np.array([a - impulse, b + impulse / 3.0])
    np.testing.assert_allclose(world.particles.velocity[0], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_momentum_stays_and_energy_does_not_grow(name: str, friction: float) -> None:
    world = sy.World(pair(0.5, friction), method=method(name, dt=1 / 120))
    momentum, energy = world.momentum.copy(), world.energy.copy()
    world.step(120)
    np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-12)
    assert world.energy[0] < energy[0]


@pytest.mark.parametrize("speed", [1.7, 2.0, 2.3])
@pytest.mark.parametrize("rate", [30, 60, 240])
def test_balls_that_meet_head_on_without_rebound_go_on_together(rate: int, speed: float) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    for x, v, mass in ((0.0, speed, 1.0), (1.27, -1.0, 3.0)):
        scene.add(sy.Particle(position=(x, 0, 0), velocity=(v, 0, 0), mass=mass, radius=0.1))
    scene.add(sy.Collisions(restitution=0.0))
    world = sy.World(scene, method=method("Rattle-Direct", dt=1 / rate))
    for _ in range(rate):
        world.step()
        # They carry no load that is more than rounding: there is nothing that could fail to settle.
        assert world.health[0] == 0
    expected = (speed - 3.0) / 4.0
    # Places are held within 1e-12 m, velocities within that over the step.
    bound = 1e-12 * rate
    np.testing.assert_allclose(world.particles.velocity[0, :, 0], expected, rtol=0, atol=bound)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_the_time_of_a_collision_is_resolved(restitution: float) -> None:
    world = sy.World(pair(restitution), method=method("ImpactRattle-Direct", dt=1 / 60))
    world.step(60)
    x = np.array([[-0.5, 0.02, 0.0], [0.5, 0.0, 0.0]])
    v = np.array([[2.0, 0.0, 0.0], [-1.0, 0.3, 0.1]])
    apart, speed = x[0] - x[1], v[0] - v[1]
    # |apart + t speed| = 0.2
    a, b, c = speed @ speed, apart @ speed, apart @ apart - 0.04
    time = (-b - np.sqrt(b * b - a * c)) / a
    x = x + time * v
    normal = (x[0] - x[1]) / 0.2
    impulse = (1.0 + restitution) * 0.75 * (speed @ normal) * normal
    v = v - np.array([impulse, -impulse / 3.0])
    if restitution > 0.0:
        x = x + (1.0 - time) * v
        np.testing.assert_allclose(world.particles.position[0], x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(world.particles.velocity[0], v, rtol=0, atol=1e-9)
    # Without restitution they stay in touch while they turn about each other.
    assert np.linalg.norm(np.subtract(*world.particles.position[0])) >= 0.2 - 1e-9


def test_a_cradle_passes_the_momentum_on() -> None:
    # Three in a row, touching none: the first stops, the last leaves with its speed.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    for k in range(3):
        scene.add(sy.Particle(position=(k, 0.0, 0.0), velocity=(1.0 - min(k, 1), 0, 0), radius=0.3))
    scene.add(sy.Collisions(restitution=1.0))
    world = sy.World(scene, method=method("ImpactRattle-Direct", dt=1 / 60))
    world.step(120)
    np.testing.assert_allclose(world.particles.velocity[0, :, 0], [0.0, 0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(world.particles.position[0, :, 0], [0.4, 1.4, 3.2], atol=1e-9)


@pytest.mark.parametrize("name", ["Rattle-Direct", "ImpactRattle-Direct", "Rattle-GaussSeidel"])
def test_a_pile_rests_without_entering(name: str) -> None:
    scene = sy.Scene()
    for x, y in ((0.0, 0.2), (0.41, 0.2), (0.205, 0.6)):
        scene.add(sy.Particle(position=(x, y, 0.0), radius=0.2))
    scene.add(sy.Ground(friction=0.6))
    scene.add(sy.Collisions(friction=0.6))
    world = sy.World(scene, method=method(name, dt=1 / 60))
    world.step(240)
    x = world.particles.position[0]
    for a in range(3):
        for b in range(a):
            assert np.linalg.norm(x[a] - x[b]) >= 0.4 - 10.0 * residual_limit(name)
    assert np.abs(world.particles.velocity).max() < 1e-3
    assert world.health[0] == 0


def test_radii_may_differ_between_pairs_and_particles_may_be_left_out() -> None:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, 0, 0), radius=0.2))
    b = scene.add(sy.Particle(position=(1, 0, 0), radius=0.1))
    scene.add(sy.Particle(position=(0.5, 0, 0), radius=0.1))
    scene.add(sy.Collisions(particles=[a, b]))
    world = sy.World(scene, method=method("ImpactRattle-Direct", dt=1 / 60))
    world.step(120)
    np.testing.assert_allclose(
        world.particles.position[0, :, 0], [0.7 + 0.65, 1.0 + 0.65, 0.5], atol=1e-9
    )


def test_an_immovable_ball_is_an_obstacle() -> None:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(sy.Particle(position=(0, 0, 0), inverse_mass=0.0, radius=0.5))
    scene.add(sy.Particle(position=(2, 0, 0), velocity=(-1, 0, 0)))
    scene.add(sy.Collisions(restitution=0.5))
    world = sy.World(scene, method=method("ImpactRattle-Direct", dt=1 / 60))
    world.step(120)
    np.testing.assert_allclose(world.particles.position[0, 1], [0.75, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(world.particles.position[0, 0], 0.0)


def test_what_can_never_meet_is_refused() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 0, 0)))
    b = scene.add(sy.Particle(position=(1, 0, 0)))
    some = scene.add(sy.Collisions())
    with pytest.raises(ValueError, match=r"radius is 0\.0 for the particles"):
        sy.World(scene)
    scene.remove(some)
    scene.add(sy.Collisions(particles=[a]))
    with pytest.raises(ValueError, match="1 particles make 0 pairs"):
        sy.World(scene)
    assert b in scene
