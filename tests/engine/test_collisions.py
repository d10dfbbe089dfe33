"""Contacts between particles, as a generator written by the user reports them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import steelyard as sy
from tests.engine.builders import STAGED, STEPWISE, Array, method, undivided

G = 9.81


def spheres(a: Array, b: Array, _: Array, reach: float = 0.2) -> tuple[Array, Array]:
    """Contacts of pairs of spheres whose radii add up to ``reach`` [m]; negative while apart."""
    apart = a - b
    distance = np.linalg.norm(apart, axis=-1)
    return apart / distance[..., None], reach - distance


def collision(name: str, restitution: float, friction: float = 0.0) -> tuple[Array, sy.World]:
    """Two unequal spheres just after their collision, and the normal (3,) at the start of its step."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(-0.5, 0.02, 0.0), velocity=(2.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(0.5, 0.0, 0.0), velocity=(-1.0, 0.3, 0.1), mass=3.0))
    scene.add(sy.ContactGenerator(spheres, [(a, b)], restitution=restitution, friction=friction))
    world = sy.World(scene, method=undivided(name, dt=1 / 120))
    before = world.particles.velocity[0].copy()
    for _ in range(120):
        apart = np.subtract(*world.particles.position[0])
        world.step()
        if np.abs(world.particles.velocity[0] - before).max() > 1e-6:
            break
    else:
        raise AssertionError("the spheres pass through each other")
    return apart / np.linalg.norm(apart), world


@pytest.mark.parametrize("name", STEPWISE)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_collision_law(name: str, restitution: float) -> None:
    # v' = v - (1 + e) m_r (v_rel . n) n / m, along the normal at the step's start.
    normal, world = collision(name, restitution)
    a, b = np.array([2.0, 0.0, 0.0]), np.array([-1.0, 0.3, 0.1])
    impulse = (1.0 + restitution) * 0.75 * ((a - b) @ normal) * normal
    expected = np.array([a - impulse, b + impulse / 3.0])
    np.testing.assert_allclose(world.particles.velocity[0], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", STEPWISE)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_colliding_particles_push_each_other(name: str, friction: float) -> None:
    _, world = collision(name, 0.5, friction)
    np.testing.assert_allclose(world.momentum, [[-1.0, 0.9, 0.3]], rtol=0, atol=1e-12)
    before = 0.5 * (4.0 + 3.0 * 1.1)
    assert world.energy[0] < before


@pytest.mark.parametrize("name", STEPWISE)
def test_collision_friction_stays_within_its_cone(name: str) -> None:
    change = []
    for friction in (0.0, 0.05):
        normal, world = collision(name, 0.5, friction)
        gained = world.particles.velocity[0, 0] - [2.0, 0.0, 0.0]
        along = gained @ normal
        across = np.linalg.norm(gained - along * normal)
        change.append((along, across))
    assert change[0][1] == pytest.approx(0.0, abs=1e-9)
    # The spheres still slip afterwards, so friction is mu times the normal impulse.
    assert change[1][1] == pytest.approx(0.05 * abs(change[1][0]), rel=1e-6)


@pytest.mark.parametrize("name", STEPWISE)
def test_spheres_pile_up_without_entering(name: str) -> None:
    scene = sy.Scene()
    pile = [
        scene.add(sy.Particle(position=(0.0, 0.1 + 0.25 * k, 0.0), radius=0.1)) for k in range(4)
    ]
    scene.add(sy.ContactGenerator(spheres, list(combinations(pile[::-1], 2))))
    scene.add(sy.Ground(friction=0.5))
    dt = 1 / 240
    world = sy.World(scene, method=method(name, dt=dt))
    world.step(480)
    # A written contact is only seen once it is entered: by a step's fall, g dt^2, and by what those above
    # push it down meanwhile, which the resolver's one way of pushing back makes worse.
    entered = (4.0 if name in STAGED else 16.0) * G * dt**2
    heights = world.particles.position[0, :, 1]
    assert (np.diff(heights) >= 0.2 - entered).all()
    np.testing.assert_allclose(heights, [0.1, 0.3, 0.5, 0.7], rtol=0, atol=4.0 * entered)
