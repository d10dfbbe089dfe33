"""The stiff spring against the closed form of the damped oscillator."""

from __future__ import annotations

import itertools
import math
from typing import Any

import mpmath
import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import DIGITS, oscillator

Array = np.ndarray

DT = 1.0 / 60.0
STEPS = 60
ANCHOR = np.array([0.5, -1.0, 2.0])
GRAVITY = np.array([0.0, -9.81, 0.0])
# Displacement [m] and velocity [m/s] at the start: along y the weight comes on top.
OFFSET = np.array([1.0, -0.5, 0.0])
SPEED = np.array([0.0, 2.0, 3.0])

STIFFNESS = [10.0**n for n in range(11)]
RATIO = [0.0, 0.1, 1.0, 10.0, 1e3]
MASS = [0.3, 1.0, 7.0]

INTEGRATORS = [
    sy.ExplicitEuler(),
    sy.SymplecticEuler(),
    sy.Rattle(),
    sy.ExponentialRungeKutta(),
]
every_integrator = pytest.mark.parametrize(
    "integrator", INTEGRATORS, ids=lambda integrator: type(integrator).__name__
)


def exact(*, stiffness: float, damping: float, inverse_mass: float) -> tuple[Array, Array]:
    """Position and velocity after `STEPS` steps, each of shape (3,).

    A world keeps 1/mass and the step as doubles: the mass and the time are what those stand for. At
    1e10 N/m a last digit of either turns the phase, 1.8e5 rad, by 1e-11.
    """
    with mpmath.workdps(DIGITS):
        mass: Any = 1 / mpmath.mpf(inverse_mass)
        time: Any = STEPS * mpmath.mpf(DT)
        place, speed = np.empty(3), np.empty(3)
        for c in range(3):
            sag = float(mass * mpmath.mpf(GRAVITY[c]) / mpmath.mpf(stiffness))
            centre = ANCHOR[c] + sag
            x, speed[c] = oscillator(
                mpmath.mpf(OFFSET[c]) - mass * mpmath.mpf(GRAVITY[c]) / mpmath.mpf(stiffness),
                SPEED[c],
                stiffness=stiffness,
                damping=damping,
                mass=mass,
                time=time,
            )
            place[c] = centre + x
        return place, speed


def scales(*, stiffness: float, inverse_mass: float) -> tuple[float, float]:
    """Amplitude A = |x - centre| + |v| / w [m] and velocity scale A w [m/s], undamped."""
    w = math.sqrt(stiffness * inverse_mass)
    sag = np.linalg.norm(GRAVITY) / w**2
    amplitude = float(np.linalg.norm(OFFSET) + sag + np.linalg.norm(SPEED) / w)
    return amplitude, amplitude * w


def sprung(
    integrator: Any,
    *,
    worlds: int = 1,
    mass: float = 1.0,
    stiffness: float = 1.0,
    damping: float = 0.0,
) -> tuple[sy.World, sy.StiffSpring]:
    scene = sy.Scene(gravity=GRAVITY)
    p = scene.add(sy.Particle(position=ANCHOR + OFFSET, velocity=SPEED, mass=mass))
    spring = scene.add(sy.StiffSpring(p, ANCHOR, stiffness=stiffness, damping=damping))
    return sy.World(scene, worlds=worlds, method=sy.Method(integrator, dt=DT)), spring


def check(
    world: sy.World, w: int, *, stiffness: float, damping: float, inverse_mass: float
) -> None:
    place, speed = exact(stiffness=stiffness, damping=damping, inverse_mass=inverse_mass)
    length, velocity = scales(stiffness=stiffness, inverse_mass=inverse_mass)
    case = f"k {stiffness:g}, c {damping:g}, 1/m {inverse_mass:g}"
    np.testing.assert_allclose(
        world.particles.position[w, 0], place, rtol=0, atol=1e-12 * length, err_msg=case
    )
    np.testing.assert_allclose(
        world.particles.velocity[w, 0], speed, rtol=0, atol=1e-12 * velocity, err_msg=case
    )


@every_integrator
def test_closed_form_at_every_stiffness_damping_and_mass(integrator: Any) -> None:
    cases = list(itertools.product(STIFFNESS, RATIO, MASS))
    stiffness, ratio, mass = np.array(cases).T
    damping = 2.0 * ratio * np.sqrt(stiffness * mass)
    world, spring = sprung(integrator, worlds=len(cases))
    world[spring].stiffness = stiffness
    world[spring].damping = damping
    world.particles.mass = mass[:, None]
    world.step(STEPS)
    inverse_mass = world.particles.inverse_mass[:, 0]
    for w in range(len(cases)):
        check(
            world,
            w,
            stiffness=stiffness[w],
            damping=damping[w],
            inverse_mass=float(inverse_mass[w]),
        )


@every_integrator
@pytest.mark.parametrize("ratio", RATIO)
def test_closed_form_with_the_values_of_the_scene(integrator: Any, ratio: float) -> None:
    mass, stiffness = 7.0, 1e6
    damping = 2.0 * ratio * math.sqrt(stiffness * mass)
    world, _ = sprung(integrator, mass=mass, stiffness=stiffness, damping=damping)
    world.step(STEPS)
    check(world, 0, stiffness=stiffness, damping=damping, inverse_mass=1.0 / mass)


