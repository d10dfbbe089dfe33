"""Sleep: what is at rest costs nothing, is where it would be awake, and wakes when anything changes."""

import math

import numpy as np
import pytest

import steelyard as sy

DT = 0.01


def world_of(scene, *, sleeps=True, worlds=1, **more):
    more = {"rest_speed": 1e-9, **more}
    solver = sy.ProximalNewton(rest_time=0.5 if sleeps else None, **more)
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), solver, dt=DT))


def stack(count=3, *, friction=0.6, **more):
    scene = sy.Scene(**more)
    for i in range(count):
        scene.add(sy.Body(position=(0, 0.5 + i, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Ground(friction=friction))
    scene.add(sy.Collisions(friction=friction))
    return scene


def test_a_stack_sleeps_where_it_would_stand_awake():
    asleep, awake = world_of(stack(10)), world_of(stack(10), sleeps=False)
    for world in (asleep, awake):
        world.bodies.position[0, :, 0] += 1e-3 * np.arange(10) % 3
        world.step(1000)
    assert asleep.bodies.asleep.all()
    assert not awake.bodies.asleep.any()
    assert not asleep.bodies.velocity.any()
    assert not asleep.bodies.angular_momentum.any()
    np.testing.assert_allclose(asleep.bodies.position, awake.bodies.position, atol=1e-9 * 10)
    np.testing.assert_allclose(asleep.contacts.force, awake.contacts.force, rtol=1e-6, atol=1e-3)
    np.testing.assert_array_equal(asleep.time, awake.time)


def test_what_sleeps_is_still_to_the_bit():
    world = world_of(stack())
    world.step(200)
    assert world.bodies.asleep.all()
    before = world.state.copy()
    world.step(300)
    changed = np.flatnonzero((world.state != before).any(axis=1))
    np.testing.assert_array_equal(changed, [world.row("particles", "time")])


def shoved(world):
    world.bodies.velocity[0, 1] = (2, 0, 0)


def spun(world):
    world.bodies.angular_velocity = [(0, 0, 0), (0, 5, 0), (0, 0, 0)]


def moved(world):
    world.bodies.position[0, 1, 0] += 0.6


def turned(world):
    world.bodies.orientation[0, 2] = (math.cos(0.3), 0, math.sin(0.3), 0)


def struck(world):
    world.apply_impulse(world.scene.bodies[2], (1500.0, 0, 0))


def weighed(world):
    world.gravity = (8.0, -9.81, 0.0)


def lightened(world):
    world.bodies.mass = world.bodies.mass * np.array((1.0, 1.0, 0.5))


def lowered(world):
    ground = next(thing for thing in world.scene.things if isinstance(thing, sy.Ground))
    world[ground].height = -0.5


def removed(world):
    world.remove(world.scene.bodies[0])


def added(world):
    ball = sy.Body(position=(0.2, 4.0, 0), velocity=(0, -4, 0), parts=sy.Sphere(0.3))
    world.add(ball)


@pytest.mark.parametrize(
    "change",
    [shoved, spun, moved, turned, struck, weighed, lightened, lowered, removed, added],
    ids=lambda change: change.__name__,
)
def test_a_change_wakes_and_does_what_it_would_have_done(change):
    asleep, awake = world_of(stack()), world_of(stack(), sleeps=False)
    for world in (asleep, awake):
        world.step(300)
    assert asleep.bodies.asleep.all()
    for world in (asleep, awake):
        change(world)
        world.step(20)
    assert not asleep.bodies.asleep.all() or change is lightened
    np.testing.assert_allclose(asleep.bodies.position, awake.bodies.position, atol=1e-6)
    np.testing.assert_allclose(asleep.bodies.velocity, awake.bodies.velocity, atol=1e-5)
    assert asleep.health[0] == 0


def test_a_force_wakes_its_island_alone():
    scene = sy.Scene()
    boxes = [
        scene.add(sy.Body(position=(3.0 * i, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
        for i in range(3)
    ]
    scene.add(sy.Ground(friction=0.5))
    scene.add(sy.Collisions())
    wrench = scene.add(sy.Wrench(boxes[1]))
    world = world_of(scene)
    world.step(200)
    assert world.bodies.asleep.all()
    world[wrench].force = (9000.0, 0.0, 0.0)
    world.step(10)
    np.testing.assert_array_equal(world.bodies.asleep[0], [True, False, True])
    slide = (9000.0 - 0.5 * 1000 * 9.81) / 1000.0
    assert world.bodies.velocity[0, 1, 0] == pytest.approx(slide * 10 * DT, rel=1e-6)
    # On its way it meets the third, which wakes; the first sleeps on.
    world.step(90)
    np.testing.assert_array_equal(world.bodies.asleep[0], [True, False, False])
    assert world.bodies.position[0, 2, 0] > 6.01


def test_less_friction_lets_a_sleeper_slide():
    slope = math.radians(20)
    scene = sy.Scene(gravity=(9.81 * math.sin(slope), -9.81 * math.cos(slope), 0))
    scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    ground = scene.add(sy.Ground(friction=0.5))
    world = world_of(scene, worlds=3)
    world.step(200)
    assert world.bodies.asleep.all()
    world[ground].friction = (0.5, 0.1, 0.5)
    world.step(50)
    np.testing.assert_array_equal(world.bodies.asleep[:, 0], [True, False, True])
    way = 0.5 * 9.81 * (math.sin(slope) - 0.1 * math.cos(slope)) * 0.5**2
    assert world.bodies.position[1, 0, 0] - world.bodies.position[0, 0, 0] == pytest.approx(
        way, rel=1e-3
    )


def test_a_support_that_is_moved_away_wakes_what_lies_on_it():
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 0, 0), parts=sy.Box((2, 0.1, 2)), inverse_mass=0))
    scene.add(sy.Body(position=(0, 0.6, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Collisions(friction=0.5))
    world = world_of(scene, worlds=2)
    world.step(200)
    assert world.bodies.asleep[:, 1].all()
    world.bodies.position[0, 0] = (50, 0, 0)
    world.step(50)
    np.testing.assert_array_equal(world.bodies.asleep[:, 1], [False, True])
    assert world.bodies.position[0, 1, 1] == pytest.approx(0.6 - 0.5 * 9.81 * 0.25, abs=1e-6)


def test_a_motor_wakes_what_it_moves():
    scene = sy.Scene()
    arm = scene.add(sy.Body(position=(0, 2, 0), parts=sy.Box((0.5, 0.1, 0.1))))
    hinge = scene.add(
        sy.HingeJoint(a=arm, place=(0, 2, 0), drive=sy.Drive(3, strength=1e4, speed=0.0))
    )
    world = world_of(scene)
    world.step(200)
    assert world.bodies.asleep.all()
    world[hinge].speed = 2.0
    world.step(20)
    assert not world.bodies.asleep.any()
    assert world.bodies.angular_velocity[0, 0, 2] == pytest.approx(2.0, abs=1e-6)


def test_a_ragdoll_comes_to_sleep():
    world = world_of(sy.scenes.ragdoll(height=0.2, angular_damping=0.2), rest_speed=1e-3)
    for _ in range(60):
        world.step(100)
        if world.bodies.asleep.all():
            break
    assert world.bodies.asleep.all()
    gap, force = world.joints.gap.copy(), world.joints.force.copy()
    world.step(100)
    np.testing.assert_array_equal(world.joints.gap, gap)
    np.testing.assert_array_equal(world.joints.force, force)
    assert gap.max() < 1e-8
    world.apply_impulse(world.scene.bodies[3], (0, 30.0, 0))
    world.step(5)
    assert not world.bodies.asleep.any()
    assert world.joints.gap.max() < 5e-3


def test_what_only_pauses_does_not_sleep():
    """A pendulum at its turning point, a ball at the top of its flight."""
    scene = sy.Scene()
    arm = scene.add(sy.Body(position=(0.5, 5, 0), parts=sy.Box((0.5, 0.05, 0.05))))
    scene.add(sy.HingeJoint(a=arm, place=(0, 5, 0)))
    scene.add(sy.Body(position=(5, 3, 0), parts=sy.Sphere(0.2)))
    scene.add(sy.Ground(restitution=1.0))
    world = world_of(scene)
    energy = world.energy[0]
    for _ in range(100):
        world.step(10)
        assert not world.bodies.asleep.any()
    assert world.energy[0] == pytest.approx(energy, rel=1e-2)


def test_worlds_sleep_and_wake_alike_in_any_batch():
    rng = np.random.default_rng(4)
    speeds = rng.uniform(-3, 3, (11, 4, 3)) * (rng.uniform(size=(11, 1, 1)) < 0.6)
    batch = world_of(stack(4), worlds=11)
    singles = [world_of(stack(4)) for _ in range(11)]
    for _ in range(3):
        batch.step(130)
        batch.bodies.velocity[:] += speeds
        for world, speed in zip(singles, speeds, strict=True):
            world.step(130)
            world.bodies.velocity[0] += speed
    batch.step(100)
    for i, world in enumerate(singles):
        for _ in range(10):
            world.step(10)
        np.testing.assert_array_equal(world.bodies.position[0], batch.bodies.position[i])
        np.testing.assert_array_equal(world.bodies.asleep[0], batch.bodies.asleep[i])


def test_snapshots_keep_what_sleeps():
    world = world_of(stack())
    world.step(200)
    kept = world.snapshot()
    world.bodies.velocity[0, 2] = (1, 0, 0)
    world.step(30)
    after = world.bodies.position.copy()
    world.restore(kept)
    assert world.bodies.asleep.all()
    world.step(7)
    assert world.bodies.asleep.all()
    world.bodies.velocity[0, 2] = (1, 0, 0)
    world.step(30)
    np.testing.assert_array_equal(world.bodies.position, after)
    world.reset()
    assert not world.bodies.asleep.any()


def test_a_buffer_shared_with_sleepers_is_not_overrun():
    scene = sy.Scene()
    for i in range(4):
        scene.add(sy.Body(position=(2.0 * i, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Ground(friction=0.5))
    world = world_of(scene, contacts=16)
    world.step(200)
    assert world.bodies.asleep.all()
    assert world.contacts.count[0] == 16
    world.bodies.velocity[0, 1] = (0, 0, 1)
    world.step(3)
    assert world.contacts.count[0] == 16
    assert world.health[0] == 0
    load = [world.contacts.force_on(body)[0, 1] for body in world.scene.bodies]
    np.testing.assert_allclose(load, 9810.0, rtol=1e-6)


@pytest.mark.parametrize("given", [{"rest_speed": 0.0}, {"rest_speed": -1.0}, {"rest_time": -0.1}])
def test_settings_that_cannot_be_are_refused(given):
    with pytest.raises(ValueError, match=next(iter(given))):
        sy.ProximalNewton(**given)
