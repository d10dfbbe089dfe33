"""Contact of bodies: impacts, friction at its limit, stacks, heaps, and what the buffer and bad input do."""

import math

import numpy as np
import pytest
from scipy.optimize import linprog

import steelyard as sy

CUBE = (0.5, 0.5, 0.5)


def box(scene, x, y, z=0.0, *, half=CUBE, density=1000.0, **more):
    part = sy.Part(shape=sy.Box(half), density=density)
    return scene.add(sy.Body(position=(x, y, z), parts=part, **more))


def on_ground(scene, friction=0.6, restitution=0.0):
    scene.add(sy.Ground(friction=friction, restitution=restitution))
    if len(scene.bodies) > 1:
        scene.add(sy.Collisions(friction=friction, restitution=restitution))
    return scene


def settled(scene, seconds=10.0, dt=1 / 60, **more):
    """A world after so many seconds awake, and how far anything moved in the last five sixths of them."""
    solver = sy.ProximalNewton(rest_time=None, **more)
    world = sy.World(scene, method=sy.Method(sy.Rattle(), solver, dt=dt))
    steps = round(seconds / dt)
    world.step(steps // 6)
    before = world.bodies.position.copy()
    world.step(steps - steps // 6)
    assert world.health[0] == 0
    return world, np.abs(world.bodies.position - before).max()


# Impacts


@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("dt", [1 / 60, 1 / 1000])
def test_a_ball_leaves_the_ground_at_e_times_the_speed_of_impact(e, dt):
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 1.5, 0), parts=sy.Sphere(0.5)))
    scene.add(sy.Ground(restitution=e))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=dt))
    while world.bodies.velocity[0, 0, 1] <= 0.0 and world.time[0] < 0.6:
        world.step(1)
    speed, height = world.bodies.velocity[0, 0, 1], world.bodies.position[0, 0, 1] - 0.5
    # By energy: the speed at the ground itself.
    assert speed**2 + 2 * 9.81 * height == pytest.approx(e**2 * 2 * 9.81, abs=1e-10)


