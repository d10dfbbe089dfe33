"""Where solvers of bodies fail: the heaviest top on a stack, the heaviest end of a chain, the angle of friction.

All at 60 Hz, never asleep. A stack stands while no box is further than ``MOVED`` from where it was; a chain of rods on
ball joints, let go level, holds while no joint is open by more than ``OPEN`` of a rod and the energy is nowhere above that
of the start by more than ``ENERGY`` of what it falls through; a block on an incline holds while it creeps by less than
``CREEP``. The worlds of a batch are the points of the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.failure_map.bisection import Array, first_loss
from benchmarks.figures import Figure

DT, GRAVITY, SECONDS = 1.0 / 60.0, 9.81, 8.0
MOVED, OPEN, ENERGY, CREEP = 1e-2, 1e-3, 1e-3, 1e-6
BOXES, LINKS = (2, 3, 5, 10, 20), (2, 3, 5, 10, 20)
RATIOS = np.geomspace(1.0, 1e6, 13)
#: By how much mu is more than the tangent of the slope.
MARGINS = np.geomspace(1e-9, 1.0, 19)
SLOPE = math.radians(25)

#: Every way to hold bodies, one line each.
CASES: dict[str, Any] = {
    "proximal Newton": sy.ProximalNewton(rest_time=None),
    "Gauss-Seidel x 10": sy.GaussSeidel(10),
    "Gauss-Seidel x 30": sy.GaussSeidel(30),
    "worst first": sy.WorstFirst(),
    "soft step x 4": sy.SoftStep(substeps=4, rest_time=None),
    "soft step x 8": sy.SoftStep(substeps=8, rest_time=None),
}


def _world(scene: sy.Scene, solver: Any, worlds: int) -> sy.World:
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), solver, dt=DT))


def _last_heavier(world: sy.World, ratios: Array) -> None:
    """Give the last body so many times its mass, a world each."""
    factor = np.ones((len(ratios), len(world.scene.bodies)))
    factor[:, -1] = ratios
    world.bodies.mass = factor * world.bodies.mass_or_zero
    world.bodies.inertia = factor[..., None, None] * np.asarray(world.bodies.inertia)


def stands(solver: Any, boxes: int, ratios: Array) -> np.ndarray:
    """Whether stacks stand whose last box is so many times as heavy, (points,)."""
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    for i in range(boxes):
        scene.add(sy.Body(position=(0, 0.5 + i, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    scene.add(sy.Ground(friction=0.6))
    scene.add(sy.Collisions(friction=0.6))
    world = _world(scene, solver, len(ratios))
    _last_heavier(world, ratios)
    start = world.bodies.position.copy()
    good = np.ones(len(ratios), dtype=bool)
    for _ in range(round(SECONDS / DT / 20)):
        world.step(20)
        with np.errstate(all="ignore"):
            good &= np.abs(world.bodies.position - start).max(axis=(1, 2)) <= MOVED
        if not good.any():
            break
    return good


def hangs(solver: Any, links: int, ratios: Array) -> np.ndarray:
    """Whether chains hold whose last rod is so many times as heavy, (points,)."""
    half = 0.1
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    before = None
    for i in range(links):
        # A little out of the plane, so that it may leave it.
        place = (half * (2 * i + 1), 0.0, 0.0)
        rod = scene.add(
            sy.Body(position=place, velocity=(0, 0, 1e-6 * (-1) ** i), parts=sy.Capsule(0.01, half))
        )
        scene.add(sy.BallJoint(a=rod, b=before, place=(2 * half * i, 0.0, 0.0)))
        before = rod
    world = _world(scene, solver, len(ratios))
    _last_heavier(world, ratios)
    start = world.energy
    weight = world.bodies.mass_or_zero.sum(axis=1) * GRAVITY * 2 * half * links
    good = np.ones(len(ratios), dtype=bool)
    for _ in range(round(SECONDS / DT / 5)):
        world.step(5)
        with np.errstate(all="ignore"):
            gap = world.joints.gap.max(axis=1)
            good &= (gap <= OPEN * 2 * half) & (world.energy - start <= ENERGY * weight)
        if not good.any():
            break
    return good


def slides(solver: Any, margins: Array) -> np.ndarray:
    """Whether blocks creep whose friction is so much more than what holds them, (points,)."""
    scene = sy.Scene(gravity=(GRAVITY * math.sin(SLOPE), -GRAVITY * math.cos(SLOPE), 0.0))
    scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    ground = scene.add(sy.Ground())
    world = _world(scene, solver, len(margins))
    world[ground].friction = math.tan(SLOPE) * (1.0 + margins)
    world.step(round(0.5 * SECONDS / DT))
    before = world.bodies.position[:, 0, 0].copy()
    world.step(round(0.5 * SECONDS / DT))
    return np.asarray((world.bodies.position[:, 0, 0] - before) / (0.5 * SECONDS) > CREEP)


def boundary(ask: Callable[[Array], np.ndarray], grid: Array, rounds: int) -> float:
    """Largest value of the grid's range up to which the answer is yes: 0 if never, inf if always."""

    def holds(values: Array) -> np.ndarray:
        return ask(values[0])[None]

    lost, _ = first_loss(holds, 1, grid, rounds=rounds, points=7)
    return float(lost[0])


