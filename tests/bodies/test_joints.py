"""Joints: what they hold, what they leave free, what drives that, what they bear, and where methods fail on them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import steelyard as sy
from steelyard.scene.shapes import rotation_matrix

G = 9.81
CLOSED = 1e-9
QUARTER = (math.sqrt(0.5), 0.0, 0.0, -math.sqrt(0.5))


def world_of(scene: sy.Scene, dt: float = 1 / 60, worlds: int = 1) -> sy.World:
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), sy.ProximalNewton(), dt=dt))


def bar(scene: sy.Scene, x: float, half: float = 1.0, thick: float = 0.1, **more: Any) -> sy.Body:
    return scene.add(sy.Body(position=(x, 0, 0), parts=sy.Box((half, thick, thick)), **more))


def pendulum(**more: Any) -> tuple[sy.Scene, Any]:
    """A level bar of 2 m that hangs by its end from the world."""
    scene = sy.Scene()
    body = bar(scene, 1.0)
    return scene, scene.add(sy.HingeJoint(a=body, **more))


def tumbling(make: Any, **more: Any) -> sy.Scene:
    """Two bodies joined at one's end, tumbling free of gravity at speeds that fit any joint: those of one body."""
    scene = sy.Scene(gravity=(0, 0, 0))
    spin = np.array((0.7, 1.1, -0.4))
    a, b = (
        bar(
            scene,
            x,
            0.5,
            0.15,
            velocity=tuple(np.cross(spin, (x, 0, 0))),
            angular_velocity=tuple(spin),
        )
        for x in (-0.5, 0.5)
    )
    scene.add(make(a=a, b=b, **more))
    return scene


def chain(links: int, ratio: float) -> sy.Scene:
    """Level links of half a metre that fall, held at one end, with a ball of so many times their mass at the other."""
    scene = sy.Scene()
    held: sy.Body | None = None
    for i in range(links):
        link = scene.add(
            sy.Body(
                position=(0.5 * i + 0.25, 0, 0), orientation=QUARTER, parts=sy.Capsule(0.05, 0.2)
            )
        )
        scene.add(sy.BallJoint(a=link, b=held, place=(0.5 * i, 0, 0)))
        held = link
    assert held is not None
    end = scene.add(
        sy.Body(position=(0.5 * links + 0.3, 0, 0), parts=sy.Sphere(0.3), mass=ratio * held.mass)
    )
    scene.add(sy.BallJoint(a=end, b=held, place=(0.5 * links, 0, 0)))
    return scene


JOINTS = {
    "ball": (sy.BallJoint, {}),
    "fixed": (sy.FixedJoint, {}),
    "hinge": (sy.HingeJoint, {"axis": (0, 1, 0)}),
    "slider": (sy.SliderJoint, {"axis": (0, 0, 1)}),
    "wheel": (sy.WheelJoint, {"axis": (0, 0, 1), "up": (0, 1, 0)}),
}


# What all joints have in common


@pytest.mark.parametrize("name", JOINTS)
def test_joined_bodies_keep_momenta_and_stay_joined(name: str) -> None:
    make, more = JOINTS[name]
    world = world_of(tumbling(make, **more))
    linear, angular, energy = (
        world.momentum.copy(), world.angular_momentum.copy(), float(world.energy[0]),
    )  # fmt: skip
    world.step(240)
    state = world.joints
    assert world.health[0] == 0
    assert state.gap[0, 0] < CLOSED and state.twist[0, 0] < CLOSED
    np.testing.assert_allclose(world.momentum, linear, atol=1e-10)
    np.testing.assert_allclose(world.angular_momentum, angular, rtol=1e-9, atol=1e-6)
    if name != "wheel":  # whose suspension is damped
        assert float(world.energy[0]) == pytest.approx(energy, rel=2e-3)
    assert float(world.energy[0]) < (1.0 + 2e-3) * energy


