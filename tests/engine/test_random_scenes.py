"""Scenes of random topology: the engine's sparse batched solver against the dense reference of the tests."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import steelyard as sy
from tests.engine.builders import advance, from_dense_scene
from tests.random_scenes import random_scene, well_posed
from tests.reference_solver import DenseScene, energy, residuals, step

TIME_STEPS = st.sampled_from([1 / 60, 1 / 100, 1 / 240])
# Direct meets a link to 1e-12 of its length of up to 1.5 m; up to 15 of them; and the scaled Jacobian's least
# singular value of .05 turns a length error into one of place up to twenty times as large: 4.5e-10 at
# worst, and a tenth of it for links that do not conspire.
PLACE = 1e-10
STEPS = 4


def well_posed_steps(scene: DenseScene, dt: float) -> list[DenseScene]:
    """The reference's states from the start on, as long as the scene stays away from singular postures."""
    states = [scene]
    for _ in range(STEPS):
        if not well_posed(states[-1]):
            break
        states.append(step(states[-1], dt))
    assume(len(states) > 1)
    return states


def agree(world: sy.World, row: int, state: DenseScene, *, steps: int) -> None:
    """An error of place made in one step is a speed of that over dt, which the next step carries on."""
    dt = world.method.dt
    tolerance = PLACE * 4.0 ** (steps - 1)
    np.testing.assert_allclose(
        world.particles.position[row], state.position, rtol=0, atol=tolerance
    )
    np.testing.assert_allclose(
        world.particles.velocity[row], state.velocity, rtol=0, atol=tolerance / dt
    )


@settings(max_examples=150)
@given(scene=random_scene(), dt=TIME_STEPS)
def test_direct_is_the_dense_solution(scene: DenseScene, dt: float) -> None:
    states = well_posed_steps(scene, dt)
    world = sy.World(from_dense_scene(scene), method=sy.Method(sy.Rattle(), sy.Direct(), dt=dt))
    for count, state in enumerate(states[1:], start=1):
        world.step()
        agree(world, 0, state, steps=count)
        if scene.links:
            assert np.abs(world.residual).max() <= 1e-11
            np.testing.assert_allclose(world.residual[0], residuals(state), rtol=0, atol=1e-11)
        np.testing.assert_allclose(world.energy, energy(state), rtol=1e-7, atol=1e-6)
    assert world.health[0] == 0


@settings(max_examples=30)
@given(scene=random_scene(), dt=TIME_STEPS)
def test_every_step_from_the_reference_state(scene: DenseScene, dt: float) -> None:
    # Each world of the batch takes one step from another state of the reference's trajectory: taut in
    # one lane, slack in the next.
    states = well_posed_steps(scene, dt)
    before = states[:-1]
    world = sy.World(
        from_dense_scene(scene),
        worlds=len(before),
        method=sy.Method(sy.Rattle(), sy.Direct(), dt=dt),
    )
    world.particles.position[:] = [state.position for state in before]
    world.particles.velocity[:] = [state.velocity for state in before]
    world.step()
    for row, after in enumerate(states[1:]):
        agree(world, row, after, steps=1)
    np.testing.assert_array_equal(world.health, 0)


@settings(max_examples=30)
@given(scene=random_scene(), dt=TIME_STEPS)
def test_many_sweeps_reach_the_dense_solution(scene: DenseScene, dt: float) -> None:
    # A sweep takes off the share sigma^2 / links of the error at worst: exp(-.05^2 / 20 x 60000) = 5e-4
    # for the slowest part, and far less for what a step's motion stirs up.
    states = well_posed_steps(scene, dt)
    solver = sy.GaussSeidel(passes=60_000)
    world = sy.World(from_dense_scene(scene), method=sy.Method(sy.Rattle(), solver, dt=dt))
    world.step()
    np.testing.assert_allclose(world.particles.position[0], states[1].position, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        world.particles.velocity[0], states[1].velocity, rtol=0, atol=1e-8 / dt
    )


@settings(max_examples=50)
@given(scene=random_scene(with_cables=False), dt=TIME_STEPS)
def test_rods_run_backwards(scene: DenseScene, dt: float) -> None:
    # RATTLE is symmetric: with the velocities turned about it returns to its start, undamped.
    assume(well_posed(scene))
    world = sy.World(from_dense_scene(scene), method=sy.Method(sy.Rattle(), sy.Direct(), dt=dt))
    world.particles.damping = 1.0
    advance(world, 3)
    world.particles.velocity[:] *= -1.0
    advance(world, 3)
    np.testing.assert_allclose(world.particles.position[0], scene.position, rtol=0, atol=1e-8)
    np.testing.assert_allclose(world.particles.velocity[0], -scene.velocity, rtol=0, atol=1e-8 / dt)


@pytest.mark.slow
@settings(max_examples=2000)
@given(scene=random_scene(), dt=TIME_STEPS)
def test_direct_is_the_dense_solution_at_length(scene: DenseScene, dt: float) -> None:
    states = well_posed_steps(scene, dt)
    world = sy.World(from_dense_scene(scene), method=sy.Method(sy.Rattle(), sy.Direct(), dt=dt))
    for count, state in enumerate(states[1:], start=1):
        world.step()
        agree(world, 0, state, steps=count)
    assert world.health[0] == 0
