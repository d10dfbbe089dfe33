"""Rigid clusters: found where rods make particles one frame, and moved as their rods would move them."""

from itertools import combinations

import numpy as np
import pytest

import steelyard as sy
from steelyard.model.clusters import find_clusters, widest_triangle

DT = 0.01


def tight(solver: str) -> sy.Method:
    solvers = {"Direct": sy.Direct(), "GaussSeidel": sy.GaussSeidel(passes=2000)}
    return sy.Method(sy.Rattle(), solvers[solver], dt=DT)


def frame(count: int = 5, *, seed: int = 0) -> tuple[sy.Scene, list[sy.Particle]]:
    rng = np.random.default_rng(seed)
    scene = sy.Scene()
    particles = [
        scene.add(sy.Particle(position=rng.uniform(-1.0, 1.0, 3), mass=rng.uniform(0.5, 2.0)))
        for _ in range(count)
    ]
    for a, b in combinations(particles, 2):
        scene.add(sy.Rod(a, b))
    return scene, particles


def loaded_frame() -> sy.Scene:
    """A frame with two riders, a pendulum, a cable to a point and a spring."""
    scene, particles = frame()
    for first, weights in ((0, (0.5, 0.25, 0.25)), (2, (0.2, 0.2, 0.6))):
        deck = particles[first : first + 3]
        place = np.einsum("k,kc->c", weights, [p.position for p in deck])
        load = scene.add(sy.Particle(position=place, mass=1.5))
        scene.add(sy.Rider(load, deck, weights))
    bob = scene.add(sy.Particle(position=(2.0, 0.0, 0.0)))
    scene.add(sy.Rod(particles[0], bob))
    scene.add(sy.CableConstraint(particles[1], anchor=(0.0, 4.0, 0.0), max_length=4.1))
    scene.add(sy.Spring(particles[3], bob, stiffness=20.0, rest_length=1.0))
    return scene


def test_what_is_rigid_is_found() -> None:
    pairs = list(combinations(range(4), 2))
    assert find_clusters(pairs) == [[0, 1, 2, 3]]
    assert find_clusters(pairs[1:]) == []  # five of six rods leave a hinge
    assert find_clusters([(0, 1), (1, 2), (0, 2)]) == []  # a triangle saves too little
    assert find_clusters([*pairs, (4, 0), (4, 1), (4, 2), (5, 0)]) == [[0, 1, 2, 3, 4]]
    two = [*pairs, *((a + 4, b + 4) for a, b in pairs), (0, 4)]
    assert find_clusters(two) == [[0, 1, 2, 3], [4, 5, 6, 7]]


def test_no_frame_hangs_on_points_of_a_line() -> None:
    assert widest_triangle(np.array([[0.0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]])) is None
    assert widest_triangle(np.array([[0.0, 0, 0], [1, 0, 0], [0, 3, 0], [0, 1, 0]])) == (0, 1, 2)


def test_a_cluster_moves_as_its_rods_and_riders_do() -> None:
    """The swept solver has a row for each rod and rider; both must find the one solution."""
    paths = {}
    for solver in ("Direct", "GaussSeidel"):
        world = sy.World(loaded_frame(), worlds=3, method=tight(solver))
        rng = np.random.default_rng(1)
        world.particles.velocity[:] = rng.uniform(-1.0, 1.0, world.particles.velocity.shape)
        path = []
        for _ in range(20):
            for rider in world.scene.of(sy.Rider):
                gain = rng.uniform(-3.0, 3.0, (3, 3))
                world[rider].accelerations = gain - gain.mean(axis=1, keepdims=True)
            world.step()
            path.append(np.stack([world.particles.position, world.particles.velocity]))
        assert np.abs(world.residual).max() < 1e-11
        paths[solver] = np.array(path)
    assert "no row" in repr(sy.World(loaded_frame(), method=tight("Direct")))
    np.testing.assert_allclose(paths["Direct"], paths["GaussSeidel"], rtol=0, atol=1e-8)


def test_a_rider_stays_at_its_place_on_the_frame() -> None:
    world = sy.World(loaded_frame(), method=tight("Direct"))
    rider = world.scene.of(sy.Rider)[0]
    world[rider].rates = (0.3, -0.1, -0.2)
    world.step(100)
    deck = [world.scene.particles.index(p) for p in rider.deck]
    load = world.scene.particles.index(rider.particle)
    place = np.einsum("k,kc->c", world[rider].weights[0], world.particles.position[0, deck])
    np.testing.assert_allclose(world.particles.position[0, load], place, rtol=0, atol=1e-14)


def test_lengths_can_be_given_per_world() -> None:
    scene, particles = frame(4)
    world = sy.World(scene, worlds=3, method=tight("Direct"))
    rods = world.scene.of(sy.Rod)
    scale = np.array([1.0, 1.1, 0.9])
    for rod in rods:
        world[rod].length = scale * rod.length
    world.step()
    np.testing.assert_allclose(world.residual, 0.0, atol=1e-14)
    apart = world.particles.position[:, 0] - world.particles.position[:, 1]
    start = np.linalg.norm(np.subtract(particles[0].position, particles[1].position))
    np.testing.assert_allclose(np.linalg.norm(apart, axis=1), scale * start, rtol=1e-13)


def test_lengths_that_no_frame_has_are_refused() -> None:
    scene, _ = frame(4)
    world = sy.World(scene, method=tight("Direct"))
    world[world.scene.of(sy.Rod)[0]].length = 50.0
    with pytest.raises(ValueError, match="cannot all have their lengths"):
        world.step()


def test_more_than_half_a_turn_in_a_step_is_flagged() -> None:
    scene, _ = frame(4)
    world = sy.World(scene, worlds=2, method=tight("Direct"))
    arm = world.particles.position[1]
    world.particles.velocity[1] = np.cross((0.0, 0.0, 2000.0), arm)
    world.step()
    assert world.health[0] == 0
    assert world.health[1] != 0
    assert np.isfinite(world.particles.position).all()
