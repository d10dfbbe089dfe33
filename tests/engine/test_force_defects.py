"""Signs and sizes of forces, and one test for every formula that the source prints wrongly."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy

INTEGRATORS = [sy.ExplicitEuler(), sy.SymplecticEuler(), sy.Rattle()]
every_integrator = pytest.mark.parametrize(
    "integrator", INTEGRATORS, ids=lambda integrator: type(integrator).__name__
)

# Signs


def _along(build: Callable[[sy.Particle], Any], x: float, *, velocity: float = 0.0) -> float:
    """Force [N] along x on a particle of 2 kg at (x, 0, 0)."""
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(x, 0, 0), velocity=(velocity, 0, 0), mass=2.0))
    scene.add(build(p))
    world = sy.World(scene, method=sy.Method(sy.ExplicitEuler(), dt=2.0**-20))
    world.step(1)
    return 2.0 * float(world.particles.velocity[0, 0, 0] - velocity) * 2.0**20


def _pair(
    kind: type, distance: float, stiffness: float = 10.0, rest: float = 1.0
) -> tuple[float, float]:
    """Forces [N] along x on a at 0 and on b at ``distance``."""
    scene = sy.Scene(gravity=(0, 0, 0))
    a = scene.add(sy.Particle(position=(0, 0, 0)))
    b = scene.add(sy.Particle(position=(distance, 0, 0)))
    scene.add(kind(a, b, stiffness, rest))
    world = sy.World(scene, method=sy.Method(sy.ExplicitEuler(), dt=2.0**-10))
    world.step(1)
    on_a, on_b = world.particles.velocity[0, :, 0] * 2.0**10
    return float(on_a), float(on_b)


@pytest.mark.parametrize("kind", [sy.Spring, sy.Bungee])
def test_a_stretched_spring_pulls_its_ends_together(kind: type) -> None:
    assert _pair(kind, 1.5) == pytest.approx((5.0, -5.0), rel=1e-12)


def test_a_compressed_spring_pushes_its_ends_apart() -> None:
    assert _pair(sy.Spring, 0.75) == pytest.approx((-2.5, 2.5), rel=1e-12)


@pytest.mark.parametrize("distance", [0.75, 1.0])
def test_a_slack_bungee_does_nothing(distance: float) -> None:
    assert _pair(sy.Bungee, distance) == (0.0, 0.0)


def test_a_spring_at_rest_length_does_nothing() -> None:
    assert _pair(sy.Spring, 1.0) == (0.0, 0.0)


def test_coinciding_ends_leave_no_direction_and_so_no_force() -> None:
    assert _pair(sy.Spring, 0.0) == (0.0, 0.0)


def test_anchored_springs_pull_and_push() -> None:
    def spring(p: sy.Particle) -> sy.AnchoredSpring:
        return sy.AnchoredSpring(p, (0, 0, 0), 10.0, 1.0)

    def bungee(p: sy.Particle) -> sy.AnchoredBungee:
        return sy.AnchoredBungee(p, (0, 0, 0), 10.0, 1.0)

    assert _along(spring, 1.5) == pytest.approx(-5.0, rel=1e-8)
    assert _along(spring, 0.75) == pytest.approx(2.5, rel=1e-8)
    assert _along(bungee, 1.5) == pytest.approx(-5.0, rel=1e-8)
    assert _along(bungee, 0.75) == 0.0


def test_a_moved_anchor_moves_the_pull() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(1, 0, 0)))
    spring = scene.add(sy.AnchoredSpring(p, (0, 0, 0), 10.0, 0.0))
    world = sy.World(scene, method=sy.Method(sy.ExplicitEuler(), dt=2.0**-10))
    world[spring].anchor = (2, 0, 0)
    world.step(1)
    assert world.particles.velocity[0, 0, 0] == 10.0 * 2.0**-10


@pytest.mark.parametrize("velocity", [3.0, -3.0])
def test_drag_acts_against_the_relative_velocity(velocity: float) -> None:
    # The particle moves at +-3 m/s, the air at 1 m/s.
    relative = velocity - 1.0
    force = _along(
        lambda p: sy.Drag(linear=0.5, quadratic=0.25, wind=(1, 0, 0)), 0.0, velocity=velocity
    )
    size = 0.5 * abs(relative) + 0.25 * relative**2
    assert force == pytest.approx(-math.copysign(size, relative), rel=1e-8)


@every_integrator
def test_no_drag_at_the_speed_of_the_wind(integrator: Any) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, 2, 3)))
    scene.add(sy.Drag(linear=0.5, quadratic=0.25, wind=(1, 2, 3)))
    world = sy.World(scene, method=sy.Method(integrator))
    world.step(5)
    np.testing.assert_array_equal(world.particles.velocity[0, 0], (1, 2, 3))


def _lift_at(y: float, **changes: float) -> float:
    """Buoyancy [N] on 2 kg and 5 litres at height y: surface 1 m, half depth .25 m, 800 kg/m^3."""
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(0, y, 0), mass=2.0))
    settings = {"surface": 1.0, "half_depth": 0.25, "volume": 0.005, "density": 800.0} | changes
    scene.add(sy.Buoyancy(p, **settings))
    world = sy.World(scene, method=sy.Method(sy.ExplicitEuler(), dt=2.0**-10))
    world.step(1)
    assert world.particles.velocity[0, 0, [0, 2]].tolist() == [0.0, 0.0]
    return 2.0 * float(world.particles.velocity[0, 0, 1]) * 2.0**10


def test_buoyancy_lifts_by_the_weight_of_the_liquid() -> None:
    full = 800.0 * 0.005 * 9.81
    assert _lift_at(-3.0) == pytest.approx(full, rel=1e-13)
    assert _lift_at(0.75) == pytest.approx(full, rel=1e-13)
    assert _lift_at(1.0) == pytest.approx(full / 2, rel=1e-13)
    assert _lift_at(1.125) == pytest.approx(full / 4, rel=1e-13)
    assert _lift_at(1.25) == 0.0
    assert _lift_at(9.0) == 0.0


# Formulas that the source prints wrongly


def test_defect_gravity_acts_on_immovable_particles() -> None:
    """The source asks for `inverse_mass >= 0`, always true: immovable particles get F = g / 0."""
    inverse_mass = 0.0
    with np.errstate(divide="ignore"):
        defective = -9.81 * np.divide(1.0, inverse_mass) if inverse_mass >= 0 else 0.0
    assert defective == -math.inf
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(0, 1, 0), inverse_mass=inverse_mass))
    scene.add(sy.Gravity((0, -9.81, 0)))
    for integrator in INTEGRATORS:
        world = sy.World(scene, method=sy.Method(integrator))
        world.step(10)
        assert world.particles.position[0, 0].tolist() == [0.0, 1.0, 0.0]
        assert world.particles.velocity[0, 0].tolist() == [0.0, 0.0, 0.0]
        assert world.health[0] == 0


def test_defect_compressed_spring_attracts() -> None:
    """The source takes |l - l0|: compressed by a quarter metre at 10 N/m it pulls b towards a."""
    stiffness, length, rest = 10.0, 0.75, 1.0
    defective = -stiffness * abs(length - rest)
    right = -stiffness * (length - rest)
    assert (defective, right) == (-2.5, 2.5)
    _, on_b = _pair(sy.Spring, length, stiffness, rest)
    assert on_b == pytest.approx(right, rel=1e-12)
    assert on_b != pytest.approx(defective)


def test_defect_bungee_repels() -> None:
    """The source doubles the sign: stretched by half a metre at 10 N/m it pushes b away from a."""
    stiffness, length, rest = 10.0, 1.5, 1.0
    defective = -(-stiffness * (length - rest))
    right = -stiffness * (length - rest)
    assert (defective, right) == (5.0, -5.0)
    _, on_b = _pair(sy.Bungee, length, stiffness, rest)
    assert on_b == pytest.approx(right, rel=1e-12)
    assert on_b != pytest.approx(defective)


def _fake_spring(x: float, v: float, k: float, c: float, mass: float, dt: float) -> float:
    """The source's force along one axis, NaN and all."""
    with np.errstate(invalid="ignore"):
        rate = 0.5 * np.sqrt(4.0 * k - c * c)
    swing = x * c / (2.0 * rate) + v / rate
    target = (x * np.cos(rate * dt) + swing * np.sin(rate * dt)) * np.exp(-0.5 * c * dt)
    return float(mass * ((target - x) / dt**2 - v / dt))