@pytest.mark.parametrize("rate", [60, 120, 240, 480])
def test_a_ball_that_just_touches_when_a_step_ends_rebounds(rate):
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Body(position=(0, 1.0, 0), velocity=(0, -4, 0), parts=sy.Sphere(0.25)))
    scene.add(sy.Ground(restitution=0.5))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=1 / rate))
    world.step(rate // 2)
    assert world.bodies.velocity[0, 0, 1] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("friction", [0.1, 0.2, 0.9])
@pytest.mark.parametrize("dt", [1 / 60, 1 / 240])
def test_an_oblique_blow_gives_the_spin_that_friction_can(e, friction, dt):
    """Sliding takes mu (1 + e) of the normal speed and gives 5/2 of that over r in spin; at most until it rolls."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Body(position=(0, 3, 0), velocity=(4, -20, 0), parts=sy.Sphere(0.25)))
    scene.add(sy.Ground(restitution=e, friction=friction))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=dt))
    world.step(round(0.3 / dt))
    lost = min(friction * (1 + e) * 20.0, 2.0 / 7.0 * 4.0)
    velocity, spin = world.bodies.velocity[0, 0], world.bodies.angular_velocity[0, 0]
    np.testing.assert_allclose(velocity, (4 - lost, 20 * e, 0), atol=1e-12)
    np.testing.assert_allclose(spin, (0, 0, -2.5 * lost / 0.25), atol=1e-11)


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
def test_balls_that_meet_head_on_part_as_newton_says(e):
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Body(position=(-1, 0, 0), velocity=(3, 0, 0), parts=sy.Sphere(0.5)))
    scene.add(sy.Body(position=(0.7, 0, 0), velocity=(-1, 0, 0), parts=sy.Sphere(0.4)))
    scene.add(sy.Collisions(restitution=e, friction=0.5))
    world = sy.World(scene)
    momentum = world.momentum.copy()
    world.step(60)
    va, vb = world.bodies.velocity[0, :, 0]
    assert vb - va == pytest.approx(4.0 * e, abs=1e-11)
    assert world.momentum[0] == pytest.approx(momentum[0], abs=1e-11)


def test_momentum_is_kept_in_a_heap_without_gravity():
    rng = np.random.default_rng(2)
    scene = sy.Scene(gravity=(0, 0, 0))
    for place in np.stack(np.meshgrid(*[np.arange(2) * 1.2] * 3), -1).reshape(-1, 3):
        box(
            scene, *place, velocity=tuple(-3 * (place - 0.6)), orientation=tuple(rng.normal(size=4))
        )
    scene.add(sy.Collisions(friction=0.5, restitution=0.3))
    # Overlaps are left: pushing them apart moves places, by which linear momentum counts as angular.
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(slop=1.0)))
    linear, angular, energy = world.momentum.copy(), world.angular_momentum.copy(), world.energy[0]
    world.step(60)
    assert world.energy[0] < 0.9 * energy
    size = 1000.0 * 8 * 3
    np.testing.assert_allclose(world.momentum, linear, atol=1e-11 * size)
    np.testing.assert_allclose(world.angular_momentum, angular, atol=1e-11 * size)


def test_bouncing_keeps_its_energy():
    """49 balls of 10 kg from 5 m, e = 1, for 20 s at 1 ms (SimBenchmark), each from a height of its own."""
    scene = sy.Scene()
    for x in range(7):
        for z in range(7):
            place = (0.5 * x, 5.0 + 0.01 * (7 * x + z), 0.5 * z)
            scene.add(sy.Body(position=place, parts=sy.Sphere(0.1), mass=10.0))
    scene.add(sy.Ground(restitution=1.0))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=1e-3))
    before = world.energy[0]
    errors = []
    for _ in range(400):
        world.step(50)
        errors.append(world.energy[0] / before - 1.0)
    assert np.sqrt(np.mean(np.square(errors))) < 1e-9


def test_balls_roll_on_a_box_that_is_pulled_over_the_ground():
    """SimBenchmark's rolling: 25 balls of 1 kg on a box of 10 kg, pulled by 150 N, against the closed form."""
    mass, ball, count, pull, ground, top = 10.0, 1.0, 25, 150.0, 0.4, 0.8
    way = np.array((0.5, 0.0, math.sqrt(0.75)))
    scene = sy.Scene()
    base = scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((10, 0.5, 10)), mass=mass))
    scene.add(sy.Ground(particles=[base], friction=ground))
    for x in range(-2, 3):
        for z in range(-2, 3):
            other = scene.add(
                sy.Body(position=(2 * x, 1.5, 2 * z), parts=sy.Sphere(0.5), mass=ball)
            )
            scene.add(sy.Collisions(particles=[base, other], friction=top))
    scene.add(sy.Wrench(base, force=tuple(pull * way)))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=1e-3))
    world.step(1000)
    resisting = ground * (mass + count * ball) * 9.81
    rolling = (pull - resisting) / mass / (3.5 / ball + count / mass)
    velocity = world.bodies.velocity[0]
    np.testing.assert_allclose(
        velocity[0], (pull - resisting - count * rolling) / mass * way, atol=1e-6
    )
    np.testing.assert_allclose(velocity[1:] - rolling / ball * way, 0.0, atol=1e-6)


# Friction


@pytest.mark.parametrize("share", [1.001, 0.999])
def test_a_block_on_an_incline_at_the_limit_of_friction(share):
    mu, g = 0.5, 9.81
    slope = math.atan(mu / share)
    scene = sy.Scene(gravity=(g * math.sin(slope), -g * math.cos(slope), 0))
    box(scene, 0, 0.25, half=(0.5, 0.25, 0.4))
    scene.add(sy.Ground(friction=mu))
    world = sy.World(scene)
    world.step(120)
    if share > 1.0:
        assert np.abs(world.bodies.velocity).max() < 1e-9
    else:
        way = 2.0 * g * (math.sin(slope) - mu * math.cos(slope))
        assert world.bodies.position[0, 0, 0] == pytest.approx(way, rel=1e-2)


