"""Runge-Kutta, exponential and implicit methods: discrete motion, stability, what they conserve, what they solve."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import approx_fprime

import steelyard as sy

Array = np.ndarray

METHODS = [
    sy.RungeKutta4(),
    sy.KinkRungeKutta4(),
    sy.ExponentialRungeKutta(),
    sy.LinearlyImplicit(),
    sy.BackwardEuler(),
    sy.ImplicitMidpoint(),
]
IMPLICIT = [sy.LinearlyImplicit(), sy.BackwardEuler(), sy.ImplicitMidpoint()]
GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
EYE = np.eye(2, dtype=np.longdouble)


def _over(some: list[Any]) -> Any:
    return pytest.mark.parametrize("integrator", some, ids=lambda i: type(i).__name__)


# A spring


def _inverse(m: Array) -> Array:
    """Inverse in extended precision, which numpy's does not have."""
    a, b, c, d = m.ravel()
    return np.array([[d, -b], [-c, a]]) / (a * d - b * c)


def amplification(integrator: Any, z: Array) -> Array:
    """The stability function of a method at a 2 x 2 matrix z, step times derivative."""
    if isinstance(integrator, sy.RungeKutta4):
        return EYE + z + z @ z / 2 + z @ z @ z / 6 + z @ z @ z @ z / 24
    if isinstance(integrator, sy.ExponentialRungeKutta):
        return expm(z.astype(np.float64))
    if isinstance(integrator, sy.BackwardEuler):
        return _inverse(EYE - z)
    if isinstance(integrator, sy.ImplicitMidpoint):
        return _inverse(EYE - z / 2) @ (EYE + z / 2)
    gamma = 1 - np.sqrt(np.longdouble(0.5))
    once = _inverse(EYE - gamma * z)
    return once @ once @ (EYE + (1 - 2 * gamma) * z)


def springs(
    integrator: Any, phases: Array, *, damping: float = 1.0, dt: float = 1.0 / 60.0
) -> sy.World:
    """Springs of rest length 0 with h w of ``phases``, one per world, let go at x = 1 m with v = w/2 m."""
    scene = sy.Scene(gravity=(0, 0, 0))
    p = scene.add(sy.Particle(position=(1, 0, 0), mass=2.0, damping=damping))
    spring = scene.add(sy.AnchoredSpring(p, (0, 0, 0), 1.0, 0.0))
    world = sy.World(scene, worlds=len(phases), method=sy.Method(integrator, dt=dt))
    world[spring].stiffness = 2.0 * (phases / dt) ** 2
    world.particles.velocity[:, 0, 0] = 0.5 * phases / dt
    return world


def scaled(world: sy.World, phases: Array) -> Array:
    """(x, v/w) of every world, shape (worlds, 2)."""
    w = phases / world.method.dt
    x, v = world.particles.position[:, 0, 0], world.particles.velocity[:, 0, 0]
    return np.stack([x, v / w], axis=1)


@pytest.mark.parametrize("damping", [1.0, 0.9, 0.01])
@_over(METHODS)
def test_a_spring_moves_as_its_amplification_matrix_says(integrator: Any, damping: float) -> None:
    h, steps = 1.0 / 60.0, 100
    phases = np.array([0.01, 0.3, 1.0, 2.0, 2.82, 2.84, 5.0])
    world = springs(integrator, phases, damping=damping)
    world.step(steps)
    for phase, found in zip(phases, scaled(world, phases), strict=True):
        c = -math.log(damping) * h
        step = amplification(integrator, np.array([[0, phase], [-phase, -c]], dtype=np.longdouble))
        state = np.array([1.0, 0.5], dtype=np.longdouble)
        largest = 1.0
        for _ in range(steps):
            state = step @ state
            largest = max(largest, float(np.hypot(*state)))
        # A step rounds at some 1e-15 of the state.
        assert np.abs(found - state).max() < 1e-12 * largest, phase


def test_stability_limit_of_rk4_from_both_sides() -> None:
    integrator = sy.RungeKutta4()
    limit = integrator.stable_limit()
    assert limit == pytest.approx(2.8284, abs=1e-4)
    phases = np.array([0.999, 1.001]) * limit
    world = springs(integrator, phases)
    world.step(4000)
    # |R|^2 = 1 - z^6/72 + z^8/576.
    gain = np.sqrt(1.0 - phases**6 / 72.0 + phases**8 / 576.0) ** 4000
    amplitude = np.hypot(*scaled(world, phases).T) / math.hypot(1.0, 0.5)
    assert gain[0] < 1e-5
    assert gain[1] > 1e5
    np.testing.assert_allclose(amplitude, gain, rtol=1e-9)


