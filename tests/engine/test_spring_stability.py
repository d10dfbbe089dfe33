"""The discrete motion of a spring: amplification, energy and phase."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from tests.engine.spring_worlds import Array, spring_world, states

STEPPING = [sy.ExplicitEuler(), sy.SymplecticEuler(), sy.Rattle()]
SPLITTING = [sy.SymplecticEuler(), sy.Rattle()]


def _over(some: list[Any]) -> Any:
    return pytest.mark.parametrize("integrator", some, ids=lambda i: type(i).__name__)


def amplification(integrator: Any, h: float, square: float, damping: float) -> Array:
    """Matrix of one step on (x, v) of x'' = -square x with damping, in extended precision."""
    h, square = np.longdouble(h), np.longdouble(square)
    q = np.longdouble(damping) ** h

    def matrix(a: Any, b: Any, c: Any, d: Any) -> Array:
        return np.array([[a, b], [c, d]], dtype=np.longdouble)

    drift = matrix(1, h, 0, 1)
    if isinstance(integrator, sy.ExplicitEuler):
        return matrix(1, 0, 0, q) @ matrix(1, h, -h * square, 1)
    if isinstance(integrator, sy.SymplecticEuler):
        return drift @ matrix(1, 0, -h * square, 1) @ matrix(1, 0, 0, q)
    kick, damp = matrix(1, 0, -h * square / 2, 1), matrix(1, 0, 0, np.sqrt(q))
    return damp @ kick @ drift @ kick @ damp


@pytest.mark.parametrize("damping", [1.0, 0.9, 0.01])
@_over(STEPPING)
def test_a_spring_moves_as_its_amplification_matrix_says(integrator: Any, damping: float) -> None:
    h, steps = 1.0 / 60.0, 200
    phases = np.array([0.01, 0.3, 1.0, 1.7, 1.99, 2.01, 2.5])
    squares = (phases / h) ** 2
    world = spring_world(integrator, squares, damping=damping, start=((1.0, 3.0),))
    world.step(steps)
    for square, found in zip(squares, states(world), strict=True):
        step = amplification(integrator, h, square, damping)
        state = np.array([1.0, 3.0], dtype=np.longdouble)
        largest = 0.0
        for _ in range(steps):
            state = step @ state
            largest = max(largest, float(np.hypot(state[0] * np.sqrt(square), state[1])))
        # A step rounds at some 4 eps; near h w = 2 the eigenvectors nearly coincide and errors add
        # up as n^2 / 2, not n: 200^2 / 2 x 4 x 1.1e-16 = 1e-11 of the largest state.
        error = np.hypot((found[0] - state[0]) * np.sqrt(square), found[1] - state[1])
        assert error < 1e-11 * largest


def test_explicit_euler_gains_energy_at_every_step() -> None:
    # |lambda|^2 = 1 + (h w)^2, whatever the phase: at 60 Hz, 1 Hz has 695 times its energy in 10 s.
    integrator, h = sy.ExplicitEuler(), 1.0 / 60.0
    assert integrator.stable_limit() == 0.0
    phases = np.array([0.001, 2.0 * math.pi / 60.0, 1.0])
    world = spring_world(integrator, (phases / h) ** 2)
    start = world.energy
    world.step(600)
    gain = (1.0 + phases**2) ** 600
    np.testing.assert_allclose(world.energy / start, gain, rtol=600 * 1e-15)
    assert 690.0 < gain[1] < 700.0


def test_verlet_holds_the_energy_of_a_spring_for_1000_periods() -> None:
    # 60 steps a period, no damping. Verlet's x is cos(n theta) with sin(theta / 2) = h w / 2, and
    # the energy it shows at a step is 1 - (h w / 2)^2 sin^2(n theta): it breathes by 2.7e-3 within
    # every period, which is the scheme, and does not drift, which is the claim.
    h, w = 1.0 / 60.0, 2.0 * math.pi
    shape = 1.0 - (h * w / 2.0) ** 2
    theta = 2.0 * math.asin(h * w / 2.0)
    world = spring_world(sy.Rattle(), w * w)
    start = float(world.energy[0])
    means = []
    for period in range(1000):
        if period in (0, 499, 999):
            energies = []
            for k in range(60):
                world.step(1)
                energies.append(float(world.energy[0]) / start)
                # Rounding of the phase adds up as steps x eps.
                n = 60 * period + k + 1
                assert energies[-1] == pytest.approx(
                    1.0 - (1.0 - shape) * math.sin(n * theta) ** 2, abs=60_000 * 1e-15
                )
            means.append(np.mean(energies))
        else:
            world.step(60)
        x, v = states(world)[0]
        # The energy that Verlet keeps.
        assert w * w * shape * x * x + v * v == pytest.approx(w * w * shape, rel=60_000 * 1e-15)
    assert np.ptp(means) < 1e-3


@_over(SPLITTING)
def test_the_phase_error_of_a_spring(integrator: Any) -> None:
    # Both turn by theta = 2 asin(h w / 2) a step: ahead by (h w)^2 / 24 + 3 (h w)^4 / 640 of h w.
    h, w = 1.0 / 60.0, 2.0 * math.pi
    lead = 2.0 * math.asin(h * w / 2.0) / (h * w) - 1.0
    assert lead == pytest.approx((h * w) ** 2 / 24.0, rel=0.12 * (h * w) ** 2)
    world = spring_world(integrator, w * w, start=((1.0, 0.0), (0.0, w)))
    before = states(world)
    world.step(1)
    turn = states(world).T @ np.linalg.inv(before.T)
    assert math.acos(np.trace(turn) / 2.0) == pytest.approx(h * w * (1.0 + lead), rel=1e-12)
