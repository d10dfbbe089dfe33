"""Energy, momentum, angular momentum and residual: what they are and where they are kept."""

from __future__ import annotations

import numpy as np
import pytest

import steelyard as sy


def test_energy_momentum_and_angular_momentum_are_their_definitions() -> None:
    scene = sy.Scene(gravity=(0, -10, 0))
    scene.add(sy.Particle(position=(1, 2, 3), velocity=(4, 5, 6), mass=2.0))
    scene.add(sy.Particle(position=(0, 1, 0), velocity=(0, 0, -1), mass=0.5))
    scene.add(sy.Particle(position=(9, 9, 9), inverse_mass=0.0))
    world = sy.World(scene, worlds=2)
    world.particles.velocity[1] = 0.0
    kinetic = 0.5 * 2.0 * (16 + 25 + 36) + 0.5 * 0.5 * 1.0
    potential = 10.0 * (2.0 * 2.0 + 0.5 * 1.0)
    np.testing.assert_allclose(world.energy, [kinetic + potential, potential], rtol=1e-15)
    np.testing.assert_array_equal(world.momentum, [(8.0, 10.0, 11.5), (0.0, 0.0, 0.0)])
    # (1, 2, 3) x (8, 10, 12) + (0, 1, 0) x (0, 0, -.5).
    np.testing.assert_array_equal(world.angular_momentum[0], (-6.0 - 0.5, 12.0, -6.0))
    np.testing.assert_array_equal(world.angular_momentum[1], 0.0)


@pytest.mark.parametrize(("chosen", "lifted"), [([0], 2.0), ([0, 1], 2.5), ([], 0.0), (None, 2.5)])
def test_gravity_as_a_force_counts_for_its_own_particles(
    chosen: list[int] | None, lifted: float
) -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    some = [scene.add(sy.Particle(position=(0, 3, 0), mass=m)) for m in (2.0, 0.5)]
    scene.add(
        sy.Gravity((0, -10, 0), particles=None if chosen is None else [some[k] for k in chosen])
    )
    world = sy.World(scene)
    assert world.energy[0] == pytest.approx(10.0 * 3.0 * lifted, rel=1e-15)


def test_residual_is_the_share_of_the_length() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 0, 0)))
    b = scene.add(sy.Particle(position=(2, 0, 0)))
    scene.add(sy.Rod(a, b, 1.6))
    scene.add(sy.Cable(a, b, 1.0))
    scene.add(sy.Cable(a, b, 2.5))
    scene.add(sy.RodConstraint(b, (2, 0, 4), 5.0))
    world = sy.World(scene, worlds=2)
    np.testing.assert_allclose(world.residual[0], [0.25, 1.0, 0.0, -0.2], rtol=0, atol=1e-15)
    world.remove(world.scene.things[-1])
    assert world.residual.shape == (2, 3)


# What is conserved


def _cluster(*, rods: bool) -> sy.Scene:
    """Four particles of different masses joined in all pairs, tumbling freely."""
    scene = sy.Scene(gravity=(0, 0, 0))
    places = np.array([(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.5), (-1.0, -0.5, 0)])
    spin, drift = np.array([0.5, 1.0, 2.0]), np.array([1.0, 0.5, -0.25])
    p = [
        scene.add(sy.Particle(position=x, velocity=drift + np.cross(spin, x), mass=m))
        for x, m in zip(places, (1.0, 2.0, 0.5, 3.0), strict=True)
    ]
    for i in range(4):
        for j in range(i):
            length = float(np.linalg.norm(places[i] - places[j]))
            scene.add(sy.Rod(p[i], p[j]) if rods else sy.Spring(p[i], p[j], 60.0, 0.9 * length))
    return scene


@pytest.mark.parametrize(
    ("rods", "method"),
    [
        (False, sy.Method(sy.ExplicitEuler())),
        (False, sy.Method(sy.SymplecticEuler())),
        (False, sy.Method(sy.Rattle())),
        (True, sy.Method(sy.Rattle(), sy.Direct())),
        (True, sy.Method(sy.Rattle(), sy.GaussSeidel())),
        (True, sy.Method(sy.SymplecticEuler(), sy.Direct())),
        (True, sy.Method(sy.SymplecticEuler(), sy.GaussSeidel())),
        (True, sy.Method(sy.SymplecticEuler(), sy.WorstFirst())),
        (True, sy.Method(sy.ExplicitEuler(), sy.WorstFirst())),
    ],
    ids=lambda value: "rods" if value is True else "springs" if value is False else None,
)
def test_momentum_is_kept(rods: bool, method: sy.Method) -> None:
    world = sy.World(_cluster(rods=rods), method=method)
    before = world.momentum
    world.step(60)
    # Every impulse comes with its opposite; 60 steps x some 20 roundings of 4 to 40 kg m/s, the
    # latter under explicit Euler.
    np.testing.assert_allclose(world.momentum, before, rtol=0, atol=1200 * 3.6e-15)


@pytest.mark.parametrize(
    ("rods", "method"),
    [
        (False, sy.Method(sy.SymplecticEuler())),
        (False, sy.Method(sy.Rattle())),
        (True, sy.Method(sy.Rattle(), sy.Direct())),
        (True, sy.Method(sy.Rattle(), sy.GaussSeidel())),
    ],
    ids=lambda value: "rods" if value is True else "springs" if value is False else None,
)
def test_angular_momentum_is_kept(rods: bool, method: sy.Method) -> None:
    # Kicks and impulses act along lines between particles, drifts along the velocities.
    world = sy.World(_cluster(rods=rods), method=method)
    before = world.angular_momentum
    assert np.linalg.norm(before) > 5.0
    world.step(600)
    # 10 s: positions reach 10 m, momenta 6 kg m/s, so a rounding is 6e-15 and 6000 of them 4e-11.
    np.testing.assert_allclose(world.angular_momentum, before, rtol=0, atol=4e-11)


def _swing(*, rods: bool, dt: float) -> float:
    """Greatest change of the energy over 10 s, as a share of it."""
    method = sy.Method(sy.Rattle(), sy.Direct() if rods else None, dt=dt)
    world = sy.World(_cluster(rods=rods), method=method)
    start = float(world.energy[0])
    largest = 0.0
    for _ in range(100):
        world.step(round(0.1 / dt))
        largest = max(largest, abs(float(world.energy[0]) / start - 1.0))
    return largest


def test_verlet_holds_the_energy_to_second_order() -> None:
    coarse, fine = _swing(rods=False, dt=0.01), _swing(rods=False, dt=0.005)
    assert coarse < 2e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_rattle_keeps_the_energy_of_a_free_rigid_body() -> None:
    # On a free rigid body it is the discrete Moser-Veselov map, which keeps the energy exactly
    # (Moser & Veselov 1991): what is left is the solver's tolerance, 1e-12 of a length.
    assert _swing(rods=True, dt=0.01) < 1e-11
