"""Explosions: the three phases against their formulas, in space and in time, on particles and bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steelyard as sy

Array = np.ndarray
PLACE = np.array([0.5, 0.0, -0.3])
BLAST: dict[str, Any] = {
    "start": 0.1,
    "implosion_force": 40.0,
    "implosion_duration": 0.25,
    "implosion_least": 0.5,
    "implosion_most": 4.0,
    "wave_force": 300.0,
    "wave_duration": 0.6,
    "wave_speed": 8.0,
    "wave_thickness": 1.5,
    "convection_force": 60.0,
    "convection_duration": 0.9,
    "chimney_radius": 3.0,
    "chimney_height": 6.0,
}


def push(x: Array, time: float) -> Array:
    """Force on something at x, written out."""
    away = x - PLACE
    distance = float(np.linalg.norm(away))
    along = away / distance
    t = time - BLAST["start"]
    u = t - BLAST["implosion_duration"]
    force = np.zeros(3)
    if t >= 0 and u < 0 and BLAST["implosion_least"] < distance < BLAST["implosion_most"]:
        force -= BLAST["implosion_force"] * along
    if 0 <= u < BLAST["wave_duration"]:
        lag = abs(distance - BLAST["wave_speed"] * u) / BLAST["wave_thickness"]
        fading = 1 - u / BLAST["wave_duration"]
        force += BLAST["wave_force"] * fading * max(0.0, 1 - lag) * along
    beside = float(np.hypot(away[0], away[2])) / BLAST["chimney_radius"]
    high = 0 <= away[1] < BLAST["chimney_height"]
    if 0 <= u < BLAST["convection_duration"] and beside < 1 and high:
        fading = 1 - u / BLAST["convection_duration"]
        force[1] += BLAST["convection_force"] * fading * (1 - beside)
    return force


def yard(**more: Any) -> tuple[sy.Scene, sy.Explosion]:
    """Particles and bodies about the place."""
    scene = sy.Scene()
    for place in ((2.0, 1.0, 0.0), (0.5, 0.2, -0.3), (-3.0, 2.0, 1.0), (6.0, 1.0, 0.0)):
        scene.add(sy.Particle(position=place, mass=2.0))
    scene.add(sy.Body(position=(1.0, 0.5, 1.0), parts=sy.Box((0.2, 0.3, 0.1)), mass=3.0))
    blast = scene.add(sy.Explosion(place=PLACE, **BLAST, **more))
    return scene, blast


@pytest.mark.parametrize(
    "integrator",
    [sy.RungeKutta4(), sy.Rattle(), sy.SymplecticEuler()],
    ids=lambda x: type(x).__name__,
)
def test_paths_are_those_of_the_formulas(integrator: Any) -> None:
    """Forces jump in time and have kinks in space: of first order, whatever the method."""
    masses = [2.0] * 4 + [3.0]

    def ends(steps: int) -> Array:
        world = sy.World(yard()[0], method=sy.Method(integrator, dt=1.0 / steps))
        world.step(steps)
        assert world.health[0] == 0
        return np.array([*world.particles.position[0], world.bodies.position[0, 0]])

    def rates(time: float, y: Array, mass: float) -> Array:
        down = np.array([0.0, -9.81, 0.0])
        return np.concatenate([y[3:], push(y[:3], time) / mass + down])

    start = sy.World(yard()[0])
    true = []
    for place, mass in zip(
        [*start.particles.position[0], start.bodies.position[0, 0]], masses, strict=True
    ):
        state = np.concatenate([place, np.zeros(3)])
        # In parts between the jumps, a moment apart from them.
        for begin, end in ((0.0, 0.1), (0.1, 0.35), (0.35, 0.95), (0.95, 1.0)):
            span = (begin + 1e-12, end - 1e-12)
            path = solve_ivp(
                rates, span, state, rtol=1e-10, atol=1e-12, max_step=1e-3, args=(mass,)
            )
            state = path.y[:, -1]
        true.append(state[:3])
    coarse, fine = (np.abs(ends(steps) - true).max() for steps in (800, 6400))
    assert fine < 0.02
    assert fine < 0.3 * coarse


def test_it_waits_for_its_time_in_each_world() -> None:
    scene, blast = yard()
    world = sy.World(scene, worlds=2, method=sy.Method(sy.Rattle(), dt=0.01))
    world[blast].start = [0.1, 9.0]
    world.gravity = (0.0, 0.0, 0.0)
    world.step(9)
    np.testing.assert_array_equal(world.particles.velocity, 0.0)
    world.step(40)
    assert np.abs(world.particles.velocity[0]).max() > 1.0
    np.testing.assert_array_equal(world.particles.velocity[1], 0.0)
    np.testing.assert_array_equal(world.bodies.velocity[1], 0.0)


def test_it_acts_on_the_chosen_and_turns_what_has_a_pivot() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    free = scene.add(sy.Body(position=(2, 0, 0), mass=1.0, inertia=(1, 1, 1)))
    held = scene.add(sy.Body(position=(2, 0, 0), mass=1.0, inertia=(1, 1, 1), pivot=(0, -1.0, 0)))
    scene.add(sy.Body(position=(0, 0, 2), mass=1.0, inertia=(1, 1, 1)))
    scene.add(
        sy.Explosion(
            place=(0, 1, 0),
            wave_force=10.0,
            wave_speed=0.0,
            wave_thickness=9.0,
            particles=[free, held],
        )
    )
    world = sy.World(scene, method=sy.Method(sy.RungeKutta4(), dt=1e-3))
    world.step()
    assert world.bodies.velocity[0, 0, 0] > 0.0
    np.testing.assert_array_equal(world.bodies.velocity[0, 1:], 0.0)
    assert world.bodies.angular_momentum[0, 1, 2] < 0.0
    np.testing.assert_array_equal(world.bodies.angular_momentum[0, 2], 0.0)


def test_same_bits_in_one_call_and_in_many() -> None:
    for integrator in (sy.Rattle(), sy.RungeKutta4(), sy.SymplecticEuler()):
        scene, _ = yard()
        one, many = (sy.World(scene, worlds=9, method=sy.Method(integrator, dt=0.01)) for _ in "ab")
        one.step(60)
        for _ in range(60):
            many.step()
        np.testing.assert_array_equal(one.particles.position, many.particles.position)
        np.testing.assert_array_equal(one.bodies.position, many.bodies.position)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Explosion: wave_thickness is 0.0"):
        sy.Explosion(place=(0, 0, 0), wave_thickness=0.0)
    with pytest.raises(ValueError, match="Explosion: implosion_force is -1"):
        sy.Explosion(place=(0, 0, 0), implosion_force=-1.0)
    scene = sy.Scene()
    scene.add(sy.Particle(position=(1, 0, 0)))
    scene.add(sy.Explosion(place=(0, 0, 0), wave_force=1.0))
    for integrator in (sy.ComposedRattle(), sy.ExponentialRungeKutta(), sy.KinkRungeKutta4()):
        with pytest.raises(ValueError, match=r"cannot take an Explosion.*Use Rattle"):
            sy.World(scene, method=sy.Method(integrator))
