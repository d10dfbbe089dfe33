"""Friction of rolling and spinning against closed forms, by every solver of bodies."""

import math

import numpy as np
import pytest

import steelyard as sy

RADIUS, LENGTH, GRAVITY = 0.5, 0.02, 9.81
SOLVERS = {
    "proximal Newton": sy.ProximalNewton(),
    "Gauss-Seidel": sy.GaussSeidel(30),
    "worst first": sy.WorstFirst(),
    "soft step": sy.SoftStep(substeps=4),
}


def ball_world(
    solver, *, tilt=0.0, dt=1 / 60, worlds=1, speed=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), **ground
):
    """A ball on a ground whose world is tilted."""
    gravity = (GRAVITY * math.sin(tilt), -GRAVITY * math.cos(tilt), 0.0)
    scene = sy.Scene(gravity=gravity)
    scene.add(
        sy.Body(position=(0, RADIUS, 0), velocity=speed, angular_velocity=spin, parts=sy.Sphere(RADIUS))
    )  # fmt: skip
    scene.add(sy.Ground(friction=0.5, **ground))
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), solver, dt=dt))


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_a_ball_that_rolls_is_braked_and_stops(solver):
    """a = 5/7 l g/r against the motion, until it stands."""
    loss = 5 / 7 * LENGTH * GRAVITY / RADIUS
    speed = np.array([0.8, 0.0, 0.6]) * 0.5
    spin = np.array([0.6, 0.0, -0.8]) * 0.5 / RADIUS
    world = ball_world(solver, speed=speed, spin=spin, rolling_friction=LENGTH)
    # A spring that gives way gives more.
    close = 1e-2 if isinstance(solver, sy.SoftStep) else 1e-9
    world.step(60)
    left = 0.5 - loss
    np.testing.assert_allclose(world.bodies.velocity[0, 0], left * speed / 0.5, atol=close)
    np.testing.assert_allclose(
        world.bodies.angular_velocity[0, 0], left * spin / 0.5, atol=3 * close
    )
    force = np.linalg.norm(world.contacts.force[0, 0])
    assert np.linalg.norm(world.contacts.torque[0, 0]) == pytest.approx(LENGTH * force, rel=3e-2)
    world.step(120)
    path = 0.5**2 / (2 * loss)
    np.testing.assert_allclose(np.linalg.norm(world.bodies.position[0, 0, [0, 2]]), path, rtol=0.02)
    assert np.abs(world.bodies.velocity).max() < (1e-6 if close > 1e-6 else 1e-8)
    world.step(60)
    assert world.bodies.asleep.all() or close > 1e-6


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_a_ball_that_spins_is_braked_and_stops(solver):
    """w' = -5/2 l g/r^2 about the vertical."""
    loss = 2.5 * LENGTH * GRAVITY / RADIUS**2
    world = ball_world(solver, spin=(0, 3.0, 0), spinning_friction=LENGTH)
    world.step(60)
    assert world.bodies.angular_velocity[0, 0, 1] == pytest.approx(3.0 - loss, abs=1e-2)
    world.step(60)
    assert np.abs(world.bodies.angular_velocity).max() < 1e-6
    assert world.health[0] == 0


def test_a_ball_stays_on_a_slope_up_to_the_ratio_of_length_and_radius():
    """It rolls beyond tan a = l/r, with 5/7 g (sin a - l/r cos a)."""
    limit = math.atan(LENGTH / RADIUS)
    held = ball_world(sy.ProximalNewton(), tilt=0.999 * limit, rolling_friction=LENGTH)
    held.step(600)
    assert np.abs(held.bodies.velocity).max() < 1e-8
    assert np.abs(held.bodies.position[0, 0, 0]) < 1e-8
    tilt = 1.001 * limit
    rolls = ball_world(sy.ProximalNewton(), tilt=tilt, rolling_friction=LENGTH)
    rolls.step(600)
    rate = 5 / 7 * GRAVITY * (math.sin(tilt) - LENGTH / RADIUS * math.cos(tilt))
    assert rolls.bodies.velocity[0, 0, 0] == pytest.approx(10 * rate, rel=1e-2)