def test_stability_limit_of_rk4_under_damping_alone_from_both_sides() -> None:
    # The real root of 1 - z/2 + z^2/6 - z^3/24 = 0: z = 2.7853.
    for share, stable in ((0.999, True), (1.001, False)):
        scene = sy.Scene(gravity=(0, 0, 0))
        scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, 0, 0)))
        scene.add(sy.Drag(linear=2.7852936 * share))
        world = sy.World(scene, method=sy.Method(sy.RungeKutta4(), dt=1.0))
        world.step(8000)
        assert (abs(world.particles.velocity[0, 0, 0]) < 1.0) == stable


@_over([*IMPLICIT, sy.ExponentialRungeKutta()])
def test_implicit_and_exponential_methods_hold_at_any_stiffness(integrator: Any) -> None:
    assert integrator.stable_limit() == math.inf
    phases = np.array([1.0, 10.0, 1e3, 1e6])
    world = springs(integrator, phases)
    steps = 50
    world.step(steps)
    z = phases
    gain = {
        sy.BackwardEuler: (1.0 + z**2) ** -0.5,
        sy.ImplicitMidpoint: np.ones(4),
        sy.ExponentialRungeKutta: np.ones(4),
        sy.LinearlyImplicit: np.sqrt(1.0 + ((1 - 2 * GAMMA) * z) ** 2) / (1.0 + (GAMMA * z) ** 2),
    }[type(integrator)]
    amplitude = np.hypot(*scaled(world, phases).T) / math.hypot(1.0, 0.5)
    # Rounding of 1 + z^2 and of the mass in it: eps z^2 a step at most, which the amplitude of L-stable methods, 1/z a
    # step, makes harmless; 1e-10 at z = 1e3.
    np.testing.assert_allclose(amplitude[:3], gain[:3] ** steps, rtol=1e-9)
    assert amplitude[3] <= 1.0 + 1e-3
    assert world.health.max() == 0


@pytest.mark.parametrize(
    ("integrator", "power", "factor"),
    [(sy.RungeKutta4(), 6, 1.0 / 72.0), (sy.LinearlyImplicit(), 4, GAMMA**4)],
    ids=["RungeKutta4", "LinearlyImplicit"],
)
def test_the_energy_a_resolved_spring_loses(integrator: Any, power: int, factor: float) -> None:
    phases = np.array([0.05, 0.1, 0.2])
    world = springs(integrator, phases)
    before = world.energy
    world.step(100)
    lost = -np.log(world.energy / before) / 100.0
    # The next terms are of relative size z^2/4 at most.
    np.testing.assert_allclose(lost, factor * phases**power, rtol=0.02)


# Networks


def network(integrator: Any, *, rest: float, dt: float, stiffness: float = 100.0) -> sy.World:
    """Five particles, all joined by springs, thrown without weight."""
    rng = np.random.default_rng(3)
    scene = sy.Scene(gravity=(0, 0, 0))
    some = [
        scene.add(
            sy.Particle(
                position=rng.uniform(-1, 1, 3), velocity=rng.uniform(-1, 1, 3), mass=1.0 + k
            )
        )
        for k in range(5)
    ]
    for k, a in enumerate(some):
        for b in some[:k]:
            scene.add(sy.Spring(a, b, stiffness * (1.0 + k), rest))
    return sy.World(scene, method=sy.Method(integrator, dt=dt))


@_over(METHODS)
def test_linear_momentum_is_kept(integrator: Any) -> None:
    world = network(integrator, rest=0.8, dt=1.0 / 60.0)
    before = world.momentum
    world.step(200)
    np.testing.assert_allclose(world.momentum, before, rtol=0, atol=200 * 1e-14)