def test_bodies_fixed_to_each_other_move_as_one() -> None:
    """Against the same shape as a single body: order 2."""
    errors = []
    for dt in (1 / 60, 1 / 120):
        world = world_of(tumbling(sy.FixedJoint), dt)
        world.step(round(2 / dt))
        whole = sy.Scene(gravity=(0, 0, 0))
        whole.add(
            sy.Body(
                position=(0, 0, 0),
                angular_velocity=(0.7, 1.1, -0.4),
                parts=sy.Box((1.0, 0.15, 0.15)),
            )
        )
        one = world_of(whole, dt)
        one.step(round(2 / dt))
        end = rotation_matrix(one.bodies.orientation[0, 0]) @ (0.5, 0, 0)
        errors.append(np.abs(world.bodies.position[0, 1] - end).max())
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.parametrize("name", JOINTS)
def test_worlds_side_by_side_are_those_alone_to_the_bit(name: str) -> None:
    make, more = JOINTS[name]
    scene = tumbling(make, **more)
    many, one = world_of(scene, worlds=11), world_of(scene)
    many.bodies.velocity[4, 0] += (0.1, 0.2, 0.3)
    one.bodies.velocity[0, 0] += (0.1, 0.2, 0.3)
    many.step(50)
    one.step(50)
    np.testing.assert_array_equal(many.bodies.position[4], one.bodies.position[0])
    np.testing.assert_array_equal(many.bodies.orientation[4], one.bodies.orientation[0])
    assert (many.bodies.position[3] == many.bodies.position[10]).all()


@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_breaks_at_its_force_and_not_below(name: str) -> None:
    make, more = JOINTS[name]
    for share, breaks in ((1.02, False), (0.98, True)):
        scene = sy.Scene()
        body = scene.add(sy.Body(position=(0, -0.5, 0), parts=sy.Box((0.2, 0.5, 0.2)), mass=2.0))
        if name == "wheel":
            more = {**more, "up": (1, 0, 0)}
        joint = scene.add(make(a=body, break_force=share * 2.0 * G, **more))
        world = world_of(scene)
        world.step(30)
        assert world.joints.broken[0, 0] == breaks
        if breaks:
            assert world.bodies.velocity[0, 0, 1] == pytest.approx(-G * 29 / 60, rel=0.05)
            world[joint].broken = 0.0
            world[joint].break_force = math.inf
            world.step(5)
            assert not world.joints.broken[0, 0]
        else:
            np.testing.assert_allclose(world.joints.force[0, 0], (0, 2.0 * G, 0), atol=1e-6)
            assert world.bodies.position[0, 0, 1] == pytest.approx(-0.5, abs=1e-9)


# Pendulums and chains


def test_a_hinge_swings_as_the_elliptic_pendulum() -> None:
    """Level start: sin(theta/2) = k sn(K - w t), order 2."""
    scene, _ = pendulum()
    body = scene.bodies[0]
    w = math.sqrt(body.mass * G / (body.inertia[2, 2] + body.mass))
    k2 = 0.5
    sn = ellipj(float(ellipk(k2)) - w * 1.5, k2)[0]
    exact = 2.0 * math.asin(math.sqrt(k2) * sn) - math.pi / 2
    errors = []
    for dt in (1 / 60, 1 / 240):
        world = world_of(pendulum()[0], dt)
        world.step(round(1.5 / dt))
        errors.append(abs(world.joints.coordinate[0, 0] - exact))
        assert world.joints.gap[0, 0] < CLOSED
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


def test_a_double_pendulum_follows_its_equations() -> None:
    """Two bars, from level, for a second; minimal coordinates by DOP853."""
    scene = sy.Scene()
    first, second = bar(scene, 1.0, thick=0.05), bar(scene, 3.0, thick=0.05)
    scene.add(sy.HingeJoint(a=first))
    scene.add(sy.BallJoint(a=second, b=first, place=(2, 0, 0)))
    m, inertia = first.mass, float(first.inertia[2, 2])

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        a, b, u, v = y
        c, s = math.cos(a - b), math.sin(a - b)
        matrix = np.array([[inertia + m + 4 * m, 2 * m * c], [2 * m * c, inertia + m]])
        force = (
            -2 * m * s * v**2 - 3 * m * G * math.cos(a), 2 * m * s * u**2 - m * G * math.cos(b),
        )  # fmt: skip
        return np.array([u, v, *np.linalg.solve(matrix, force)])

    a, b = solve_ivp(rates, (0, 1), (0, 0, 0, 0), method="DOP853", rtol=1e-12, atol=1e-12).y[:2, -1]
    tip = np.array([2 * math.cos(a) + math.cos(b), 2 * math.sin(a) + math.sin(b), 0.0])
    errors = []
    for dt in (1 / 60, 1 / 240):
        world = world_of(scene, dt)
        world.step(round(1 / dt))
        errors.append(np.abs(world.bodies.position[0, 1] - tip).max())
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)


