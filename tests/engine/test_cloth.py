"""A stiff spring network: where explicit steps fail and implicit ones hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import steelyard as sy
from benchmarks.spring_network import SpringNetwork


def test_what_the_cloth_is_made_of() -> None:
    scene = sy.scenes.cloth(side=4, width=3.0, mass=8.0, stiffness=100.0, ratio=10.0)
    particles, springs = scene.particles, scene.of(sy.Spring)
    assert len(particles) == 16
    assert sum(not p.movable for p in particles) == 4
    assert {p.mass for p in particles if p.movable} == {0.5}
    # 2 x 12 structural springs less 3 along the held edge, 2 x 9 across the squares.
    assert sum(s.stiffness == 100.0 for s in springs) == 21
    assert sum(s.stiffness == 10.0 for s in springs) == 18
    for s in springs:
        apart = np.linalg.norm(np.subtract(s.a.position, s.b.position))
        assert apart == pytest.approx(s.rest_length, rel=1e-15)
    corners = sy.scenes.cloth(side=4, held="corners", ratio=np.inf)
    assert [k for k, p in enumerate(corners.particles) if not p.movable] == [0, 3]
    assert len(corners.of(sy.Spring)) == 24
    with pytest.raises(ValueError, match=r"side is 1.*at least 2"):
        sy.scenes.cloth(side=1)
    with pytest.raises(ValueError, match=r"held.*'edge' or 'corners'"):
        sy.scenes.cloth(held="nails")


@pytest.mark.parametrize("held", ["edge", "corners"])
@pytest.mark.parametrize(
    "integrator", [sy.BackwardEuler(), sy.LinearlyImplicit()], ids=lambda i: type(i).__name__
)
def test_implicit_methods_hold_the_cloth_at_60_hz(integrator: Any, held: str) -> None:
    world = sy.World(sy.scenes.cloth(held=held), method=sy.Method(integrator))
    for _ in range(5):
        world.step(60)
        # Let go at rest at energy 0, it can only lose; the weight can give .4 kg g 1 m = 3.9 J.
        assert -3.9 < world.energy[0] < 0.0
    assert world.health[0] == 0


@pytest.mark.parametrize(("rate", "holds"), [(60, False), (950, False), (1200, True)])
def test_velocity_verlet_needs_small_steps_on_the_cloth(rate: int, holds: bool) -> None:
    # Its fastest modes are those of springs along one axis, 2 sqrt(k/m) = 2000/s: 1000 Hz.
    world = sy.World(sy.scenes.cloth(), method=sy.Method(sy.Rattle(), dt=1.0 / rate))
    world.step(rate)
    assert (np.isfinite(world.particles.position).all() and abs(world.energy[0]) < 1.0) == holds


@pytest.mark.parametrize(("passes", "holds"), [(1, False), (2, True)])
def test_a_stiffer_cloth_needs_more_passes(passes: int, holds: bool) -> None:
    # h w = 330 at 60 Hz.
    scene = sy.scenes.cloth(stiffness=1e5)
    world = sy.World(scene, method=sy.Method(sy.LinearlyImplicit(passes=passes)))
    world.step(60)
    assert (world.energy[0] < 0.0) == holds


def test_methods_converge_to_the_cloths_reference() -> None:
    scene = sy.scenes.cloth()
    (exact,), _ = SpringNetwork(scene).motion(np.array([0.25]))

    def error(integrator: Any, rate: int) -> float:
        world = sy.World(scene, method=sy.Method(integrator, dt=1.0 / rate))
        world.step(rate // 4)
        return float(np.abs(world.particles.position[0] - exact).max())

    assert error(sy.RungeKutta4(), 8000) < 1e-10
    rates = [60, 240, 960]
    errors = [error(sy.LinearlyImplicit(), rate) for rate in rates]
    assert errors[0] < 2e-3
    slope = -np.polyfit(np.log(rates), np.log(errors), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.15), errors
