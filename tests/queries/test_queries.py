"""Queries against oracles that share nothing with them: dense sampling of signed distances, and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from steelyard.queries import ask
from steelyard.scene.shapes import rotation_matrix

SHAPES = {
    "sphere": sy.Sphere(0.3),
    "box": sy.Box((0.25, 0.4, 0.15)),
    "capsule": sy.Capsule(0.2, 0.35),
}


def yard(count: int, seed: int, *, size: float = 5.0, ground: bool = True) -> sy.Scene:
    """Bodies of all shapes strewn about above the ground."""
    rng = np.random.default_rng(seed)
    scene = sy.Scene()
    for i in range(count):
        shape: Any = (
            sy.Sphere(rng.uniform(0.2, 0.7)),
            sy.Box(tuple(rng.uniform(0.2, 0.7, 3))),
            sy.Capsule(rng.uniform(0.1, 0.3), rng.uniform(0.2, 0.7)),
        )[i % 3]
        place = rng.uniform(-size, size, 3) + np.array((0, size + 1, 0))
        scene.add(
            sy.Body(position=tuple(place), orientation=tuple(rng.normal(size=4)), parts=shape)
        )
    if ground:
        scene.add(sy.Ground())
    return scene


def world_of(scene: sy.Scene, worlds: int = 1) -> sy.World:
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), sy.ProximalNewton()))


def sample(shape: Any, spacing: float) -> np.ndarray:
    """Points all over a shape's surface, in its axes, at least this dense."""
    if isinstance(shape, sy.Box):
        points = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            grid = [
                np.linspace(
                    -shape.half_size[a],
                    shape.half_size[a],
                    2 + int(2 * shape.half_size[a] / spacing),
                )
                for a in (i, j)
            ]
            u, v = (g.ravel() for g in np.meshgrid(*grid))
            for sign in (-1, 1):
                face = np.empty((len(u), 3))
                face[:, i], face[:, j], face[:, k] = u, v, sign * shape.half_size[k]
                points.append(face)
        return np.concatenate(points)
    half = shape.half_length if isinstance(shape, sy.Capsule) else 0.0
    n = int(4 * math.pi * (shape.radius / spacing) ** 2) + 20
    k = np.arange(n) + 0.5
    y, turn = 1 - 2 * k / n, math.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - y**2)
    ball = shape.radius * np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)
    if half == 0.0:
        return ball
    rings = np.linspace(-half, half, 2 + int(2 * half / spacing))
    around = np.linspace(0, 2 * math.pi, 2 + int(2 * math.pi * shape.radius / spacing))
    a, h = (g.ravel() for g in np.meshgrid(around, rings))
    side = np.stack([shape.radius * np.cos(a), h, shape.radius * np.sin(a)], axis=1)
    ends = ball + np.where(ball[:, 1:2] >= 0, 1.0, -1.0) * (0, half, 0)
    return np.concatenate([side, ends])


def depth_in(shape: Any, points: np.ndarray) -> np.ndarray:
    """How far points in a shape's axes lie outside of it [m]; 0 or less inside."""
    if isinstance(shape, sy.Box):
        outside = np.abs(points) - shape.half_size
        return np.where(
            (outside > 0).any(-1), np.linalg.norm(np.maximum(outside, 0), axis=-1), outside.max(-1)
        )
    core = points.copy()
    if isinstance(shape, sy.Capsule):
        core[..., 1] -= np.clip(core[..., 1], -shape.half_length, shape.half_length)
    return np.linalg.norm(core, axis=-1) - shape.radius


def gap_of(body: sy.Body, points: np.ndarray) -> np.ndarray:
    """Distance of points of the world to a body of one part."""
    turn = rotation_matrix(np.array(body.orientation))
    return depth_in(body.parts[0].shape, (points - body.position) @ turn)


# Rays


