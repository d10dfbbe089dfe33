"""Motion of rigid bodies: the free rotor, forces at points, what is conserved, and what each method refuses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steelyard as sy
from steelyard.integrators.base import Integrator
from steelyard.scene.shapes import rotation_matrix
from tests.elliptic import INERTIA, elliptic_spin

Array = np.ndarray
FULL = [[1.0, 0.1, 0.0], [0.1, 2.0, -0.2], [0.0, -0.2, 2.5]]
MOVING = [
    sy.Rattle(),
    sy.SymplecticEuler(),
    sy.RungeKutta4(),
    *(sy.ComposedRattle(substeps) for substeps in (3, 5, 9)),
]


def _over(some: list[Any]) -> Any:
    return pytest.mark.parametrize(
        "integrator", some, ids=lambda i: f"{type(i).__name__}{getattr(i, 'substeps', '')}"
    )


def top(spin: Any = (0.01, 5.0, 0.01), inertia: Any = INERTIA, **more: Any) -> sy.Scene:
    """A body alone in space."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(sy.Body(position=(0, 0, 0), mass=1.0, inertia=inertia, angular_velocity=spin, **more))
    return scene


def own_spin(world: sy.World) -> Array:
    """Angular velocities along the bodies' axes, (worlds, bodies, 3)."""
    turn = rotation_matrix(world.bodies.orientation)
    return np.einsum("wbji,wbj->wbi", turn, world.bodies.angular_velocity)


@pytest.mark.parametrize("spin", [(0.01, 5.0, 0.01), (0.3, 2.0, 1.0), (1.0, 0.5, 0.3)], ids=str)
@_over([sy.Rattle(), sy.ComposedRattle(9)])
def test_a_free_top_is_the_elliptic_solution(integrator: Any, spin: Any) -> None:
    """The first turns over and over (Dzhanibekov), about every 4 s; 10 s at 60 Hz."""
    world = sy.World(top(spin), method=sy.Method(integrator, dt=1.0 / 60.0))
    momentum = world.angular_momentum.copy()
    energy = world.energy.copy()
    world.step(600)
    assert np.abs(own_spin(world)[0, 0] - elliptic_spin(np.array(spin), 10.0)).max() < 1e-10
    np.testing.assert_array_equal(world.angular_momentum, momentum)
    np.testing.assert_allclose(world.energy, energy, rtol=1e-14)


def test_a_fast_top_is_halved_until_it_is_followed() -> None:
    """900 rad/s at 60 Hz: 15 rad a step, in 128 parts, as exact as at 120 steps for each."""
    fast = (3.0, 900.0, 5.0)
    world = sy.World(top(fast), method=sy.Method(sy.Rattle(), dt=1.0 / 60.0))
    world.step(6)
    assert np.abs(own_spin(world)[0, 0] - elliptic_spin(np.array(fast), 0.1)).max() < 1e-9 * 900.0


def test_without_the_gyroscopic_term_a_top_would_not_turn_over() -> None:
    """The middle axis is unstable: after 3 s the small parts of the spin have grown a hundredfold."""
    world = sy.World(top(), method=sy.Method(sy.Rattle(), dt=1.0 / 60.0))
    largest = 0.0
    lowest = 5.0
    for _ in range(300):
        world.step()
        spin = own_spin(world)[0, 0]
        largest = max(largest, abs(spin[0]))
        lowest = min(lowest, spin[1])
    assert largest > 4.0 and lowest < -4.9


@_over(MOVING)
def test_order_on_a_free_top(integrator: Any) -> None:
    """Methods that turn freely are exact; the others have their order."""
    spin = np.array([0.3, 2.0, 1.0])
    errors = []
    for steps in (120, 240):
        world = sy.World(top(spin), method=sy.Method(integrator, dt=2.0 / steps))
        world.step(steps)
        errors.append(np.abs(own_spin(world)[0, 0] - elliptic_spin(spin, 2.0)).max())
    if isinstance(integrator, sy.Rattle | sy.ComposedRattle):
        assert max(errors) < 1e-12
    else:
        assert math.log2(errors[0] / errors[1]) == pytest.approx(integrator.order(), abs=0.3)