@pytest.mark.parametrize("ratio", [1.0, 1000.0])
def test_a_chain_of_forty_holds_a_heavy_end_at_sixty_hertz(ratio: float) -> None:
    world = world_of(chain(40, ratio))
    start = world.energy[0]
    gap = 0.0
    for _ in range(60):
        world.step(10)
        gap = max(gap, world.joints.gap[0].max())
        assert world.energy[0] < start + 1e-6 * abs(start) + 1e-3
    assert gap < CLOSED
    assert world.health[0] == 0


def test_a_hanging_chain_bears_the_weight_below_each_joint() -> None:
    scene = sy.Scene()
    held = None
    for i in range(6):
        link = scene.add(sy.Body(position=(0, -0.5 * i - 0.25, 0), parts=sy.Capsule(0.05, 0.2)))
        scene.add(sy.BallJoint(a=link, b=held, place=(0, -0.5 * i, 0)))
        held = link
    world = world_of(scene)
    world.step(60)
    weight = world.bodies.mass_or_zero[0] * G
    below = np.cumsum(weight[::-1])[::-1]
    np.testing.assert_allclose(world.joints.force[0, :, 1], below, rtol=1e-7)
    assert np.abs(world.joints.force[0][:, [0, 2]]).max() < 1e-6


def test_a_cantilever_bears_its_moment() -> None:
    scene = sy.Scene()
    body = bar(scene, 1.0)
    scene.add(sy.FixedJoint(a=body))
    world = world_of(scene)
    world.step(60)
    np.testing.assert_allclose(world.joints.force[0, 0], (0, body.mass * G, 0), atol=1e-5)
    np.testing.assert_allclose(world.joints.torque[0, 0], (0, 0, body.mass * G), atol=1e-5)
    np.testing.assert_allclose(world.bodies.position[0, 0], (1, 0, 0), atol=1e-9)


# Ragdolls


@pytest.mark.parametrize(
    ("dt", "seed"),
    [
        pytest.param(dt, seed, marks=[pytest.mark.slow] * (seed > most))
        for dt, most in ((0.01, 0), (1 / 60, 1))
        for seed in range(6)
    ],
)
def test_a_ragdoll_holds_together_while_it_is_thrown_about(dt: float, seed: int) -> None:
    """Every two seconds every part gets a push of its own, up to a dozen m/s: the joints must take it."""
    rng = np.random.default_rng(seed)
    world = world_of(sy.scenes.ragdoll(), dt)
    gap = 0.0
    for i in range(round(8 / dt)):
        if i % round(2 / dt) == 0:
            world.bodies.velocity[:] += 4.0 * rng.normal(size=3) + (0, 4, 0)
            world.bodies.angular_velocity = world.bodies.angular_velocity + 4.0 * rng.normal(
                size=(12, 3)
            )
            start = np.inf
        world.step()
        energy = float(world.energy[0])
        assert energy < 1.01 * start + 1.0
        start = energy
        if i % 10 == 0:
            gap = max(gap, float(world.joints.gap.max()))
    assert gap < 5e-3
    assert world.health[0] == 0
    assert np.abs(world.bodies.position[0, :, 1]).max() < 3.0


def test_a_ragdoll_that_falls_comes_to_rest() -> None:
    """Damped, since joints have no friction: undamped, a head may hang and swing for ever."""
    world = world_of(sy.scenes.ragdoll(height=0.5, angular_damping=0.3), 0.01)
    world.step(2000)
    assert np.abs(world.bodies.velocity).max() < 1e-3
    assert world.bodies.position[0, :, 1].max() < 0.5
    assert world.health[0] == 0


