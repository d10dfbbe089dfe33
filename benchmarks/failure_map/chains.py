"""The largest step with which a chain holds, over its length and the mass at its end, for every solver.

Rods of one length and particles of one mass from a fixed point, a heavier one at the end, released level. It holds
while no rod is off its length by more than ``STRETCH`` and the energy is nowhere above that of the start by
more than ``ENERGY`` of M g L, for as long as it takes to swing to the other side.

Steps are told in tau = sqrt(l/g), l the length of a rod: nothing else has a time. So the worlds of a batch, which
share dt, take different steps by having different gravity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

import steelyard as sy
from benchmarks import record
from benchmarks.failure_map.bisection import Array, first_loss
from benchmarks.figures import Figure

LENGTH, GRAVITY, DT = 0.1, 9.81, 1.0 / 60.0
TAU = math.sqrt(LENGTH / GRAVITY)
STRETCH, ENERGY = 1e-3, 1e-3
#: Half a swing from level, of a weightless rod with a mass: 2 K(sin 45 deg) sqrt(L/g).
HALF_SWING = 3.708

LINKS = (2, 3, 5, 8, 12, 20)
RATIOS = np.geomspace(1.0, 1e6, 7)
STEPS = np.geomspace(2.0**-12, 2.0, 14)
HEAVY = 1e4
QUICK_LINKS, QUICK_RATIOS = (2, 5), np.array([1.0, 100.0])
QUICK_STEPS = np.geomspace(2.0**-7, 1.0, 8)


@dataclass(frozen=True)
class ChainCase:
    """A method that holds rods, and what the theory says of it.

    Attributes:
        name: how it is called in the pictures.
        integrator: the integrator.
        solver: the solver.
        limit: largest step over tau by links and mass ratio, where there is a theory.
    """

    name: str
    integrator: Any
    solver: Any
    limit: Callable[[int, float], float] | None = None


def geometric_stiffness(links: int, ratio: float) -> float:
    """h w_geo = 2 with w_geo = 2 sqrt(T / (m l)) cos(pi / 2n): T = 3 M g at the lowest point of the swing."""
    return 1.0 / math.sqrt(3.0 * (ratio + links - 1)) / math.cos(math.pi / (2 * links))


def left_by_one_pass(substeps: int) -> Callable[[int, float], float]:
    """Where the stretch h^2 T / (m l) that one pass leaves of a load's pull reaches ``STRETCH``.

    A rod that is right after its turn is stretched again when the next one pulls its end by h^2 T / m.
    """

    def limit(links: int, ratio: float) -> float:
        return substeps * math.sqrt(STRETCH / (3.0 * (ratio + max(links - 2, 0))))

    return limit


#: Every way to hold rods, one line each.
CASES = (
    ChainCase("RATTLE, direct", sy.Rattle(), sy.Direct(), geometric_stiffness),
    ChainCase("symplectic Euler, direct", sy.SymplecticEuler(), sy.Direct(), geometric_stiffness),
    ChainCase("generalised-alpha, rho 0", sy.GeneralisedAlpha(rho_inf=0.0), None),
    ChainCase("RATTLE, 20 sweeps", sy.Rattle(), sy.GaussSeidel(passes=20)),
    ChainCase("XPBD, 20 substeps", sy.SymplecticEuler(), sy.Xpbd(substeps=20), left_by_one_pass(20)),
    ChainCase("symplectic Euler, worst first", sy.SymplecticEuler(), sy.WorstFirst()),
)  # fmt: skip


def chain(links: int, *, aside_by: float = 1e-6) -> sy.Scene:
    """A level chain, a millionth of a rod out of its plane, so that it may leave it."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    aside = aside_by * LENGTH * np.random.default_rng(links).standard_normal(links)
    row = [
        scene.add(sy.Particle(position=(LENGTH * (k + 1), 0.0, float(aside[k]))))
        for k in range(links)
    ]
    scene.add(sy.RodConstraint(row[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(row):
        scene.add(sy.Rod(a, b))
    return scene


class ChainBench:
    """Chains of so many links, a world for each mass ratio.

    Args:
        case: integrator and solver.
        links: number of rods.
        ratios: (rows,) mass at the end over that of each other particle.
    """

    def __init__(self, case: ChainCase, links: int, ratios: Array) -> None:
        self.links = links
        method = sy.Method(case.integrator, case.solver, dt=DT)
        self.world = sy.World(chain(links), worlds=len(ratios), method=method)
        mass = np.ones((len(ratios), links))
        mass[:, -1] = ratios
        self.world.particles.mass = mass
        self.total = mass.sum(axis=1)

    def holds(self, steps: Array) -> np.ndarray:
        """Which steps (rows, points), over tau, hold; the points of a row one after the other."""
        return np.stack([self._run(column) for column in steps.T], axis=1)

    def _run(self, step: Array) -> np.ndarray:
        """Which of the steps (rows,) hold."""
        world = self.world
        gravity = LENGTH * (step / DT) ** 2
        world.reset()
        world.gravity = np.stack([0.0 * gravity, -gravity, 0.0 * gravity], axis=1)
        count = np.ceil(HALF_SWING * math.sqrt(self.links) / step).astype(int)
        start, weight = world.energy, self.total * gravity * self.links * LENGTH
        good = np.ones(len(step), dtype=bool)
        done = 0
        # Looked at as often as it takes to see each world twenty times, whatever its step.
        while (good & (done < count)).any():
            ahead = max(1, done // 20)
            world.step(ahead)
            done += ahead
            # A torn chain goes on as not a number, which fails both comparisons.
            with np.errstate(all="ignore"):
                stretch = np.abs(world.residual).max(axis=1)
                fine = (stretch <= STRETCH) & (world.energy - start <= ENERGY * weight)
            good &= fine | (done > count)
        return good


def measure(
    case: ChainCase, links: Sequence[int], ratios: Array, steps: Array, *, rounds: int
) -> Array:
    """Largest step over tau, (links, ratios)."""
    found = []
    for count in links:
        bench = ChainBench(case, count, ratios)
        lost, _ = first_loss(bench.holds, len(ratios), steps, rounds=rounds, points=1)
        found.append(lost)
    return np.array(found)


def run(*, quick: bool, output: Path) -> list[Figure]:
    """Measure all cases; write chains.json and chains.png to ``output``."""
    links = QUICK_LINKS if quick else LINKS
    ratios = QUICK_RATIOS if quick else RATIOS
    steps = QUICK_STEPS if quick else STEPS
    found = {
        case.name: measure(case, links, ratios, steps, rounds=1 if quick else 4) for case in CASES
    }
    figures = []
    heavy = min(HEAVY, float(ratios[-1]))
    for case in CASES:
        # Where nothing but the load pulls.
        if case.limit is not None:
            share = (found[case.name] / theory(case, links, ratios))[:, ratios >= heavy]
            for word, value in (("least", share.min()), ("most", share.max())):
                name = f"{case.name}: largest step over theory, end x {heavy:g} and more, {word}"
                figures.append(Figure(name=name, measured=float(value)))
    payload = {
        "quick": quick,
        "figures": [figure.record() for figure in figures],
        "units": "largest step over tau = sqrt(l/g); 0: none down to the least of the search, null: all of it hold",
        "stretch": STRETCH,
        "energy": ENERGY,
        "links": links,
        "end_mass_ratios": ratios,
        "search": steps,
        "largest_step": {
            name: np.where(np.isfinite(values), values, None).tolist()
            for name, values in found.items()
        },
        "predicted": {c.name: theory(c, links, ratios) for c in CASES if c.limit is not None},
    }
    record.write("chains", payload, directory=output)
    draw(found, links, ratios, steps, output / "chains.png")
    return figures


def theory(case: ChainCase, links: Sequence[int], ratios: Array) -> Array:
    """The limit of a case at every point, (links, ratios)."""
    assert case.limit is not None
    return np.array([[case.limit(n, r) for r in ratios.tolist()] for n in links])


# Picture


def draw(
    found: Mapping[str, Array], links: Sequence[int], ratios: Array, steps: Array, path: Path
) -> None:
    """A map per case, and the longest chain of all cases beside the theory."""
    columns = 4
    rows = -(-(len(found) + 1) // columns)
    figure, panels = plt.subplots(
        rows, columns, figsize=(5.6 * columns, 4.3 * rows), layout="constrained"
    )
    flat = list(np.ravel(panels))
    norm = LogNorm(steps[0], 0.4)
    for panel, (name, values) in zip(flat, found.items(), strict=False):
        _draw_map(panel, name, values, links, ratios, norm)
    _draw_longest(flat[len(found)], found, links, ratios, steps)
    for panel in flat[len(found) + 1 :]:
        panel.set_visible(False)
    scale = figure.colorbar(plt.cm.ScalarMappable(norm, "viridis"), ax=flat, shrink=0.6, pad=0.01)
    scale.set_label("largest step over sqrt(l/g)")
    figure.suptitle(
        "Where a chain released level fails: the largest step over sqrt(l/g) that keeps rods within "
        f"{STRETCH:g} and the energy within {ENERGY:g} above the start"
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_map(
    panel: Axes, name: str, values: Array, links: Sequence[int], ratios: Array, norm: LogNorm
) -> None:
    most = STEPS[-1]
    shown = np.ma.masked_less_equal(np.minimum(values, most), 0.0)
    panel.imshow(shown, norm=norm, cmap="viridis", origin="lower", aspect="auto")
    panel.set_facecolor("0.85")
    for row, column in np.ndindex(*values.shape):
        value = float(values[row, column])
        text = "none" if value <= 0.0 else f"{value:.2g}" if math.isfinite(value) else f"> {most:g}"
        # Light on the dark half of the scale.
        light = 0.0 < value < math.sqrt(norm.vmin * norm.vmax)
        panel.text(column, row, text, ha="center", va="center", fontsize=8,
                   color="white" if light else "black")  # fmt: skip
    panel.set_xticks(range(len(ratios)), [f"$10^{{{math.log10(ratio):.0f}}}$" for ratio in ratios])
    panel.set_yticks(range(len(links)), [str(count) for count in links])
    panel.set_title(name, fontsize=11)
    panel.set_xlabel("mass at the end, times the others'")
    panel.set_ylabel("links")


def _draw_longest(
    panel: Axes, found: Mapping[str, Array], links: Sequence[int], ratios: Array, steps: Array
) -> None:
    r = np.geomspace(ratios[0], ratios[-1], 100)
    for marker, case in zip("osD^v<>", CASES, strict=False):
        values = found[case.name][-1]
        (dots,) = panel.plot(
            ratios, np.where(values > 0.0, values, np.nan), marker, ms=5, label=case.name
        )
        if case.limit is not None:
            panel.plot(
                r, [case.limit(links[-1], x) for x in r.tolist()], lw=1.0, color=dots.get_color()
            )
    panel.axhline(steps[0], color="0.6", lw=0.8, ls=":")
    panel.set(xscale="log", yscale="log", ylim=(0.6 * steps[0], 12.0))
    panel.set_title(
        f"{links[-1]} links: dots measured, lines theory, dotted end of the search", fontsize=10
    )
    panel.set_xlabel("mass at the end, times the others'")
    panel.set_ylabel("largest step over sqrt(l/g)")
    panel.grid(True, alpha=0.3)
    panel.legend(fontsize=8, frameon=False, loc="upper right")
