"""Manifolds of all pairs against distances found by brute force, and manifolds that are known."""

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from steelyard.collision.narrow_phase import ALL_POINTS, MOST_POINTS, POINT, WORK, collide_many
from steelyard.model.colliders import BOX, CAPSULE, HALF_SPACE, PLACED, SPHERE

SOLID = (SPHERE, BOX, CAPSULE)
PAIRS = list(itertools.product(SOLID, SOLID)) + [(kind, HALF_SPACE) for kind in SOLID]


def placed(centre, turn, size):
    return np.concatenate([centre, np.asarray(turn).ravel(), size])


def collide(kind_a, a, kind_b, b, margin=1e3):
    """Points (n, 8): normal, gap, place, id."""
    points, counts = np.zeros((1, ALL_POINTS * POINT)), np.zeros(1, dtype=np.int64)
    memory = np.zeros(2 * PLACED + ALL_POINTS * POINT + WORK)
    kinds = np.array([[kind_a, kind_b]])
    collide_many(kinds, np.array([[a, b]]), margin, memory, points, counts)
    return points.reshape(-1, POINT)[: counts[0]]


def random_collider(rng, kind, reach):
    turn = Rotation.random(random_state=rng).as_matrix()
    size = rng.uniform(0.2, 1.0, 3)
    return placed(rng.uniform(-reach, reach, 3), turn, size)


def distance(kind, a, place):
    """Signed distance of a place from a collider, exact outside."""
    local = a[3:12].reshape(3, 3).T @ (place - a[:3])
    if kind == SPHERE:
        return np.linalg.norm(local) - a[12]
    if kind == CAPSULE:
        local[1] -= np.clip(local[1], -a[13], a[13])
        return np.linalg.norm(local) - a[12]
    if kind == HALF_SPACE:
        return local[1]
    beyond = np.abs(local) - a[12:15]
    return np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0)


def parted(kind_a, a, kind_b, b):
    """Distance of two colliders that are apart: the least distance from b of a place in a's core, less its radius."""
    turn, centre = a[3:12].reshape(3, 3), a[:3]
    half = {SPHERE: np.zeros(3), CAPSULE: np.array([0.0, a[13], 0.0]), BOX: a[12:15]}[kind_a]
    radius = 0.0 if kind_a == BOX else a[12]

    def of(x):
        return distance(kind_b, b, centre + turn @ (half * x))

    starts = [np.zeros(3), *np.array(list(itertools.product((-0.7, 0.7), repeat=3)))]
    found = min(
        (
            minimize(of, x, bounds=[(-1, 1)] * 3, method="L-BFGS-B", options={"ftol": 1e-15})
            for x in starts
        ),
        key=lambda result: result.fun,
    )
    found = minimize(
        of, found.x, bounds=[(-1, 1)] * 3, method="Powell", options={"xtol": 1e-10, "ftol": 1e-14}
    )
    return found.fun - radius


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_gaps_of_what_is_apart(kind_a, kind_b):
    """Least gap = distance; of two boxes at most that, as their nearest corners lie on no axis that is tried."""
    rng = np.random.default_rng(7)
    tried = 0
    while tried < 25:
        a, b = random_collider(rng, kind_a, 2.0), random_collider(rng, kind_b, 2.0)
        wanted = parted(kind_a, a, kind_b, b)
        if wanted < 0.05:
            continue
        tried += 1
        points = collide(kind_a, a, kind_b, b)
        found = points[:, 3].min() if len(points) else np.inf
        if kind_a == kind_b == BOX:
            # Clipped faces may miss each other: then the manifold is empty, or deeper points lie outside.
            assert found > 0.0
        else:
            assert found == pytest.approx(wanted, abs=2e-6)


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_moving_by_the_depth_parts(kind_a, kind_b):
    """Moved along the normal by what the deepest point says, and a little more, nothing overlaps any longer."""
    rng = np.random.default_rng(8)
    deep = 0
    for _ in range(400):
        a, b = random_collider(rng, kind_a, 0.6), random_collider(rng, kind_b, 0.6)
        points = collide(kind_a, a, kind_b, b)
        if not len(points) or points[:, 3].min() > 0.0:
            continue
        deep += 1
        assert np.isfinite(points).all()
        np.testing.assert_allclose(np.linalg.norm(points[:, :3], axis=1), 1.0, rtol=1e-12)
        first = points[points[:, 3].argmin()]
        a[:3] += first[:3] * (1e-3 * 1.1 - first[3])
        again = collide(kind_a, a, kind_b, b)
        assert not len(again) or again[:, 3].min() > -2e-9
    assert deep > 100


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_swapping_flips_normals_alone(kind_a, kind_b):
    rng = np.random.default_rng(9)
    for _ in range(200):
        a, b = random_collider(rng, kind_a, 0.8), random_collider(rng, kind_b, 0.8)
        one, other = collide(kind_a, a, kind_b, b), collide(kind_b, b, kind_a, a)
        if kind_a == kind_b:
            # Which box's face is the reference may differ.
            least = [points[:, 3].min() if len(points) else np.inf for points in (one, other)]
            assert least[0] == pytest.approx(least[1], abs=2e-3)
        else:
            np.testing.assert_array_equal(one[:, :3], -other[:, :3])
            np.testing.assert_array_equal(one[:, 3:], other[:, 3:])


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_a_common_motion_moves_points_alone(kind_a, kind_b):
    rng = np.random.default_rng(10)
    turn = Rotation.random(random_state=rng).as_matrix()
    shift = rng.normal(size=3)
    for _ in range(100):
        a, b = random_collider(rng, kind_a, 0.8), random_collider(rng, kind_b, 0.8)
        moved = [placed(turn @ x[:3] + shift, turn @ x[3:12].reshape(3, 3), x[12:]) for x in (a, b)]
        one, other = collide(kind_a, a, kind_b, b), collide(kind_a, moved[0], kind_b, moved[1])
        one, other = (points[points[:, 7].argsort()] for points in (one, other))
        np.testing.assert_array_equal(one[:, 7], other[:, 7])
        np.testing.assert_allclose(other[:, :3], one[:, :3] @ turn.T, atol=1e-9)
        np.testing.assert_allclose(other[:, 3], one[:, 3], atol=1e-9)
        np.testing.assert_allclose(other[:, 4:7], one[:, 4:7] @ turn.T + shift, atol=1e-8)


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS)
def test_ids_are_different_and_stay(kind_a, kind_b):
    """A millionth of a millimetre changes no id but where features change."""
    rng = np.random.default_rng(11)
    changed = 0
    for _ in range(200):
        a, b = random_collider(rng, kind_a, 0.6), random_collider(rng, kind_b, 0.6)
        points = collide(kind_a, a, kind_b, b, 0.0)
        assert len(points) <= MOST_POINTS
        assert len(set(points[:, 7])) == len(points)
        assert (points[:, 7] >= 0).all()
        assert (points[:, 7] < 128).all()
        a[:3] += 1e-9
        changed += set(points[:, 7]) != set(collide(kind_a, a, kind_b, b, 0.0)[:, 7])
    assert changed <= 1