# Loops


def test_a_slider_crank_turns_through_its_dead_centres() -> None:
    """A crank of .5 m, a rod of 1.5 m and a block on a rail: x = r cos + sqrt(l^2 - r^2 sin^2)."""
    scene = sy.Scene(gravity=(0, 0, 0))
    crank = scene.add(sy.Body(position=(0.25, 0, 0), parts=sy.Box((0.25, 0.03, 0.03))))
    rod = scene.add(sy.Body(position=(1.25, 0, 0), parts=sy.Box((0.75, 0.03, 0.03))))
    block = scene.add(sy.Body(position=(2.0, 0, 0), parts=sy.Box((0.1, 0.1, 0.1))))
    motor = sy.Drive(3, speed=4.0, strength=1e4)
    scene.add(sy.HingeJoint(a=crank, drive=motor))
    scene.add(sy.HingeJoint(a=rod, b=crank, place=(0.5, 0, 0)))
    scene.add(sy.HingeJoint(a=block, b=rod, place=(2, 0, 0)))
    scene.add(sy.SliderJoint(a=block, place=(2, 0, 0)))
    world = world_of(scene)
    for _ in range(200):
        world.step()
        state = world.joints
        angle = state.coordinate[0, 0]
        x = 0.5 * math.cos(angle) + math.sqrt(1.5**2 - (0.5 * math.sin(angle)) ** 2)
        assert world.bodies.position[0, 2, 0] == pytest.approx(x, abs=1e-7)
        assert state.gap.max() < 1e-8
    assert world.joints.rate[0, 0] == pytest.approx(4.0, abs=1e-3)
    assert world.health[0] == 0


# Drives


def test_a_motor_pushes_with_its_strength_and_then_holds_its_speed() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(sy.Body(position=(0, 0, 0), parts=sy.Sphere(0.5), mass=2.0))
    joint = scene.add(sy.HingeJoint(a=body, drive=sy.Drive(3, speed=3.0, strength=0.4)))
    world = world_of(scene)
    inertia = body.inertia[2, 2]
    world.step(30)
    assert world.joints.rate[0, 0] == pytest.approx(0.4 / inertia * 0.5, rel=1e-9)
    np.testing.assert_allclose(world.joints.torque[0, 0], (0, 0, 0.4), atol=1e-9)
    world.step(120)
    assert world.joints.rate[0, 0] == pytest.approx(3.0, abs=1e-9)
    world[joint].speed = -1.0
    world.step(240)
    assert world.joints.rate[0, 0] == pytest.approx(-1.0, abs=1e-9)


def test_motors_differ_from_world_to_world() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(sy.Body(position=(0, 0, 0), parts=sy.Sphere(0.5)))
    joint = scene.add(sy.SliderJoint(a=body, drive=sy.Drive(0, strength=1e6)))
    world = world_of(scene, worlds=3)
    world[joint].speed = [-1.0, 0.0, 2.0]
    world.step(60)
    np.testing.assert_allclose(world.joints.rate[:, 0], (-1, 0, 2), atol=1e-9)
    np.testing.assert_allclose(world.joints.coordinate[:, 0], (-1, 0, 2), atol=0.02)


@pytest.mark.parametrize("kind", ["hinge", "slider"])
def test_limits_stop_without_passing(kind: str) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(
        sy.Body(
            position=(0, 0, 0), parts=sy.Sphere(0.5), velocity=(2, 0, 0), angular_velocity=(0, 0, 2)
        )
    )
    if kind == "hinge":
        body.velocity = (0.0, 0.0, 0.0)
        scene.add(sy.HingeJoint(a=body, drive=sy.Drive(3, low=-0.3, high=0.7)))
    else:
        body.angular_velocity = (0.0, 0.0, 0.0)
        scene.add(sy.SliderJoint(a=body, drive=sy.Drive(0, low=-0.3, high=0.7)))
    world = world_of(scene)
    for _ in range(60):
        world.step()
        assert -0.3 - 1e-8 < world.joints.coordinate[0, 0] < 0.7 + 1e-8
    assert world.joints.coordinate[0, 0] == pytest.approx(0.7, abs=1e-8)
    assert world.joints.rate[0, 0] == pytest.approx(0.0, abs=1e-8)
    assert world.health[0] == 0


