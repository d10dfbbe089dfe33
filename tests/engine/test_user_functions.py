"""Forces and contact generators written by the user, as Python callables and numba functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

import steelyard as sy
from tests.engine.full_scene import every_method

Array = np.ndarray

INTEGRATORS = [sy.ExplicitEuler(), sy.SymplecticEuler(), sy.Rattle()]
every_integrator = pytest.mark.parametrize(
    "integrator", INTEGRATORS, ids=lambda integrator: type(integrator).__name__
)


def swarm(*forces: Any, worlds: int = 3, method: sy.Method | None = None) -> sy.World:
    """Three particles, differently placed and moving in every world."""
    scene = sy.Scene()
    for k in range(3):
        scene.add(sy.Particle(position=(k, 1, 0), mass=1.0 + k, damping=0.9))
    for force in forces:
        scene.add(force)
    world = sy.World(scene, worlds=worlds, method=method or sy.Method(sy.Rattle()))
    rng = np.random.default_rng(8)
    world.particles.velocity[:] = rng.normal(size=(worlds, 3, 3))
    world.particles.position[:] += 0.1 * rng.normal(size=(worlds, 3, 3))
    return world


# Forces


def pull(position: Array, velocity: Array, time: Array) -> Array:
    """12 N/m towards (0, 2, 0)."""
    return -12.0 * (position - np.array([0.0, 2.0, 0.0]))


@numba.njit
def compiled_pull(position: Array, velocity: Array, time: Array) -> Array:
    """The same, written out for numba."""
    force = np.empty_like(position)
    for w in range(position.shape[0]):
        for p in range(position.shape[1]):
            force[w, p, 0] = -12.0 * position[w, p, 0]
            force[w, p, 1] = -12.0 * (position[w, p, 1] - 2.0)
            force[w, p, 2] = -12.0 * position[w, p, 2]
    return force


@every_integrator
@pytest.mark.parametrize("function", [pull, compiled_pull], ids=["python", "numba"])
def test_a_written_spring_is_the_spring_of_the_engine(integrator: Any, function: Any) -> None:
    method = sy.Method(integrator)
    written = swarm(sy.UserForce(function), worlds=11, method=method)
    built_in = swarm(worlds=11, method=method)
    for p in built_in.scene.particles:
        built_in.add(sy.AnchoredSpring(p, (0, 2, 0), 12.0, 0.0))
    written.step(120)
    built_in.step(120)
    # The pull is rounded in another order: 120 steps of 1e-15, with errors that grow with time.
    np.testing.assert_allclose(
        written.particles.position, built_in.particles.position, rtol=0, atol=1e-12
    )


@every_integrator
def test_python_and_numba_give_the_same_bits(integrator: Any) -> None:
    first, second = (
        swarm(sy.UserForce(function), method=sy.Method(integrator))
        for function in (pull, compiled_pull)
    )
    first.step(50)
    second.step(50)
    np.testing.assert_array_equal(first.particles.position, second.particles.position)


@every_integrator
def test_what_a_force_is_given(integrator: Any) -> None:
    seen: list[tuple[Array, Array, Array]] = []

    def watch(position: Array, velocity: Array, time: Array) -> Array:
        seen.append((position, velocity, time))
        return np.zeros_like(position)

    world = swarm(sy.UserForce(watch), worlds=4, method=sy.Method(integrator))
    world.step(3)
    world.reset(np.array([False, False, True, False]))
    seen.clear()
    start = world.particles.position.copy(), world.particles.velocity.copy(), world.time.copy()
    world.step()
    for found, expected in zip(seen[0], start, strict=True):
        np.testing.assert_array_equal(found, expected)
    assert [part.shape for part in seen[0]] == [(4, 3, 3), (4, 3, 3), (4,)]
    # Verlet asks again at the end of the step, for the forces there.
    if isinstance(integrator, sy.Rattle):
        position, _, time = seen[1]
        np.testing.assert_array_equal(position, world.particles.position)
        np.testing.assert_allclose(time, world.time, rtol=1e-15)


def test_a_force_cannot_spoil_what_it_is_given() -> None:
    def careless(position: Array, velocity: Array, time: Array) -> Array:
        force = np.zeros_like(position)
        position[:] = velocity[:] = 1e6
        time[:] = -1.0
        return force

    spoilt, plain = swarm(sy.UserForce(careless)), swarm()
    spoilt.step(20)
    plain.step(20)
    np.testing.assert_array_equal(spoilt.particles.position, plain.particles.position)
    np.testing.assert_array_equal(spoilt.time, plain.time)


def test_one_force_does_not_see_what_another_did_to_its_arguments() -> None:
    def careless(position: Array, velocity: Array, time: Array) -> Array:
        force = pull(position, velocity, time)
        position[:] = 1e6
        return force

    both = swarm(sy.UserForce(careless), sy.UserForce(pull))
    twice = swarm(sy.UserForce(pull), sy.UserForce(pull))
    both.step(20)
    twice.step(20)
    np.testing.assert_array_equal(both.particles.position, twice.particles.position)


def test_an_energy_cannot_spoil_the_positions() -> None:
    def careless(position: Array) -> Array:
        position[:] = 0.0
        return np.zeros(len(position))

    world = swarm(sy.UserForce(pull, energy=careless))
    before = world.particles.position.copy()
    try:
        _ = world.energy
    except ValueError as error:
        assert "read-only" in str(error)
    np.testing.assert_array_equal(world.particles.position, before)


def test_the_energy_of_a_written_force_counts() -> None:
    def potential(position: Array) -> Array:
        return 6.0 * ((position - np.array([0.0, 2.0, 0.0])) ** 2).sum(axis=(1, 2))

    with_energy = swarm(sy.UserForce(pull, energy=potential))
    without = swarm(sy.UserForce(pull))
    stored = with_energy.energy - without.energy
    np.testing.assert_allclose(stored, potential(with_energy.particles.position), rtol=1e-14)


def test_a_force_that_breaks_down_in_one_world_flags_that_world_alone() -> None:
    def broken(position: Array, velocity: Array, time: Array) -> Array:
        force = pull(position, velocity, time)
        force[1, 0] = np.nan
        return force

    world, sound = swarm(sy.UserForce(broken)), swarm(sy.UserForce(pull))
    world.step(5)
    sound.step(5)
    assert world.health.tolist() == [0, 1, 0]
    np.testing.assert_array_equal(world.particles.position[::2], sound.particles.position[::2])


@every_method
@pytest.mark.parametrize("threads", [1, 3])
def test_worlds_of_a_batch_with_written_parts_are_worlds_alone(
    method: sy.Method, threads: int
) -> None:
    """Written functions take all worlds at once; links and contacts must not mix them up."""

    def build(*, worlds: int, threads: int = 1) -> sy.World:
        scene = sy.Scene()
        a = scene.add(sy.Particle(position=(0, 2, 0)))
        b = scene.add(sy.Particle(position=(1, 2, 0)))
        scene.add(sy.Rod(a, b))
        scene.add(sy.CableConstraint(a, (0, 2.6, 0), 0.7, restitution=0.7))
        scene.add(sy.Ground(height=1.5, restitution=0.5, friction=0.3))
        scene.add(sy.UserForce(pull))
        scene.add(sy.ContactGenerator(wall, [(b, None)], restitution=0.2, friction=0.1))
        return sy.World(scene, worlds=worlds, method=method, threads=threads)

    def wall(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
        return np.broadcast_to([-1.0, 0.0, 0.0], x.shape), x[..., 0] - 1.1

    batch = build(worlds=19, threads=threads)
    start = np.random.default_rng(2).normal(size=(19, 1, 3))
    batch.particles.velocity[:] = start
    batch.step(60)
    assert not batch.health.any()
    for w in (0, 7, 8, 18):
        alone = build(worlds=1)
        alone.particles.velocity[:] = start[w]
        alone.step(60)
        np.testing.assert_array_equal(batch.particles.position[w], alone.particles.position[0])


# Contact generators


def floor(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
    """Level ground at 0."""
    normal = np.zeros(x.shape)
    normal[..., 1] = 1.0
    return normal, -x[..., 1]


@numba.njit
def compiled_floor(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
    """The same, written out for numba."""
    normal = np.zeros(x.shape)
    depth = np.empty(x.shape[:2])
    for w in range(x.shape[0]):
        for k in range(x.shape[1]):
            normal[w, k, 1] = 1.0
            depth[w, k] = -x[w, k, 1]
    return normal, depth


def ball(method: sy.Method, function: Callable[..., Any], *, e: float = 0.0) -> sy.World:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0, 0.3, 0), velocity=(0, -1, 0)))
    scene.add(sy.ContactGenerator(function, [(p, None)], restitution=e))
    return sy.World(scene, worlds=3, method=method)


@every_method
def test_a_ball_comes_to_rest_on_a_written_floor(method: sy.Method) -> None:
    world = ball(method, floor)
    start, lowest = float(world.energy[0]), 0.0
    for k in range(180):
        world.step()
        lowest = min(lowest, float(world.particles.position[0, 0, 1]))
        # Explicit Euler gains m (g h)^2 / 2 a step in free fall.
        assert world.energy[0] < start + 0.5 * (9.81 / 60.0) ** 2 * (k + 1) + 1e-12
    # It is found once it is in, at up to 2.7 m/s x 1/60 s.
    assert -0.05 < lowest < 0.0
    assert abs(world.particles.velocity[0, 0, 1]) < 0.2
    assert abs(world.particles.position[0, 0, 1]) < 0.01
    assert not world.health.any()


@every_method
def test_python_and_numba_contacts_give_the_same_bits(method: sy.Method) -> None:
    first, second = ball(method, floor), ball(method, compiled_floor)
    first.step(90)
    second.step(90)
    np.testing.assert_array_equal(first.particles.position, second.particles.position)


@every_method
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_head_on_collision_of_two_particles(method: sy.Method, e: float) -> None:
    """v' = v -+ (1 + e) m_r v_rel / m, with nothing else acting."""

    def spheres(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
        apart = x - y
        distance = np.linalg.norm(apart, axis=-1)
        return apart / distance[..., None], 0.5 - distance

    scene = sy.Scene(gravity=(0, 0, 0))
    a = scene.add(sy.Particle(position=(0, 0, 0), velocity=(3, 0, 0), mass=2.0))
    b = scene.add(sy.Particle(position=(1, 0, 0), velocity=(-1, 0, 0), mass=0.5))
    scene.add(sy.ContactGenerator(spheres, [(a, b)], restitution=e))
    world = sy.World(scene, method=method)
    world.step(60)
    reduced = 2.0 * 0.5 / 2.5
    expected = (3.0 - (1.0 + e) * reduced * 4.0 / 2.0, -1.0 + (1.0 + e) * reduced * 4.0 / 0.5)
    # Small steps leave the way out of the last nanometre as speed.
    atol = 1e-9 if method.substeps == 1 else 1e-9 / method.substep
    np.testing.assert_allclose(world.particles.velocity[0, :, 0], expected, rtol=0, atol=atol)
    np.testing.assert_allclose(world.momentum[0], (5.5, 0, 0), rtol=0, atol=1e-13)


@every_method
def test_a_generator_without_contact_changes_nothing(method: sy.Method) -> None:
    def far(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
        return np.broadcast_to([0.0, 1.0, 0.0], x.shape), np.full(x.shape[:2], -0.5)

    world, plain = ball(method, far), ball(method, far)
    plain.remove(plain.scene.things[-1])
    world.step(30)
    plain.step(30)
    np.testing.assert_allclose(
        world.particles.position, plain.particles.position, rtol=0, atol=1e-14
    )


def test_what_a_generator_is_given() -> None:
    seen: list[tuple[Array, Array, Array]] = []

    def watch(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
        seen.append((x, y, time))
        return floor(x, y, time)

    scene = sy.Scene()
    a, b, c = (scene.add(sy.Particle(position=(k, 5, 0))) for k in range(3))
    scene.add(sy.ContactGenerator(watch, [(c, a), (b, None)]))
    world = sy.World(scene, worlds=2)
    world.step()
    seen.clear()
    start = world.particles.position.copy()
    world.step()
    x, y, time = seen[0]
    np.testing.assert_array_equal(x, start[:, [2, 1]])
    np.testing.assert_array_equal(y, start[:, [0, 1]])
    np.testing.assert_array_equal(time, [1 / 60, 1 / 60])


@every_method
def test_a_contact_that_breaks_down_in_one_world_flags_that_world_alone(method: sy.Method) -> None:
    def broken(x: Array, y: Array, time: Array) -> tuple[Array, Array]:
        normal, depth = floor(x, y, time)
        depth[1] = np.nan
        return normal, depth

    world, sound = ball(method, broken), ball(method, floor)
    world.step(30)
    sound.step(30)
    assert world.health[[0, 2]].tolist() == [0, 0]
    assert world.health[1] & 1
    np.testing.assert_array_equal(world.particles.position[::2], sound.particles.position[::2])