def test_a_sliding_ball_comes_to_roll():
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 0.5, 0), velocity=(2, 0, 0), parts=sy.Sphere(0.5)))
    scene.add(sy.Ground(friction=0.3))
    world = sy.World(scene)
    world.step(120)
    assert world.bodies.velocity[0, 0, 0] == pytest.approx(10 / 7, abs=1e-6)
    assert world.bodies.angular_velocity[0, 0, 2] == pytest.approx(-20 / 7, abs=2e-6)


def test_friction_is_along_the_way_and_no_larger_than_mu_times_the_load():
    scene = sy.Scene()
    body = box(scene, 0, 0.5, velocity=(3, 0, 4))
    ground = scene.add(sy.Ground(friction=0.4))
    world = sy.World(scene)
    world.step(10)
    force = world.contacts.force_on(body)[0]
    weight = body.mass * 9.81
    np.testing.assert_allclose(force, weight * np.array([-0.24, 1.0, -0.32]), rtol=1e-6)
    np.testing.assert_allclose(world.contacts.force_on(ground)[0], -force)


# Stacks


def test_a_stack_of_twenty_stands():
    scene = sy.Scene()
    for i in range(20):
        box(scene, 0, 0.5 + i)
    world, moved = settled(on_ground(scene))
    assert moved < 1e-8
    assert np.abs(world.bodies.velocity).max() < 1e-9


@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_a_top_a_thousand_times_heavier(offset):
    scene = sy.Scene()
    for i in range(9):
        box(scene, 0, 0.5 + i)
    box(scene, offset, 9.5, density=1e6)
    world, moved = settled(on_ground(scene))
    assert moved < 1e-7
    assert np.abs(world.bodies.velocity).max() < 1e-9


@pytest.mark.parametrize(("count", "sinks"), [(3, 1e-3), (20, 2e-2)])
def test_a_top_a_million_times_heavier_is_held(count, sinks):
    """No pass can settle what is so stiff: the next step goes on where it ended."""
    scene = sy.Scene()
    for i in range(count):
        box(scene, 0, 0.5 + i, density=1e9 if i == count - 1 else 1e3)
    world = sy.World(on_ground(scene))
    start = world.bodies.position.copy()
    world.step(300)
    assert np.abs(world.bodies.position - start).max() < sinks
    assert np.abs(world.bodies.velocity).max() < 1e-6
    assert world.health[0] == 0


def test_four_hundred_to_one_on_two_small_ones():
    scene = sy.Scene()
    box(scene, -0.6, 0.25, half=(0.25, 0.25, 0.25))
    box(scene, 0.6, 0.25, half=(0.25, 0.25, 0.25))
    top = box(scene, 0, 1.0, half=(1, 0.5, 0.5), density=400 * 125 / 2)
    assert top.mass == pytest.approx(400 * 125)
    world, moved = settled(on_ground(scene))
    assert moved < 1e-7
    assert np.abs(world.bodies.velocity).max() < 1e-9


@pytest.mark.slow
def test_a_pyramid_of_ten_stands_for_a_minute():
    scene = sy.Scene()
    for i in range(10):
        for j in range(10 - i):
            box(scene, 1.05 * (j - (9 - i) / 2), 0.5 + i)
    world, moved = settled(on_ground(scene), seconds=60.0)
    assert moved < 1e-6
    assert np.abs(world.bodies.velocity).max() < 1e-9


@pytest.mark.parametrize(("overhang", "stands"), [(0.49, True), (0.51, False)])
def test_an_overhanging_box_falls_beyond_its_middle(overhang, stands):
    scene = sy.Scene()
    box(scene, 0, 0.5)
    box(scene, overhang, 1.5)
    world = sy.World(on_ground(scene))
    world.step(180)
    assert (world.bodies.position[0, 1, 1] > 1.49) == stands