UP = np.eye(3)


def test_a_box_on_a_box_has_the_corners_of_what_overlaps():
    a = placed([0.3, 1.0, 0.2], UP, [0.5, 0.5, 0.5])
    b = placed([0.0, 0.0, 0.0], UP, [0.6, 0.5, 0.6])
    points = collide(BOX, a, BOX, b)
    assert len(points) == 4
    np.testing.assert_allclose(points[:, :3], np.tile([0.0, 1.0, 0.0], (4, 1)), atol=1e-15)
    np.testing.assert_allclose(points[:, 3], 0.0, atol=1e-15)
    corners = {tuple(np.round(place, 9)) for place in points[:, 4:7]}
    assert corners == {(x, 0.5, z) for x in (-0.2, 0.6) for z in (-0.3, 0.6)}


@pytest.mark.parametrize("angle", [1e-12, 1e-10, 1e-8, 1e-6])
@pytest.mark.parametrize("seed", range(5))
def test_faces_on_each_other_touch_at_their_corners_whatever_rounding_does(angle, seed):
    # Sides that lie on each other cross somewhere along their way: no place for a point.
    rng = np.random.default_rng(seed)
    common = Rotation.random(random_state=rng).as_matrix()
    half = np.array((0.5, 0.2, 0.3))
    tilt = Rotation.from_rotvec(angle * rng.normal(size=3)).as_matrix()
    up = common @ (0.0, 0.4, 0.0)
    points = collide(BOX, placed(up, common @ tilt, half), BOX, placed(np.zeros(3), common, half))
    corners = [common @ (x * 0.5, 0.2, z * 0.3) for x in (-1, 1) for z in (-1, 1)]
    assert len(points) == 4
    for corner in corners:
        assert np.linalg.norm(points[:, 4:7] - corner, axis=1).min() < 10 * angle + 1e-9


def test_crossed_edges_touch_at_one_point():
    turn = Rotation.from_euler("x", 45, degrees=True).as_matrix()
    other = Rotation.from_euler("z", 45, degrees=True).as_matrix()
    root = np.sqrt(0.5)
    a = placed([0.1, 2.0 * root - 0.01, 0.05], turn, [2.0, 0.5, 0.5])
    b = placed([0.0, 0.0, 0.0], other, [0.5, 0.5, 2.0])
    (point,) = collide(BOX, a, BOX, b)
    np.testing.assert_allclose(point[:3], [0.0, 1.0, 0.0], atol=1e-12)
    assert point[3] == pytest.approx(-0.01 + 0.0, abs=1e-12)
    np.testing.assert_allclose(point[4:7], [0.0, root - 0.005, 0.05], atol=1e-12)


def test_a_lying_capsule_touches_at_both_ends():
    along = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    a = placed([0.0, 0.4, 0.0], along, [0.4, 1.0, 0.0])
    for kind, b in (
        (HALF_SPACE, placed([0, 0, 0], UP, [0, 0, 0])),
        (BOX, placed([0, -1, 0], UP, [3, 1, 3])),
    ):
        points = collide(CAPSULE, a, kind, b)
        assert len(points) == 2
        np.testing.assert_allclose(sorted(points[:, 4]), [-1.0, 1.0], atol=1e-12)
        np.testing.assert_allclose(points[:, 3], 0.0, atol=1e-12)


def test_a_centre_inside_a_box_leaves_by_the_nearest_face():
    a = placed([0.1, 0.4, -0.2], UP, [0.3, 0.0, 0.0])
    (point,) = collide(SPHERE, a, BOX, placed([0, 0, 0], UP, [1.0, 0.5, 1.0]))
    np.testing.assert_allclose(point[:4], [0.0, 1.0, 0.0, -0.4], atol=1e-15)


def test_what_coincides_gets_a_normal_all_the_same():
    for kind in SOLID:
        a = placed([0, 0, 0], UP, [0.5, 0.6, 0.7])
        points = collide(kind, a, kind, a)
        assert len(points) >= 1
        assert np.isfinite(points).all()
        np.testing.assert_allclose(np.linalg.norm(points[:, :3], axis=1), 1.0)