def test_a_pendulum_rests_on_its_limit() -> None:
    scene, _ = pendulum(drive=sy.Drive(3, low=-0.5, high=0.5))
    world = world_of(scene)
    world.step(300)
    assert world.joints.coordinate[0, 0] == pytest.approx(-0.5, abs=1e-8)
    mass = world.bodies.mass_or_zero[0, 0]
    assert world.joints.torque[0, 0, 2] == pytest.approx(mass * G * math.cos(0.5), rel=1e-6)


def test_a_spring_swings_at_its_frequency_and_any_stiffness_is_stable() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(
        sy.Body(position=(0, 0, 0), parts=sy.Sphere(0.5), mass=2.0, velocity=(1, 0, 0))
    )
    joint = scene.add(sy.SliderJoint(a=body, drive=sy.Drive(0, stiffness=50.0)))
    world = world_of(scene, 1e-4)
    world.step(5000)
    assert world.joints.coordinate[0, 0] == pytest.approx(math.sin(5.0 * 0.5) / 5.0, abs=1e-4)
    energy = world.energy[0]
    assert energy == pytest.approx(1.0, rel=2e-3)
    stiff = world_of(scene)
    stiff[joint].stiffness = 1e12
    stiff.step(60)
    assert abs(stiff.joints.coordinate[0, 0]) < 1e-6
    assert stiff.energy[0] <= 1.0 + 1e-6


def test_a_wheel_stands_on_its_suspension_and_drives_off() -> None:
    scene = sy.Scene()
    frame = scene.add(sy.Body(position=(0, 1.0, 0), parts=sy.Box((1.0, 0.1, 0.4)), mass=100.0))
    wheels = []
    for x in (-0.8, 0.8):
        for z in (-0.6, 0.6):
            wheel = scene.add(sy.Body(position=(x, 0.5, z), parts=sy.Sphere(0.5), mass=5.0))
            wheels.append(
                scene.add(
                    sy.WheelJoint(
                        a=wheel, b=frame, place=(x, 0.5, z),
                        suspension=sy.Drive(1, stiffness=5e3, damping=500.0, low=-0.3, high=0.3),
                    )
                )
            )  # fmt: skip
    scene.add(sy.Ground(friction=1.0))
    world = world_of(scene)
    world.step(300)
    state = world.joints
    sag = [k for k, (_, drive) in enumerate(state.drives) if drive.coordinate == 1]
    np.testing.assert_allclose(state.coordinate[0, sag], 100.0 * G / 4 / 5e3, rtol=1e-3)
    for wheel in wheels:
        world[wheel].strength = 20.0
        world[wheel].speed = -4.0
    world.step(300)
    assert world.bodies.velocity[0, 0, 0] == pytest.approx(2.0, rel=1e-3)
    assert world.health[0] == 0


def test_distance_joints_hold_points_of_bodies_and_particles() -> None:
    scene = sy.Scene()
    body = bar(scene, 0.0)
    hook = scene.add(sy.Particle(position=(-1, 1, 0), inverse_mass=0.0))
    load = scene.add(sy.Particle(position=(1, -1.5, 0), mass=3.0))
    scene.add(sy.DistanceJoint(hook, body.at((-1, 0, 0))))
    scene.add(sy.DistanceJoint(body.at((1, 0, 0)), load))
    world = world_of(scene)
    start = world.energy[0]
    for _ in range(120):
        world.step()
        assert world.joints.gap.max() < 1e-8
    assert world.energy[0] < start + 1e-3 * abs(start)
    assert world.health[0] == 0