@pytest.mark.parametrize("seed", range(4))
def test_rays_hit_what_they_meet_first(seed: int) -> None:
    """The place lies on the thing's surface, nothing lies before it, and misses meet nothing."""
    scene = yard(30, seed)
    rng = np.random.default_rng(100 + seed)
    start = rng.uniform(-7, 7, (60, 3)) + np.array((0, 8, 0))
    way = rng.normal(size=(60, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    hits = world_of(scene).queries.ray(start, way)
    gaps = np.stack([gap_of(body, start) for body in scene.bodies])
    inside = (gaps <= 0).any(0)
    assert (hits.distance[0, inside] == 0.0).all()
    for ray in np.flatnonzero(~inside):
        reach = hits.distance[0, ray] if hits.hit[0, ray] else 30.0
        path = start[ray] + np.linspace(0, reach - 1e-6, 4000)[:, None] * way[ray]
        assert path[:, 1].min() > -1e-9  # not through the ground
        for body in scene.bodies:
            assert gap_of(body, path).min() > -1e-9
        if hits.hit[0, ray]:
            place, thing = hits.place[0, ray], hits.things[hits.thing[0, ray]]
            np.testing.assert_allclose(place, start[ray] + reach * way[ray], atol=1e-9)
            off = place[1] if isinstance(thing, sy.Ground) else gap_of(thing, place)
            assert off == pytest.approx(0.0, abs=1e-9)
            assert hits.normal[0, ray] @ way[ray] < 0.0
            assert np.linalg.norm(hits.normal[0, ray]) == pytest.approx(1.0)


def test_all_hits_are_those_of_each_thing_alone_in_order() -> None:
    scene = yard(40, 7)
    world = world_of(scene)
    rng = np.random.default_rng(1)
    start, way = rng.uniform(-7, 7, (50, 3)) + np.array((0, 8, 0)), rng.normal(size=(50, 3))
    hits = world.queries.ray(start, way, every=True)
    alone = np.stack(
        [world.queries.ray(start, way, only=[thing]).distance[0] for thing in hits.things], axis=1
    )
    assert (np.diff(np.where(hits.hit, hits.distance, 1e9), axis=-1) >= 0).all()
    for ray in range(50):
        expected = np.sort(alone[ray][np.isfinite(alone[ray])])
        np.testing.assert_array_equal(hits.distance[0, ray][hits.hit[0, ray]], expected)
    first = world.queries.ray(start, way)
    np.testing.assert_array_equal(first.distance, hits.distance[..., 0])
    np.testing.assert_array_equal(first.thing, hits.thing[..., 0])


@pytest.mark.parametrize("kind", ["ray", *SHAPES])
def test_a_tree_finds_what_trying_all_finds(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the bit, with all hits and with the first."""
    world = world_of(yard(60, 3))
    rng = np.random.default_rng(2)
    start, way = rng.uniform(-7, 7, (80, 3)) + np.array((0, 8, 0)), rng.normal(size=(80, 3))
    answers = []
    for many in (1, 10**9):
        monkeypatch.setattr(ask.Queries, "many", many)
        for every in (False, True):
            if kind == "ray":
                answers.append(world.queries.ray(start, way, every=every))
            else:
                answers.append(world.queries.cast(SHAPES[kind], start, way, every=every))
        if kind != "ray":
            answers.append(world.queries.overlap(SHAPES[kind], start))
    half = len(answers) // 2
    for tree, brute in zip(answers[:half], answers[half:], strict=True):
        np.testing.assert_array_equal(tree.thing, brute.thing)
        np.testing.assert_array_equal(tree.distance, brute.distance)
        np.testing.assert_array_equal(tree.place, brute.place)


def test_a_tree_finds_what_touches_to_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Balls whose lowest places are a last bit above or below a box's upper side."""
    rng = np.random.default_rng(4)
    scene = sy.Scene(gravity=(0, 0, 0))
    balls = []
    for radius in rng.uniform(0.1, 0.5, 300).tolist():
        x, z = rng.uniform(-30, 30, 2)
        place = (x, np.nextafter(radius, rng.choice([0.0, 1.0])), z)
        balls.append(scene.add(sy.Particle(position=place, mass=1.0, radius=radius)))
    world = world_of(scene)
    found = []
    for many in (1, 10**9):
        monkeypatch.setattr(ask.Queries, "many", many)
        hits = world.queries.overlap(sy.Box((40, 1, 40)), (0, -1, 0))
        found.append([bool(hits.of(ball).any()) for ball in balls])
    assert found[0] == found[1]
    assert 20 < sum(found[0]) < 280


# Shapes


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_shapes_stop_where_their_surface_first_touches(name: str, seed: int) -> None:
    """Samples of the moved surface: none within anything up to the hit, some at it."""
    shape = SHAPES[name]
    scene = yard(8, seed, size=2.5, ground=False)
    world = world_of(scene)
    rng = np.random.default_rng(50 + seed)
    start = rng.uniform(-5, 5, (16, 3)) + np.array((0, 3.5, 0))
    aim = rng.uniform(-1.5, 1.5, (16, 3)) + np.array((0, 3.5, 0))
    turn = rng.normal(size=(16, 4))
    hits = world.queries.cast(shape, start, aim - start, orientation=turn)
    overlaps = world.queries.overlap(shape, start, orientation=turn)
    spacing = 0.03
    surface = sample(shape, spacing)
    some = 0
    for c in range(16):
        turned = surface @ rotation_matrix(turn[c] / np.linalg.norm(turn[c])).T
        way = (aim[c] - start[c]) / np.linalg.norm(aim[c] - start[c])

        def nearest(
            reach: float,
            bodies: Any = scene.bodies,
            turned: Any = turned,
            way: Any = way,
            c: int = c,
        ) -> float:
            return min(gap_of(body, start[c] + reach * way + turned).min() for body in bodies)

        assert (hits.distance[0, c] == 0.0) == overlaps.hit[0, c].any()
        if not hits.hit[0, c]:
            # Corners and edges of boxes that stand still reach between the samples.
            assert all(nearest(reach) > -2 * spacing for reach in np.linspace(0, 15, 40))
        elif hits.distance[0, c] > 0.0:
            some += 1
            reach = float(hits.distance[0, c])
            assert all(nearest(share * reach) > -1e-9 for share in np.linspace(0, 1 - 1e-9, 12))
            thing = hits.things[hits.thing[0, c]]
            assert nearest(reach, [thing]) < 2 * spacing
            # A little further it is within, for all that samples show: never before.
            assert (
                world.queries.overlap(shape, start[c] + (reach + 1e-6) * way, orientation=turn[c])
                .of(thing)
                .any()
            )
            assert not world.queries.overlap(
                shape, start[c] + (reach - 1e-6) * way, orientation=turn[c]
            ).hit.any()
    assert some >= 3


def test_balls_meet_balls_walls_and_the_ground_when_the_closed_form_says() -> None:
    scene = sy.Scene()
    ball = scene.add(sy.Body(position=(3, 2, 0.4), parts=sy.Sphere(0.5)))
    wall = scene.add(sy.Body(position=(0, 2, -4), parts=sy.Box((9, 9, 0.05)), inverse_mass=0.0))
    ground = scene.add(sy.Ground())
    q = world_of(scene).queries
    hits = q.cast(sy.Sphere(0.25), (0, 2, 0), [(1, 0, 0), (0, 0, -1), (0, -1, 0), (0, 1, 0)])
    np.testing.assert_allclose(
        hits.distance[0], (3 - math.sqrt(0.75**2 - 0.4**2), 4 - 0.3, 1.75, np.inf), atol=1e-12
    )
    assert [hits.things[i] if i >= 0 else None for i in hits.thing[0]] == [ball, wall, ground, None]
    np.testing.assert_allclose(hits.normal[0, 1:3], [(0, 0, 1), (0, 1, 0)], atol=1e-12)


@pytest.mark.parametrize("speed", [1.0, 30.0, 1000.0])
def test_the_time_of_impact_of_a_bullet_is_known_to_a_nanosecond(speed: float) -> None:
    """Against a turned wall of a millimetre."""
    tilt = 0.3
    scene = sy.Scene()
    scene.add(
        sy.Body(
            position=(10, 5, 0), orientation=(math.cos(tilt / 2), 0, 0, math.sin(tilt / 2)),
            parts=sy.Box((5e-4, 2, 2)), inverse_mass=0.0,
        )
    )  # fmt: skip
    hits = world_of(scene).queries.cast(sy.Sphere(0.05), (0, 5, 0), (1, 0, 0))
    exact = 10 - (0.05 + 5e-4) / math.cos(tilt)
    assert hits.distance[0, 0] / speed == pytest.approx(exact / speed, abs=1e-9)


def test_overlaps_tell_depth_and_everything_within() -> None:
    scene = yard(40, 11)
    q = world_of(scene).queries
    rng = np.random.default_rng(4)
    place = rng.uniform(-5, 5, (40, 3)) + np.array((0, 6, 0))
    hits = q.overlap(sy.Sphere(1.5), place)
    for c in range(40):
        gaps = np.array([gap_of(body, place[c]) for body in scene.bodies] + [place[c, 1]]) - 1.5
        within = {hits.things[i] for i in hits.thing[0, c] if i >= 0}
        assert within == {hits.things[i] for i in np.flatnonzero(gaps <= 0)}
        told = hits.gap[0, c][hits.hit[0, c]]
        assert (np.diff(told) >= 0).all()
        outside = gaps[(gaps <= 0) & (gaps > -1.5)]
        np.testing.assert_allclose(np.sort(told[told > -1.5]), np.sort(outside), atol=1e-9)


def test_a_cast_that_starts_within_things_reports_all_of_them() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Body(position=(0, 1, 0), parts=sy.Sphere(0.45)))
    b = scene.add(sy.Body(position=(0.6, 1, 0), parts=sy.Box((0.3, 0.3, 0.3))))
    c = scene.add(sy.Body(position=(5, 1, 0), parts=sy.Capsule(0.2, 0.5)))
    hits = world_of(scene).queries.cast(sy.Sphere(0.2), (0.4, 1, 0), (1, 0, 0), every=True)
    assert [hits.things[i] for i in hits.thing[0, 0]] == [b, a, c]
    np.testing.assert_allclose(hits.distance[0, 0], (0, 0, 5 - 0.4 - 0.4), atol=1e-12)
    np.testing.assert_allclose(hits.gap[0, 0], (-0.3, -0.25, 0.0), atol=1e-12)


# What all have in common


def test_sight_is_blocked_by_what_lies_between_and_not_by_what_is_ignored() -> None:
    scene = sy.Scene()
    wall = scene.add(sy.Body(position=(2, 1, 0), parts=sy.Box((0.1, 1, 1))))
    q = world_of(scene).queries
    eyes = [(0, 1, 0), (0, 1, 0), (0, 1, 0)]
    aims = [(4, 1, 0), (1.8, 1, 0), (0, 9, 0)]
    assert q.sees(eyes, aims)[0].tolist() == [False, True, True]
    assert q.sees(eyes, aims, ignore=[wall]).all()


def test_worlds_answer_for_themselves_and_nothing_changes() -> None:
    world = world_of(yard(5, 0), worlds=9)
    world.bodies.position[:, :, 1] += np.arange(9)[:, None]
    before = world.snapshot()
    down = world.queries.ray(
        (0, 40, 0) + world.bodies.position[:, :1], (0, -1, 0), ignore=world.scene.of(sy.Ground)
    )
    first = world.bodies.position[:, 0]
    assert (down.thing[:, 0] == 0).all()
    np.testing.assert_allclose(down.place[:, 0, [0, 2]], first[:, [0, 2]], atol=1e-12)
    assert np.ptp(down.place[:, 0, 1] - np.arange(9)) < 1e-12
    np.testing.assert_array_equal(world.snapshot().state, before.state)


def test_particles_are_hit_at_their_radius() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(3, 1, 0), mass=1.0, radius=0.25))
    point = scene.add(sy.Particle(position=(0, 4, 0), mass=1.0))
    world = sy.World(scene)
    assert world.queries.ray((0, 1, 0), (1, 0, 0)).distance[0, 0] == pytest.approx(2.75, abs=1e-12)
    assert world.queries.overlap(sy.Sphere(0.5), (0, 4.4, 0)).of(point).any()