def _stiff_world(
    integrator: Any, *, k: float, c: float, mass: float, dt: float = 1.0 / 60.0
) -> sy.World:
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(1, 0, 0), mass=mass))
    scene.add(sy.StiffSpring(p, (0, 0, 0), stiffness=k, damping=c))
    return sy.World(scene, method=sy.Method(integrator, dt=dt))


@every_integrator
def test_defect_overdamped_stiff_spring_is_nan(integrator: Any) -> None:
    """The source takes sqrt(4 k - c^2), NaN where c^2 > 4 k; right is an exponential approach."""
    k, c, t = 1.0, 4.0, 1.0
    assert math.isnan(_fake_spring(1.0, 0.0, k, c, 1.0, 1.0 / 60.0))
    world = _stiff_world(integrator, k=k, c=c, mass=1.0)
    world.step(60)
    slow, fast = -2.0 + math.sqrt(3.0), -2.0 - math.sqrt(3.0)
    right = (fast * math.exp(slow * t) - slow * math.exp(fast * t)) / (fast - slow)
    assert world.particles.position[0, 0, 0] == pytest.approx(right, rel=1e-13)


@every_integrator
def test_defect_stiff_spring_ignores_mass(integrator: Any) -> None:
    """The source swings with sqrt(k): a mass of 4 kg must swing at half of that."""
    k, mass, t = 9.0, 4.0, 1.0
    defective, right = math.cos(math.sqrt(k) * t), math.cos(math.sqrt(k / mass) * t)
    world = _stiff_world(integrator, k=k, c=0.0, mass=mass)
    world.step(60)
    x = world.particles.position[0, 0, 0]
    assert x == pytest.approx(right, abs=1e-13)
    assert abs(x - defective) > 1.0