def test_implicit_midpoint_keeps_energy_of_linear_springs_and_angular_momentum_of_all() -> None:
    linear = network(sy.ImplicitMidpoint(), rest=0.0, dt=0.1, stiffness=1e3)
    before = linear.energy
    linear.step(500)
    assert linear.health[0] == 0
    np.testing.assert_allclose(linear.energy, before, rtol=500 * 1e-14)
    bent = network(sy.ImplicitMidpoint(), rest=0.8, dt=1.0 / 120.0)
    turning, before = bent.angular_momentum, bent.energy
    energies = []
    for _ in range(20):
        bent.step(300)
        energies.append(float(bent.energy[0] / before[0]))
    assert bent.health[0] == 0
    np.testing.assert_allclose(bent.angular_momentum, turning, rtol=0, atol=6000 * 2e-14)
    # Near, by (h w)^2/8 with w about 45/s, and without drift: the other methods lose or gain it.
    assert np.ptp(energies) < 0.1
    assert abs(np.mean(energies[:10]) - np.mean(energies[10:])) < 0.01


def test_implicit_midpoint_retraces_its_steps() -> None:
    world = network(sy.ImplicitMidpoint(), rest=0.8, dt=1.0 / 60.0)
    start = world.particles.position.copy()
    world.step(60)
    world.particles.velocity[:] *= -1.0
    world.step(60)
    np.testing.assert_allclose(world.particles.position, start, rtol=0, atol=1e-9)


def test_backward_euler_and_the_linearly_implicit_method_end_at_rest() -> None:
    # hw is about 1e4: both let what they do not resolve die out, while the centre of mass goes on.
    for integrator in (sy.BackwardEuler(), sy.LinearlyImplicit()):
        world = network(integrator, rest=0.0, dt=1.0, stiffness=1e7)
        momentum, mass = world.momentum[0], 15.0
        world.step(20)
        speed = world.particles.velocity[0]
        # Rounding of (h w)^2 eps in what moves softly.
        np.testing.assert_allclose(speed, np.tile(momentum / mass, (5, 1)), rtol=0, atol=1e-6)


def test_implicit_midpoint_flags_a_world_that_needs_more_passes() -> None:
    few = network(sy.ImplicitMidpoint(passes=2), rest=0.8, dt=0.1, stiffness=1e4)
    few.step(1)
    assert few.health[0] == 2


# Against the same methods in dense matrices


def _pull(apart: Array, stiffness: float, rest: float) -> Array:
    length = np.linalg.norm(apart)
    return -stiffness * (length - rest) * apart / length


POSITION = np.array([[0.0, 0.0, 0.0], [1.1, 0.2, -0.1], [2.0, -0.3, 0.2], [0.9, 1.2, 0.3]])
VELOCITY = np.array([[0.0, 0.0, 0.0], [0.5, -1.0, 2.0], [-1.0, 0.3, 0.4], [2.0, 0.1, -0.7]])
MASS = np.array([1.0, 2.0, 0.5, 1.5])
SLACK = 1.5


def mixture(integrator: Any, *, dt: float, worlds: int = 1) -> sy.World:
    """One of every force on four particles, of which the first is immovable."""
    scene = sy.Scene()
    fixed = sy.Particle(position=POSITION[0], inverse_mass=0.0)
    some = [scene.add(fixed)] + [
        scene.add(sy.Particle(position=x, velocity=v, mass=m, damping=0.8))
        for x, v, m in zip(POSITION[1:], VELOCITY[1:], MASS[1:].tolist(), strict=True)
    ]
    a, b, c, d = some
    scene.add(sy.Spring(a, b, 50.0, 0.9))
    scene.add(sy.Spring(b, c, 80.0, 0.5))
    scene.add(sy.Spring(c, d, 30.0, 1.0))
    scene.add(sy.Bungee(b, d, 70.0, SLACK))
    scene.add(sy.Bungee(c, a, 40.0, 0.7))
    scene.add(sy.AnchoredSpring(d, (0, 2, 0), 20.0, 0.3))
    scene.add(sy.AnchoredBungee(b, (1, 3, 0), 25.0, 1.0))
    scene.add(sy.StiffSpring(c, (2, 0, 0), 60.0, 1.2))
    scene.add(sy.Drag(linear=0.3, quadratic=0.4, wind=(1, 0, 2)))
    scene.add(sy.Buoyancy(b, surface=0.1, half_depth=1.0, volume=0.003))
    scene.add(sy.Buoyancy(d, surface=-3.0, half_depth=1.0, volume=0.003))
    scene.add(sy.Buoyancy(c, surface=3.0, half_depth=0.2, volume=0.002))
    scene.add(sy.Gravity((0.2, 0, 0.1), particles=[b, c]))
    return sy.World(scene, worlds=worlds, method=sy.Method(integrator, dt=dt))


