"""Each boundary from both sides: the method fails just beyond it and holds just within.

Where a limit is predicted, the comment derives it. ``benchmarks/failure_map`` draws the same boundaries.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigvalsh

import steelyard as sy
from benchmarks.failure_map import chains, iterations, springs
from benchmarks.failure_map.iterations import left_after, sweep_share
from benchmarks.failure_map.springs import CASES, SpringBench, SpringCase
from tests.engine.spring_worlds import Array, spring_world, states

SPLITTING = [sy.SymplecticEuler(), sy.Rattle()]


def _over(some: list[Any]) -> Any:
    return pytest.mark.parametrize("integrator", some, ids=lambda i: type(i).__name__)


# Springs


@_over(SPLITTING)
def test_stability_limit_from_both_sides(integrator: Any) -> None:
    h = 1.0 / 60.0
    limit = integrator.stable_limit()
    assert limit == 2.0
    inside, outside = 0.995 * limit, 1.005 * limit
    world = spring_world(integrator, (np.array([inside, outside]) / h) ** 2)
    # Inside: Verlet's x is cos(n theta); symplectic Euler keeps v^2 + w^2 x^2 - h w^2 x v, an
    # ellipse that reaches 1 / sqrt(1 - (h w / 2)^2).
    reach = 1.0 if isinstance(integrator, sy.Rattle) else (1.0 - (inside / 2.0) ** 2) ** -0.5
    largest = 0.0
    for _ in range(100):
        world.step(7)
        largest = max(largest, abs(world.particles.position[0, 0, 0]))
    assert 0.99 * reach < largest < (1.0 + 1e-9) * reach
    # Outside: growth by e^mu a step with cosh(mu) = (h w)^2 / 2 - 1.
    assert abs(world.particles.position[1, 0, 0]) > math.cosh(
        700 * math.acosh(outside**2 / 2.0 - 1.0) - 1.0
    )


def test_stability_limit_of_damped_symplectic_euler() -> None:
    # The trace 1 + q - (h w)^2 leaves the stable triangle where (h w)^2 = 2 (1 + q), q = d^h.
    h, damping = 1.0 / 60.0, 0.01
    limit = math.sqrt(2.0 * (1.0 + damping**h))
    squares = (np.array([0.995, 1.005]) * limit / h) ** 2
    world = spring_world(sy.SymplecticEuler(), squares, damping=damping)
    world.step(2000)
    assert abs(world.particles.position[0, 0, 0]) < 1e-6
    assert abs(world.particles.position[1, 0, 0]) > 1e6


@pytest.mark.parametrize(("ratio", "stable"), [(6.32, True), (6.34, False)])
def test_damped_explicit_euler_is_stable_up_to_its_limit(ratio: float, stable: bool) -> None:
    # The area spanned by two solutions changes by the determinant d^h (1 + h^2 k/m) at each step,
    # and both eigenvalues have its root as modulus: stable iff k/m < (d^-h - 1) / h^2 = 6.327.
    h, damping, steps = 1.0 / 60.0, 0.9, 36_000
    limit = (damping**-h - 1.0) / h**2
    assert limit == pytest.approx(6.33, abs=0.005)
    assert (ratio < limit) == stable
    world = spring_world(sy.ExplicitEuler(), ratio, damping=damping, start=((1, 0), (0, 1)))
    world.step(steps)
    area = np.linalg.det(states(world))
    assert area == pytest.approx((damping**h * (1.0 + h * h * ratio)) ** steps, rel=1e-10)
    assert (area < 1.0) == stable
    # A hundredth of k/m is 2.8e-6 a step: 10 % over the run.
    assert abs(math.log(area)) > 0.05


def farthest(case: SpringCase, ratio: float, phases: list[float], steps: int) -> Array:
    """Greatest |(x, v/w)| at each h w in a run of both starts; inf where it overflows."""
    bench = SpringBench(case, 1.0 / 60.0, np.array([ratio]), len(phases))
    w = bench.start(np.array([phases]))
    largest = np.zeros(2 * len(phases))
    for _ in range(8):
        bench.world.step(steps // 8)
        x = bench.world.particles.position[:, 0, 0]
        size = np.hypot(x, bench.world.particles.velocity[:, 0, 0] / w)
        largest = np.maximum(largest, np.where(np.isfinite(size), size, np.inf))
    return largest.reshape(2, -1).max(axis=0)


# A step is (x, v) -> A (x, v) with trace T and determinant D; both eigenvalues lie in the unit circle iff
# |T| < 1 + D and D < 1. With a = h w, damping ratio z and q = e^(-2 z a):
#   explicit Euler, drag as a force: T = 2 - 2 z a, D = 1 - 2 z a + a^2, so a < 2 z, and above z = 1
#     T > -1 - D fails first, at a^2 - 4 z a + 4 = 0;
#   explicit Euler, damping: T = 1 + q, D = q (1 + a^2), so a^2 < 1/q - 1;
#   symplectic Euler, flow: T = 1 + q - a^2, D = q, so a^2 < 2 (1 + q); drag as a force: T = 2 - 2 z a
#     - a^2, D = 1 - 2 z a, so a < 2 (sqrt(1 + z^2) - z);
#   Verlet, flow: T = (1 - a^2/2)(1 + q), D = q, so a < 2 whatever the damping.
@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.9, 3.0])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_damped_spring_from_both_sides(case: SpringCase, ratio: float) -> None:
    limit = case.limit(ratio)
    if math.isinf(limit):
        # Stable at every step: none of these grows.
        assert (farthest(case, ratio, [0.5, 5.0, 50.0], 4_000) < 8.0).all()
        return
    # Slowest is explicit Euler: beyond its limit |lambda|^2 - 1 = .01 a^2 with a = 2 z = .2.
    within, beyond = farthest(
        case, ratio, [0.99 * limit, 1.01 * limit], 4_000 if case.damper == "force" else 40_000
    )
    # 7 is the reach of an undamped orbit at .99 of the limit.
    assert within < 8.0
    assert beyond > 1e3


def test_damped_explicit_euler_fails_in_between_only() -> None:
    # a^2 = e^(2 z a) - 1 has two roots where z < z_c, and none above: with u = 2 z a, 4 z^2 = u^2 / (e^u - 1), whose
    # greatest value .64761 lies at u = 1.59362, so z_c = .40237. Beyond the second root each step
    # kills the velocity, and the spring creeps.
    case = next(case for case in CASES if case.damper == "damping")
    (first, second), u = springs.explicit_damped(0.4), 1.59362
    critical = 0.5 * math.sqrt(u * u / math.expm1(u))
    assert critical == pytest.approx(0.40237, abs=1e-5)
    phases = [0.99 * first, 1.01 * first, 0.99 * second, 1.01 * second]
    holds = farthest(case, 0.4, phases, 40_000) < 8.0
    np.testing.assert_array_equal(holds, [True, False, False, True])
    scan = np.geomspace(0.01, 5.0, 64).tolist()
    assert (farthest(case, 1.001 * critical, scan, 4_000) < 8.0).all()
    assert not (farthest(case, 0.99 * critical, scan, 400_000) < 8.0).all()


# Rods under load


def hanging_chain(links: int, ratio: float) -> sy.Scene:
    """Rods of .1 m that hang from the origin, particles of 1 kg and one of ``ratio`` kg at the end."""
    scene = sy.Scene()
    masses = [1.0] * (links - 1) + [ratio]
    chain = [
        scene.add(sy.Particle(position=(0.0, -0.1 * (k + 1), 0.0), mass=mass))
        for k, mass in enumerate(masses)
    ]
    scene.add(sy.RodConstraint(chain[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(chain):
        scene.add(sy.Rod(a, b))
    return scene


def transverse_rate(masses: Array, length: float, gravity: float) -> float:
    """Highest angular frequency at which a hanging chain swings across."""
    tension = gravity * np.cumsum(masses[::-1])[::-1] / length
    stiffness = np.diag(tension + np.append(tension[1:], 0.0))
    stiffness -= np.diag(tension[1:], 1) + np.diag(tension[1:], -1)
    return math.sqrt(eigvalsh(stiffness, np.diag(masses))[-1])


@pytest.mark.parametrize(("links", "ratio"), [(10, 1000.0), (20, 1000.0), (10, 1.0)])
def test_rattle_holds_a_loaded_chain_up_to_its_geometric_stiffness(
    links: int, ratio: float
) -> None:
    # Across a taut chain tension is a spring of T/l per link: Verlet on its modes, stable while
    # h w < 2. Under a heavy end T = M g all along and w = 2 sqrt(T / (m l)) cos(pi / 2n), the highest mode
    # of n - 1 equal particles between two that stand.
    masses = np.append(np.ones(links - 1), ratio)
    w = transverse_rate(masses, 0.1, 9.81)
    if ratio > 1.0:
        even = 2.0 * math.sqrt((ratio + 0.5 * links) * 9.81 / 0.1) * math.cos(math.pi / (2 * links))
        assert w == pytest.approx(even, rel=0.01)
    sizes = []
    for share in (0.99, 1.01):
        method = sy.Method(sy.Rattle(), sy.Direct(), dt=share * 2.0 / w)
        world = sy.World(hanging_chain(links, ratio), method=method)
        # Small enough that lengths do not notice while the growth is measured.
        world.particles.position[0, :, 0] = 1e-10 * np.random.default_rng(3).standard_normal(links)
        size = []
        for _ in range(100):
            world.step(10)
            size.append(np.linalg.norm(world.particles.position[0, :-1, 0]))
        sizes.append(np.array(size))
    # Within, a mode reaches 1/sqrt(1 - .99^2) = 7 times its start.
    assert sizes[0].max() < 1e-8
    # Beyond, it grows by acosh(2 (h w / 2)^2 - 1) a step, until the chain is torn.
    growth = math.acosh(2.0 * 1.01**2 - 1.0)
    assert math.log(sizes[1][3] / sizes[1][2]) / 10.0 == pytest.approx(growth, rel=1e-3)
    assert not np.isfinite(sizes[1][-1])


# Sweeps


@pytest.mark.parametrize("links", [4, 10, 20])
def test_sweeps_leave_the_share_that_theory_says(links: int) -> None:
    # Equal masses: the Jacobi matrix of such a chain is that of the Chebyshev polynomials (its first coupling is
    # 1/sqrt 2, all others 1/2), whose eigenvalues are cos((2k - 1) pi / 2n).
    rate = math.cos(math.pi / (2 * links)) ** 2
    assert sweep_share(links, 1.0) == pytest.approx(rate, rel=1e-12)
    # The next mode must have died out: its share is cos^2(3 pi / 2n).
    first = 2 * links**2 // 3
    found = (left_after(links, 1.0, 2 * first) / left_after(links, 1.0, first)) ** (1.0 / first)
    assert found == pytest.approx(rate, rel=1e-5)
    if links == 20:
        # .93 n^2 sweeps for a digit.
        assert -math.log(10.0) / math.log(rate) == pytest.approx(0.933 * links**2, rel=0.01)


@pytest.mark.parametrize(("links", "ratio"), [(4, 100.0), (20, 100.0), (20, 1000.0)])
def test_a_heavy_end_slows_the_sweeps(links: int, ratio: float) -> None:
    # Moving the whole chain strains only the anchor's rod: 1 A 1 = 1/r against 1 D 1 = 2 (n - 1) + 1/r, so the Jacobi
    # matrix's radius is 1 - 1/(2 r (n - 1)) and the sweeps leave 1 - 1/(r (n - 1)): 2.3 r (n - 1) for a digit.
    digit = -math.log(10.0) / math.log(sweep_share(links, ratio))
    assert digit == pytest.approx(math.log(10.0) * ratio * (links - 1), rel=0.4 / ratio * links)
    first = round(digit / 4)
    found = (left_after(links, ratio, 3 * first) / left_after(links, ratio, first)) ** (0.5 / first)
    assert -math.log(found) == pytest.approx(-math.log(sweep_share(links, ratio)), rel=1e-3)


def gained(links: int, passes: int, step: float) -> float:
    """Most energy over that of the start, over M g L, while a level chain swings across by RATTLE's sweeps."""
    world = sy.World(
        chains.chain(links),
        method=sy.Method(sy.Rattle(), sy.GaussSeidel(passes=passes), dt=step * chains.TAU),
    )
    start, most = float(world.energy[0]), -math.inf
    count = math.ceil(chains.HALF_SWING * math.sqrt(links) / step)
    for _ in range(200):
        world.step(max(1, count // 200))
        most = max(most, float(world.energy[0]) - start)
    return most / (links * chains.GRAVITY * links * chains.LENGTH)


@pytest.mark.parametrize(("links", "few", "enough"), [(12, 10, 20), (20, 30, 40)])
def test_too_few_sweeps_pump_energy(links: int, few: int, enough: int) -> None:
    # Position sweeps start from the last step's multipliers, velocity sweeps from none: what they leave adds up, and
    # smaller steps only make it worse. No theory: the numbers of sweeps are as found.
    assert gained(links, few, 1 / 512) > 0.5
    assert abs(gained(links, enough, 1 / 512)) < 1e-4


def test_worst_first_stops_getting_better() -> None:
    # It resolves along directions of the step's start, so what is quadratic in the step is left however often it
    # goes round; sweeps go on to rounding.
    def left(solver: object, dt: float = iterations.DT) -> float:
        return iterations.swing(sy.SymplecticEuler(), solver, dt=dt)[0]

    few, some, many = (left(sy.WorstFirst(iterations=5 * count)) for count in (1, 64, 4096))
    assert few > 50.0 * some
    assert many == pytest.approx(some, rel=1e-3)
    assert some > 1e-3
    assert left(sy.GaussSeidel(passes=256)) < 1e-11
    # A quarter of the step leaves about a sixteenth.
    fine = left(sy.WorstFirst(iterations=5 * 512), iterations.DT / 4)
    assert 8.0 < some / fine < 32.0


# XPBD


@pytest.mark.parametrize("links", [5, 12])
def test_xpbd_holds_a_swinging_load_up_to_what_one_pass_leaves(links: int) -> None:
    # A rod is right after its turn, and the next one then pulls its end by h^2 T / m: a stretch of h^2 T / (m l) with T
    # = 3 M g at the lowest point. The whole swing adds some per cent, so the sides are 20 % apart.
    (case,) = (case for case in chains.CASES if case.name == "XPBD, 20 substeps")
    limit = chains.left_by_one_pass(20)(links, 1e4)
    bench = chains.ChainBench(case, links, np.array([1e4, 1e4]))
    within, beyond = bench.holds(limit * np.array([[0.9], [1.1]]))[:, 0]
    assert within and not beyond
