"""The contract of every force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from steelyard.scene.scene import FORCES

Array = np.ndarray

MASS = np.array([2.0, 0.7])
ANCHOR = np.array([0.3, -0.2, 0.5])
WIND = np.array([1.5, -0.5, 0.25])
INTEGRATORS = [sy.ExplicitEuler(), sy.SymplecticEuler(), sy.Rattle()]


def _pull(apart: Array, stiffness: float, rest: float, *, slack: bool = False) -> Array:
    """-k (l - l0) n for vectors ``apart`` of shape (..., 3); nothing below l0 where ``slack``."""
    length = np.linalg.norm(apart, axis=-1, keepdims=True)
    stretch = length - rest
    return -stiffness * (np.maximum(stretch, 0.0) if slack else stretch) * apart / length


def _between(
    stiffness: float, rest: float, *, slack: bool = False
) -> Callable[[Array, Array], Array]:
    def formula(x: Array, v: Array) -> Array:
        on_a = _pull(x[:, 0] - x[:, 1], stiffness, rest, slack=slack)
        return np.stack([on_a, -on_a], axis=1)

    return formula


def _anchored(
    stiffness: float, rest: float, *, slack: bool = False
) -> Callable[[Array, Array], Array]:
    def formula(x: Array, v: Array) -> Array:
        on_a = _pull(x[:, 0] - ANCHOR, stiffness, rest, slack=slack)
        return np.stack([on_a, np.zeros_like(on_a)], axis=1)

    return formula


def _drag(x: Array, v: Array) -> Array:
    relative = v - WIND
    speed = np.linalg.norm(relative, axis=-1, keepdims=True)
    return -(0.8 * speed + 0.3 * speed**2) * relative / speed


def _implosion(x: Array, v: Array) -> Array:
    """What an explosion begins with."""
    away = x - ANCHOR
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    return np.where(distance > 0.3, -6.0 * away / distance, 0.0)


def _stiff(x: Array, v: Array) -> Array:
    on_a = -40.0 * (x[:, 0] - ANCHOR) - 3.0 * v[:, 0]
    return np.stack([on_a, np.zeros_like(on_a)], axis=1)


def _lift(x: Array, v: Array) -> Array:
    """Surface at .2 m, half depth .8 m, 3 litres of a liquid of 900 kg/m^3."""
    force = np.zeros_like(x)
    force[:, 0, 1] = 0.003 * 900.0 * 9.81 * np.clip((0.2 + 0.8 - x[:, 0, 1]) / 1.6, 0.0, 1.0)
    return force


def _cubic(x: Array, v: Array, time: Array) -> Array:
    return -0.5 * x**3


def _quartic(x: Array) -> Array:
    return 0.125 * (x**4).sum(axis=(1, 2))


@dataclass(frozen=True)
class Case:
    """A force on the particles a (and b), and what it must be.

    Attributes:
        kind: the class.
        build: the force from the particles.
        formula: forces [N] (worlds, 2, 3) from positions and velocities (worlds, 2, 3).
        conservative: whether it has an energy.
        parameters: three other values of every parameter.
    """

    kind: type
    build: Callable[[sy.Particle, sy.Particle], Any]
    formula: Callable[[Array, Array], Array]
    conservative: bool = True
    parameters: dict[str, list[Any]] = field(default_factory=dict)


_SPRING_PARAMETERS: dict[str, list[Any]] = {
    "stiffness": [5.0, 11.0, 40.0],
    "rest_length": [0.0, 0.4, 3.0],
}
_ANCHORS: dict[str, list[Any]] = {"anchor": [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (-1.0, 0.5, 0.0)]}

CASES = [
    Case(
        sy.Gravity,
        lambda a, b: sy.Gravity((0.5, -3.0, 1.0)),
        lambda x, v: MASS[:, None] * np.array([0.5, -3.0, 1.0]) + np.zeros_like(x),
        parameters={"acceleration": [(0.0, -9.81, 0.0), (0.0, -1.62, 0.0), (1.0, 2.0, 3.0)]},
    ),
    Case(
        sy.Drag,
        lambda a, b: sy.Drag(linear=0.8, quadratic=0.3, wind=tuple(WIND)),
        _drag,
        conservative=False,
        parameters={
            "linear": [0.0, 0.5, 9.0],
            "quadratic": [0.0, 0.1, 2.0],
            "wind": [(0.0, 0.0, 0.0), (5.0, 0.0, 1.0), (0.0, -2.0, 0.0)],
        },
    ),
    Case(
        sy.Spring,
        lambda a, b: sy.Spring(a, b, stiffness=20.0, rest_length=1.5),
        _between(20.0, 1.5),
        parameters=_SPRING_PARAMETERS,
    ),
    Case(
        sy.Bungee,
        lambda a, b: sy.Bungee(a, b, stiffness=20.0, rest_length=1.5),
        _between(20.0, 1.5, slack=True),
        parameters=_SPRING_PARAMETERS,
    ),
    Case(
        sy.AnchoredSpring,
        lambda a, b: sy.AnchoredSpring(a, ANCHOR, stiffness=15.0, rest_length=1.2),
        _anchored(15.0, 1.2),
        parameters=_SPRING_PARAMETERS | _ANCHORS,
    ),
    Case(
        sy.AnchoredBungee,
        lambda a, b: sy.AnchoredBungee(a, ANCHOR, stiffness=15.0, rest_length=1.2),
        _anchored(15.0, 1.2, slack=True),
        parameters=_SPRING_PARAMETERS | _ANCHORS,
    ),
    Case(
        sy.StiffSpring,
        lambda a, b: sy.StiffSpring(a, ANCHOR, stiffness=40.0, damping=3.0),
        _stiff,
        parameters={"stiffness": [5.0, 1e4, 1e8], "damping": [0.0, 0.5, 1e5]} | _ANCHORS,
    ),
    Case(
        sy.Buoyancy,
        lambda a, b: sy.Buoyancy(a, surface=0.2, half_depth=0.8, volume=0.003, density=900.0),
        _lift,
        parameters={
            "surface": [-0.5, 0.0, 1.0],
            "half_depth": [0.1, 0.5, 2.0],
            "volume": [0.001, 0.01, 0.002],
            "density": [1.2, 1000.0, 13_534.0],
            "gravity": [1.62, 9.81, 24.8],
        },
    ),
    Case(
        sy.Explosion,
        lambda a, b: sy.Explosion(
            place=ANCHOR,
            start=-0.02,
            implosion_force=6.0,
            implosion_duration=0.05,
            implosion_least=0.3,
            implosion_most=9.0,
            wave_force=30.0,
            wave_speed=2.0,
            wave_duration=2.0,
            wave_thickness=4.0,
            convection_force=8.0,
            chimney_radius=3.0,
        ),
        _implosion,
        conservative=False,
        parameters={
            "place": [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (-1.0, 0.5, 0.0)],
            "start": [-0.04, -0.02, 5.0],
            "implosion_force": [0.0, 3.0, 40.0],
            "implosion_duration": [0.0, 0.05, 0.5],
            "implosion_least": [0.0, 0.3, 3.0],
            "implosion_most": [0.0, 2.0, 9.0],
            "wave_force": [0.0, 5.0, 50.0],
            "wave_duration": [0.06, 1.0, 9.0],
            "wave_speed": [0.0, 1.0, 20.0],
            "wave_thickness": [0.5, 2.0, 9.0],
            "convection_force": [0.0, 4.0, 30.0],
            "convection_duration": [0.06, 1.0, 9.0],
            "chimney_radius": [0.5, 2.0, 9.0],
            "chimney_height": [0.1, 2.0, 9.0],
        },
    ),
    Case(
        sy.UserForce,
        lambda a, b: sy.UserForce(_cubic, energy=_quartic),
        lambda x, v: _cubic(x, v, np.zeros(len(x))),
    ),
]


def _over(cases: list[Case]) -> Any:
    return pytest.mark.parametrize("case", cases, ids=lambda case: case.kind.__name__)


every_force = _over(CASES)
every_energy = _over([case for case in CASES if case.conservative])
every_two_body_force = _over(
    [case for case in CASES if {"a", "b"} <= {f.name for f in fields(case.kind)}]
)
# All integrators step the stiff spring by its flow: the force in the limit of small steps only.
every_kick = _over([case for case in CASES if case.kind is not sy.StiffSpring])
every_integrator = pytest.mark.parametrize(
    "integrator", INTEGRATORS, ids=lambda integrator: type(integrator).__name__
)


def make(
    case: Case,
    *,
    worlds: int = 1,
    integrator: Any = INTEGRATORS[0],
    dt: float = 2.0**-10,
    immovable: tuple[bool, bool] = (False, False),
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    force: Any = None,
) -> tuple[sy.World, Any]:
    """A world with particles a and b, the case's force and nothing else."""
    scene = sy.Scene(gravity=gravity)
    a, b = (
        scene.add(
            sy.Particle(position=place, **({"inverse_mass": 0.0} if fixed else {"mass": mass}))
        )
        for place, fixed, mass in zip(
            [(0.7, 0.4, -0.6), (-0.8, 1.1, 0.9)], immovable, MASS, strict=True
        )
    )
    force = scene.add(case.build(a, b) if force is None else force(case.build(a, b)))
    return sy.World(scene, worlds=worlds, method=sy.Method(integrator, dt=dt)), force