def forces(y: Array) -> Array:
    """Of the scene above on its movable particles, from positions and velocities (18,); shape (9,)."""
    x = np.concatenate([POSITION[:1], y[:9].reshape(3, 3)])
    v = np.concatenate([VELOCITY[:1], y[9:].reshape(3, 3)])
    f = MASS[:, None] * np.array([0.0, -9.81, 0.0]) + MASS[:, None] * math.log(0.8) * v

    def join(a: int, b: int, stiffness: float, rest: float, *, slack: bool = False) -> None:
        if not (slack and np.linalg.norm(x[a] - x[b]) <= rest):
            pull = _pull(x[a] - x[b], stiffness, rest)
            f[a] += pull
            f[b] -= pull

    join(0, 1, 50.0, 0.9)
    join(1, 2, 80.0, 0.5)
    join(2, 3, 30.0, 1.0)
    join(1, 3, 70.0, SLACK, slack=True)
    join(2, 0, 40.0, 0.7, slack=True)
    f[3] += _pull(x[3] - [0, 2, 0], 20.0, 0.3)
    f[1] += _pull(x[1] - [1, 3, 0], 25.0, 1.0)
    f[2] += -60.0 * (x[2] - [2, 0, 0]) - 1.2 * v[2]
    u = v - [1, 0, 2]
    f -= (0.3 + 0.4 * np.linalg.norm(u, axis=1, keepdims=True)) * u
    f[1, 1] += 1000.0 * 0.003 * 9.81 * np.clip((0.1 + 1.0 - x[1, 1]) / 2.0, 0.0, 1.0)
    f[2, 1] += 1000.0 * 0.002 * 9.81
    f[1:3] += MASS[1:3, None] * [0.2, 0, 0.1]
    return f[1:].ravel()


def rates(y: Array) -> Array:
    return np.concatenate([y[9:], forces(y) / np.repeat(MASS[1:], 3)])


def state(world: sy.World) -> Array:
    """Positions and velocities of the movable particles of world 0, (18,)."""
    return np.concatenate(
        [world.particles.position[0, 1:].ravel(), world.particles.velocity[0, 1:].ravel()]
    )