@pytest.mark.parametrize("side", [-1e-3, -1e-7, -1e-12, 0.0, 1e-12, 1e-7, 1e-3])
def test_closed_form_around_critical_damping(side: float) -> None:
    # Where both rates coincide the formulas of either side are 0/0.
    stiffness, mass = 3e4, 0.3
    damping = 2.0 * (1.0 + side) * math.sqrt(stiffness * mass)
    world, _ = sprung(sy.Rattle(), mass=mass, stiffness=stiffness, damping=damping)
    world.step(STEPS)
    check(world, 0, stiffness=stiffness, damping=damping, inverse_mass=1.0 / mass)


@every_integrator
def test_other_constant_forces_shift_the_centre(integrator: Any) -> None:
    # Weight, a gravity force of the same kind and a constant user force share the load of one.
    mass, stiffness = 0.3, 4e3
    scene = sy.Scene(gravity=0.25 * GRAVITY)
    p = scene.add(sy.Particle(position=ANCHOR + OFFSET, velocity=SPEED, mass=mass))
    scene.add(sy.StiffSpring(p, ANCHOR, stiffness=stiffness, damping=5.0))
    scene.add(sy.Gravity(0.5 * GRAVITY))
    scene.add(sy.UserForce(lambda x, v, t: np.broadcast_to(0.25 * mass * GRAVITY, x.shape)))
    world = sy.World(scene, method=sy.Method(integrator, dt=DT))
    world.step(STEPS)
    check(world, 0, stiffness=stiffness, damping=5.0, inverse_mass=1.0 / mass)


@every_integrator
def test_rest_at_the_sagged_centre(integrator: Any) -> None:
    stiffness, mass = 2e8, 7.0
    world, spring = sprung(integrator, mass=mass, stiffness=stiffness)
    sagged = ANCHOR + GRAVITY * mass / stiffness
    world.particles.position[:] = sagged
    world.particles.velocity[:] = 0.0
    world.step(1000)
    # The sag is 3.4e-7 m; the anchor's own rounding leaves a swing of some 1e-16 m, which grows no
    # faster than by as much a step.
    np.testing.assert_allclose(world.particles.position[0, 0], sagged, rtol=0, atol=1000 * 4e-16)
    world[spring].anchor = (0, 0, 0)
    world.step(1)
    assert np.abs(world.particles.position[0, 0] - sagged).max() > 0.1


@every_integrator
def test_an_undamped_stiff_spring_keeps_its_energy(integrator: Any) -> None:
    world, _ = sprung(integrator, mass=7.0, stiffness=1e8)
    start = world.energy
    world.step(6000)
    # Each step rounds by some 1e-16.
    np.testing.assert_allclose(world.energy, start, rtol=6000 * 1e-15)


def test_particle_damping_and_drag_around_it_keep_order_2() -> None:
    # Rattle splits them symmetrically around the exact flow.
    def final(count: int) -> Array:
        scene = sy.Scene(gravity=GRAVITY)
        p = scene.add(sy.Particle(position=(1, 0, 0), velocity=SPEED, mass=2.0, damping=0.3))
        scene.add(sy.StiffSpring(p, (0, 0, 0), stiffness=400.0, damping=3.0))
        scene.add(sy.Drag(linear=0.5, quadratic=0.2))
        world = sy.World(scene, method=sy.Method(sy.Rattle(), dt=1.0 / count))
        world.step(count)
        return world.particles.position[0, 0].copy()

    counts = np.array([50, 100, 200, 400])
    finest = final(20_000)
    errors = [np.linalg.norm(final(count) - finest) for count in counts.tolist()]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1), errors


@pytest.mark.parametrize(
    "method",
    [
        sy.Method(sy.Rattle(), sy.Direct(), dt=DT),
        sy.Method(sy.Rattle(), sy.GaussSeidel(), dt=DT),
        sy.Method(sy.SymplecticEuler(), sy.Direct(), dt=DT),
        sy.Method(sy.SymplecticEuler(), sy.GaussSeidel(), dt=DT),
        sy.Method(sy.SymplecticEuler(), sy.WorstFirst(), dt=DT),
        sy.Method(sy.ExplicitEuler(), sy.WorstFirst(), dt=DT),
    ],
    ids=lambda method: f"{type(method.integrator).__name__}-{type(method.solver).__name__}",
)
def test_links_and_contacts_of_other_particles_change_nothing(method: sy.Method) -> None:
    scene = sy.Scene(gravity=GRAVITY)
    p = scene.add(sy.Particle(position=ANCHOR + OFFSET, velocity=SPEED, mass=7.0))
    scene.add(sy.StiffSpring(p, ANCHOR, stiffness=1e6, damping=20.0))
    a = scene.add(sy.Particle(position=(0, 1, 0), velocity=(1, 0, 0)))
    b = scene.add(sy.Particle(position=(1, 1, 0)))
    scene.add(sy.Rod(a, b))
    scene.add(sy.CableConstraint(a, (0, 2, 0), 1.1))
    scene.add(sy.Ground(particles=[b], friction=0.5))
    world = sy.World(scene, method=method)
    world.step(STEPS)
    check(world, 0, stiffness=1e6, damping=20.0, inverse_mass=1.0 / 7.0)
