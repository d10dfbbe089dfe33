"""The contract of every integrator: order, stability limit and discrete motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steelyard as sy
from steelyard.integrators.base import Integrator

Array = np.ndarray

SMOOTH_METHODS = [
    sy.RungeKutta4(),
    sy.KinkRungeKutta4(),
    sy.ExponentialRungeKutta(),
    sy.LinearlyImplicit(),
    sy.BackwardEuler(),
    sy.ImplicitMidpoint(),
    sy.GeneralisedAlpha(),
]
STEPPING = [sy.ExplicitEuler(), sy.SymplecticEuler(), sy.Rattle(), *SMOOTH_METHODS]
# Parts of whose step run backwards in time; they refuse drag and stiff springs.
COMPOSED = [sy.ComposedRattle(substeps=substeps) for substeps in (3, 5, 9)]
# Whose step impacts divide; it refuses drag and stiff springs too.
DIVIDED = [sy.ImpactRattle()]
INTEGRATORS: list[Any] = [*STEPPING, *COMPOSED, *DIVIDED, sy.ClosedForm()]
# Whose damping is a closed form.
DAMPING_EXACTLY = [
    sy.ExplicitEuler(),
    sy.SymplecticEuler(),
    sy.Rattle(),
    sy.ExponentialRungeKutta(),
    sy.ClosedForm(),
]
SPLITTING = [sy.SymplecticEuler(), sy.Rattle()]


def _name(integrator: Any) -> str:
    substeps = getattr(integrator, "substeps", "")
    return f"{type(integrator).__name__}{substeps}"


def _over(some: list[Any]) -> Any:
    return pytest.mark.parametrize("integrator", some, ids=_name)


def test_every_integrator_is_here() -> None:
    below = set(Integrator.__subclasses__())
    below |= {kind for one in below for kind in one.__subclasses__()}
    assert {type(integrator) for integrator in INTEGRATORS} == below


# Order

ANCHOR = np.array([0.0, 0.5, 0.0])
GRAVITY = np.array([0.0, -9.81, 0.0])
START = np.array([[1.2, 0.0, 0.3], [-0.4, 0.6, -0.8]])
SPEED = np.array([[0.0, 1.0, -2.0], [1.5, 0.5, 1.0]])
MASS = np.array([[2.0], [0.5]])


def _pull(apart: Array, stiffness: float, rest: float) -> Array:
    length = np.linalg.norm(apart)
    return -stiffness * (length - rest) * apart / length


def _springs(t: float, x: Array, v: Array) -> Array:
    """Anchored spring on a, spring between a and b, bungee that stays taut on b."""
    between = _pull(x[0] - x[1], 30.0, 1.0)
    return np.stack([_pull(x[0] - ANCHOR, 40.0, 0.7) + between, _pull(x[1], 20.0, 0.01) - between])


def _add_springs(scene: sy.Scene, a: sy.Particle, b: sy.Particle) -> None:
    scene.add(sy.AnchoredSpring(a, ANCHOR, 40.0, 0.7))
    scene.add(sy.Spring(a, b, 30.0, 1.0))
    scene.add(sy.AnchoredBungee(b, (0, 0, 0), 20.0, 0.01))


def _brake(v: Array, linear: float, quadratic: float, wind: tuple[float, float, float]) -> Array:
    relative = v - np.array(wind)
    speed = np.linalg.norm(relative, axis=1, keepdims=True)
    return -(linear + quadratic * speed) * relative


def _one_drag(t: float, x: Array, v: Array) -> Array:
    return _springs(t, x, v) + _brake(v, 0.5, 0.4, (1.0, 0.0, 3.0))


def _add_one_drag(scene: sy.Scene, a: sy.Particle, b: sy.Particle) -> None:
    _add_springs(scene, a, b)
    scene.add(sy.Drag(linear=0.5, quadratic=0.4, wind=(1, 0, 3)))


def _two_drags(t: float, x: Array, v: Array) -> Array:
    return _one_drag(t, x, v) + _brake(v, 0.0, 0.6, (-4.0, 2.0, 0.0))


def _add_two_drags(scene: sy.Scene, a: sy.Particle, b: sy.Particle) -> None:
    _add_one_drag(scene, a, b)
    scene.add(sy.Drag(quadratic=0.6, wind=(-4, 2, 0)))


def _damping(t: float, x: Array, v: Array) -> Array:
    return _one_drag(t, x, v) + MASS * math.log(0.4) * v


def _float(t: float, x: Array, v: Array) -> Array:
    lift = 9.81 * 1000.0 * 0.004 * (2.0 - x[:1, 1:2]) / 4.0
    steady = MASS * np.array([1.0, -2.0, 0.5])
    return _springs(t, x, v) + np.pad(lift, ((0, 1), (1, 1))) + steady


def _add_float(scene: sy.Scene, a: sy.Particle, b: sy.Particle) -> None:
    _add_springs(scene, a, b)
    scene.add(sy.Buoyancy(a, surface=0.0, half_depth=2.0, volume=0.004))
    scene.add(sy.Gravity((1, -2, 0.5)))


def _driven(t: float, x: Array, v: Array) -> Array:
    return _springs(t, x, v) - 4.0 * x**3 + 5.0 * math.cos(7.0 * t)


def _add_driven(scene: sy.Scene, a: sy.Particle, b: sy.Particle) -> None:
    def force(position: Array, velocity: Array, time: Array) -> Array:
        return -4.0 * position**3 + 5.0 * np.cos(7.0 * time)[:, None, None]

    _add_springs(scene, a, b)
    scene.add(sy.UserForce(force))


Smooth = tuple[Callable[..., Array], Callable[..., None], float]
SMOOTH: dict[str, Smooth] = {
    "springs": (_springs, _add_springs, 1.0),
    "one drag": (_one_drag, _add_one_drag, 1.0),
    "two drags": (_two_drags, _add_two_drags, 1.0),
    "damping and drag": (_damping, _add_one_drag, 0.4),
    "float": (_float, _add_float, 1.0),
    "user force of time": (_driven, _add_driven, 1.0),
}


@pytest.mark.parametrize("name", SMOOTH)
@_over([*STEPPING, *COMPOSED, *DIVIDED])
def test_order_on_smooth_motion(integrator: Any, name: str) -> None:
    if name == "user force of time" and not integrator.evaluations:
        pytest.skip("refused")
    if "drag" in name and integrator in (*COMPOSED, *DIVIDED):
        pytest.skip("refused")
    force, add, damping = SMOOTH[name]

    def rate(t: float, state: Array) -> Array:
        x, v = state.reshape(2, 2, 3)
        return np.concatenate([v, force(t, x, v) / MASS + GRAVITY]).ravel()

    start = np.concatenate([START, SPEED]).ravel()
    exact = solve_ivp(rate, (0.0, 1.0), start, method="DOP853", rtol=2.5e-14, atol=1e-14).y[:, -1]

    # Steps short enough for the leading term of the error to stand alone.
    counts = np.array([1, 2, 4, 8]) * {1: 500, 2: 100, 4: 300, 6: 50}[integrator.order()]
    errors = []
    for count in counts.tolist():
        scene = sy.Scene()
        a, b = (
            scene.add(sy.Particle(position=x, velocity=v, mass=m, damping=damping))
            for x, v, m in zip(START, SPEED, MASS[:, 0].tolist(), strict=True)
        )
        add(scene, a, b)
        world = sy.World(scene, method=sy.Method(integrator, dt=1.0 / count))
        world.step(count)
        state = np.concatenate([world.particles.position[0], world.particles.velocity[0]]).ravel()
        errors.append(np.linalg.norm(state - exact))
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # The next term of the expansion bends the line by some (h w)^order, with w about 15/s.
    assert slope == pytest.approx(integrator.order(), abs=0.1), errors


def test_closed_form_claims_no_order_since_its_error_does_not_depend_on_the_step() -> None:
    assert sy.ClosedForm().order() == 0
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 1, 0), velocity=(40, 30, 0), damping=0.9))
    once = sy.World(scene, method=sy.Method(sy.ClosedForm(), dt=4.0))
    often = sy.World(scene, method=sy.Method(sy.ClosedForm(), dt=1.0 / 64.0))
    once.step(1)
    often.step(256)
    # 256 roundings of numbers up to 160 m.
    np.testing.assert_allclose(
        once.particles.position, often.particles.position, rtol=0, atol=256 * 1.5e-14
    )


def test_verlet_retraces_its_steps() -> None:
    scene = sy.Scene()
    a, b = (
        scene.add(sy.Particle(position=x, velocity=v, mass=m))
        for x, v, m in zip(START, SPEED, MASS[:, 0].tolist(), strict=True)
    )
    _add_float(scene, a, b)
    world = sy.World(scene, method=sy.Method(sy.Rattle()))
    world.step(300)
    world.particles.velocity[:] *= -1.0
    world.step(300)
    # 600 steps of 1e-16, with errors that grow with the time (the motion is not chaotic here).
    np.testing.assert_allclose(world.particles.position[0], START, rtol=0, atol=1e-11)
    np.testing.assert_allclose(world.particles.velocity[0], -SPEED, rtol=0, atol=1e-10)


# Free flight and damping


@pytest.mark.parametrize(
    ("integrator", "offset"),
    [
        (sy.ExplicitEuler(), 0.5),
        (sy.SymplecticEuler(), -0.5),
        (sy.Rattle(), 0.0),
        (sy.ClosedForm(), 0.0),
        (sy.ComposedRattle(), 0.0),
        (sy.RungeKutta4(), 0.0),
        (sy.ExponentialRungeKutta(), 0.0),
        (sy.LinearlyImplicit(), 0.0),
        (sy.BackwardEuler(), -0.5),
        (sy.ImplicitMidpoint(), 0.0),
        (sy.GeneralisedAlpha(), 0.0),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_parabola_of_every_integrator(integrator: Any, offset: float) -> None:
    # Sums of h v_k: x_n = x_0 + v t - g t^2 / 2 + offset g h t, exactly for every n.
    h, steps, g = 1.0 / 64.0, 256, 9.81
    t = h * steps
    scene = sy.Scene()
    scene.add(sy.Particle(position=(1, 2, 3), velocity=(28, 28, -1), mass=3.0))
    world = sy.World(scene, method=sy.Method(integrator, dt=h))
    world.step(steps)
    expected = (1 + 28 * t, 2 + 28 * t - g * t * t / 2.0 + offset * g * h * t, 3 - t)
    # 256 additions to at most 113 m, each rounded by 7e-15, or as many for each substep.
    added = 256 * getattr(integrator, "substeps", 1)
    np.testing.assert_allclose(
        world.particles.position[0, 0], expected, rtol=0, atol=added * 7.2e-15
    )
    np.testing.assert_allclose(
        world.particles.velocity[0, 0], (28, 28 - g * t, -1), rtol=0, atol=added * 1.8e-15
    )


@pytest.mark.parametrize("damping", [0.999, 0.5, 1e-6])
@_over(DAMPING_EXACTLY)
def test_damping_keeps_its_share_of_the_velocity(integrator: Any, damping: float) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(0, 0, 0), velocity=(1, -2, 3), damping=damping))
    world = sy.World(scene, method=sy.Method(integrator))
    world.step(90)
    # 180 products and a power, each rounded by 1.1e-16; the power's argument 1/60 by as much, which
    # counts ln(d) <= 14 times.
    np.testing.assert_allclose(
        world.particles.velocity[0, 0], np.array([1, -2, 3]) * damping**1.5, rtol=180 * 2e-16
    )


@pytest.mark.parametrize("linear", [0.0, 1e-12, 1e-4, 0.7, 30.0])
@pytest.mark.parametrize("quadratic", [0.0, 0.3, 20.0])
@_over(SPLITTING)
def test_drag_alone_is_exact(integrator: Any, quadratic: float, linear: float) -> None:
    """dw/dt = -(k1 w + k2 w^2) / m has w(t) = w e / (1 + k2 w phi), in wind as in still air."""
    mass, wind, t = 1.6, np.array([3.0, 0.0, -1.0]), 1.5
    relative = np.array([20.0, -5.0, 8.0])
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(0, 0, 0), velocity=wind + relative, mass=mass))
    scene.add(sy.Drag(linear=linear, quadratic=quadratic, wind=wind))
    world = sy.World(scene, method=sy.Method(integrator))
    world.step(90)
    speed = float(np.linalg.norm(relative))
    phi = -math.expm1(-linear * t / mass) / linear if linear else t / mass
    left = math.exp(-linear * t / mass) / (1.0 + quadratic * speed * phi)
    # 90 or 180 flows, each of some five roundings of at most 22 m/s.
    np.testing.assert_allclose(
        world.particles.velocity[0, 0], wind + left * relative, rtol=0, atol=900 * 2.5e-15
    )


@_over([*SPLITTING, *SMOOTH_METHODS])
def test_linear_drag_is_damping(integrator: Any) -> None:
    # F = -k1 v keeps exp(-k1/m) of the velocity over a second.
    def final(*, damping: float, linear: float) -> Array:
        scene = sy.Scene()
        p = scene.add(
            sy.Particle(position=(1, 0, 0), velocity=(0, 3, 1), mass=2.5, damping=damping)
        )
        scene.add(sy.AnchoredSpring(p, (0, 0, 0), 50.0, 0.5))
        scene.add(sy.Drag(linear=linear))
        world = sy.World(scene, method=sy.Method(integrator))
        world.step(120)
        return world.particles.position[0, 0].copy()

    np.testing.assert_allclose(
        final(damping=0.3, linear=0.0),
        final(damping=1.0, linear=-2.5 * math.log(0.3)),
        rtol=0,
        atol=1e-12,
    )


@_over(STEPPING)
def test_many_steps_at_once_are_the_same_bits_as_one_by_one(integrator: Any) -> None:
    def build() -> sy.World:
        scene = sy.Scene()
        a = scene.add(sy.Particle(position=START[0], velocity=SPEED[0], damping=0.9))
        b = scene.add(sy.Particle(position=START[1], velocity=SPEED[1], damping=0.9))
        c = scene.add(sy.Particle(position=(2, 1, 0)))
        _add_one_drag(scene, a, b)
        scene.add(sy.StiffSpring(c, (1, 1, 1), 1e5, 3.0))
        scene.add(sy.Spring(a, c, 10.0, 1.0))
        return sy.World(scene, method=sy.Method(integrator))

    once, often = build(), build()
    once.step(50)
    for _ in range(50):
        often.step(1)
    np.testing.assert_array_equal(once.particles.position, often.particles.position)
    np.testing.assert_array_equal(once.particles.velocity, often.particles.velocity)
    np.testing.assert_array_equal(once.time, often.time)
