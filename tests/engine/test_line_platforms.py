"""Line platforms: particles with a radius rest on them and slide off their round ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

import steelyard as sy
from tests.engine.builders import METHODS, method

G = 9.81


@pytest.mark.parametrize("name", METHODS)
def test_a_particle_rests_on_a_line_platform(name: str) -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0.2, 0.5, 0.0), radius=0.1))
    start, end = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    scene.add(sy.LinePlatform(start=start, end=end, radius=0.05, friction=0.3))
    dt = 1 / 120
    world = sy.World(scene, method=method(name, dt=dt))
    world.step(240)
    slack = 2.0 * G * dt**2 if name.startswith("Explicit") else 1e-12
    np.testing.assert_allclose(world.particles.position[0, 0], [0.2, 0.15, 0.0], rtol=0, atol=slack)


@pytest.mark.parametrize("name", METHODS)
def test_a_particle_slides_off_the_round_end(name: str) -> None:
    # Without friction a point on a round of radius R leaves it at cos a = 2/3 + v0^2 / (3 g R), and keeps
    # its level speed from there.
    radius, speed = 1.0, 1.0
    cosine = 2.0 / 3.0 + speed**2 / (3.0 * G * radius)
    level = math.sqrt(speed**2 + 2.0 * G * radius * (1.0 - cosine)) * cosine
    scene = sy.Scene()
    scene.add(sy.Particle(position=(-0.1, 1.0, 0.0), velocity=(speed, 0.0, 0.0), radius=0.4))
    scene.add(sy.LinePlatform(start=(-2.0, 0.0, 0.0), end=(0.0, 0.0, 0.0), radius=0.6))
    dt = 1 / 1600
    world = sy.World(scene, method=method(name, dt=dt))
    nearest = math.inf
    for _ in range(240):
        world.step(10)
        x = world.particles.position[0, 0]
        nearest = min(nearest, np.linalg.norm(x - [min(x[0], 0.0), 0.0, 0.0]))
    # First order at best: the normal is that of the step's start.
    assert world.particles.velocity[0, 0, 0] == pytest.approx(level, abs=5.0 * speed * dt)
    # From the tangent plane of the step's start the round falls away: nothing can be nearer.
    assert nearest > radius - 1e-9
    assert world.particles.position[0, 0, 1] < -1.0


@pytest.mark.parametrize("name", METHODS)
def test_platforms_and_ground_touch_only_the_particles_named(name: str) -> None:
    scene = sy.Scene()
    a, b, c = (scene.add(sy.Particle(position=(x, 0.5, 0.0), radius=0.1)) for x in (-1.0, 0.0, 1.0))
    ends = {"start": (-2.0, 0.0, 0.0), "end": (2.0, 0.0, 0.0)}
    scene.add(sy.LinePlatform(**ends, particles=[a]))
    scene.add(sy.Ground(height=-0.4, particles=[b]))
    world = sy.World(scene, method=method(name, dt=1 / 120))
    world.step(120)
    falls = world.particles.position[0, [scene.particles.index(p) for p in (a, b, c)], 1]
    np.testing.assert_allclose(falls[:2], [0.1, -0.3], rtol=0, atol=2.0 * G / 120**2)
    assert falls[2] < -4.0