@pytest.mark.parametrize(("factor", "stands"), [(1.02, True), (0.98, False)])
def test_a_leaning_plank_stands_by_friction(factor, stands):
    """A plank against a wall without friction: moments about its lower end give mu (2 y + r) = x."""
    angle = math.radians(60)
    half = 1.0
    scene = sy.Scene()
    turn = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
    r = 0.05
    plank = sy.Part(shape=sy.Capsule(r, half), orientation=(math.sqrt(0.5), 0, 0, -math.sqrt(0.5)))
    x, y = half * math.cos(angle), half * math.sin(angle)
    mu = factor * x / (2.0 * y + r)
    scene.add(
        sy.Body(position=(-x - r, y + r, 0), orientation=turn, parts=plank, velocity=(0, 0, 0))
    )
    scene.add(sy.Ground(friction=mu))
    scene.add(sy.Ground(normal=(-1, 0, 0), height=0.0))
    world = sy.World(scene)
    world.step(300)
    fell = y + r - world.bodies.position[0, 0, 1]
    assert (fell < 1e-4) if stands else (fell > 0.05)


# Heaps


def heap(seed, count=30, spread=1000.0):
    """Boxes of random sizes, densities and turns above the ground."""
    rng = np.random.default_rng(seed)
    scene = sy.Scene()
    for i in range(count):
        density = 1000.0 * spread ** (rng.uniform() - 0.5)
        box(
            scene, rng.uniform(-1, 1), 0.8 + 0.75 * i, rng.uniform(-1, 1), half=tuple(rng.uniform(0.2, 0.5, 3)),
            density=density, orientation=tuple(rng.normal(size=4)), velocity=tuple(rng.normal(size=3)),
            angular_velocity=tuple(2 * rng.normal(size=3)),
        )  # fmt: skip
    return on_ground(scene, friction=0.5)


@pytest.mark.parametrize("seed", range(10))
def test_a_tumbling_heap_settles_without_a_failed_solve(seed):
    world = sy.World(heap(seed))
    energy = first = world.energy[0]
    for _ in range(600):
        world.step()
        assert world.energy[0] <= energy + 1e-5 * first
        energy = world.energy[0]
    assert world.health[0] == 0
    # A light one that a thousand times its mass squeezed out may be far away, and on its way still.
    near = np.abs(world.bodies.position[0]).max(axis=1) < 30.0
    assert near.sum() >= 27
    assert np.abs(world.bodies.velocity[0, near]).max() < 1e-3
    # Nothing fell through: the thinnest half edge is .2 m.
    assert world.bodies.position[0, :, 1].min() > 0.19


def test_what_turns_fast_meets_what_faced_away_when_the_step_began():
    depths = []
    for seed in range(7):
        rng = np.random.default_rng(seed)
        scene = sy.Scene()
        for i in range(10):
            box(
                scene, rng.uniform(-0.5, 0.5), 1.0 + 1.6 * i, rng.uniform(-0.5, 0.5),
                half=tuple(rng.uniform(0.2, 0.45, 3)), orientation=tuple(rng.normal(size=4)),
                angular_velocity=tuple(4 * rng.normal(size=3)),
            )  # fmt: skip
        world = sy.World(on_ground(scene, friction=0.5))
        energy = first = world.energy[0]
        depth = 0.0
        for _ in range(150):
            world.step()
            depth = max(depth, world.penetration[0])
            assert world.energy[0] <= energy + 1e-5 * first
            energy = world.energy[0]
        depths.append(depth)
    # With the contacts of the steps' starts alone half of such heaps go deeper than 5 cm.
    assert np.median(depths) < 2e-3
    assert max(depths) < 0.1


def test_a_thin_plate_that_falls_flat_lands_flat():
    """All eight of its corners are near the ground within a step: the lower ones must be those that count."""
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 1.0, 0), parts=sy.Box((0.5, 0.01, 0.3))))
    scene.add(sy.Ground(friction=0.5))
    world = sy.World(scene)
    for _ in range(60):
        world.step()
        assert world.penetration[0] < 1e-9
        assert np.abs(world.bodies.angular_velocity).max() < 1e-9
    assert world.bodies.position[0, 0, 1] == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize(("dt", "gain"), [(1 / 240, 3e-5), (1 / 1000, 2e-6)])