def _dense_rk4(y: Array, h: float) -> Array:
    k1 = rates(y)
    k2 = rates(y + h / 2 * k1)
    k3 = rates(y + h / 2 * k2)
    k4 = rates(y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def _dense_leg(base: Array, v: Array, reach: float) -> Array:
    """One pass from velocities v for y = base + reach F(y)."""
    guess = np.concatenate([base[:9] + reach * v, v])
    # Differences of 1e-8 leave 1e-7 of the derivative.
    jacobian = approx_fprime(guess, rates, 1e-8)
    matrix = np.eye(9) - reach * jacobian[9:, 9:] - reach**2 * jacobian[9:, :9]
    v = v + np.linalg.solve(matrix, reach * rates(guess)[9:] - (v - base[9:]))
    return np.concatenate([base[:9] + reach * v, v])


def _dense_backward_euler(y: Array, h: float) -> Array:
    return _dense_leg(y, y[9:], h)


def _dense_linearly_implicit(y: Array, h: float) -> Array:
    first = _dense_leg(y, y[9:], GAMMA * h)
    return _dense_leg(y + (1 - GAMMA) / GAMMA * (first - y), first[9:], GAMMA * h)


@pytest.mark.parametrize("h", [0.01, 0.05])
@pytest.mark.parametrize(
    ("integrator", "dense", "limit"),
    [
        (sy.RungeKutta4(), _dense_rk4, 1e-14),
        (sy.BackwardEuler(), _dense_backward_euler, 1e-7),
        (sy.LinearlyImplicit(), _dense_linearly_implicit, 1e-7),
    ],
    ids=["RungeKutta4", "BackwardEuler", "LinearlyImplicit"],
)
def test_one_step_of_all_forces(
    integrator: Any, dense: Callable[..., Array], limit: float, h: float
) -> None:
    # The bungees, one slack and one taut, and the compressed spring (between 3 and 4, which is longer than its rest
    # length only by a little) are where they are for the whole step; nothing is clipped at these steps.
    world = mixture(integrator, dt=h)
    start = state(world)
    world.step(1)
    change = dense(start, h) - start
    np.testing.assert_allclose(state(world) - start, change, rtol=0, atol=limit * 10.0)


@pytest.mark.parametrize("h", [0.01, 0.1])
@pytest.mark.parametrize(
    ("integrator", "share"),
    [(sy.BackwardEuler(passes=30), 1.0), (sy.ImplicitMidpoint(passes=30), 0.5)],
    ids=["BackwardEuler", "ImplicitMidpoint"],
)
def test_an_implicit_step_solves_its_equation(integrator: Any, share: float, h: float) -> None:
    world = mixture(integrator, dt=h)
    for _ in range(5):
        start = state(world)
        world.step(1)
        assert world.health[0] == 0
        end = state(world)
        leg = share * end + (1.0 - share) * start
        # The tolerance is on positions: 1e-12 of 2 m, over s h in velocities.
        np.testing.assert_allclose(end - start, h * rates(leg), rtol=0, atol=1e-11 / share)


@_over(METHODS)
def test_an_immovable_particle_never_moves(integrator: Any) -> None:
    world = mixture(integrator, dt=1.0 / 60.0, worlds=9)
    world.particles.position[:, 0] = np.linspace(0.1, 0.2, 27).reshape(9, 3)
    before = world.particles.position[:, 0].copy()
    world.step(100)
    np.testing.assert_array_equal(world.particles.position[:, 0], before)
    np.testing.assert_array_equal(world.particles.velocity[:, 0], 0.0)
    assert np.isfinite(world.particles.position).all()


@_over([sy.RungeKutta4(), sy.ExponentialRungeKutta()])
def test_a_written_force_is_evaluated_at_every_stage(integrator: Any) -> None:
    def brake(x: Array, v: Array, t: Array) -> Array:
        return -0.4 * np.linalg.norm(v, axis=2, keepdims=True) * v

    def final(force: Any) -> Array:
        scene = sy.Scene()
        p = scene.add(sy.Particle(position=(1, 0, 0), velocity=(0, 3, 1), mass=2.5))
        scene.add(sy.AnchoredSpring(p, (0, 0, 0), 50.0, 0.5))
        scene.add(force)
        world = sy.World(scene, method=sy.Method(integrator, dt=0.05))
        world.step(100)
        assert world.time[0] == pytest.approx(5.0, rel=1e-13)
        return world.particles.position[0, 0].copy()

    written, built_in = final(sy.UserForce(brake)), final(sy.Drag(quadratic=0.4))
    np.testing.assert_allclose(written, built_in, rtol=0, atol=1e-13)


# Where the stiffness would not be definite


@_over(IMPLICIT)
def test_a_crushed_chain_stays_finite(integrator: Any) -> None:
    """Springs pressed to a tenth of their length push across far more than the mass of a step can hold."""
    scene = sy.Scene(gravity=(0, 0, 0))
    rng = np.random.default_rng(0)
    row = [scene.add(sy.Particle(position=(0.1 * k, *rng.normal(0, 1e-3, 2)))) for k in range(10)]
    for k, p in enumerate(row[1:]):
        scene.add(sy.Spring(row[k], p, 1e5, 1.0))
    world = sy.World(scene, method=sy.Method(integrator))
    before = world.energy[0]
    world.step(600)
    assert np.isfinite(world.particles.position).all()
    if isinstance(integrator, sy.BackwardEuler):
        assert world.energy[0] < 0.1 * before


def test_coinciding_ends_of_a_spring() -> None:
    for integrator in IMPLICIT:
        scene = sy.Scene(gravity=(0, 0, 0))
        a = scene.add(sy.Particle(position=(1, 0, 0)))
        b = scene.add(sy.Particle(position=(1, 0, 0)))
        scene.add(sy.Spring(a, b, 1e3, 0.5))
        scene.add(sy.Bungee(a, b, 1e3, 0.0))
        world = sy.World(scene, method=sy.Method(integrator))
        world.step(10)
        np.testing.assert_array_equal(world.particles.position[0, 0], (1, 0, 0))


# The exponential method


def test_what_is_linear_in_one_particle_is_exact_for_the_exponential_method() -> None:
    # Two anchored springs, one stiff spring, damping, two drags in wind and weight, in one step of 2 s.
    def world(dt: float) -> sy.World:
        scene = sy.Scene()
        p = scene.add(sy.Particle(position=(1, 2, 3), velocity=(3, -1, 2), mass=1.7, damping=0.6))
        scene.add(sy.AnchoredSpring(p, (1, 0, 0), 20.0, 0.0))
        scene.add(sy.AnchoredSpring(p, (0, 3, -1), 35.0, 0.0))
        scene.add(sy.StiffSpring(p, (0, 1, 5), 10.0, 0.3))
        scene.add(sy.Drag(linear=0.2, wind=(5, 0, 0)))
        scene.add(sy.Drag(linear=0.1, wind=(0, -2, 1)))
        return sy.World(scene, method=sy.Method(sy.ExponentialRungeKutta(), dt=dt))

    once = world(2.0)
    once.step(1)
    m, c, k = 1.7, -1.7 * math.log(0.6) + 0.3 + 0.3, 65.0
    push = 20.0 * np.array([1, 0, 0]) + 35.0 * np.array([0, 3, -1]) + 10.0 * np.array([0, 1, 5])
    push = push + [1.0, 0, 0] + 0.1 * np.array([0, -2, 1]) + m * np.array([0, -9.81, 0])
    turn = expm(2.0 * np.array([[0, 1], [-k / m, -c / m]]))
    start = np.stack([np.array([1, 2, 3]) - push / k, [3.0, -1.0, 2.0]])
    y, v = turn @ start
    np.testing.assert_allclose(once.particles.position[0, 0], y + push / k, rtol=0, atol=1e-13)
    np.testing.assert_allclose(once.particles.velocity[0, 0], v, rtol=0, atol=1e-12)


def test_an_anchored_spring_of_a_million_radians_per_second_at_60_hz() -> None:
    h, w, steps = 1.0 / 60.0, 1e6, 600
    world = springs(sy.ExponentialRungeKutta(), np.array([w * h]))
    square = mpmath.mpf(float(world[world.scene.things[1]].stiffness.item())) / 2
    world.step(steps)
    with mpmath.workdps(40):
        turn = mpmath.sqrt(square) * steps * mpmath.mpf(h)
        v = mpmath.mpf(0.5 * (w * h) / h) / mpmath.sqrt(square)
        x = mpmath.cos(turn) + v * mpmath.sin(turn)
        assert abs(float(world.particles.position[0, 0, 0] - x)) < 1e-12


def test_the_exponential_method_keeps_equilibria() -> None:
    # h w = 30: the spring's rest length and the coupling shift the place of rest.
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 0, 0), mass=2.0))
    scene.add(sy.AnchoredSpring(a, (0, 1, 0), 2.0 * 1800.0**2, 0.0))
    scene.add(sy.Buoyancy(a, surface=1.0, half_depth=0.5, volume=1.0))
    world = sy.World(scene, method=sy.Method(sy.ExponentialRungeKutta()))
    lift, k, m = 9810.0, 2.0 * 1800.0**2, 2.0
    # k (1 - y) - m g + lift (1.5 - y) = 0.
    y = (k - m * 9.81 + 1.5 * lift) / (k + lift)
    world.particles.position[0, 0] = (0, y, 0)
    world.step(1000)
    np.testing.assert_allclose(world.particles.position[0, 0], (0, y, 0), rtol=0, atol=1e-12)