def test_what_is_not_given_is_not_there():
    world = ball_world(sy.ProximalNewton(), speed=(1.0, 0, 0), spin=(0, 2.0, -2.0))
    rows = len(world.model.start)
    world.step(120)
    assert world.bodies.velocity[0, 0, 0] == pytest.approx(1.0, abs=1e-12)
    assert world.bodies.angular_velocity[0, 0, 1] == pytest.approx(2.0, abs=1e-12)
    assert not world.contacts.torque.any()
    braked = ball_world(sy.ProximalNewton(), rolling_friction=0.0)
    assert len(braked.model.start) > rows
    with pytest.raises(AttributeError):
        world[world.scene.of(sy.Ground)[0]].rolling_friction = 0.1


def test_worlds_have_their_own_and_do_not_depend_on_their_neighbours():
    lengths = np.linspace(0.0, 0.05, 11)
    world = ball_world(
        sy.ProximalNewton(), worlds=11, speed=(1.0, 0, 0), spin=(0, 2.0, -2.0), rolling_friction=0.0
    )
    (ground,) = world.scene.of(sy.Ground)
    world[ground].rolling_friction = lengths
    world.step(60)
    np.testing.assert_allclose(
        world.bodies.velocity[:, 0, 0],
        np.maximum(1.0 - 5 / 7 * lengths * GRAVITY / RADIUS, 0),
        atol=1e-9,
    )
    for k in (0, 3, 10):
        alone = ball_world(
            sy.ProximalNewton(), speed=(1.0, 0, 0), spin=(0, 2.0, -2.0), rolling_friction=lengths[k]
        )
        alone.step(60)
        np.testing.assert_array_equal(alone.bodies.position[0], world.bodies.position[k])
        np.testing.assert_array_equal(alone.bodies.orientation[0], world.bodies.orientation[k])


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_two_bodies_brake_each_other_alike(solver):
    """Without gravity: momenta stay, and their energy only falls."""
    rng = np.random.default_rng(4)
    scene = sy.Scene(gravity=(0, 0, 0))
    for i in range(6):
        place = np.array([i % 2, i // 2 % 2, i // 4]) * 1.1
        scene.add(
            sy.Body(
                position=place, velocity=-place, angular_velocity=4 * rng.normal(size=3),
                parts=sy.Sphere(0.5) if i % 2 else sy.Box((0.4, 0.45, 0.5)),
            )
        )  # fmt: skip
    scene.add(sy.Collisions(friction=0.5, rolling_friction=0.05, spinning_friction=0.05))
    solver = type(solver)(**{**vars(solver), "slop": 1.0})
    world = sy.World(scene, method=sy.Method(sy.Rattle(), solver))
    linear, angular = world.momentum.copy(), world.angular_momentum.copy()
    energy = [world.energy[0]]
    turned = 0.0
    for _ in range(60):
        world.step()
        energy.append(world.energy[0])
        turned = max(turned, np.abs(world.contacts.torque).max())
    size = np.abs(angular).max() + 1000.0
    np.testing.assert_allclose(world.momentum, linear, atol=1e-11 * size)
    np.testing.assert_allclose(world.angular_momentum, angular, atol=1e-10 * size)
    assert np.diff(energy).max() <= 1e-9 * energy[0]
    assert turned > 1.0


def test_balls_that_fall_in_a_heap_come_to_rest():
    """Without friction of rolling they would roll away for good."""
    rng = np.random.default_rng(0)
    scene = sy.Scene()
    for i in range(12):
        x, z = rng.uniform(-0.5, 0.5, 2)
        scene.add(
            sy.Body(position=(x, 0.6 + 0.9 * i, z), parts=sy.Sphere(float(rng.uniform(0.2, 0.4))))
        )
    scene.add(sy.Ground(friction=0.6, rolling_friction=0.02, spinning_friction=0.01))
    scene.add(sy.Collisions(friction=0.6, rolling_friction=0.02, spinning_friction=0.01))
    world = sy.World(scene)
    energy = world.energy[0]
    for _ in range(60):
        world.step(20)
        assert world.energy[0] <= energy + 1e-6
        energy = world.energy[0]
    assert world.bodies.asleep.all()
    assert np.abs(world.bodies.position).max() < 20.0
    assert world.health[0] == 0


@pytest.mark.parametrize("name", ["rolling_friction", "spinning_friction"])
@pytest.mark.parametrize("kind", [sy.Ground, sy.Collisions])
def test_lengths_below_0_are_refused(kind, name):
    with pytest.raises(ValueError, match=f"{name} is -0.1"):
        kind(**{name: -0.1})