@pytest.mark.parametrize("friction", [2.0, 4.0, 10.0])
@pytest.mark.parametrize("slope", [0.3, 0.9, 1.3])
@pytest.mark.parametrize("speed", [-4.0, 4.0])
def test_a_rod_that_jams_gains_nothing(dt, gain, friction, slope, speed):
    """Painleve's rod: beyond mu = 4/3 sliding has no solution with finite forces."""
    scene = sy.Scene()
    turn = (math.cos(slope / 2), 0, 0, math.sin(slope / 2))
    height = 0.02 + 0.5 * math.sin(slope)
    scene.add(
        sy.Body(
            position=(0, height, 0),
            velocity=(speed, 0, 0),
            orientation=turn,
            parts=sy.Box((0.5, 0.02, 0.02)),
        )
    )
    scene.add(sy.Ground(friction=friction))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=dt))
    energies = [world.energy[0]]
    for _ in range(round(1.0 / dt)):
        world.step()
        energies.append(world.energy[0])
    assert np.isfinite(energies).all()
    assert world.health[0] == 0
    assert np.diff(energies).max() < gain * (energies[0] - min(energies))


def test_deep_overlaps_part_without_a_burst():
    scene = sy.Scene()
    box(scene, 0, 0.5)
    box(scene, 0.1, 0.9, orientation=(1, 0.05, 0, 0.02))
    scene.add(sy.Body(position=(0.05, 1.1, 0.3), parts=sy.Sphere(0.3)))
    world = sy.World(on_ground(scene))
    before = world.energy[0]
    highest = before
    for _ in range(300):
        world.step(1)
        highest = max(highest, world.energy[0])
    assert world.health[0] == 0
    # Parting lifts what lies above: one box by 1 m at most.
    assert highest < before + 1000 * 9.81 * 1.5
    assert np.abs(world.bodies.velocity).max() < 4.0


# Particles, capsules, scenery


def test_particles_and_bodies_hold_each_other():
    scene = sy.Scene()
    ball = scene.add(sy.Particle(position=(0, 0.2, 0), radius=0.2, mass=5.0))
    tray = box(scene, 0, 0.5, half=(1.0, 0.1, 1.0))
    for x, z in ((-0.8, -0.8), (-0.8, 0.8), (0.8, 0.0)):
        scene.add(sy.Particle(position=(x, 0.2, z), radius=0.2, mass=1.0))
    world = sy.World(on_ground(scene))
    world.step(120)
    assert np.abs(world.bodies.velocity).max() < 1e-6
    load = world.contacts.force_on(world.scene.of(sy.Ground)[0])[0, 1]
    assert load == pytest.approx(-9.81 * (tray.mass + 8.0), rel=1e-6)
    assert world.particles.position[0, 0] == pytest.approx(ball.position, abs=1e-6)


def test_a_ball_rolls_down_an_immovable_ramp():
    slope = 0.3
    scene = sy.Scene()
    scene.add(
        sy.Body(
            position=(0, 0, 0), inverse_mass=0, parts=sy.Box((20, 0.5, 2)),
            orientation=(math.cos(slope / 2), 0, 0, -math.sin(slope / 2)),
        )
    )  # fmt: skip
    up = np.array([math.sin(slope), math.cos(slope), 0])
    scene.add(sy.Body(position=tuple(0.75 * up), parts=sy.Sphere(0.25)))
    scene.add(sy.Collisions(friction=0.8))
    world = sy.World(scene)
    world.step(120)
    speed = np.linalg.norm(world.bodies.velocity[0, 1])
    assert speed == pytest.approx(5 / 7 * 9.81 * math.sin(slope) * 2.0, rel=1e-6)


