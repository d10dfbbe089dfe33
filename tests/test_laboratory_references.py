"""The references of the laboratory, each by a second way that shares nothing with the first."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import roots_laguerre

pytest.importorskip("mujoco")
pytest.importorskip("pymunk")

import steelyard as sy
from benchmarks import references
from benchmarks.laboratory import pendulums
from benchmarks.laboratory.problems import (
    bouncing_ball,
    bungee,
    buoyancy,
    catenary,
    cloth,
    collision,
    contact,
    net,
    projectile,
    top,
)
from benchmarks.moving_load import taut_motion
from benchmarks.spring_network import SpringNetwork
from tests.elliptic import elliptic_spin

Array = np.ndarray


def test_quadratic_drag_by_taylor_series_of_thirty_digits() -> None:
    time, place = projectile.quadratic_impact()
    assert place == pytest.approx(78.146996, abs=5e-7)
    with mpmath.workdps(30):
        speed = mpmath.mpf(40) / mpmath.sqrt(2)

        def rate(_: mpmath.mpf, y: list[mpmath.mpf]) -> list[mpmath.mpf]:
            drag = mpmath.sqrt(y[2] ** 2 + y[3] ** 2) / 100
            return [y[2], y[3], -drag * y[2], -mpmath.mpf("9.81") - drag * y[3]]

        x, y, _, v = mpmath.odefun(rate, 0, [0, 0, speed, speed], tol=mpmath.mpf("1e-20"))(time)
        # The cosine of 45 degrees, rounded, and a few hundred steps of 2e-16.
        assert float(x) == pytest.approx(place, abs=2e-12)
        assert float(y / v) == pytest.approx(0.0, abs=1e-13)


def test_impact_measure_finds_the_true_impact_between_two_frames() -> None:
    time, place = projectile.quadratic_impact()
    frames = projectile.STRETCH * np.array(projectile._looks(time))
    motion = projectile.quadratic_drag(frames)
    # h^4 / 384 times the fourth derivative, some 5 m/s^4: what the cubic leaves.
    assert projectile.impact(place).error(motion) < 2e-9


def falling(rate: object, start: list[float], times: Array, level: float) -> Array:
    """A one-dimensional motion whose law changes at a level, integrated from event to event."""
    state, before, found = np.array(start), 0.0, []

    def crossing(_: float, y: Array) -> float:
        return float(y[0] - level)

    crossing.terminal = True  # type: ignore[attr-defined]
    for time in times:
        while before < time:
            inside = state[0] < level or (abs(state[0] - level) < 1e-9 and state[1] < 0.0)
            crossing.direction = 1.0 if inside else -1.0  # type: ignore[attr-defined]
            done = solve_ivp(
                lambda _, y, inside=inside: [y[1], rate(y[0], inside)],  # type: ignore[operator]
                (before, float(time)),
                state,
                method="DOP853",
                events=crossing,
                rtol=1e-12,
                atol=1e-13,
                max_step=0.05,
            )
            state, before = done.y[:, -1], float(done.t[-1])
            if done.status == 1:
                state = np.array([level, state[1]])
        found.append(state.copy())
    return np.array(found)


def test_bungee_by_integration_from_event_to_event() -> None:
    times = np.linspace(0.5, 10.0, 20)

    def rate(y: float, taut: bool) -> float:
        pull = bungee.STIFFNESS * (-y - bungee.LENGTH) / bungee.MASS if taut else 0.0
        return pull - bungee.GRAVITY

    found = falling(rate, [-bungee.START, 0.0], times, -bungee.LENGTH)
    motion = bungee.reference(times)
    np.testing.assert_allclose(motion.position[:, 0, 1], found[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.velocity[:, 0, 1], found[:, 1], rtol=0, atol=1e-9)


def test_buoyancy_by_integration() -> None:
    b = buoyancy
    times = np.linspace(0.5, 10.0, 20)

    def rate(_: float, y: Array) -> list[float]:
        under = min(max((b.SURFACE + b.HALF_DEPTH - y[0]) / (2 * b.HALF_DEPTH), 0.0), 1.0)
        return [y[1], b.DENSITY * b.VOLUME * b.GRAVITY * under / b.MASS - b.GRAVITY]

    found = solve_ivp(
        rate, (0.0, 10.0), [b.REST, b.SPEED], method="DOP853", t_eval=times,
        rtol=1e-13, atol=1e-14, max_step=0.02,
    ).y.T  # fmt: skip
    motion = b.reference(times)
    np.testing.assert_allclose(motion.position[:, 0, 1], found[:, 0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(motion.velocity[:, 0, 1], found[:, 1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("restitution", [0.5, 0.8, 1.0])
def test_bouncing_ball_by_its_peaks_and_its_stop(restitution: float) -> None:
    h, g = bouncing_ball.HEIGHT, bouncing_ball.GRAVITY
    fall = math.sqrt(2 * h / g)
    # Peak k comes after the fall and twice the rise of every bounce before; each rise takes e^k falls.
    peaks = [
        fall * (1 + 2 * sum(restitution**j for j in range(1, k)) + restitution**k)
        for k in (1, 2, 3)
    ]
    motion = bouncing_ball.reference(restitution, np.array(peaks))
    heights = [h * restitution ** (2 * k) for k in (1, 2, 3)]
    np.testing.assert_allclose(motion.position[:, 0, 1], heights, rtol=1e-13)
    np.testing.assert_allclose(motion.velocity[:, 0, 1], 0.0, rtol=0, atol=1e-13)
    if restitution < 1.0:
        stop = fall * (1 + restitution) / (1 - restitution)
        around = bouncing_ball.reference(restitution, np.array([stop * (1 - 1e-6), stop * 1.0001]))
        assert around.velocity[0].any() or around.position[0].any()
        assert not around.velocity[1].any() and not around.position[1].any()


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_collision_by_its_laws(restitution: float) -> None:
    before, after = collision.reference(restitution, np.array([0.1, 0.9])).velocity[:, :, 0]
    mass = np.array(collision.MASSES)
    assert after @ mass == pytest.approx(before @ mass, rel=1e-15)
    assert after[1] - after[0] == pytest.approx(restitution * (before[0] - before[1]), abs=1e-15)
    lost = 0.5 * (mass @ before**2 - mass @ after**2)
    reduced = mass.prod() / mass.sum()
    closing = before[0] - before[1]
    assert lost == pytest.approx(0.5 * reduced * (1 - restitution**2) * closing**2, abs=1e-14)
    # Centre of mass: untouched by the collision.
    late = collision.reference(restitution, np.array([0.9])).position[0, :, 0]
    start = np.array([0.0, collision.GAP + 2 * collision.RADIUS])
    assert mass @ late == pytest.approx(mass @ (start + 0.9 * before), rel=1e-14)
    assert late[1] - late[0] >= 2 * collision.RADIUS - 1e-15


def test_catenary_by_statics_of_the_network() -> None:
    place = catenary.discrete_catenary()
    rest = references.equilibrium(catenary.cable(place + 0.01 * np.eye(len(place), 3)))
    np.testing.assert_allclose(rest.position, place, rtol=0, atol=1e-12)
    # Close to the continuous one, y = a cosh(x / a): the sag of as long a cable is some per mille away.
    length = catenary.LINK * (catenary.COUNT + 1)
    a = 0.3
    for _ in range(100):
        a -= (2 * a * math.sinh(0.5 * catenary.SPAN / a) - length) / (
            2 * math.sinh(0.5 * catenary.SPAN / a)
            - catenary.SPAN / a * math.cosh(0.5 * catenary.SPAN / a)
        )
    sag = a * (math.cosh(0.5 * catenary.SPAN / a) - 1.0)
    assert -place[:, 1].min() == pytest.approx(sag, rel=5e-3)


def test_one_pendulum_of_the_chain_is_the_elliptic_one() -> None:
    chain = pendulums.Pendulums(
        mass=(2.0,), length=1.3, angle=pendulums.LEVEL, times=pendulums.even(5.0, 0.5)
    )
    angle, _ = references.pendulum(np.array(chain.times), length=1.3)
    exact = 1.3 * np.stack([np.sin(angle), -np.cos(angle), np.zeros_like(angle)], axis=1)
    np.testing.assert_allclose(pendulums.integrate(chain).position[:, 0], exact, rtol=0, atol=1e-11)


def test_small_motions_of_the_chain_have_the_frequencies_of_laguerre() -> None:
    # Across a hanging chain of equal links the squared frequencies are g/l times the zeros of L_n.
    count, length, angle = 5, 0.4, 1e-5
    chain = pendulums.Pendulums(
        mass=(1.0,) * count, length=length, angle=angle, times=pendulums.even(3.0, 0.5)
    )
    tension = pendulums.GRAVITY * np.arange(count, 0, -1) / length
    matrix = np.diag(tension) + np.diag([*tension[1:], 0.0])
    matrix -= np.diag(tension[1:], 1) + np.diag(tension[1:], -1)
    values, shapes = np.linalg.eigh(matrix)
    zeros = roots_laguerre(count)[0]
    np.testing.assert_allclose(values, pendulums.GRAVITY / length * np.sort(zeros), rtol=1e-12)
    start = shapes.T @ (angle * length * np.arange(1, count + 1))
    swings = np.cos(np.sqrt(values) * np.array(chain.times)[:, None]) * start
    found = pendulums.integrate(chain).position[:, :, 0]
    # What is left out is of the order angle^2 of it.
    np.testing.assert_allclose(found, swings @ shapes.T, rtol=0, atol=10 * angle**3)


@pytest.mark.parametrize(
    "name",
    [
        "triple",
        "chain_1",
        pytest.param("chain_1000", marks=pytest.mark.slow),
        pytest.param("chain_1e+06", marks=pytest.mark.slow),
    ],
)
def test_chains_by_the_forces_of_their_rods_in_space(name: str) -> None:
    # Positions in space and multipliers of the rods, by other code; the stored motion must be the one.
    chain = pendulums.CHAINS[name]
    scene = pendulums.scene(chain)
    looks = chain.times if name != "chain_1e+06" else chain.times[:2]
    masses = np.tile(scene.mass, (len(looks), 1))
    tolerance = 1e-13 if name != "chain_1e+06" else 1e-11
    position, velocity = taut_motion(scene, masses, chain.times[0], tolerance=tolerance)
    stored = pendulums.stored(name)
    np.testing.assert_allclose(stored.position[: len(looks)], position, rtol=0, atol=1e-10)
    # Light links under a heavy end vibrate at up to 34,000 rad/s: 1e-11 m are 3e-7 m/s.
    speed = 3e-7 if name == "chain_1e+06" else 1e-8
    np.testing.assert_allclose(stored.velocity[: len(looks)], velocity, rtol=0, atol=speed)


def test_stored_motions_are_what_their_program_makes() -> None:
    for name in ("triple", "chain_1"):
        again = pendulums.integrate(pendulums.CHAINS[name], tolerance=1e-12)
        np.testing.assert_allclose(
            again.position, pendulums.stored(name).position, rtol=0, atol=1e-11
        )
    for name, chain in pendulums.CHAINS.items():
        stored, scene = pendulums.stored(name), pendulums.scene(chain)
        span = np.diff(stored.position, axis=1, prepend=np.zeros((len(chain.times), 1, 3)))
        np.testing.assert_allclose(np.linalg.norm(span, axis=2), chain.length, rtol=1e-13)
        kinetic = 0.5 * np.einsum("p,tpc,tpc->t", scene.mass, stored.velocity, stored.velocity)
        height = pendulums.GRAVITY * stored.position[:, :, 1] @ scene.mass
        # Let go level with the anchor: no energy at the start.
        np.testing.assert_allclose(kinetic + height, 0.0, rtol=0, atol=1e-9 * kinetic.max())


def test_cloth_by_another_tolerance_and_by_small_steps_of_order_four() -> None:
    stored = cloth.stored()
    again = cloth.integrate(tolerance=1e-9)
    np.testing.assert_allclose(again.position, stored.position, rtol=0, atol=1e-8)
    world = sy.World(sy.scenes.cloth(), method=sy.Method(sy.RungeKutta4(), dt=cloth.STRETCH / 128))
    for place, speed in zip(stored.position, stored.velocity, strict=True):
        world.step(128)
        np.testing.assert_allclose(world.particles.position[0], place, rtol=0, atol=1e-8)
        np.testing.assert_allclose(world.particles.velocity[0], speed, rtol=0, atol=1e-5)


def test_net_keeps_its_energy_and_is_met_by_order_four() -> None:
    stored = net.stored()
    network = SpringNetwork(net.net())
    change = network.energy(stored.position, stored.velocity) - network.energy(
        *network.start[:, None]
    )
    np.testing.assert_allclose(change, 0.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(net.integrate().position, stored.position, rtol=0, atol=1e-11)
    distance = []
    for steps in (96, 192):
        method = sy.Method(sy.KinkRungeKutta4(), dt=net.STRETCH / steps)
        world = sy.World(net.net(), method=method)
        world.step(steps * len(net.LOOKS))
        distance.append(np.abs(world.particles.position[0] - stored.position[-1]).max())
    assert distance[1] < 2e-6 and distance[0] / distance[1] > 10.0


def test_free_top_is_the_elliptic_solution_and_keeps_its_momentum() -> None:
    true = top.stored("free")
    turn = true.position[:, 1:]  # its rows are the body's axes
    spin = 0.5 * np.cross(turn, true.velocity[:, 1:]).sum(axis=1)
    own = np.einsum("tkc,tc->tk", turn, spin)
    for time, found in zip(top.STRETCH * np.array(top.LOOKS), own, strict=True):
        exact = elliptic_spin(np.array(top.SPIN), time)
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-13)
    momentum = np.einsum("tkc,tk->tc", turn, own * top.INERTIA)
    start = np.array(top.SPIN) * top.INERTIA
    np.testing.assert_allclose(momentum, np.broadcast_to(start, momentum.shape), rtol=0, atol=1e-10)


def test_heavy_top_by_order_six_and_by_its_three_constants() -> None:
    true = top.stored("heavy")
    turn = true.position[:, 1:]
    spin = 0.5 * np.cross(turn, true.velocity[:, 1:]).sum(axis=1)
    first = top.ACROSS + top.MASS * top.ARM**2
    momentum = np.einsum(
        "tkc,tk->tc", turn, np.einsum("tkc,tc->tk", turn, spin) * [first, top.ALONG, first]
    )
    # What is left of the momentum: along the axis, and along the vertical.
    np.testing.assert_allclose(
        np.einsum("tc,tc->t", momentum, turn[:, 1]), top.ALONG * top.RATE, rtol=1e-12
    )
    np.testing.assert_allclose(
        momentum[:, 1], top.ALONG * top.RATE * math.cos(top.TILT), rtol=1e-12
    )
    world = sy.World(top.heavy_top(), method=sy.Method(sy.ComposedRattle(9), dt=1.0 / 480.0))
    world.step(4_800)
    np.testing.assert_allclose(sy.landmarks(world)[0][0], true.position[-1], rtol=0, atol=1e-10)


def test_projectile_without_drag_is_the_limit_of_little_drag() -> None:
    times = np.array([1.0, 2.0])
    thin = projectile.quadratic_drag(times, quadratic=1e-9)
    exact = projectile.SPEED * times
    np.testing.assert_allclose(thin.position[:, 0, 0], exact, rtol=0, atol=1e-4)
    np.testing.assert_allclose(
        thin.position[:, 0, 1], exact - 0.5 * 9.81 * times**2, rtol=0, atol=1e-4
    )


@pytest.mark.parametrize(
    ("scene", "motion", "constant"),
    [
        (contact.sliding_block, contact.sliding, False),
        (contact.rolling_ball, contact.rolling, False),
        (contact.bouncing_body, contact.bouncing, False),
        (contact.cradle, contact.swinging, True),
    ],
)
def test_bodies_that_touch_start_with_the_scene_and_move_as_they_say(
    scene: Any, motion: Any, constant: bool
) -> None:
    start = motion(np.array([0.0]))
    places, speeds = sy.landmarks(sy.World(scene()))
    np.testing.assert_allclose(start.position[0], places[0], atol=1e-12)
    np.testing.assert_allclose(start.velocity[0], speeds[0], atol=1e-12)
    # Between events: places change by the velocities.
    h = 1e-4
    times = np.array([0.11, 0.31, 0.62, 0.87, 1.23])
    before, now, after = motion(times - h), motion(times), motion(times + h)
    rates = (after.position - before.position) / (2 * h)
    np.testing.assert_allclose(rates, now.velocity, atol=2e-5)
    energy = contact.energy_of(scene())(now.position, now.velocity)
    own = sy.World(scene()).energy[0]
    if constant:
        np.testing.assert_allclose(energy - energy[0], 0.0, atol=1e-9 * abs(own) + 1e-12)
    assert (np.diff(energy) <= 1e-9 * abs(own)).all()
    np.testing.assert_allclose(
        contact.energy_of(scene())(start.position, start.velocity)[0], own, rtol=1e-12
    )


def test_a_rolling_ball_does_not_slip_and_keeps_its_moment_about_the_ground() -> None:
    true = contact.rolling(np.array([0.1, 0.4, 0.5, 1.0]))
    speed = true.velocity.reshape(4, 4, 3)
    spin = 0.5 * np.cross(
        np.diff(true.position.reshape(4, 4, 3)[:, [0, 1]], axis=1), speed[:, 1:2] - speed[:, :1]
    )
    v, w = speed[:, 0, 0], 2.0 * spin[:, 0, 2]
    np.testing.assert_allclose(v[2:] + contact.RADIUS * w[2:], 0.0, atol=1e-12)
    assert (v[:2] + contact.RADIUS * w[:2] > 0.1).all()
    np.testing.assert_allclose(v - 0.4 * contact.RADIUS * w, contact.SPEED, rtol=1e-12)
