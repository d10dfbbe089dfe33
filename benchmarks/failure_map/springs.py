"""The largest stable step of every integrator over stiffness and damping ratio.

One particle on an anchored spring, x'' = -w^2 x - 2 z w x'. Two starts give the engine's own matrix of ``STEPS`` steps;
it is stable where no eigenvalue lies outside the unit circle. The worlds of a batch are the points of
a search over the stiffness, at a given step and for every damping ratio at once.

The theory, with a = h w and the eigenvalues of one step on (x, v/w): both lie within the unit circle where
|trace| <= 1 + det and det <= 1.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from scipy.optimize import brentq

import steelyard as sy
from benchmarks import record
from benchmarks.failure_map.bisection import Array, first_loss
from benchmarks.figures import Figure

#: Steps of which the matrix is taken: a method may carry more than place and velocity.
STEPS = 64
MASS = 2.0
#: Growth over all steps that counts as none: rounding, which is some (h w)^2 eps a step of implicit methods.
ALLOWED = 1e-9

RATIOS = np.concatenate([[0.0], np.geomspace(0.003, 10.0, 32)])
PHASES = np.geomspace(0.003, 100.0, 36)
#: Steps [s] at which boundaries are searched.
DECADES = (1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5)
COLOURS = "viridis"


def explicit_damped(ratio: float) -> tuple[float, float]:
    """Both roots of a^2 = e^(2 z a) - 1: unstable between them; (inf, inf) where there are none.

    x += h v, v -= h w^2 x, v *= q with q = d^h = e^(-2 z a): trace 1 + q, det q (1 + a^2), so det decides.
    """
    if ratio == 0.0:
        return 0.0, math.inf

    def excess(a: float) -> float:
        return math.log1p(a * a) - 2.0 * ratio * a

    # The excess is greatest where 2 a / (1 + a^2) = 2 z.
    peak = (1.0 + math.sqrt(1.0 - 4.0 * ratio * ratio)) / (2.0 * ratio) if ratio < 0.5 else 0.0
    if peak == 0.0 or excess(peak) < 0.0:
        return math.inf, math.inf
    far = peak
    while excess(far) > 0.0:
        far *= 2.0
    # Below, the excess is first negative (-2 z a) and has its only root short of the peak.
    return brentq(excess, 1e-9, peak), brentq(excess, peak, far)


def explicit_dragged(ratio: float) -> float:
    """Explicit Euler with the damping in the force: trace 2 - 2 z a, det 1 - 2 z a + a^2.

    det <= 1 while a < 2 z; above z = 1 first an eigenvalue falls below -1, where a^2 - 4 z a + 4 = 0.
    """
    flips = 2.0 * (ratio - math.sqrt(ratio * ratio - 1.0)) if ratio > 1.0 else math.inf
    return min(2.0 * ratio, flips)


def symplectic_damped(ratio: float) -> float:
    """Root of a^2 = 2 (1 + q), q = e^(-2 z a): the damping is an exact flow, trace 1 + q - a^2, det q."""
    return brentq(lambda a: a * a - 2.0 * (1.0 + math.exp(-2.0 * ratio * a)), 1.0, 3.0)


def symplectic_forced(ratio: float) -> float:
    """Symplectic Euler with the damping in the force: trace 2 - 2 z a - a^2, det 1 - 2 z a."""
    return 2.0 * (math.sqrt(1.0 + ratio * ratio) - ratio)


def runge_kutta(ratio: float) -> float:
    """First a at which |1 + y + y^2/2 + y^3/6 + y^4/24| = 1 along y = a (-z - sqrt(z^2 - 1))."""
    root = -ratio - cmath.sqrt(ratio * ratio - 1.0)

    def excess(a: float) -> float:
        y = a * root
        return abs(1.0 + y * (1.0 + y / 2.0 * (1.0 + y / 3.0 * (1.0 + y / 4.0)))) - 1.0

    # The boundary lies 2.59 ... 3.0 from 0 in the left half plane, and what is within it has no hole.
    return brentq(excess, 2.5 / abs(root), 3.1 / abs(root))


def never(ratio: float) -> float:
    """Stable at every step."""
    return math.inf


@dataclass(frozen=True)
class SpringCase:
    """An integrator with a way to damp, and what the theory says of them.

    Attributes:
        name: how it is called in the pictures.
        integrator: the integrator.
        damper: "drag" (``Drag.linear``), "damping" (``Particle.damping``), "force" (``UserForce``) or "spring"
            (``StiffSpring``).
        theory: the limit as a formula of a = h w and the damping ratio z.
        limit: largest stable h w at a damping ratio; 0 if none, inf if all.
        regained: h w from which on it is stable again, if it is.
        steps: steps h [s] at which it is measured.
        solver: what holds the springs, if they are no forces.
    """

    name: str
    integrator: Any
    damper: str
    theory: str
    limit: Callable[[float], float]
    regained: Callable[[float], float] | None = None
    steps: Sequence[float] = DECADES
    solver: Any = None


#: Every integrator that steps springs, one line each.
CASES = (
    SpringCase("explicit Euler, drag as a force", sy.ExplicitEuler(), "drag",
               "a < 2 z;  z > 1: a < 2 (z - sqrt(z^2 - 1))", explicit_dragged),
    SpringCase("explicit Euler, damping per second", sy.ExplicitEuler(), "damping",
               "a^2 < e^(2 z a) - 1", lambda z: explicit_damped(z)[0],
               lambda z: explicit_damped(z)[1], (1.0, 0.1)),
    SpringCase("symplectic Euler", sy.SymplecticEuler(), "drag",
               "a^2 < 2 (1 + e^(-2 z a))", symplectic_damped),
    SpringCase("symplectic Euler, drag in a user's force", sy.SymplecticEuler(), "force",
               "a < 2 (sqrt(1 + z^2) - z)", symplectic_forced),
    SpringCase("velocity Verlet", sy.Rattle(), "drag", "a < 2", lambda z: 2.0),
    SpringCase("RK4", sy.RungeKutta4(), "drag", "|R(y)| < 1, y = a (-z +- sqrt(z^2 - 1))", runge_kutta),
    SpringCase("velocity Verlet, stiff spring", sy.Rattle(), "spring", "all", never),
    SpringCase("exponential", sy.ExponentialRungeKutta(), "drag", "all", never),
    SpringCase("linearly implicit", sy.LinearlyImplicit(), "drag", "all", never),
    SpringCase("implicit midpoint", sy.ImplicitMidpoint(), "drag", "all", never),
    SpringCase("backward Euler", sy.BackwardEuler(), "drag", "all", never),
    SpringCase("XPBD, a substep", sy.SymplecticEuler(), "drag", "all", never,
               solver=sy.Xpbd(substeps=1)),
)  # fmt: skip


class SpringBench:
    """Springs of one case at one step, a world for each point of a search and each of two starts.

    Args:
        case: integrator and damper.
        dt: step [s].
        ratios: damping ratio of each row.
        points: points of a row.
    """

    def __init__(self, case: SpringCase, dt: float, ratios: Array, points: int) -> None:
        self.case = case
        self.ratio = np.repeat(ratios, points)
        self.count = len(self.ratio)
        self.dt = dt
        self.rate = np.zeros(2 * self.count)
        scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
        particle = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), mass=MASS))
        if case.damper == "spring":
            self.spring = scene.add(sy.StiffSpring(particle, (0.0, 0.0, 0.0), 1.0))
        else:
            self.spring = scene.add(sy.AnchoredSpring(particle, (0.0, 0.0, 0.0), 1.0, 0.0))
        self.drag = scene.add(sy.Drag(linear=0.0)) if case.damper == "drag" else None
        if case.damper == "force":
            scene.add(sy.UserForce(lambda x, v, t: -self.rate[:, None, None] * v))
        self.world = sy.World(
            scene, worlds=2 * self.count, method=sy.Method(case.integrator, case.solver, dt=dt)
        )

    def start(self, phase: Array) -> Array:
        """Set h w of every point (rows, points), and one world at x = 1, one at v = w. Returns w."""
        w = np.tile(phase.ravel() / self.dt, 2)
        damping = 2.0 * np.tile(self.ratio, 2) * w
        world = self.world
        world[self.spring].stiffness = MASS * w * w
        self.rate = MASS * damping
        if self.drag is not None:
            world[self.drag].linear = self.rate
        if self.case.damper == "spring":
            world[self.spring].damping = self.rate
        if self.case.damper == "damping":
            # The smallest fraction that float64 holds; at the steps of the case less would leave no more.
            world.particles.damping = np.exp(-np.minimum(damping, 700.0))[:, None]
        world.reset()
        world.particles.position[: self.count, 0, 0] = 1.0
        world.particles.velocity[self.count :, 0, 0] = w[self.count :]
        return w

    def radius(self, phase: Array) -> Array:
        """Spectral radius of ``STEPS`` steps at every point (rows, points); inf where they overflow."""
        w = self.start(phase)
        self.world.step(STEPS)
        x = self.world.particles.position[:, 0, 0].reshape(2, -1)
        v = (self.world.particles.velocity[:, 0, 0] / w).reshape(2, -1)
        matrix = np.stack([x.T, v.T], axis=1)
        # Grown beyond all numbers.
        burst = ~np.isfinite(matrix).all(axis=(1, 2))
        matrix[burst] = 0.0
        radius = np.where(burst, np.inf, np.abs(np.linalg.eigvals(matrix)).max(axis=1))
        return radius.reshape(phase.shape)

    def holds(self, phase: Array) -> np.ndarray:
        """Which points are stable."""
        return self.radius(phase) <= 1.0 + ALLOWED


def measure(
    case: SpringCase, *, ratios: Array = RATIOS, phases: Array = PHASES, quick: bool = False
) -> dict[str, Any]:
    """Boundaries of a case: (steps, ratios) of h w lost and regained, and the theory's (ratios,)."""
    steps = case.steps[:1] if quick else case.steps
    lost, regained = [], []
    for dt in steps:
        bench = SpringBench(case, dt, ratios, len(phases))
        low, high = first_loss(
            bench.holds, len(ratios), phases, rounds=2 if quick else 4, points=len(phases)
        )
        lost.append(low)
        regained.append(high)
    return {
        "case": case,
        "steps": steps,
        "ratios": ratios,
        "lost": np.array(lost),
        "regained": np.array(regained),
        "theory": np.array([case.limit(z) for z in ratios.tolist()]),
        "theory_regained": np.array(
            [case.regained(z) if case.regained else math.inf for z in ratios.tolist()]
        ),
    }