@pytest.mark.parametrize("thickness", [1e-3, 1e-2, 0.1])
@pytest.mark.parametrize(
    "shots", [1024, pytest.param(33_400, marks=pytest.mark.slow)], ids=["some", "a third of 1e5"]
)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_no_bullet_passes_a_wall(thickness, shots, friction):
    """Balls of .05 m at 1 to 1000 m/s, from anywhere, in any direction, at a turned wall; and when they meet it."""
    rng = np.random.default_rng(int(1e4 * thickness))
    tilt = 0.4
    scene = sy.Scene(gravity=(0, 0, 0))
    turn = (math.cos(tilt / 2), 0, 0, math.sin(tilt / 2))
    wall = scene.add(
        sy.Body(
            position=(0, 0, 0),
            orientation=turn,
            inverse_mass=0,
            parts=sy.Box((thickness / 2, 400, 400)),
        )
    )
    scene.add(sy.Body(position=(-5, 0, 0), parts=sy.Sphere(0.05)))
    scene.add(sy.Collisions(friction=friction))
    world = sy.World(scene, worlds=shots)
    across = np.array((math.cos(tilt), math.sin(tilt), 0.0))
    away = 0.05 + thickness / 2 + rng.uniform(1e-3, 5.0, shots)
    speed = 10.0 ** rng.uniform(0, 3, shots)
    aim = rng.normal(size=(shots, 3))
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    # Towards the wall, at least a tenth of the way.
    aim += across * (np.maximum(0.1, np.abs(aim @ across)) - aim @ across)[:, None]
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    world.bodies.position[:, 1] = -away[:, None] * across
    world.bodies.velocity[:, 1] = speed[:, None] * aim
    hits = world.queries.cast(
        sy.Sphere(0.05), world.bodies.position[:, 1:], aim[:, None], only=[wall]
    )
    exact = (away - 0.05 - thickness / 2) / (aim @ across)
    np.testing.assert_allclose(hits.distance[:, 0] / speed, exact / speed, atol=1e-6)
    for _ in range(30):
        world.step()
        assert (world.bodies.position[:, 1] @ across).max() < -0.05 - thickness / 2 + 1e-4
    assert not (world.health != 0).any()


def test_worlds_do_not_depend_on_their_neighbours_or_threads():
    scene = heap(1, count=6)
    alone = sy.World(scene)
    many = sy.World(scene, worlds=13, threads=3)
    alone.bodies.velocity[0, 2] += (1.0, 2.0, 3.0)
    many.bodies.velocity[5, 2] += (1.0, 2.0, 3.0)
    many.bodies.velocity[7, 3] += (0.0, 9.0, 3.0)
    for world in (alone, many):
        world.step(60)
        world.step(60)
    np.testing.assert_array_equal(many.state[:, 5], alone.state[:, 0])
    assert not np.array_equal(many.state[:, 7], alone.state[:, 0])


def test_steps_and_snapshots_go_on_to_the_bit():
    one, other = sy.World(heap(2, count=6)), sy.World(heap(2, count=6))
    one.step(90)
    other.step(30)
    kept = other.snapshot()
    other.step(60)
    np.testing.assert_array_equal(one.state, other.state)
    other.restore(kept)
    other.step(60)
    np.testing.assert_array_equal(one.state, other.state)


def test_friction_restitution_and_radius_can_differ_between_worlds():
    scene = sy.Scene()
    box(scene, 0, 0.5, velocity=(2, 0, 0))
    ground = scene.add(sy.Ground(friction=0.1))
    world = sy.World(scene, worlds=3)
    world[ground].friction = [0.1, 0.2, 0.4]
    world.step(20)
    lost = 2.0 - world.bodies.velocity[:, 0, 0]
    np.testing.assert_allclose(lost, 9.81 / 3 * np.array([0.1, 0.2, 0.4]), rtol=1e-3)


# Limits and refusals


def test_a_full_buffer_is_flagged_and_keeps_the_deepest():
    scene = sy.Scene()
    for i in range(3):
        box(scene, 0, 0.5 + i)
    world = sy.World(
        on_ground(scene), method=sy.Method(sy.Rattle(), sy.ProximalNewton(contacts=11))
    )
    world.step(3)
    assert world.health[0] == 8
    assert world.contacts.count[0] == 11
    assert np.isfinite(world.state[:, 0]).all()