def scatter(world: sy.World, *, moving: bool = True) -> None:
    """Another state for every world: springs long and short, floats at all depths."""
    rng = np.random.default_rng(20)
    world.particles.position[:] = rng.uniform(-1.6, 1.6, world.particles.position.shape)
    if moving:
        world.particles.velocity[:] = rng.uniform(-2.0, 2.0, world.particles.velocity.shape)


def measure(world: sy.World) -> Array:
    """Forces [N] as the change of momentum over one step, shape (worlds, 2, 3)."""
    before = world.particles.velocity.copy()
    world.step(1)
    return world.particles.mass[:, None] * (world.particles.velocity - before) / world.method.dt


def test_every_force_of_the_engine_has_a_case() -> None:
    assert {case.kind for case in CASES} == set(FORCES)


@every_force
def test_every_parameter_of_the_force_has_values(case: Case) -> None:
    world, force = make(case)
    actors = {"a", "b", "particle", "particles", "function", "energy"}
    assert set(case.parameters) == {f.name for f in fields(force)} - actors
    for name in case.parameters:
        np.testing.assert_array_equal(getattr(world[force], name), getattr(force, name))


@every_kick
def test_force_is_its_formula(case: Case) -> None:
    # Explicit Euler kicks with the force at the start alone, so m dv / dt is the force but for the
    # rounding of dv: 2 kg x 2 m/s x 1.1e-16 x 1024 Hz < 5e-13 N.
    world, _ = make(case, worlds=40)
    scatter(world)
    expected = case.formula(world.particles.position.copy(), world.particles.velocity.copy())
    np.testing.assert_allclose(measure(world), expected, rtol=1e-12, atol=2e-12)


