"""What more iterations buy: sweeps for a digit on chains, and the error that each solver leaves.

Gauss-Seidel's error falls by the same share at every sweep, which theory knows; the worst-first resolver's does
not fall with its iterations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import steelyard as sy
from benchmarks import record
from benchmarks.failure_map.bisection import Array
from benchmarks.failure_map.chains import GRAVITY, HALF_SWING, LENGTH, TAU, chain
from benchmarks.figures import Figure

LINKS = (2, 3, 5, 8, 12, 20)
RATIOS = (1.0, 10.0, 100.0, 1000.0)
QUICK_LINKS, QUICK_RATIOS = (3, 8), (1.0, 100.0)

#: A chain short enough for every solver to hold in principle, and a step well within its limit.
SWUNG, DT = 5, 0.01
COUNTS = tuple(2**k for k in range(13))
#: From so many sweeps a digit on, what rounding leaves of each is no longer small beside what it gains.
MOST_SWEEPS = 3e4
#: Place in ``COUNTS`` from which the worst-first resolver gains no more.
SETTLED = 5


def sweep_share(links: int, ratio: float) -> float:
    """Share of the error that a sweep leaves on a straight chain: the square of the Jacobi matrix's radius.

    J M^-1 J^T of a chain that hangs from a point is tridiagonal, so the sweeps are consistently
    ordered (Young 1954) and their radius is the square of that of D^-1 (L + U).
    """
    inverse = np.append(np.ones(links - 1), 1.0 / ratio)
    diagonal = inverse + np.append(0.0, inverse[:-1])
    jacobi = (np.diag(inverse[:-1], 1) + np.diag(inverse[:-1], -1)) / np.sqrt(
        np.outer(diagonal, diagonal)
    )
    return float(np.abs(np.linalg.eigvalsh(jacobi)).max()) ** 2


def left_after(links: int, ratio: float, passes: int) -> float:
    """Norm of the strains after so many sweeps on a straight chain that is pulled along."""
    scene = chain(links, aside_by=0.0)
    method = sy.Method(sy.SymplecticEuler(), sy.GaussSeidel(passes=passes), dt=DT)
    world = sy.World(scene, method=method)
    mass = np.ones(links)
    mass[-1] = ratio
    world.particles.mass = mass
    world.gravity = (0.0, 0.0, 0.0)
    # Strains of 1e-7: what is quadratic in them does not show.
    world.particles.velocity[0, :, 0] = 1e-6 * np.random.default_rng(5).standard_normal(links)
    world.step()
    return float(np.linalg.norm(world.residual))


def sweeps_for_a_digit(links: int, ratio: float) -> tuple[float, float]:
    """Sweeps that divide the error by ten: measured, and by the theory."""
    theory = -math.log(10.0) / math.log(sweep_share(links, ratio))
    if theory > MOST_SWEEPS:
        return math.nan, theory
    # After two digits the slowest mode is alone, with five more left above rounding.
    first = max(4, round(2.0 * theory))
    second = first + max(2, round(theory))
    ends = left_after(links, ratio, first), left_after(links, ratio, second)
    return (second - first) / math.log10(ends[0] / ends[1]), theory


def swing(integrator: Any, solver: Any, *, dt: float = DT) -> tuple[float, float]:
    """Greatest stretch, and greatest change of energy over m g L, while a chain swings across; inf if it tears."""
    world = sy.World(chain(SWUNG), method=sy.Method(integrator, solver, dt=dt))
    start, weight = world.energy[0], SWUNG * GRAVITY * SWUNG * LENGTH
    stretch = change = 0.0
    with np.errstate(all="ignore"):
        for _ in range(math.ceil(HALF_SWING * math.sqrt(SWUNG) * TAU / dt)):
            world.step()
            stretch = np.maximum(stretch, np.abs(world.residual).max())
            change = np.maximum(change, np.abs(world.energy[0] - start) / weight)
    return tuple(float(v) if np.isfinite(v) else math.inf for v in (stretch, change))  # type: ignore[return-value]


def solvers(count: int) -> Mapping[str, tuple[Any, Any]]:
    """Every solver that iterates, with as many iterations (resolutions, for the resolver, of five links)."""
    return {
        "RATTLE, Gauss-Seidel": (sy.Rattle(), sy.GaussSeidel(passes=count)),
        "XPBD, substeps": (sy.SymplecticEuler(), sy.Xpbd(substeps=count)),
        "XPBD, passes in one substep": (
            sy.SymplecticEuler(),
            sy.Xpbd(substeps=1, iterations=count),
        ),
        "worst first": (sy.SymplecticEuler(), sy.WorstFirst(iterations=SWUNG * count)),
        "worst first, explicit Euler": (
            sy.ExplicitEuler(),
            sy.WorstFirst(iterations=SWUNG * count),
        ),
    }


def run(*, quick: bool, output: Path) -> list[Figure]:
    """Measure; write iterations.json and iterations.png to ``output``."""
    links = QUICK_LINKS if quick else LINKS
    ratios = QUICK_RATIOS if quick else RATIOS
    counts = COUNTS[:6] if quick else COUNTS
    digits = np.array([[sweeps_for_a_digit(n, r) for n in links] for r in ratios])
    swings = {
        name: np.array([swing(*solvers(count)[name]) for count in counts]) for name in solvers(1)
    }
    direct = swing(sy.Rattle(), sy.Direct())
    off = float(np.nanmax(np.abs(digits[..., 0] / digits[..., 1] - 1.0)))
    worst = swings["worst first"][:, 0]
    sweeps = swings["RATTLE, Gauss-Seidel"][:, 0]
    figures = [
        Figure(name="Gauss-Seidel: sweeps for a digit against theory, greatest difference",
               measured=off, unit="of it", at_most=0.01),
        Figure(name=f"worst first: stretch left by {SWUNG * counts[-1]} resolutions over that of "
               f"{SWUNG * counts[SETTLED]}", measured=float(worst[-1] / worst[SETTLED])),
        Figure(name=f"Gauss-Seidel: stretch left by {counts[-1]} sweeps over that of 1",
               measured=float(sweeps[-1] / sweeps[0])),
    ]  # fmt: skip
    payload = {
        "quick": quick,
        "figures": [figure.record() for figure in figures],
        "links": links,
        "end_mass_ratios": ratios,
        "sweeps_for_a_digit": {"measured": _finite(digits[..., 0]), "predicted": digits[..., 1]},
        "swing": {"links": SWUNG, "dt": DT, "columns": ["stretch", "energy over m g L"]},
        "iterations": counts,
        "left": {name: _finite(values) for name, values in swings.items()},
        "left_by_direct": direct,
    }
    record.write("iterations", payload, directory=output)
    draw(links, ratios, digits, counts, swings, direct, output / "iterations.png")
    return figures


def _finite(values: Array) -> Any:
    return np.where(np.isfinite(values), values, None).tolist()


# Picture


def draw(
    links: Sequence[int],
    ratios: Sequence[float],
    digits: Array,
    counts: Sequence[int],
    swings: Mapping[str, Array],
    direct: tuple[float, float],
    path: Path,
) -> None:
    """Sweeps for a digit; stretch and energy over iterations."""
    figure, panels = plt.subplots(1, 3, figsize=(17.0, 4.8), layout="constrained")
    first = panels[0]
    n = np.arange(links[0], links[-1] + 1)
    for ratio, values in zip(ratios, digits, strict=True):
        (dots,) = first.plot(links, values[:, 0], "o", ms=5, label=f"end x {ratio:g}")
        exact = [-math.log(10.0) / math.log(sweep_share(k, ratio)) for k in n.tolist()]
        first.plot(n, exact, lw=1.0, color=dots.get_color())
    first.plot(n, 0.933 * n**2.0, "k:", lw=1.0, label=".93 n²")
    first.plot(
        n, 2.303 * ratios[-1] * (n - 1), "k--", lw=1.0, label=f"2.3 r (n - 1), r = {ratios[-1]:g}"
    )
    first.set(xscale="log", yscale="log", xlabel="links n", ylabel="sweeps for a digit")
    first.set_xticks(list(links), [str(count) for count in links])
    first.minorticks_off()
    first.set_title("Gauss-Seidel on a straight chain: dots measured, lines theory", fontsize=10)
    titles = ("greatest stretch of a rod", "greatest change of energy / m g L")
    for column, (panel, title) in enumerate(zip(panels[1:], titles, strict=True)):
        _draw_left(panel, counts, swings, direct[column], column)
        panel.set_title(f"chain of {SWUNG}, dt {DT:g} s, half a swing: {title}", fontsize=10)
    for panel in panels:
        panel.grid(True, alpha=0.3)
        panel.legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_left(
    panel: Axes, counts: Sequence[int], swings: Mapping[str, Array], direct: float, column: int
) -> None:
    for marker, (name, values) in zip("osD^v", swings.items(), strict=True):
        shown = np.where(np.isfinite(values[:, column]), values[:, column], np.nan)
        panel.plot(counts, shown, marker + "-", ms=4, lw=1.0, label=name)
    panel.axhline(direct, color="black", lw=0.8, ls="--", label="RATTLE, direct")
    panel.set(xscale="log", yscale="log", xlabel="iterations (worst first: five resolutions each)")
