"""Planar scenes: the same motion as in space, and refusals of what leaves the plane."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import steelyard as sy

Build = Callable[[bool], sy.Scene]


def _particles(scene: sy.Scene, count: int, **settings: Any) -> list[sy.Particle]:
    """A row of particles, not quite straight, that move in different directions."""
    return [
        scene.add(
            sy.Particle(
                position=(0.9 * k, 0.1 * k * k, 0.0),
                velocity=(0.3 * np.cos(2.0 * k), 0.4 * np.sin(3.0 * k), 0.0),
                mass=1.0 + 0.5 * k,
                **settings,
            )
        )
        for k in range(count)
    ]


def flight(planar: bool) -> sy.Scene:
    scene = sy.Scene(planar=planar)
    _particles(scene, 3, damping=0.7)
    return scene


def forces(planar: bool) -> sy.Scene:
    """Every kind of force."""
    scene = sy.Scene(gravity=(0.4, -9.81, 0.0), planar=planar)
    row = _particles(scene, 5, damping=0.9)
    for a, b in pairwise(row):
        scene.add(sy.Spring(a, b, 40.0, 0.9))
    scene.add(sy.Bungee(row[0], row[4], 15.0, 2.0))
    scene.add(sy.AnchoredSpring(row[0], (0.0, 1.0, 0.0), 60.0, 0.4))
    scene.add(sy.AnchoredBungee(row[4], (4.0, 3.0, 0.0), 30.0, 1.0))
    scene.add(sy.Gravity((1.0, 2.0, 0.0), [row[1]]))
    scene.add(sy.Drag(0.2, 0.3, wind=(1.0, 0.5, 0.0), particles=[row[2], row[3]]))
    scene.add(sy.Buoyancy(row[3], surface=1.0, half_depth=0.5, volume=0.004))
    scene.add(sy.StiffSpring(row[1], (0.9, 0.5, 0.0), stiffness=90.0, damping=2.0))
    return scene


def links(planar: bool) -> sy.Scene:
    """A hanging chain of rods, a cable that snaps, and a load that rides on two of the chain."""
    scene = sy.Scene(planar=planar)
    row = _particles(scene, 5)
    scene.add(sy.RodConstraint(row[0], (-1.0, 0.2, 0.0)))
    for a, b in pairwise(row):
        scene.add(sy.Rod(a, b))
    scene.add(sy.CableConstraint(row[4], (4.0, 3.0, 0.0), max_length=2.0, restitution=0.3))
    place = 0.5 * (np.array(row[2].position) + np.array(row[3].position))
    load = scene.add(sy.Particle(position=place, mass=3.0))
    scene.add(sy.Rider(load, [row[2], row[3]]))
    return scene


def truss(planar: bool) -> sy.Scene:
    """A rigid triangle that hangs from two cables, one with a winch."""
    scene = sy.Scene(planar=planar)
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(0.2, 0.0, 0.0)))
    b = scene.add(sy.Particle(position=(1.0, 0.1, 0.0), velocity=(0.2, 0.1, 0.0)))
    c = scene.add(sy.Particle(position=(0.4, 0.9, 0.0), mass=2.0))
    for pair in ((a, b), (b, c), (c, a)):
        scene.add(sy.Rod(*pair))
    scene.add(sy.CableConstraint(c, (0.0, 2.0, 0.0), max_length=1.2, winch=True))
    scene.add(sy.CableConstraint(b, (2.0, 2.0, 0.0), max_length=2.2))
    return scene


def contacts(planar: bool) -> sy.Scene:
    """A rigid triangle and a ball that fall on ground and on a line, with friction and restitution."""
    scene = sy.Scene(planar=planar)
    row = _particles(scene, 2)
    third = scene.add(sy.Particle(position=(0.4, 0.8, 0.0), velocity=(1.0, -1.0, 0.0)))
    for pair in ((row[0], row[1]), (row[1], third), (third, row[0])):
        scene.add(sy.Rod(*pair))
    ball = scene.add(sy.Particle(position=(3.0, 0.5, 0.0), velocity=(1.5, 0.0, 0.0), radius=0.1))
    scene.add(sy.Ground(height=-0.3, restitution=0.4, friction=0.5))
    scene.add(
        sy.LinePlatform(
            start=(2.0, 0.0, 0.0),
            end=(5.0, 0.5, 0.0),
            radius=0.1,
            restitution=0.3,
            friction=0.2,
            particles=[ball],
        )
    )
    scene.add(sy.Particle(position=(3.3, 0.6, 0.0), velocity=(-0.5, 0.0, 0.0), radius=0.1))
    scene.add(sy.Collisions(particles=scene.particles[-2:], restitution=0.6, friction=0.1))
    return scene


def written(planar: bool) -> sy.Scene:
    """A user-written force and user-written contacts."""
    scene = sy.Scene(planar=planar)
    row = _particles(scene, 3)
    scene.add(sy.UserForce(lambda position, velocity, time: -0.5 * velocity - 2.0 * position))

    def between(a: np.ndarray, b: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart = a - b
        distance = np.linalg.norm(apart, axis=-1)
        return apart / distance[..., None], 0.8 - distance

    scene.add(sy.ContactGenerator(between, [(row[0], row[1]), (row[1], row[2])], restitution=0.5))
    return scene


SCENES: tuple[Build, ...] = (flight, forces, links, truss, contacts, written)


def able() -> list[Any]:
    """Every method on every scene that it can step."""
    found = []
    for build in SCENES:
        for entry in sy.CANDIDATES:
            try:
                entry.at(0.01).refuse(build(True))
            except ValueError:
                continue
            found.append(pytest.param(build, entry, id=f"{build.__name__}, {entry.name}"))
    return found


@pytest.mark.parametrize(("build", "entry"), able())
def test_a_planar_scene_moves_as_in_space(build: Build, entry: Any) -> None:
    runs = []
    for planar in (False, True):
        world = sy.World(build(planar), worlds=11, method=entry.at(0.005))
        shift = 0.01 * np.arange(11)[:, None]
        world.particles.velocity[:, :, 0] += shift
        world.step(60)
        runs.append(world)
    space, plane = runs
    scale = 1.0 + np.abs(space.particles.position).max()
    for name in ("position", "velocity"):
        expected = getattr(space.particles, name)
        assert np.isfinite(expected).all()
        np.testing.assert_allclose(
            getattr(plane.particles, name), expected, rtol=0, atol=1e-12 * scale
        )
        assert not getattr(plane.particles, name)[..., 2].any()
    np.testing.assert_array_equal(plane.health, space.health)
    np.testing.assert_allclose(plane.energy, space.energy, rtol=1e-12, atol=1e-11)


def test_it_is_said_of_a_scene_and_kept_by_its_copies() -> None:
    scene = forces(True)
    assert "planar" in repr(scene)
    assert scene.axes == 2
    assert scene.copy().planar
    assert forces(False).axes == 3
    assert "planar" not in repr(forces(False))
    with pytest.raises(TypeError, match="planar"):
        sy.Scene(planar="xy")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("position", lambda: sy.Particle(position=(0, 0, 1))),
        ("velocity", lambda: sy.Particle(position=(0, 0, 0), velocity=(0, 0, 1))),
        ("acceleration", lambda: sy.Particle(position=(0, 0, 0), acceleration=(0, 0, 1))),
        ("normal", lambda: sy.Ground(normal=(0, 0.6, 0.8))),
        ("end", lambda: sy.LinePlatform(start=(0, 0, 0), end=(0, 1, 1), radius=0.1)),
    ],
)
def test_what_leaves_the_plane_is_refused(name: str, make: Callable[[], Any]) -> None:
    scene = sy.Scene(planar=True)
    with pytest.raises(ValueError, match=rf"{name} along z is .*; it must be 0 in a planar scene"):
        scene.add(make())
    assert not scene.things
    sy.Scene().add(make())


def test_assignments_that_leave_the_plane_are_refused() -> None:
    scene = forces(True)
    world = sy.World(scene, worlds=3, method=sy.Method(sy.Rattle()))
    with pytest.raises(ValueError, match=r"gravity along z is 2.0"):
        world.gravity = (0.0, -9.81, 2.0)
    drag = scene.of(sy.Drag)[0]
    with pytest.raises(ValueError, match=r"Drag: wind along z is -1.0 in world 1"):
        world[drag].wind = [(0, 0, 0), (0, 0, -1), (0, 0, 0)]
    world[drag].wind = (2.0, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"gravity along z"):
        sy.Scene(gravity=(0.0, 0.0, -9.81), planar=True)


def test_written_functions_that_leave_the_plane_are_refused() -> None:
    scene = sy.Scene(planar=True)
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0)))
    b = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    other = scene.copy()
    scene.add(sy.UserForce(lambda position, velocity, time: position + 1.0))
    with pytest.raises(ValueError, match=r"UserForce: force along z is 1.0"):
        sy.World(scene).step()
    normal = np.full((1, 1, 3), 1.0 / np.sqrt(3.0))
    other.add(sy.ContactGenerator(lambda *_: (normal, np.full((1, 1), 0.1)), [(a, b)]))
    with pytest.raises(ValueError, match="ContactGenerator: normal along z"):
        sy.World(other).step()
