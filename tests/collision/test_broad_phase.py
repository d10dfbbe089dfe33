"""Pairs that a tree finds against all that there are: the same worlds to the bit, whatever a scene holds."""

import dataclasses
import itertools

import numpy as np
import pytest

import steelyard as sy
from steelyard.collision.broad_phase import MANY

SWEEPS = sy.GaussSeidel(10, contacts=300)
TURN = (np.cos(0.3), 0.0, np.sin(0.3), 0.0)


def heap(count=24, seed=0, spread=2.0, scene=None):
    """Boxes, balls and capsules strewn over a ground."""
    rng = np.random.default_rng(seed)
    scene = scene or sy.Scene()
    for i in range(count):
        half = rng.uniform(0.2, 0.4, 3)
        shapes = sy.Box(tuple(half)), sy.Sphere(half[0]), sy.Capsule(half[0], half[1])
        place = (*rng.uniform(-spread, spread, 2), rng.uniform(-spread, spread))
        scene.add(
            sy.Body(
                position=(place[0], 1.0 + 0.4 * i, place[2]), orientation=tuple(rng.normal(size=4)),
                velocity=tuple(rng.normal(size=3)), angular_velocity=tuple(rng.normal(size=3)), parts=shapes[i % 3],
            )
        )  # fmt: skip
    scene.add(sy.Ground(friction=0.5))
    scene.add(sy.Collisions(friction=0.5))
    return scene


def with_particles():
    """Particles with and without a radius among bodies."""
    scene = heap(10)
    for i in range(4):
        scene.add(sy.Particle(position=(0.3 * i, 9.0, 0.1), radius=0.1 * i, mass=5.0))
    return scene


def with_joints():
    """A chain of bodies that do not touch each other where they are joined."""
    scene = heap(8)
    links = [
        scene.add(sy.Body(position=(3.0 + i, 6.0, 0), parts=sy.Box((0.6, 0.1, 0.1))))
        for i in range(5)
    ]
    for i, (a, b) in enumerate(itertools.pairwise(links)):
        scene.add(sy.BallJoint(a=a, b=b, place=(3.5 + i, 6.0, 0)))
    return scene


def with_compounds():
    """Bodies of several parts, and scenery that is a body and comes first."""
    scene = sy.Scene()
    floor = sy.Box((1.0, 0.5, 1.0))
    scene.add(sy.Body(position=(0, 0.5, 0), inverse_mass=0.0, parts=floor))
    heap(8, scene=scene)
    for i in range(4):
        parts = [
            sy.Part(shape=sy.Box((0.5, 0.1, 0.1)), offset=(0.0, 0.2 * k, 0.0)) for k in range(3)
        ]
        scene.add(sy.Body(position=(0.2 * i, 6.0 + i, 0.3), orientation=TURN, parts=parts))
    return scene


def with_groups():
    """Things that meet only their own kind, and a wall for some."""
    scene = sy.Scene()
    groups: list[list[sy.Body]] = [[], []]
    for i in range(16):
        body = sy.Body(position=(0.1 * i, 0.6 + 0.7 * i, 0.05 * i), parts=sy.Sphere(0.4))
        groups[i % 2].append(scene.add(body))
    scene.add(sy.Ground(friction=0.3))
    scene.add(sy.Ground(normal=(-1, 0, 0), height=-1.5, particles=groups[0]))
    for group in groups:
        scene.add(sy.Collisions(friction=0.4, particles=group))
    return scene


def worlds_of(scene, worlds=1, *, solver=SWEEPS, dt=0.01):
    """One that tries all pairs and one that has a tree."""
    return [
        sy.World(
            scene,
            worlds=worlds,
            method=sy.Method(
                sy.Rattle(), dataclasses.replace(solver, broad_phase=broad_phase), dt=dt
            ),
        )
        for broad_phase in ("pairs", "tree")
    ]


def assert_same(one, other):
    """Motions and contacts, to the bit."""
    np.testing.assert_array_equal(one.bodies.position, other.bodies.position)
    np.testing.assert_array_equal(one.bodies.orientation, other.bodies.orientation)
    np.testing.assert_array_equal(one.contacts.first, other.contacts.first)
    np.testing.assert_array_equal(one.contacts.second, other.contacts.second)
    np.testing.assert_array_equal(one.contacts.force, other.contacts.force)


@pytest.mark.parametrize(
    "solver", [SWEEPS, sy.ProximalNewton(contacts=300)], ids=["swept", "newton"]
)
@pytest.mark.parametrize("build", [heap, with_particles, with_joints, with_compounds, with_groups])
def test_a_tree_changes_nothing(build, solver):
    pairs, tree = worlds_of(build(), solver=solver)
    touched = 0
    for _ in range(40):
        pairs.step(5)
        tree.step(5)
        assert_same(pairs, tree)
        touched = max(touched, int(tree.contacts.count[0]))
    assert touched > 8
    assert tree.health[0] == 0