@_over(MOVING)
def test_momentum_is_conserved_without_forces(integrator: Any) -> None:
    scene = top((0.4, 1.0, -0.7), FULL)
    scene.add(
        sy.Body(
            position=(3, 1, 0),
            velocity=(1, -2, 0.5),
            angular_velocity=(2, 1, 0),
            orientation=(1, 2, 3, 4),
            parts=[sy.Box((0.2, 0.3, 0.1)), sy.Part(shape=sy.Sphere(0.2), offset=(0.5, 0, 0))],
        )
    )
    world = sy.World(scene, worlds=3, method=sy.Method(integrator, dt=0.01))
    linear, angular = world.momentum.copy(), world.angular_momentum.copy()
    world.step(50)
    np.testing.assert_allclose(world.momentum, linear, rtol=1e-14)
    exact = not isinstance(integrator, sy.SymplecticEuler)
    np.testing.assert_allclose(world.angular_momentum, angular, rtol=1e-13 if exact else 0.02)


# Forces

TENSOR = np.array([[-0.1, 0.0, 0.05], [0.0, -2.0, 0.3], [0.02, 0.1, -0.4]])
WIND = np.array([1.0, 0.5, -2.0])
LOW, MIDDLE, HIGH = (
    np.diag([-0.1, -0.2, -0.3]),
    np.diag([-0.2, -0.3, -0.5]),
    np.diag([-1.0, -2.0, -3.0]),
)
TURN = np.array([1.0, 0.3, -0.2, 0.4]) / np.linalg.norm([1.0, 0.3, -0.2, 0.4])
MASS, LIGHT = 2.0, 0.5


def loaded() -> sy.Scene:
    """A body and a particle with a force of every kind on them."""
    scene = sy.Scene()
    body = scene.add(
        sy.Body(
            position=(0, 1, 0),
            mass=MASS,
            inertia=FULL,
            velocity=(1, 0, 0.5),
            angular_velocity=(0.3, 1, -0.5),
            orientation=(1, 0.2, 0.3, -0.1),
        )
    )
    particle = scene.add(sy.Particle(position=(2, 1, 0), mass=LIGHT))
    scene.add(sy.Spring(body.at((0.5, 0, 0.2)), particle, 40.0, 1.0))
    scene.add(sy.AnchoredSpring(body.at((-0.5, 0.1, 0)), (0, 3, 0), 30.0, 1.0))
    scene.add(sy.Buoyancy(body.at((0, -0.3, 0)), surface=1.0, half_depth=3.0, volume=0.001))
    scene.add(sy.AeroSurface(body.at((0, 0.2, 1.0)), TENSOR, WIND))
    scene.add(sy.AngledAeroSurface(body.at((0.1, 0, 0)), TENSOR, orientation=TURN))
    for control in (0.4, -0.7):
        scene.add(
            sy.ControlledAeroSurface(
                body.at((0, 0, -1.0)), MIDDLE, low=LOW, high=HIGH, control=control
            )
        )
    scene.add(sy.Thruster(body.at((0, 0, -0.5)), (0, 0, 2), 5.0, throttle=0.6))
    scene.add(sy.Wrench(body, (0.1, 0.2, 0.3), (0.3, -0.2, 0.1)))
    scene.add(sy.Gravity((0.3, 0, 0)))
    return scene


