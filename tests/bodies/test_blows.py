"""Blows that pass through what touches: Newton's cradle and its kin, against sequences of impacts."""

import math

import numpy as np
import pytest

import steelyard as sy

RADIUS, SWING = 0.05, 0.3
SOLVER = sy.ProximalNewton()


def cradle(count=5, *, pulled=1, gap=0.0, restitution=1.0, joints=False):
    """Balls on strings of a metre; the first ones are pulled aside."""
    scene = sy.Scene()
    for i in range(count):
        angle = -SWING if i < pulled else 0.0
        x = i * (2 * RADIUS + gap)
        turn = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
        if joints:
            place = (x + math.sin(angle), -math.cos(angle), 0)
            ball = scene.add(sy.Body(position=place, orientation=turn, parts=sy.Sphere(RADIUS)))
            scene.add(sy.HingeJoint(a=ball, place=(x, 0, 0)))
        else:
            scene.add(
                sy.Body(
                    position=(x, 0, 0), pivot=(0, 1, 0), orientation=turn, parts=sy.Sphere(RADIUS)
                )
            )
    scene.add(sy.Collisions(restitution=restitution, friction=0.0))
    return scene


def angles(world):
    turn = world.bodies.orientation[0]
    return 2 * np.arctan2(turn[:, 3], turn[:, 0])


def swings(scene, seconds, dt):
    """Angles of all balls after every step, and the world."""
    world = sy.World(scene, method=sy.Method(sy.Rattle(), SOLVER, dt=dt))
    seen = []
    for _ in range(round(seconds / dt)):
        world.step()
        seen.append(angles(world))
    assert world.health[0] == 0
    return np.array(seen), world


@pytest.mark.parametrize("joints", [False, True])
@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_one_in_one_out(gap, joints):
    seen, _ = swings(cradle(gap=gap, joints=joints), 1.5, 1 / 240)
    out = seen.max(axis=0)
    assert out[4] == pytest.approx(SWING, rel=0.01)
    assert out[:4].max() < 0.01 * SWING


def test_two_in_two_out_and_back():
    seen, _ = swings(cradle(pulled=2), 3.0, 1 / 240)
    there, back = seen[: len(seen) // 2].max(axis=0), seen[len(seen) // 2 :].min(axis=0)
    np.testing.assert_allclose(there, [0, 0, 0, SWING, SWING], atol=0.01 * SWING)
    np.testing.assert_allclose(back, [-SWING, -SWING, 0, 0, 0], atol=0.02 * SWING)


def test_it_goes_on_for_a_minute():
    seen, world = swings(cradle(), 60.0, 1 / 240)
    late = seen[-600:]
    # A step in which all touch moves the middle ones a little: in sixty blows they take up a few per cent.
    assert late[:, 4].max() == pytest.approx(SWING, rel=0.05)
    assert late[:, 0].min() == pytest.approx(-SWING, rel=0.05)
    scale = 4 / 3 * math.pi * RADIUS**3 * 1000 * 9.81 * (1 - math.cos(SWING))
    start = sy.World(cradle()).energy[0]
    assert world.energy[0] == pytest.approx(start, abs=0.01 * scale)


def played(masses, speeds, restitution):
    """Speeds after all blows along a row that touches, each the one of the pair that closes fastest."""
    v, m = np.array(speeds, dtype=float), np.array(masses, dtype=float)
    for _ in range(10_000):
        closing = v[:-1] - v[1:]
        i = int(np.argmax(closing))
        if closing[i] <= 1e-12:
            return v
        push = (1 + restitution) * closing[i] / (1 / m[i] + 1 / m[i + 1])
        v[i] -= push / m[i]
        v[i + 1] += push / m[i + 1]
    raise AssertionError("blows without end")


@pytest.mark.parametrize("restitution", [0.3, 0.8, 1.0])
@pytest.mark.parametrize(
    ("masses", "speeds"),
    [
        ((1, 1, 1, 1), (2, 0, 0, 0)),
        ((1, 1, 1, 1), (2, 0, 0, -2)),
        ((1, 1, 1, 1), (2, 2, 0, 0)),
        ((3, 1, 1, 1), (2, 0, 0, 0)),
        ((1, 1, 1, 5), (2, 0, 0, 0)),
        ((1, 2, 4, 8, 16), (3, 0, 0, 0, 0)),
        ((16, 8, 4, 2, 1), (3, 0, 0, 0, 0)),
    ],
)
def test_a_row_of_balls_parts_as_its_blows_one_by_one_say(masses, speeds, restitution):
    scene = sy.Scene(gravity=(0, 0, 0))
    # Those that move have a step's way to go.
    place = 0.0
    for mass, speed in zip(masses, speeds, strict=True):
        scene.add(
            sy.Body(
                position=(place - 0.004 * speed, 0, 0),
                velocity=(speed, 0, 0),
                parts=sy.Sphere(0.1),
                mass=mass,
            )
        )
        place += 0.2
    scene.add(sy.Collisions(restitution=restitution, friction=0.5))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), SOLVER, dt=0.01))
    world.step(40)
    expected = played(masses, speeds, restitution)
    np.testing.assert_allclose(world.bodies.velocity[0, :, 0], expected, atol=1e-6)
    assert world.energy[0] <= 0.5 * np.dot(masses, np.square(speeds)) * (1 + 1e-9)


