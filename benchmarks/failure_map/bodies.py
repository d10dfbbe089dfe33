"""Where solvers of bodies fail: the heaviest top on a stack, the heaviest end of a chain, the angle of friction.

All at 60 Hz, never asleep. A stack stands while no box is further than ``MOVED`` from where it was. A chain of rods on
ball joints, let go level, holds while no joint is open by more than ``OPEN`` of a rod and the energy is nowhere above
that of the start by more than ``ENERGY`` of what it falls through. A block on an incline holds while it creeps by less
than ``CREEP``. The worlds of a batch are the points of the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap

import steelyard as sy
from benchmarks import record
from benchmarks.failure_map.bisection import Array, first_loss
from benchmarks.figures import Figure

DT, GRAVITY, SECONDS = 1.0 / 60.0, 9.81, 8.0
MOVED, OPEN, ENERGY, CREEP = 5e-2, 1e-3, 1e-3, 1e-6
BOXES, LINKS = (2, 3, 5, 10, 20), (2, 3, 5, 10, 20)
RATIOS = np.geomspace(1.0, 1e6, 13)
#: By how much mu is more than the tangent of the slope.
MARGINS = np.geomspace(1e-9, 1.0, 19)
SLOPE = math.radians(25)
#: Turns the y along which capsules lie into x.
_ALONG_X = (math.sqrt(0.5), 0.0, 0.0, -math.sqrt(0.5))

#: Every way to hold bodies, one line each.
CASES: dict[str, Any] = {
    "proximal Newton": sy.ProximalNewton(rest_time=None),
    "Gauss-Seidel x 10": sy.GaussSeidel(10, rest_time=None),
    "Gauss-Seidel x 30": sy.GaussSeidel(30, rest_time=None),
    "worst first": sy.WorstFirst(rest_time=None),
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
        # What is lost would only take time.
        world.reset(~good)
    return good


def hangs(solver: Any, links: int, ratios: Array) -> np.ndarray:
    """Whether chains hold whose last rod is so many times as heavy, (points,)."""
    half = 0.1
    scene = sy.Scene(gravity=(0.0, -GRAVITY, 0.0))
    before = None
    for i in range(links):
        # A little out of the plane, so that it may leave it.
        rod = scene.add(
            sy.Body(
                position=(half * (2 * i + 1), 0.0, 0.0),
                velocity=(0, 0, 1e-6 * (-1) ** i),
                orientation=_ALONG_X,
                parts=sy.Capsule(0.01, half),
            )
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
        # What is lost would only take time.
        world.reset(~good)
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
    tops = {name: np.array([stands(s, n, ratios) for n in boxes]) for name, s in CASES.items()}
    ends = {name: np.array([hangs(s, n, ratios) for n in links]) for name, s in CASES.items()}
    frictions = {
        name: boundary(lambda m, s=solver: slides(s, m), margins, 1 if quick else 2)
        for name, solver in CASES.items()
    }
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
        "moved": MOVED, "open": OPEN, "energy": ENERGY, "creep": CREEP, "seconds": SECONDS,
        "boxes": boxes, "links": links, "ratios": ratios,
        "stands": {name: held.tolist() for name, held in tops.items()},
        "hangs": {name: held.tolist() for name, held in ends.items()},
        "friction": {name: value if math.isfinite(value) else None for name, value in frictions.items()},
    }  # fmt: skip
    record.write("bodies", payload, directory=output)
    draw(boxes, tops, links, ends, ratios, frictions, output / "bodies.png")
    return figures


def draw(
    boxes: Sequence[int],
    tops: dict[str, Any],
    links: Sequence[int],
    ends: dict[str, Any],
    ratios: Array,
    frictions: dict[str, float],
    path: Path,
) -> None:
    """Two maps per solver: stacks above, chains below."""
    figure, panels = plt.subplots(
        2, len(CASES), figsize=(3.1 * len(CASES), 6.4), layout="constrained", squeeze=False
    )
    colours = ListedColormap(["#D9D9D9", "#0072B2"])
    for column, name in enumerate(CASES):
        share = frictions[name]
        margin = f"{share:.0e}" if 0.0 < share < math.inf else ("0" if share <= 0.0 else "none")
        for panel, counts, held, label in (
            (panels[0, column], boxes, tops[name], "boxes, the top heavier"),
            (panels[1, column], links, ends[name], "rods, the end heavier"),
        ):
            panel.imshow(held, cmap=colours, vmin=0, vmax=1, origin="lower", aspect="auto")
            panel.set_xticks(
                range(len(ratios)), [f"{math.log10(r):.3g}" for r in ratios], fontsize=7
            )
            panel.set_yticks(range(len(counts)), [str(count) for count in counts])
            panel.set_xlabel("log10 of its mass over the others'", fontsize=8)
            if column == 0:
                panel.set_ylabel(label)
        panels[0, column].set_title(f"{name}\nslope: mu/tan a - 1 > {margin}", fontsize=10)
    figure.suptitle(
        "Blue: held at 60 Hz. Above stacks, below chains of rods let go level; in the titles, the friction from "
        "which on a block lies still on a slope"
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)