@every_integrator
def test_defect_stiff_spring_blows_up(integrator: Any) -> None:
    """The source's force lands on its target if v moves before x; its integrator moves x first."""
    k, dt, steps = 2e4, 1.0 / 60.0, 120
    x, v = 1.0, 0.0
    for _ in range(steps):
        force = _fake_spring(x, v, k, 0.0, 1.0, dt)
        x, v = x + dt * v, v + dt * force
    assert abs(x) > 1e6
    world = _stiff_world(integrator, k=k, c=0.0, mass=1.0)
    world.step(steps)
    assert world.particles.position[0, 0, 0] == pytest.approx(
        math.cos(math.sqrt(k) * 2.0), abs=1e-12
    )


def test_defect_partial_buoyancy_sinks() -> None:
    """The source subtracts in the wrong order: half under, a float is pushed down."""
    y, surface, half, weight = 1.1, 1.0, 0.25, 800.0 * 0.005 * 9.81
    defective = weight * (y - half - surface) / (2.0 * half)
    right = weight * (surface + half - y) / (2.0 * half)
    assert defective < 0.0 < right
    assert _lift_at(y) == pytest.approx(right, rel=1e-12)


def test_defect_buoyancy_divides_by_two_and_multiplies_by_the_depth() -> None:
    """The source writes `/ 2 * d` for `/ (2 d)`: off by d^2, 16 times at half a half metre."""
    y, surface, half, weight = 1.1, 1.0, 0.25, 800.0 * 0.005 * 9.81
    defective = weight * (surface + half - y) / 2.0 * half
    right = weight * (surface + half - y) / (2.0 * half)
    assert right == pytest.approx(16.0 * defective)
    assert _lift_at(y) == pytest.approx(right, rel=1e-12)


@pytest.mark.parametrize("y", [0.0, 1.1])
def test_defect_buoyancy_lacks_g(y: float) -> None:
    """The source leaves g out, at full depth and in part."""
    share = min(1.0, (1.0 + 0.25 - y) / 0.5)
    defective, right = 800.0 * 0.005 * share, 800.0 * 0.005 * 9.81 * share
    assert _lift_at(y) == pytest.approx(right, rel=1e-12)
    assert _lift_at(y) > 9.0 * defective
    assert _lift_at(y, gravity=1.62) == pytest.approx(1.62 * defective, rel=1e-12)