def left_of_amplitude(case: SpringCase, phases: Array) -> Array:
    """Share of an undamped spring's amplitude that one step leaves, at each h w."""
    bench = SpringBench(case, 1.0 / 60.0, np.zeros(1), len(phases))
    return bench.radius(phases[None])[0] ** (1.0 / STEPS)


def deviation(found: Mapping[str, Any]) -> float:
    """Greatest relative difference of the measured boundaries from the theory's; both within the search.

    Raises:
        ArithmeticError: one sees a boundary where the other sees none.
    """
    worst = 0.0
    for measured, theory in (
        (found["lost"], found["theory"]),
        (found["regained"], found["theory_regained"]),
    ):
        expected = np.broadcast_to(np.where(theory < PHASES[-1], theory, np.inf), measured.shape)
        inside = np.isfinite(expected) & (expected > 0.0)
        if (np.isfinite(measured) & (measured > 0.0) != inside).any():
            raise ArithmeticError(
                f"{found['case'].name}: a boundary is only measured or only predicted."
            )
        if inside.any():
            worst = max(worst, float(np.abs(measured[inside] / expected[inside] - 1.0).max()))
    return worst


def run(*, quick: bool, output: Path) -> list[Figure]:
    """Measure all cases; write springs.json and springs.png to ``output``."""
    ratios = RATIOS[::8] if quick else RATIOS
    found = [measure(case, ratios=ratios, quick=quick) for case in CASES]
    unlimited = [case for case in CASES if case.limit is never]
    left = {case.name: left_of_amplitude(case, PHASES) for case in unlimited}
    figures = [
        Figure(
            name=f"{each['case'].name}: boundary against theory, greatest difference",
            measured=deviation(each),
            unit="of it",
            at_most=1e-3 if quick else 1e-5,
        )
        for each in found
    ]
    payload = {
        "quick": quick,
        "figures": [figure.record() for figure in figures],
        "damping_ratios": ratios,
        "units": "h w (step times angular frequency); null: none up to the end of the search",
        "search": [PHASES[0], PHASES[-1]],
        "cases": [_plain(each) for each in found],
        "amplitude_left_by_a_step": {"phases": PHASES, **left},
    }
    record.write("springs", payload, directory=output)
    draw(found, left, output / "springs.png")
    return figures