# Refusals


@_over(METHODS)
def test_a_smooth_method_says_what_it_cannot_hold(integrator: Any) -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 0, 0)))
    b = scene.add(sy.Particle(position=(1, 0, 0)))
    for thing in (sy.Rod(a, b), sy.Cable(a, b, 2.0), sy.Rider(a, [b]), sy.Ground()):
        scene.add(thing)
        name, kind = type(integrator).__name__, type(thing).__name__
        with pytest.raises(ValueError, match=rf"{name} cannot hold a {kind}.*Use Rattle\(\)"):
            sy.World(scene, method=sy.Method(integrator, sy.Direct()))
        scene.remove(thing)


def test_implicit_midpoint_takes_no_written_force() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 0, 0)))
    scene.add(sy.UserForce(lambda x, v, t: 0.0 * x))
    with pytest.raises(ValueError, match=r"ImplicitMidpoint.*UserForce.*Use LinearlyImplicit"):
        sy.World(scene, method=sy.Method(sy.ImplicitMidpoint()))


@pytest.mark.parametrize("bad", [0, -1, 2.5])
@pytest.mark.parametrize("kind", [sy.BackwardEuler, sy.ImplicitMidpoint])
def test_passes_are_a_count(kind: Any, bad: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="passes"):
        sy.Method(kind(passes=bad))
    with pytest.raises(ValueError, match="tolerance"):
        sy.Method(kind(tolerance=-1.0))