def loaded_rates(time: float, y: Array) -> Array:
    """The same written out with numpy, from the formulas: x, q, v, L of the body, x, v of the particle."""
    x, q, v, momentum, other, other_v = np.split(y, [3, 7, 10, 13, 16])
    turn = rotation_matrix(q / np.linalg.norm(q))
    spin = turn @ np.linalg.inv(np.array(FULL)) @ turn.T @ momentum
    down = np.array([0.0, -9.81, 0.0])
    side = np.array([0.3, 0.0, 0.0])
    force = np.array([0.1, 0.2, 0.3]) + MASS * (down + side)
    torque = np.array([0.3, -0.2, 0.1])
    on_other = LIGHT * (down + side)

    def pull(apart: Array, stiffness: float) -> Array:
        length = np.linalg.norm(apart)
        return -stiffness * (length - 1.0) * apart / length

    def add(place: Array, push: Array) -> None:
        nonlocal force, torque
        force = force + push
        torque = torque + np.cross(turn @ place, push)

    def moving(place: Array) -> Array:
        return v + np.cross(spin, turn @ place)

    place = np.array([0.5, 0.0, 0.2])
    push = pull(x + turn @ place - other, 40.0)
    add(place, push)
    on_other = on_other - push
    place = np.array([-0.5, 0.1, 0.0])
    add(place, pull(x + turn @ place - np.array([0.0, 3.0, 0.0]), 30.0))
    place = np.array([0.0, -0.3, 0.0])
    under = np.clip((1.0 + 3.0 - (x + turn @ place)[1]) / 6.0, 0.0, 1.0)
    add(place, np.array([0.0, 0.001 * 1000.0 * 9.81 * under, 0.0]))
    place = np.array([0.0, 0.2, 1.0])
    add(place, turn @ TENSOR @ turn.T @ (moving(place) - WIND))
    place = np.array([0.1, 0.0, 0.0])
    angled = turn @ rotation_matrix(TURN)
    add(place, angled @ TENSOR @ angled.T @ moving(place))
    place = np.array([0.0, 0.0, -1.0])
    for tensor in (MIDDLE + 0.4 * (HIGH - MIDDLE), MIDDLE + 0.7 * (LOW - MIDDLE)):
        add(place, turn @ tensor @ turn.T @ moving(place))
    add(np.array([0.0, 0.0, -0.5]), turn @ np.array([0.0, 0.0, 3.0]))
    turning = 0.5 * np.array([-spin @ q[1:], *(q[0] * spin + np.cross(spin, q[1:]))])
    return np.concatenate([v, turning, force / MASS, torque, other_v, on_other / LIGHT])


def numbers(world: sy.World) -> Array:
    """The state as ``loaded_rates`` takes it."""
    bodies, particles = world.bodies, world.particles
    parts = (bodies.position, bodies.orientation, bodies.velocity, bodies.angular_momentum)
    rest = (particles.position, particles.velocity)
    return np.concatenate([part[0, 0] for part in parts + rest])