def test_worlds_of_other_blocks_leave_a_tree_that_is_right():
    """One thread has memory for eight worlds, and steps three times as many in turn."""
    pairs, tree = worlds_of(heap(12), worlds=20)
    start = np.random.default_rng(1).normal(size=(20, 12, 3))
    for world in (pairs, tree):
        world.bodies.velocity[:] = start
    for _ in range(30):
        pairs.step(3)
        tree.step(3)
        assert_same(pairs, tree)


def test_what_is_put_elsewhere_is_found_there():
    pairs, tree = worlds_of(heap(24))
    rng = np.random.default_rng(3)
    for _ in range(20):
        for world in (pairs, tree):
            world.step(4)
        moved = np.array((0.0, 4.0, 0.0)) + rng.uniform(-2, 2, (24, 3))
        chosen = rng.random(24) < rng.random()
        for world in (pairs, tree):
            world.bodies.position[0, chosen] = moved[chosen]
        before = tree.snapshot()
        pairs.step(4)
        tree.step(9)
        tree.restore(before)
        tree.step(4)
        assert_same(pairs, tree)


def test_what_comes_to_rest_sleeps_and_wakes_with_a_tree():
    scene = sy.Scene()
    for i in range(6):
        scene.add(sy.Body(position=(1.5 * i, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Body(position=(0, 20.0, 0), parts=sy.Sphere(0.5)))
    scene.add(sy.Ground(friction=0.5))
    scene.add(sy.Collisions(friction=0.5))
    pairs, tree = worlds_of(scene, dt=1 / 60)
    for _ in range(60):
        pairs.step(5)
        tree.step(5)
        np.testing.assert_array_equal(pairs.bodies.asleep, tree.bodies.asleep)
        np.testing.assert_allclose(pairs.bodies.position, tree.bodies.position, atol=1e-9)
        if tree.time[0] == pytest.approx(1.5):
            assert tree.bodies.asleep[0, :6].all()
    # The ball has fallen on the first one, and lies beside it or on it.
    assert abs(tree.bodies.position[0, -1, 1]) < 3.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_what_is_nowhere_harms_no_other(bad):
    scene = heap(12)
    pairs, tree = worlds_of(scene, worlds=2)
    for world in (pairs, tree):
        world.step(5)
        world.bodies.position[0, 3, 1] = bad
        world.step(10)
    np.testing.assert_array_equal(pairs.bodies.position[1], tree.bodies.position[1])
    assert tree.health[1] == 0
    assert tree.health[0] != 0 or not np.isfinite(bad) or bad == 1e300


def test_many_bodies_take_memory_as_their_number():
    words = []
    for count in (200, 400):
        scene = heap(count, spread=8.0)
        world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.GaussSeidel(10)))
        words.append(len(world.model.tape))
        world.step(20)
        assert world.health[0] == 0
    assert words[1] < 2.1 * words[0]


def test_penetration_is_that_of_all_pairs():
    few, many = heap(MANY // 2, spread=0.6), heap(2 * MANY, spread=0.6)
    for scene in (few, many):
        world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.GaussSeidel(10)))
        deepest = 0.0
        for body in scene.bodies:
            hits = world.queries.overlap(
                body.parts[0].shape, body.position, orientation=body.orientation, ignore=(body,)
            )
            deepest = max(deepest, -float(hits.gap[0, hits.hit[0]].min(initial=0.0)))
        assert world.penetration[0] == pytest.approx(deepest, abs=1e-12)
        assert deepest > 0.01


def test_the_last_that_names_both_says_how_they_meet():
    """A block on another that holds it by friction, or not."""
    for later, held in ((0.0, False), (1.0, True)):
        scene = sy.Scene(gravity=(3.0, -9.81, 0.0))
        parts = sy.Box((5.0, 0.5, 0.5))
        floor = scene.add(sy.Body(position=(0, -0.5, 0), inverse_mass=0.0, parts=parts))
        block = scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
        scene.add(sy.Collisions(friction=1.0 - later))
        scene.add(sy.Collisions(friction=later, particles=[floor, block]))
        for world in worlds_of(scene):
            world.step(50)
            assert world.contacts.count[0] == 4
            assert (abs(world.bodies.velocity[0, 1, 0]) < 1e-6) == held


def test_a_wrong_broad_phase_is_refused():
    for solver in (sy.ProximalNewton, sy.GaussSeidel, sy.WorstFirst, sy.SoftStep):
        with pytest.raises(ValueError, match=f"{solver.__name__}: broad_phase is 'grid'"):
            solver(broad_phase="grid")