def test_a_distance_with_a_drive_is_a_rope() -> None:
    """Slack until its length, and then no further."""
    scene = sy.Scene()
    hook = scene.add(sy.Particle(position=(0, 0, 0), inverse_mass=0.0))
    ball = scene.add(sy.Body(position=(0, -1, 0), parts=sy.Sphere(0.1), mass=2.0))
    scene.add(sy.DistanceJoint(hook, ball.at((0, 0, 0)), drive=sy.Drive(6, high=2.0)))
    world = world_of(scene)
    world.step(20)
    assert world.bodies.position[0, 0, 1] == pytest.approx(-1 - 0.5 * G / 9, abs=1e-9)
    world.step(100)
    assert world.joints.coordinate[0, 0] == pytest.approx(2.0, abs=1e-8)
    assert world.joints.force[0, 0, 1] == pytest.approx(-2.0 * G, rel=1e-6)


# Bad input


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda a, b: sy.BallJoint(a=a, b=a), "same body"),
        (lambda a, b: sy.BallJoint(a=3), "a is 3"),
        (lambda a, b: sy.BallJoint(a=a, b=b, break_force=0.0), "break_force is 0.0; .*greater than 0"),
        (lambda a, b: sy.BallJoint(a=a, place=(0, 0, math.nan)), "place"),
        (lambda a, b: sy.HingeJoint(a=a, axis=(0, 0, 0)), "axis"),
        (lambda a, b: sy.HingeJoint(a=a, drive=sy.Drive(0)), "coordinate 0; it must be 3"),
        (lambda a, b: sy.SliderJoint(a=a, drive=sy.Drive(3)), "coordinate 3; it must be 0"),
        (lambda a, b: sy.WheelJoint(a=a, b=b, axis=(0, 0, 1), up=(0, 1, 1)), "right angles"),
        (lambda a, b: sy.DistanceJoint(a.at((0, 0, 0)), b), "point of a body"),
        (lambda a, b: sy.DistanceJoint(a.at((1, 0, 0)), b.at((-1, 0, 0))), "distance 0.0"),
        (lambda a, b: sy.Drive(3, low=1.0, high=-1.0), "low is 1.0 and high is -1.0"),
        (lambda a, b: sy.Drive(3, strength=-1.0), "strength is -1.0"),
        (lambda a, b: sy.Drive(3, low=math.nan), "low is nan"),
        (lambda a, b: sy.Drive(4), "coordinate is 4"),
    ],
)  # fmt: skip
def test_bad_joints_are_refused(make: Any, message: str) -> None:
    scene = sy.Scene()
    a, b = bar(scene, 0.0), bar(scene, 2.0)
    with pytest.raises((ValueError, TypeError), match=message):
        make(a, b)


def test_bodies_that_cannot_move_are_not_joined() -> None:
    scene = sy.Scene()
    wall = scene.add(sy.Body(position=(0, 0, 0), parts=sy.Box((1, 1, 1)), inverse_mass=0.0))
    with pytest.raises(ValueError, match="neither body can move"):
        sy.BallJoint(a=wall)


def test_bad_assignments_in_a_world_are_refused() -> None:
    scene, joint = pendulum()
    world = world_of(scene)
    with pytest.raises(ValueError, match=r"strength is -1\.0"):
        world[joint].strength = -1.0
    with pytest.raises(ValueError, match="high is nan"):
        world[joint].high = math.nan
    world[joint].high = 0.3
    with pytest.raises(AttributeError, match="has no 'stifness'"):
        world[joint].stifness = 1.0


def test_methods_without_joints_say_so() -> None:
    scene, _ = pendulum()
    for method in (sy.Method(sy.RungeKutta4()), sy.Method(sy.Rattle(), sy.Direct())):
        with pytest.raises(ValueError, match="cannot hold a HingeJoint"):
            sy.World(scene, method=method)
    assert isinstance(sy.World(scene).method.solver, sy.ProximalNewton)


def test_joined_bodies_do_not_touch_unless_asked_to() -> None:
    for collide in (False, True):
        scene = sy.Scene(gravity=(0, 0, 0))
        a, b = bar(scene, 0.0), bar(scene, 1.5)
        scene.add(sy.BallJoint(a=a, b=b, place=(0.75, 0, 0), collide=collide))
        scene.add(sy.Collisions())
        world = world_of(scene)
        assert world.model.touching == collide
