"""The reference solver against motion known by other means."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.random_scenes import random_scene, well_posed
from tests.reference_solver import (
    Array,
    DenseScene,
    Link,
    energy,
    link_jacobian,
    project_velocity,
    residuals,
    solve_positions,
    step,
)

GRAVITY = 9.81


def advance(scene: DenseScene, dt: float, steps: int) -> DenseScene:
    for _ in range(steps):
        scene = step(scene, dt)
    return scene


def falling(
    position: list[list[float]],
    *,
    links: tuple[Link, ...],
    inverse_mass: list[float] | None = None,
    damping: float = 1.0,
) -> DenseScene:
    place = np.array(position)
    return DenseScene(
        position=place,
        velocity=np.zeros_like(place),
        inverse_mass=np.ones(len(place)) if inverse_mass is None else np.array(inverse_mass),
        acceleration=np.tile([0.0, -GRAVITY, 0.0], (len(place), 1)),
        damping=damping,
        links=links,
    )


def mechanism() -> DenseScene:
    """A branched chain in motion, hung from the origin, that carries a body of redundant rods."""
    place = [[1.0, 0, 0], [1.9, 0.3, 0.2], [2.2, 1.2, -0.3], [2.5, -0.4, 0.6], [1.6, -0.8, 0.4]]
    place += [[2.3, -0.9, -0.3], [2.0, -0.6, 1.3], [2.9, -0.3, 0.1]]
    scene = falling(
        place, links=(), inverse_mass=[1.0, 0.5, 1.0, 2.0, 1.0, 0.7, 1.0, 3.0], damping=0.8
    )
    pairs = [(0, 1), (1, 2), (1, 3), *combinations(range(3, 8), 2)]
    links = [Link("rod", 0, (0.0, 0.0, 0.0), 1.0)]
    for a, b in pairs:
        links.append(
            Link("rod", a, b, float(np.linalg.norm(scene.position[a] - scene.position[b])))
        )
    scene = replace(scene, links=tuple(links))
    random = np.random.default_rng(0).standard_normal(scene.velocity.shape)
    return replace(scene, velocity=project_velocity(scene, random, cables=[])[0])


def smooth_motion(scene: DenseScene, time: float) -> Array:
    """Positions [m] at `time` of a scene of rods, by DOP853 with the rods' forces eliminated.

    J a = -(dJ/dt) v gives the forces; the rods then drift by the integration error alone.
    """
    weight = np.repeat(scene.inverse_mass, 3)
    drag = -np.log(scene.damping)
    count = scene.position.size

    def rate(_: float, state: Array) -> Array:
        place, velocity = state[:count].reshape(-1, 3), state[count:]
        jacobian = link_jacobian(scene, place)
        free = scene.acceleration.ravel() - drag * velocity
        # J is linear in the positions and the only anchor is the origin, so dJ/dt is J at v.
        centripetal = link_jacobian(scene, velocity.reshape(-1, 3)) @ velocity
        tension = np.linalg.lstsq(
            jacobian @ (weight[:, None] * jacobian.T), -jacobian @ free - centripetal, rcond=1e-9
        )[0]
        return np.concatenate([velocity, free + weight * (jacobian.T @ tension)])

    start = np.concatenate([scene.position.ravel(), scene.velocity.ravel()])
    solution = solve_ivp(rate, (0.0, time), start, method="DOP853", rtol=1e-12, atol=1e-13)
    return solution.y[:count, -1].reshape(-1, 3)


def test_motion_under_rods_is_second_order() -> None:
    scene = mechanism()
    exact = smooth_motion(scene, 0.5)
    error = [
        np.abs(advance(scene, 0.5 / steps, steps).position - exact).max()
        for steps in (100, 200, 400)
    ]
    ratios = np.array(error[:-1]) / error[1:]
    # 4 and a share that is odd in the step: 2 % at 200 steps of this motion is ample.
    assert ratios == pytest.approx(4.0, rel=0.02)


def test_pendulum_keeps_its_energy_and_its_rod() -> None:
    scene = falling([[1.0, 0.0, 0.0]], links=(Link("rod", 0, (0.0, 0.0, 0.0), 1.0),))
    swing = 0.0
    for _ in range(2000):
        scene = step(scene, 0.01)
        swing = max(swing, abs(energy(scene)))
        assert abs(residuals(scene)).max() < 1e-14
    # The energy is 0 at release; what a second-order symmetric method lets it swing by is of the
    # order of m g L (w dt)^2, and does not grow.
    assert swing < GRAVITY * (GRAVITY * 0.01**2)


def test_a_slack_cable_does_nothing_until_it_is_taut_and_then_only_holds() -> None:
    scene = falling([[0.0, 0.0, 0.0]], links=(Link("cable", 0, (0.0, 0.0, 0.0), 0.5),))
    dt = 0.01
    slack_steps = int(np.sqrt(2 * 0.5 / GRAVITY) / dt)
    scene = advance(scene, dt, slack_steps)
    assert scene.position[0, 1] == pytest.approx(
        -0.5 * GRAVITY * (slack_steps * dt) ** 2, rel=1e-13
    )
    scene = step(scene, dt)
    assert scene.position[0] == pytest.approx([0.0, -0.5, 0.0], abs=1e-14)
    assert scene.velocity[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-13)
    held = step(scene, dt)
    assert held.position[0] == pytest.approx(scene.position[0], abs=1e-14)
    # At rest, twice the multiplier times the length over dt^2 is the weight, and it pulls.
    predicted = scene.position + 0.5 * dt**2 * scene.acceleration
    _, multiplier = solve_positions(scene, predicted)
    assert 2 * multiplier[0] * 0.5 / dt**2 == pytest.approx(-GRAVITY, rel=1e-10)
    lifted = replace(scene, velocity=np.array([[0.0, 1.0, 0.0]]))
    assert step(lifted, dt).position[0, 1] == pytest.approx(
        -0.5 + 1.0 * dt - 0.5 * GRAVITY * dt**2, rel=1e-14
    )


def test_two_cables_of_which_one_must_let_go() -> None:
    # Both are too long at the predicted place. Held by the first alone the particle ends within
    # reach of the second; to give both their length, the second would have to push.
    links = (Link("cable", 0, (0.0, 0.0, 0.0), 1.0), Link("cable", 0, (-1.0, -0.5, 0.0), 2.115))
    scene = falling([[1.0, 0.0, 0.0]], links=links)
    position, multiplier = solve_positions(scene, np.array([[1.2, 0.3, 0.0]]))
    # The correction acts along the cable's old direction, x.
    assert position[0] == pytest.approx([np.sqrt(1.0 - 0.3**2), 0.3, 0.0], abs=1e-14)
    assert multiplier[0] == pytest.approx(position[0, 0] - 1.2, rel=1e-13)
    assert multiplier[1] == 0.0


def test_an_immovable_particle_acts_as_an_anchor() -> None:
    place = [[0.2, 0.1, -0.3], [1.0, 0.6, 0.0]]
    length = float(np.linalg.norm(np.array(place[0]) - place[1]))
    held = falling(place, links=(Link("rod", 0, 1, length),), inverse_mass=[0.0, 0.5])
    free = falling(place[1:], links=(Link("rod", 0, (0.2, 0.1, -0.3), length),), inverse_mass=[0.5])
    held, free = advance(held, 0.01, 50), advance(free, 0.01, 50)
    np.testing.assert_array_equal(held.position[0], place[0])
    # The rounding of a squared length, grown over 50 steps.
    np.testing.assert_allclose(held.position[1], free.position[0], rtol=0, atol=1e-13)


def test_damping_alone_is_exact() -> None:
    scene = replace(
        falling([[0.0, 0.0, 0.0]], links=(), damping=0.3), acceleration=np.zeros((1, 3))
    )
    scene = replace(scene, velocity=np.array([[1.0, 2.0, 3.0]]))
    after = advance(scene, 0.01, 100)
    np.testing.assert_allclose(after.velocity, 0.3 * scene.velocity, rtol=1e-13)


STEPS = st.sampled_from([1 / 60, 1 / 100, 1 / 240])


@settings(max_examples=100)
@given(scene=random_scene(), dt=STEPS)
def test_links_hold_and_never_push(scene: DenseScene, dt: float) -> None:
    assert abs(residuals(scene)).max(initial=0.0) < 1e-14
    for _ in range(5):
        if not well_posed(scene):
            return
        after = step(scene, dt)
        # A squared length is closed to 1e-14; a slack cable may pass by the sign tolerance.
        assert abs(residuals(after)).max(initial=0.0) < 1e-11
        rods = [c for c, link in enumerate(scene.links) if link.kind == "rod"]
        rate = link_jacobian(after, after.position)[rods] @ after.velocity.ravel()
        assert abs(rate).max(initial=0.0) < 1e-11
        cables = [c for c, link in enumerate(scene.links) if link.kind == "cable"]
        _, pull = solve_positions(scene, scene.position + dt * scene.velocity)
        _, impulse = project_velocity(after, scene.velocity, cables=cables)
        assert (pull[cables] <= 1e-11).all()
        assert (impulse[cables] <= 1e-11).all()
        scene = after


@settings(max_examples=100)
@given(scene=random_scene(with_cables=False), dt=STEPS)
def test_rods_run_backwards(scene: DenseScene, dt: float) -> None:
    # RATTLE is symmetric: it returns to its start when the velocities are turned about. Cables
    # that catch lose energy, and damping does.
    scene = replace(scene, damping=1.0)
    there = advance(scene, dt, 3)
    back = advance(replace(there, velocity=-there.velocity), dt, 3)
    np.testing.assert_allclose(back.position, scene.position, rtol=0, atol=1e-10)
    np.testing.assert_allclose(back.velocity, -scene.velocity, rtol=0, atol=1e-8)


@settings(max_examples=100)
@given(scene=random_scene(), dt=STEPS)
def test_links_between_particles_keep_momentum(scene: DenseScene, dt: float) -> None:
    movable = scene.inverse_mass > 0.0
    inner = tuple(
        link
        for link in scene.links
        if isinstance(link.b, int) and movable[link.a] and movable[link.b]
    )
    scene = replace(scene, links=inner, damping=1.0)
    mass = np.divide(1.0, scene.inverse_mass, where=movable, out=np.zeros(len(movable)))
    after = step(scene, dt)
    gained = mass @ (after.velocity - scene.velocity) - dt * (mass @ scene.acceleration)
    np.testing.assert_allclose(gained, 0.0, atol=1e-11)