@_over([sy.RungeKutta4(), sy.Rattle(), sy.SymplecticEuler()])
def test_every_force_on_bodies_against_its_formula(integrator: Any) -> None:
    start = numbers(sy.World(loaded()))
    true = solve_ivp(loaded_rates, (0, 1), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for steps in (200, 400):
        world = sy.World(loaded(), method=sy.Method(integrator, dt=1.0 / steps))
        world.step(steps)
        assert world.health[0] == 0
        errors.append(np.abs(numbers(world) - true).max())
    # Forces that depend on velocity, as those of air do, make velocity Verlet first order.
    order = 4 if isinstance(integrator, sy.RungeKutta4) else 1
    assert errors[1] < (2e-7 if order == 4 else 0.05)
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@_over([sy.Rattle(), *(sy.ComposedRattle(substeps) for substeps in (5, 9)), sy.RungeKutta4()])
def test_order_and_energy_of_bodies_on_springs(integrator: Any) -> None:
    def scene() -> sy.Scene:
        made = sy.Scene()
        a = made.add(
            sy.Body(position=(0, 2, 0), mass=2.0, inertia=FULL, angular_velocity=(1, 0.5, -1))
        )
        b = made.add(
            sy.Body(
                position=(1.5, 2, 0.3), parts=sy.Box((0.3, 0.2, 0.4)), mass=1.0, velocity=(0, 1, 0)
            )
        )
        made.add(sy.Spring(a.at((0.4, 0, 0)), b.at((-0.3, 0.2, 0)), 60.0, 0.7))
        made.add(sy.AnchoredSpring(a.at((-0.3, 0.3, 0.2)), (0, 4, 0), 50.0, 1.5))
        return made

    def run(steps: int) -> tuple[Array, float]:
        world = sy.World(scene(), method=sy.Method(integrator, dt=1.0 / steps))
        before = float(world.energy[0])
        world.step(steps)
        bodies = world.bodies
        state = np.concatenate([bodies.position[0].ravel(), bodies.angular_momentum[0].ravel()])
        return state, abs(float(world.energy[0]) - before)

    fine = sy.World(scene(), method=sy.Method(sy.ComposedRattle(9), dt=1.0 / 1000))
    fine.step(1000)
    true = np.concatenate(
        [fine.bodies.position[0].ravel(), fine.bodies.angular_momentum[0].ravel()]
    )
    (one, first), (two, second) = run(40), run(80)
    errors = [np.abs(state - true).max() for state in (one, two)]
    assert math.log2(errors[0] / errors[1]) > integrator.order() - 0.4
    assert second < first
    assert abs(float(fine.energy[0]) - float(sy.World(scene()).energy[0])) < 1e-9


@_over(MOVING)
def test_damping_takes_speed_and_spin(integrator: Any) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(
        sy.Body(
            position=(0, 0, 0),
            parts=sy.Sphere(0.5),
            mass=1.0,
            velocity=(2, 0, 0),
            angular_velocity=(0, 3, 0),
            damping=0.8,
            angular_damping=0.5,
        )
    )
    world = sy.World(scene, method=sy.Method(integrator, dt=0.01))
    world.step(100)
    tolerance = 1e-9 if isinstance(integrator, sy.RungeKutta4) else 1e-13
    np.testing.assert_allclose(world.bodies.velocity[0, 0], (1.6, 0, 0), rtol=tolerance)
    np.testing.assert_allclose(
        world.bodies.angular_velocity[0, 0], (0, 1.5, 0), rtol=tolerance, atol=1e-15
    )


@_over([sy.Rattle(), sy.RungeKutta4(), sy.SymplecticEuler()])
def test_drag_takes_a_body_as_it_takes_a_particle(integrator: Any) -> None:
    scene = sy.Scene()
    start = {"velocity": (20.0, 5.0, 0.0), "mass": 3.0}
    scene.add(sy.Body(position=(0, 0, 0), inertia=(1, 2, 3), angular_velocity=(0, 2, 0), **start))
    scene.add(sy.Particle(position=(0, 0, 0), **start))
    scene.add(sy.Drag(linear=0.3, quadratic=0.05, wind=(-2.0, 0.0, 1.0)))
    world = sy.World(scene, worlds=2, method=sy.Method(integrator, dt=0.01))
    spin = world.bodies.angular_momentum.copy()
    world.step(100)
    places = world.bodies.position[:, 0], world.particles.position[:, 0]
    np.testing.assert_allclose(*places, rtol=1e-12)
    assert abs(places[0][0, 0]) < 19.0
    np.testing.assert_allclose(world.bodies.angular_momentum, spin, rtol=1e-3)
    world.bodies.mass = [[3.0], [300.0]]
    world.step(10)
    assert world.bodies.velocity[1, 0, 0] > world.bodies.velocity[0, 0, 0]
    held = sy.Scene()
    held.add(sy.Body(position=(0, 0, 0), inertia=(1, 1, 1), pivot=(0, -1, 0)))
    held.add(sy.Drag(linear=1.0))
    with pytest.raises(ValueError, match=r"Drag on a body with a pivot.*angular_damping"):
        sy.World(held)


def test_an_impulse_off_centre_changes_both_momenta() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(
        sy.Body(position=(1, 0, 0), mass=2.0, inertia=(1, 2, 3), orientation=(1, 1, 0, 0))
    )
    world = sy.World(scene, worlds=3)
    blow = np.array([0.0, 4.0, 0.0])
    world.apply_impulse(body, blow, at=(2, 0, 0), mask=np.array([True, False, True]))
    world.apply_angular_impulse(body, (0, 0, 1))
    np.testing.assert_allclose(world.bodies.velocity[:, 0], [(0, 2, 0), (0, 0, 0), (0, 2, 0)])
    np.testing.assert_allclose(world.momentum[0], blow)
    # About its centre: lever (1, 0, 0) times the blow, and the couple.
    np.testing.assert_allclose(
        world.bodies.angular_momentum[:, 0], [(0, 0, 5), (0, 0, 1), (0, 0, 5)]
    )
    # Turned by a quarter about x, the world's z is the body's y, with moment 2.
    np.testing.assert_allclose(world.bodies.angular_velocity[0, 0], (0, 0, 2.5), atol=1e-15)


def test_two_opposite_forces_are_a_couple() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(sy.Body(position=(0, 0, 0), mass=1.0, inertia=(1, 1, 1)))
    for x, push in ((1.0, 3.0), (-1.0, -3.0)):
        scene.add(sy.Thruster(body.at((x, 0, 0)), (0, push, 0), 3.0, throttle=1.0))
    world = sy.World(scene, method=sy.Method(sy.RungeKutta4(), dt=0.01))
    world.step(10)
    np.testing.assert_allclose(world.bodies.velocity, 0.0, atol=1e-15)
    np.testing.assert_allclose(world.bodies.angular_momentum[0, 0], (0, 0, 0.6), atol=1e-14)


# Worlds


@pytest.mark.parametrize("name", ["loaded", "top"])
@_over(MOVING)
def test_same_bits_for_any_batch(integrator: Any, name: str) -> None:
    build = {"loaded": loaded, "top": top}[name]
    if name == "loaded" and isinstance(integrator, sy.ComposedRattle):
        pytest.skip("air has no meaning backwards in time")
    method = sy.Method(integrator, dt=0.02)

    def batch(worlds: int, threads: int = 1) -> sy.World:
        world = sy.World(build(), worlds=worlds, method=method, threads=threads)
        # Spins so different that neighbours need unequal numbers of parts.
        world.bodies.angular_momentum[:] *= np.geomspace(0.1, 300.0, 19)[:worlds, None, None]
        return world

    whole = batch(19)
    whole.step(15)
    for worlds, threads in ((1, 1), (9, 1), (19, 2)):
        part = batch(worlds, threads)
        for _ in range(15):
            part.step()
        for field in ("position", "orientation", "velocity", "angular_momentum"):
            np.testing.assert_array_equal(
                getattr(part.bodies, field), getattr(whole.bodies, field)[:worlds], err_msg=field
            )


def test_snapshot_reset_and_pickle_hold_bodies() -> None:
    import pickle

    world = sy.World(loaded(), worlds=2, method=sy.Method(sy.RungeKutta4(), dt=0.01))
    world.step(5)
    kept = world.snapshot()
    copied = pickle.loads(pickle.dumps(world))
    world.step(5)
    later = world.bodies.orientation.copy()
    world.restore(kept)
    world.step(5)
    copied.step(5)
    np.testing.assert_array_equal(world.bodies.orientation, later)
    np.testing.assert_array_equal(copied.bodies.orientation, later)
    world.reset()
    np.testing.assert_array_equal(numbers(world), numbers(sy.World(loaded())))


def test_bodies_come_and_go_while_all_else_goes_on() -> None:
    scene = top((1.0, 0.5, 0.3))
    world = sy.World(scene, worlds=2, method=sy.Method(sy.Rattle(), dt=0.01))
    world.step(10)
    before = world.bodies.orientation[:, 0].copy()
    ball = world.add(sy.Body(position=(5, 0, 0), parts=sy.Sphere(0.1), velocity=(1, 0, 0)))
    wrench = world.add(sy.Wrench(ball, (0, 2, 0)))
    np.testing.assert_array_equal(world.bodies.orientation[:, 0], before)
    world.step(10)
    assert world.bodies.position.shape == (2, 2, 3)
    world[wrench].force = (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="still refers to this body"):
        world.remove(ball)
    world.remove(wrench)
    world.remove(ball)
    alone = sy.World(top((1.0, 0.5, 0.3)), worlds=2, method=world.method)
    alone.step(20)
    np.testing.assert_allclose(
        world.bodies.orientation, alone.bodies.orientation, rtol=0, atol=1e-15
    )


def test_parameters_differ_between_worlds() -> None:
    world = sy.World(top((1.0, 0.5, 0.3)), worlds=2, method=sy.Method(sy.Rattle(), dt=0.01))
    inertia = np.stack([np.diag(INERTIA), 2.0 * np.diag(INERTIA)])[:, None]
    world.bodies.inertia = inertia
    world.bodies.mass = [[1.0], [4.0]]
    world.bodies.angular_velocity = (1.0, 0.5, 0.3)
    np.testing.assert_allclose(
        world.bodies.angular_momentum[1], 2.0 * world.bodies.angular_momentum[0]
    )
    world.gravity = [(0.0, -1.0, 0.0), (0.0, -2.0, 0.0)]
    world.step(100)
    np.testing.assert_allclose(world.bodies.orientation[0], world.bodies.orientation[1], atol=1e-14)
    np.testing.assert_allclose(world.bodies.velocity[:, 0, 1], [-1.0, -2.0])
    np.testing.assert_allclose(world.momentum[:, 1], [-1.0, -8.0])
    with pytest.raises(ValueError, match="principal moments"):
        world.bodies.inertia = np.diag([1.0, 1.0, 5.0])[None]
    with pytest.raises(ValueError, match="read-only"):
        world.bodies.angular_velocity[:] = 0.0


def test_an_immovable_body_stands_and_holds_springs() -> None:
    scene = sy.Scene()
    wall = scene.add(sy.Body(position=(0, 2, 0), inverse_mass=0.0, orientation=(1, 0, 0, 1)))
    bob = scene.add(sy.Particle(position=(0, 1.5, 0)))
    scene.add(sy.Spring(wall.at((1.0, 0, 0)), bob, 50.0, 1.0))
    world = sy.World(scene)
    energy = float(world.energy[0])
    world.step(60)
    np.testing.assert_array_equal(world.bodies.position[0, 0], (0, 2, 0))
    assert world.particles.position[0, 0, 1] != 1.5
    assert abs(float(world.energy[0]) - energy) < 0.02


def test_a_scene_of_particles_pays_nothing() -> None:
    def cost(*more: Any) -> tuple[int, int, int]:
        scene = sy.Scene()
        scene.add(sy.Particle(position=(0, 0, 0)))
        for thing in more:
            scene.add(thing)
        world = sy.World(scene)
        return world.bytes_per_world, world.model.rows, len(world.model.recipe)

    alone = cost()
    assert cost(sy.Body(position=(0, 0, 0), parts=sy.Sphere(1.0)))[0] == alone[0] + 8 * 13
    assert alone[1] < 40
    names = {stage.__name__ for stage, _ in sy.World(sy.scenes.cloth()).model.recipe}
    assert not any("bod" in name for name in names)


def test_a_non_finite_body_is_flagged_alone() -> None:
    world = sy.World(top(), worlds=3)
    world.bodies.angular_momentum[1, 0, 0] = np.nan
    world.step(3)
    np.testing.assert_array_equal(world.health, [0, 1, 0])


# Refusals


def test_methods_that_know_no_bodies_refuse_them() -> None:
    kinds = [*Integrator.__subclasses__(), sy.KinkRungeKutta4]
    moving = {type(integrator) for integrator in MOVING}
    for kind in kinds:
        solver = sy.Direct() if kind is sy.ImpactRattle else None
        if kind in moving:
            assert kind.moves_bodies
            continue
        with pytest.raises(ValueError, match=rf"{kind.__name__} cannot step a Body.*Use Rattle"):
            sy.World(top(), method=sy.Method(kind(), solver))


def test_what_bodies_cannot_do_yet_is_refused() -> None:
    scene = top()
    scene.add(sy.LinePlatform(start=(0, 0, 0), end=(1, 0, 0), radius=0.1))
    with pytest.raises(ValueError, match=r"bodies would pass through it.*LinePlatform\(particles="):
        sy.World(scene)
    body = sy.Body(position=(0, 0, 0), parts=sy.Sphere(1.0))
    with pytest.raises(ValueError, match="cannot be in a planar scene"):
        sy.Scene(planar=True).add(body)
    with pytest.raises(ValueError, match="refers to a body at"):
        sy.Scene().add(sy.Wrench(body))
    with pytest.raises(TypeError, match="must be a Particle"):
        sy.Rod(body.at((0, 0, 0)), sy.Particle(position=(1, 0, 0)))
    scene = loaded()
    with pytest.raises(ValueError, match="Xpbd cannot hold a Spring"):
        sy.World(scene, method=sy.Method(sy.SymplecticEuler(), sy.Xpbd()))
    with pytest.raises(ValueError, match=r"ComposedRattle cannot step a .*AeroSurface"):
        sy.World(scene, method=sy.Method(sy.ComposedRattle()))


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda b: sy.Wrench(b, force=(math.nan, 0, 0)), "force"),
        (lambda b: sy.Thruster(b.at((0, 0, 0)), (0, 0, 0), 1.0), "direction"),
        (lambda b: sy.Thruster(b.at((0, 0, 0)), (0, 0, 1), 1.0, throttle=2.0), "throttle is 2.0"),
        (lambda b: sy.AeroSurface(b.at((0, 0, 0)), np.eye(2)), "tensor"),
        (lambda b: sy.ControlledAeroSurface(b.at((0, 0, 0)), np.eye(3)), "low is None"),
        (lambda b: b.at((0, 0, math.inf)), "place"),
    ],
)
def test_senseless_forces_on_bodies_are_refused(build: Any, words: str) -> None:
    body = sy.Body(position=(0, 0, 0), parts=sy.Sphere(1.0))
    with pytest.raises(ValueError, match=words):
        build(body)
    with pytest.raises(TypeError, match=r"must be of type BodyPoint.*body\.at"):
        sy.AeroSurface(body, np.eye(3))  # type: ignore[arg-type]