def run(*, quick: bool, output: Path) -> list[Figure]:
    """Measure all cases; write bodies.json and bodies.png to ``output``."""
    boxes: Sequence[int] = (2, 3) if quick else BOXES
    links: Sequence[int] = (2, 3) if quick else LINKS
    ratios = RATIOS[[0, 8]] if quick else RATIOS
    margins = MARGINS[::6] if quick else MARGINS
    rounds = 1 if quick else 2
    tops, ends, frictions = {}, {}, {}
    for name, solver in CASES.items():
        tops[name] = [
            boundary(lambda r, n=n, s=solver: stands(s, n, r), ratios, rounds) for n in boxes
        ]
        ends[name] = [
            boundary(lambda r, n=n, s=solver: hangs(s, n, r), ratios, rounds) for n in links
        ]
        frictions[name] = boundary(lambda m, s=solver: slides(s, m), margins, rounds)
    figures = [
        Figure(
            name=f"{name}: friction beyond the tangent of the slope at which a block holds",
            measured=value, unit="share", at_most=1e-3 if name == "proximal Newton" else None,
        )
        for name, value in frictions.items()
    ]  # fmt: skip
    payload = {
        "quick": quick,
        "figures": [figure.record() for figure in figures],
        "units": "largest mass over the others'; 0: none, null: all of the search hold",
        "moved": MOVED, "open": OPEN, "energy": ENERGY, "creep": CREEP,
        "boxes": boxes, "links": links, "search": ratios, "margins": margins,
        "top": {name: _plain(values) for name, values in tops.items()},
        "end": {name: _plain(values) for name, values in ends.items()},
        "friction": {name: _plain([value])[0] for name, value in frictions.items()},
    }  # fmt: skip
    record.write("bodies", payload, directory=output)
    draw(boxes, tops, links, ends, frictions, output / "bodies.png")
    return figures


def _plain(values: Sequence[float]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values]


def draw(
    boxes: Sequence[int],
    tops: dict[str, list[float]],
    links: Sequence[int],
    ends: dict[str, list[float]],
    frictions: dict[str, float],
    path: Path,
) -> None:
    """Heaviest top and end over the number of bodies, a line per solver; and the margin of friction."""
    figure, panels = plt.subplots(1, 3, figsize=(16.5, 4.8), layout="constrained")
    none, most = 0.5 * RATIOS[0], 2.0 * RATIOS[-1]
    for index, name in enumerate(CASES):
        # Lines that lie on each other are told apart by a little.
        shift = 1.0 + 0.06 * (index - 2.5)
        for panel, counts, found in ((panels[0], boxes, tops), (panels[1], links, ends)):
            values = np.array(found[name])
            shown = np.where(values <= 0.0, none, np.minimum(values, most)) * shift
            panel.plot(counts, shown, "osD^vP"[index] + "-", label=name, ms=6, lw=1.2)
    for panel, title, label in (
        (panels[0], "Stacks: the heaviest top that stands", "boxes"),
        (panels[1], "Chains of rods let go level: the heaviest end", "rods"),
    ):
        panel.set(
            xscale="log",
            yscale="log",
            ylim=(0.3, 4e6),
            xlabel=label,
            ylabel="mass over the others'",
        )
        panel.set_xticks(boxes, [str(count) for count in boxes])
        panel.minorticks_off()
        panel.axhline(RATIOS[-1], color="0.6", lw=0.8, ls=":")
        panel.text(
            boxes[0], 1.1 * RATIOS[-1], "above: all that was searched", fontsize=8, color="0.4"
        )
        panel.text(
            boxes[0], 0.62, "below: not even equal masses", fontsize=8, color="0.4", va="top"
        )
        panel.axhline(0.75, color="0.6", lw=0.8, ls=":")
        panel.set_title(title, fontsize=11)
        panel.grid(visible=True, alpha=0.3)
    panels[0].legend(fontsize=8, frameon=False, loc="center left")
    names = list(CASES)
    values = [min(max(frictions[name], 1e-10), 2.0) for name in names]
    panels[2].barh(names, values, color="#0072B2")
    for row, name in enumerate(names):
        value = frictions[name]
        text = (
            "all slide"
            if not math.isfinite(value)
            else "none slides"
            if value <= 0.0
            else f"{value:.1e}"
        )
        panels[2].text(1.3 * values[row], row, text, va="center", fontsize=9)
    panels[2].set(
        xscale="log", xlim=(1e-10, 1e3), xlabel="mu over the tangent of the slope, less 1"
    )
    panels[2].invert_yaxis()
    panels[2].set_title(
        f"Incline: friction below which a block creeps faster than {CREEP:g} m/s", fontsize=11
    )
    figure.suptitle("Where solvers of bodies fail, at 60 Hz")
    figure.savefig(path, dpi=110)
    plt.close(figure)