def _plain(found: Mapping[str, Any]) -> dict[str, Any]:
    def finite(values: Array) -> Any:
        return np.where(np.isfinite(values), values, None).tolist()

    case = found["case"]
    return {
        "name": case.name,
        "integrator": repr(case.integrator),
        "damper": case.damper,
        "theory": case.theory,
        "steps": found["steps"],
        "lost": finite(found["lost"]),
        "regained": finite(found["regained"]),
        "predicted": finite(found["theory"]),
        "predicted_regained": finite(found["theory_regained"]),
    }


# Picture


def draw(found: Sequence[Mapping[str, Any]], left: Mapping[str, Array], path: Path) -> None:
    """A map per case that has a limit, all limits in h w, and what the others leave of the amplitude."""
    limited = [each for each in found if each["case"].limit is not never]
    columns = 4
    rows = -(-(len(limited) + 2) // columns)
    figure, panels = plt.subplots(
        rows, columns, figsize=(4.4 * columns, 4.2 * rows), layout="constrained"
    )
    flat = list(np.ravel(panels))
    norm = LogNorm(DECADES[-1], DECADES[0])
    for panel, each in zip(flat, limited, strict=False):
        _draw_map(panel, each, norm)
    _draw_limits(flat[len(limited)], limited)
    _draw_left(flat[len(limited) + 1], left)
    for panel in flat[len(limited) + 2 :]:
        panel.set_visible(False)
    scale = figure.colorbar(
        plt.cm.ScalarMappable(norm, COLOURS), ax=flat, shrink=0.6, pad=0.01, extend="both"
    )
    scale.set_label("largest stable step [s]")
    figure.suptitle(
        "Where integrators of a spring fail: colour and lines theory, dots measured (steps of 1 s, .1 s, ... 10 µs)"
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_map(panel: Axes, found: Mapping[str, Any], norm: LogNorm) -> None:
    """Largest stable step as colour, by the theory; the dots are where each step was lost (and regained)."""
    case = found["case"]
    shown = found["ratios"] > 0.0
    ratios = found["ratios"][shown]
    z = np.geomspace(ratios[0], ratios[-1], 160)
    stiffness = np.geomspace(1e-4, 1e12, 320)
    limit = np.array([case.limit(value) for value in z.tolist()])
    largest = limit[None, :] / np.sqrt(stiffness)[:, None]
    largest = np.clip(largest, norm.vmin, norm.vmax)
    panel.pcolormesh(
        z, stiffness, largest, norm=norm, cmap=COLOURS, shading="auto", rasterized=True
    )
    measured = {"ls": "", "mfc": "white", "mec": "black", "mew": 0.7, "ms": 4}
    for dt, lost, regained in zip(found["steps"], found["lost"], found["regained"], strict=True):
        panel.plot(z, (limit / dt) ** 2, color="black", lw=0.8)
        panel.plot(ratios, (lost[shown] / dt) ** 2, marker="o", **measured)
        if case.regained is not None:
            back = np.array([case.regained(value) for value in z.tolist()])
            panel.plot(z, (back / dt) ** 2, color="black", lw=0.8, ls="--")
            panel.plot(ratios, (regained[shown] / dt) ** 2, marker="s", **measured)
            panel.text(
                0.97, 0.5, "dashed: stable\nagain beyond", transform=panel.transAxes, ha="right"
            )
    panel.set(xscale="log", yscale="log", xlim=(z[0], z[-1]), ylim=(stiffness[0], stiffness[-1]))
    panel.set_title(case.name, fontsize=11)
    panel.set_xlabel("damping ratio z")
    panel.set_ylabel("stiffness k/m [1/s²]")


def _draw_limits(panel: Axes, found: Sequence[Mapping[str, Any]]) -> None:
    """h w at the limit over the damping ratio, of all cases that have one."""
    for each in found:
        ratios = each["ratios"][1:]
        z = np.geomspace(ratios[0], ratios[-1], 200)
        limit = [each["case"].limit(value) for value in z.tolist()]
        (line,) = panel.plot(z, limit, lw=1.2, label=each["case"].name)
        measured = np.where(np.isfinite(each["lost"][0]), each["lost"][0], np.nan)[1:]
        panel.plot(ratios, measured, "o", ms=4, color=line.get_color())
    panel.set(xscale="log", yscale="log", ylim=(0.001, 5.0))
    panel.set_title("all limits: line theory, dots measured", fontsize=11)
    panel.set_xlabel("damping ratio z")
    panel.set_ylabel("largest stable h w")
    panel.grid(True, alpha=0.3)
    panel.legend(fontsize=7.5, loc="lower right", frameon=False)


def _draw_left(panel: Axes, left: Mapping[str, Array]) -> None:
    """What one step leaves of an undamped spring, by the methods that hold it at every step."""
    gamma = 1.0 - math.sqrt(0.5)
    a = np.geomspace(PHASES[0], PHASES[-1], 200)
    theory = {
        "backward Euler": 1.0 / np.hypot(1.0, a),
        "XPBD, a substep": 1.0 / np.hypot(1.0, a),
        "linearly implicit": np.hypot(1.0, (1.0 - 2.0 * gamma) * a) / (1.0 + (gamma * a) ** 2),
    }
    # Where all is left, and for backward Euler in two ways, dots coincide, so they are drawn in falling size.
    sizes = np.linspace(8.0, 3.0, len(left))
    for (name, values), size in zip(left.items(), sizes, strict=True):
        (dots,) = panel.plot(PHASES, values, "o", ms=size, label=name)
        panel.plot(a, theory.get(name, np.ones_like(a)), color=dots.get_color(), lw=1.2)
    panel.set(xscale="log", ylim=(0.0, 1.1), xlim=(0.01, a[-1]))
    panel.set_title("stable at every step: amplitude left by one", fontsize=11)
    panel.set_xlabel("h w, no damping")
    panel.set_ylabel("share left")
    panel.grid(True, alpha=0.3)
    panel.legend(fontsize=8, loc="lower left", frameon=False)