def test_what_cannot_be_is_refused():
    scene = sy.Scene()
    box(scene, 0, 0.5)
    ground = scene.add(sy.Ground())
    with pytest.raises(
        ValueError, match=r"Direct cannot hold a Ground that meets a Body.*ProximalNewton"
    ):
        sy.World(scene, method=sy.Method(sy.Rattle(), sy.Direct()))
    with pytest.raises(ValueError, match="SymplecticEuler does not work with ProximalNewton"):
        sy.World(scene, method=sy.Method(sy.SymplecticEuler(), sy.ProximalNewton()))
    with pytest.raises(ValueError, match="slop is 0"):
        sy.ProximalNewton(slop=0.0)
    with pytest.raises(ValueError, match="contacts is 0"):
        sy.ProximalNewton(contacts=0)
    scene.add(sy.Particle(position=(0, 3, 0)))
    scene.add(sy.RodConstraint(scene.particles[0], anchor=(0, 4, 0), length=1.0))
    with pytest.raises(ValueError, match="ProximalNewton cannot hold a RodConstraint"):
        sy.World(scene)
    bare = sy.Scene()
    bare.add(sy.Body(position=(0, 1, 0), mass=1.0, inertia=(1, 1, 1)))
    bare.add(sy.Ground())
    with pytest.raises(ValueError, match="has 0 parts"):
        sy.World(bare)
    bare.remove(bare.of(sy.Ground)[0])
    with pytest.raises(ValueError, match="keeps no list of contacts"):
        _ = sy.World(bare).contacts
    assert ground.particles is None


# Cards


LONG, THIN, WIDE = 0.5, 0.02, 0.3


def tent(scene, x, y, slope):
    """Two cards at a slope that meet above x and stand at the height y; the height of their top, and the friction [1]
    with the ground that statics asks for: the weight's lever over that of the thrust between the tops.
    """
    for side in (-1, 1):
        angle = side * slope
        c, s = math.cos(angle), math.sin(angle)
        corners = [
            (c * a * THIN - s * b * LONG, s * a * THIN + c * b * LONG)
            for a in (-1, 1)
            for b in (-1, 1)
        ]
        foot = min(corners, key=lambda corner: corner[1])
        tip = max(corners, key=lambda corner: -side * corner[0])
        turn = (math.cos(angle / 2), 0, 0, math.sin(angle / 2))
        box(scene, x - tip[0], y - foot[1], half=(THIN, LONG, WIDE), orientation=turn)
    return y + max(corner[1] for corner in corners) - foot[1], abs(foot[0]) / (tip[1] - foot[1])


@pytest.mark.parametrize("slope", [0.2, 0.3, 0.4, 0.5])
@pytest.mark.parametrize("share", [1.02, 0.98])
def test_two_cards_lean_on_each_other_as_statics_says(slope, share):
    scene = sy.Scene()
    _, least = tent(scene, 0.0, 0.0, slope)
    scene.add(sy.Ground(friction=share * least))
    scene.add(sy.Collisions(friction=0.8))
    if share > 1.0:
        world, moved = settled(scene, 60.0)
        assert moved < 1e-5
        assert np.abs(world.bodies.velocity).max() < 1e-9
    else:
        world = sy.World(scene)
        world.step(600)
        assert world.bodies.position[0, :, 1].max() < 0.5 * LONG


def test_a_house_of_seven_cards_stands():
    scene = sy.Scene()
    for x in (-0.5, 0.5):
        top, _ = tent(scene, x, 0.0, 0.25)
    box(scene, 0, top + THIN, half=(0.75, THIN, WIDE))
    tent(scene, 0.0, top + 2 * THIN, 0.25)
    scene.add(sy.Ground(friction=0.8))
    scene.add(sy.Collisions(friction=0.8))
    world, moved = settled(scene, 60.0)
    assert moved < 1e-5
    assert np.abs(world.bodies.velocity).max() < 1e-9
    assert world.bodies.position[0, :, 1].max() > 2.4 * LONG