@every_force
@every_integrator
def test_force_is_its_formula_in_the_limit_of_a_small_step(case: Case, integrator: Any) -> None:
    # dv/dt over one step is F/m within h/2 |d(F/m)/dt|, the latter below 1e3 m/s^3 here; rounding
    # adds 2 m/s x 1.1e-16 / h. With h = 2^-24 s they stay below 1e-4 and 1e-8.
    world, _ = make(case, worlds=40, integrator=integrator, dt=2.0**-24)
    scatter(world)
    expected = case.formula(world.particles.position.copy(), world.particles.velocity.copy())
    np.testing.assert_allclose(measure(world), expected, rtol=0, atol=1e-4)


def test_all_forces_but_drag_and_explosions_have_an_energy() -> None:
    assert [case.kind for case in CASES if not case.conservative] == [sy.Drag, sy.Explosion]


@every_energy
def test_force_is_minus_the_gradient_of_its_energy(case: Case) -> None:
    # One world per displaced coordinate and direction. The central difference is off by
    # e^2 |E'''| / 6 < 1e-8 and by rounding 1.1e-16 x 100 J / e = 1e-9 with e = 1e-5 m.
    shift = 1e-5
    for seed in range(5):
        world, _ = make(case, worlds=12)
        start = np.random.default_rng(seed).uniform(-1.6, 1.6, (2, 3))
        world.particles.position[:] = start
        flat = world.particles.position.copy().reshape(12, 6)
        for i in range(6):
            flat[i, i] += shift
            flat[6 + i, i] -= shift
        world.particles.position[:] = flat.reshape(12, 2, 3)
        gradient = (world.energy[:6] - world.energy[6:]) / (2.0 * shift)
        expected = case.formula(start[None], np.zeros((1, 2, 3)))[0]
        np.testing.assert_allclose(-gradient.reshape(2, 3), expected, rtol=0, atol=1e-7)


@every_two_body_force
def test_action_equals_reaction(case: Case) -> None:
    world, _ = make(case, worlds=40)
    scatter(world)
    position = world.particles.position.copy()
    force = measure(world)
    # Both are products of one pull and one distance, so only the rounding of dv differs (5e-13 N).
    np.testing.assert_allclose(force[:, 0], -force[:, 1], rtol=0, atol=2e-12)
    torque = np.cross(position, force).sum(axis=1)
    np.testing.assert_allclose(torque, 0.0, rtol=0, atol=1e-11)
    assert np.abs(force).max() > 1.0


@every_force
@every_integrator
def test_immovable_particles_feel_nothing(case: Case, integrator: Any) -> None:
    world, _ = make(case, integrator=integrator, immovable=(True, True), gravity=(0.0, -9.81, 0.0))
    before = world.particles.position.copy()
    world.step(3)
    np.testing.assert_array_equal(world.particles.position, before)
    np.testing.assert_array_equal(world.particles.velocity, 0.0)
    assert np.isfinite(world.energy).all()