def test_a_ball_on_a_ball_is_thrown_up():
    """A light ball on a heavy one that fall together leaves with three times the speed (mass ratio to infinity)."""
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 1.5, 0), parts=sy.Sphere(0.5), mass=1000.0))
    scene.add(sy.Body(position=(0, 2.1, 0), parts=sy.Sphere(0.1), mass=0.001))
    scene.add(sy.Ground(restitution=1.0))
    scene.add(sy.Collisions(restitution=1.0))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), SOLVER, dt=1 / 1000))
    energy, high = world.energy[0], 0.0
    for _ in range(2000):
        world.step()
        high = max(high, world.bodies.position[0, 1, 1])
    # It leaves the top of the heavy ball, 1.1 m up, with 3 sqrt(2 g h), for h = 1: nine metres more.
    assert high == pytest.approx(1.1 + 9.0, rel=0.02)
    assert world.energy[0] == pytest.approx(energy, rel=1e-3)


def test_what_falls_flat_stays_flat():
    scene = sy.Scene()
    for i in range(3):
        scene.add(sy.Body(position=(0, 1.0 + 1.001 * i, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Ground(restitution=0.5))
    scene.add(sy.Collisions(restitution=0.5))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), SOLVER, dt=1 / 240))
    before = world.energy[0]
    for _ in range(60):
        world.step(4)
        assert world.energy[0] <= before * (1 + 1e-5)
        before = world.energy[0]
        assert np.abs(world.bodies.angular_velocity).max() < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_bouncing_heap_gains_nothing(seed):
    rng = np.random.default_rng(seed)
    scene = sy.Scene()
    for i in range(10):
        half = rng.uniform(0.2, 0.5, 3)
        shape = sy.Sphere(float(half[0])) if i % 2 else sy.Box(tuple(half))
        place = (*rng.uniform(-0.8, 0.8, 2), 0)
        scene.add(
            sy.Body(
                position=(place[0], 1.0 + i, place[1]),
                orientation=tuple(rng.normal(size=4)),
                parts=shape,
            )
        )
    scene.add(sy.Ground(restitution=0.6, friction=0.5))
    scene.add(sy.Collisions(restitution=0.6, friction=0.5))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), SOLVER, dt=0.01))
    start, before, worst = world.energy[0], world.energy[0], 0.0
    for _ in range(400):
        world.step()
        worst = max(worst, (world.energy[0] - before) / start)
        before = world.energy[0]
    assert world.health[0] == 0
    assert worst < 1e-5