# Arches


def voussoirs(count, thickness, wide=0.5):
    """A half circle of mean radius 1 of equal wedges, each two slabs along its joints, on the ground.

    Returns:
        The scene; places of inner and outer ends of the joints (count + 1, 2, 2) and of centres of mass (count, 2).
    """
    scene = sy.Scene()
    half = math.pi / (2 * count)
    inner, outer = 1 - thickness / 2, 1 + thickness / 2
    slab = 0.3 * inner * half
    centres = []
    for i in range(count):
        middle = (2 * i + 1) * half
        parts = []
        for side in (-1, 1):
            along = np.array((math.cos(side * half), math.sin(side * half)))
            across = side * np.array((-along[1], along[0]))
            parts.append(
                sy.Part(
                    shape=sy.Box((thickness / 2, slab, wide)),
                    offset=(*(along - slab * across), 0.0),
                    orientation=(math.cos(side * half / 2), 0, 0, math.sin(side * half / 2)),
                )
            )
        # Both parts weigh the same: the centre of mass is midway.
        centre = np.mean([part.offset[0] for part in parts]) * np.array(
            (math.cos(middle), math.sin(middle))
        )
        turn = (math.cos(middle / 2), 0, 0, math.sin(middle / 2))
        scene.add(sy.Body(position=(*centre, 0.0), orientation=turn, parts=parts))
        centres.append(centre)
    angles = 2 * half * np.arange(count + 1)
    ways = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    return scene, np.stack((inner * ways, outer * ways), axis=1), np.array(centres)


def can_stand(joints, centres, friction):
    """Whether forces at the ends of the joints, within friction, can bear equal blocks: by linear programming."""
    count = len(centres)
    # Unknown are the pushes at both ends of each joint, and the friction along it, on the block behind it.
    balance, load = np.zeros((3 * count, 3 * (count + 1))), np.tile((0.0, 1.0, 0.0), count)
    limits = np.zeros((2 * (count + 1), 3 * (count + 1)))
    for j, ends in enumerate(joints):
        radial = ends[1] - ends[0]
        radial /= np.linalg.norm(radial)
        push = np.array((-radial[1], radial[0]))
        for block, sign in ((j, 1.0), (j - 1, -1.0)):
            if 0 <= block < count:
                for k, (force, place) in enumerate(
                    ((push, ends[0]), (push, ends[1]), (radial, ends[0]))
                ):
                    arm = place - centres[block]
                    column = (*force, arm[0] * force[1] - arm[1] * force[0])
                    balance[3 * block : 3 * block + 3, 3 * j + k] = sign * np.array(column)
        for k, sign in enumerate((1.0, -1.0)):
            limits[2 * j + k, 3 * j : 3 * j + 3] = (-friction, -friction, sign)
    bounds = [(0, None), (0, None), (None, None)] * (count + 1)
    found = linprog(np.zeros(3 * (count + 1)), limits, np.zeros(len(limits)), balance, load, bounds)
    return found.status == 0


@pytest.mark.parametrize("count", [5, 9, 13])
@pytest.mark.parametrize("share", [1.02, 0.98])
def test_an_arch_stands_if_it_is_as_thick_as_statics_asks_for(count, share):
    friction = 0.8
    low, high = 0.01, 0.3
    for _ in range(14):
        middle = 0.5 * (low + high)
        _, joints, centres = voussoirs(count, middle)
        low, high = (low, middle) if can_stand(joints, centres, friction) else (middle, high)
    scene, _, centres = voussoirs(count, share * high)
    on_ground(scene, friction)
    if share > 1.0:
        world, _ = settled(scene, 60.0)
        assert np.abs(world.bodies.position[0, :, :2] - centres).max() < 1e-6
        assert np.abs(world.bodies.velocity).max() < 1e-6
    else:
        world = sy.World(scene)
        world.step(1200)
        assert world.bodies.position[0, count // 2, 1] < 0.5