@every_kick
def test_an_immovable_partner_changes_nothing(case: Case) -> None:
    world, _ = make(case, immovable=(False, True))
    scatter(world, moving=False)
    expected = case.formula(world.particles.position.copy(), world.particles.velocity.copy())
    before = world.particles.velocity.copy()
    world.step(1)
    force = MASS[0] * (world.particles.velocity - before)[:, 0] / world.method.dt
    np.testing.assert_allclose(force, expected[:, 0], rtol=1e-12, atol=2e-12)


@every_force
@every_integrator
def test_parameters_per_world_equal_separate_worlds(case: Case, integrator: Any) -> None:
    for name, values in case.parameters.items():
        world, force = make(case, worlds=3, integrator=integrator, dt=1.0 / 60.0)
        world.particles.velocity[:] = (0.5, 1.0, -0.25)
        setattr(world[force], name, np.array(values))
        np.testing.assert_array_equal(getattr(world[force], name), np.array(values))
        world.step(5)
        for w, value in enumerate(values):
            alone, _ = make(
                case,
                integrator=integrator,
                dt=1.0 / 60.0,
                force=lambda given, name=name, value=value: replace(given, **{name: value}),
            )
            alone.particles.velocity[:] = (0.5, 1.0, -0.25)
            alone.step(5)
            np.testing.assert_array_equal(world.particles.position[w], alone.particles.position[0])
            np.testing.assert_array_equal(world.particles.velocity[w], alone.particles.velocity[0])
        assert not np.array_equal(world.particles.velocity[0], world.particles.velocity[2]), name


@every_force
def test_a_parameter_for_all_worlds_equals_one_per_world(case: Case) -> None:
    for name, values in case.parameters.items():
        shared, force = make(case, worlds=3)
        each, other = make(case, worlds=3)
        setattr(shared[force], name, values[1])
        setattr(each[other], name, np.array([values[1]] * 3))
        shared.step(5)
        each.step(5)
        np.testing.assert_array_equal(shared.particles.velocity, each.particles.velocity)


def test_a_force_evaluated_at_the_new_parameter_has_its_energy() -> None:
    world, spring = make(next(case for case in CASES if case.kind is sy.Spring), worlds=2)
    world[spring].stiffness = np.array([2.0, 6.0])
    low, high = world.energy
    assert high == pytest.approx(3.0 * low, rel=1e-15)


@every_integrator
@pytest.mark.parametrize("kind", ["Gravity", "Drag", "UserForce"])
def test_only_the_chosen_particles_feel_it(kind: str, integrator: Any) -> None:
    def build(chosen: list[sy.Particle] | None) -> Any:
        if kind == "Gravity":
            return sy.Gravity((0.0, -5.0, 0.0), particles=chosen)
        if kind == "Drag":
            return sy.Drag(linear=2.0, particles=chosen)
        return sy.UserForce(lambda x, v, t: np.ones_like(x), particles=chosen)

    def final(select: list[int] | None) -> Array:
        scene = sy.Scene(gravity=(0, 0, 0))
        some = [scene.add(sy.Particle(position=(k, 0, 0), velocity=(1, 0, 0))) for k in range(3)]
        scene.add(build(None if select is None else [some[k] for k in select]))
        world = sy.World(scene, method=sy.Method(integrator))
        world.step(2)
        return world.particles.velocity[0].copy()

    everyone, two = final(None), final([2, 0])
    np.testing.assert_array_equal(two[[0, 2]], everyone[[0, 2]])
    np.testing.assert_array_equal(two[1], (1, 0, 0))
    assert (np.abs(everyone - (1, 0, 0)).max(axis=1) > 1e-3).all()


@every_integrator
def test_forces_add_up(integrator: Any) -> None:
    # d'Alembert: to first order in the step the change of velocity is the sum of the parts.
    dt = 2.0**-24

    def acceleration(*kinds: type) -> Array:
        scene = sy.Scene(gravity=(0, 0, 0))
        a = scene.add(sy.Particle(position=(0.7, 0.4, -0.6), velocity=(1, 2, 0), mass=2.0))
        b = scene.add(sy.Particle(position=(-0.8, 1.1, 0.9), mass=0.7))
        for case in CASES:
            if case.kind in kinds:
                scene.add(case.build(a, b))
        world = sy.World(scene, method=sy.Method(integrator, dt=dt))
        world.step(1)
        return (world.particles.velocity[0] - np.array([(1, 2, 0), (0, 0, 0)])) / dt

    np.testing.assert_allclose(
        acceleration(*FORCES), sum(acceleration(kind) for kind in FORCES), rtol=0, atol=1e-4
    )