def test_a_scene_without_shapes_is_never_hit() -> None:
    scene = sy.Scene()
    scene.add(sy.Body(position=(2, 0, 0), mass=1.0, inertia=np.eye(3)))
    world = sy.World(scene)
    assert not world.queries.ray((0, 0, 0), (1, 0, 0), every=True).hit.any()
    assert not world.queries.overlap(sy.Sphere(9.0), (0, 0, 0)).hit.any()


@pytest.mark.parametrize(
    ("question", "message"),
    [
        (lambda q: q.ray((0, 0), (1, 0, 0)), "start"),
        (lambda q: q.ray((0, 0, math.nan), (1, 0, 0)), "not finite"),
        (lambda q: q.ray((0, 0, 0), (0, 0, 0)), "direction is 0"),
        (lambda q: q.ray((0, 0, 0), (1, 0, 0), reach=0.0), "reach is 0"),
        (lambda q: q.ray(np.zeros((5, 1, 3)), (1, 0, 0)), "start"),
        (lambda q: q.cast(3.0, (0, 0, 0), (1, 0, 0)), "Sphere, Box or Capsule"),
        (lambda q: q.cast(sy.Sphere(1), (0, 0, 0), (1, 0, 0), orientation=(0, 0, 0, 0)), "orientation is 0"),
        (lambda q: q.ray((0, 0, 0), (1, 0, 0), ignore=[sy.Ground()]), "ignore"),
    ],
)  # fmt: skip
def test_bad_questions_are_refused(question: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError, KeyError), match=message):
        question(world_of(yard(3, 0)).queries)
