"""What a planar scene saves: the same scene, declared planar and not, stepped in turns."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.figures import Announce, Figure

WORLDS, STEPS, REPEATS = 1024, 20, 7
#: Pairs of worlds built anew: where arrays lie moves one pair by up to a quarter.
BUILDS = 7
DT = 1.0 / 240.0


def grid(planar: bool) -> sy.Scene:
    """Springs between 8 x 8 particles, hung by two corners."""
    scene = sy.Scene(planar=planar)
    side = 8
    points = [
        [
            scene.add(
                sy.Particle(
                    position=(0.1 * i, -0.1 * j, 0.0),
                    inverse_mass=0.0 if j == 0 and i in (0, side - 1) else 100.0,
                )
            )
            for j in range(side)
        ]
        for i in range(side)
    ]
    for i in range(side):
        for j in range(side):
            for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
                if i + di < side and 0 <= j + dj < side:
                    a, b = points[i][j], points[i + di][j + dj]
                    scene.add(sy.Spring(a, b, 50.0, 0.1 * float(np.hypot(di, dj))))
    return scene


def chain(planar: bool) -> sy.Scene:
    """Twenty rods, let go level."""
    scene = sy.Scene(planar=planar)
    row = [scene.add(sy.Particle(position=(0.1 * (k + 1), 0.0, 0.0))) for k in range(20)]
    scene.add(sy.RodConstraint(row[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(row):
        scene.add(sy.Rod(a, b))
    return scene


def pendulum(planar: bool) -> sy.Scene:
    """One rod."""
    scene = sy.Scene(planar=planar)
    scene.add(sy.RodConstraint(scene.add(sy.Particle(position=(1.0, 0.0, 0.0))), (0.0, 0.0, 0.0)))
    return scene


def shots(planar: bool) -> sy.Scene:
    """Four shots with drag."""
    scene = sy.Scene(planar=planar)
    for k in range(4):
        scene.add(sy.Particle(position=(k, 0.0, 0.0), velocity=(30.0 + k, 20.0, 0.0)))
    scene.add(sy.Drag(0.1, 0.01))
    return scene


CASES: dict[str, tuple[Callable[[bool], sy.Scene], sy.Integrator, sy.Solver | None]] = {
    "grid of springs, velocity Verlet": (grid, sy.Rattle(), None),
    "grid of springs, RK4": (grid, sy.RungeKutta4(), None),
    "grid of springs, linearly implicit": (grid, sy.LinearlyImplicit(), None),
    "grid of springs, backward Euler": (grid, sy.BackwardEuler(), None),
    "chain of 20, RATTLE direct": (chain, sy.Rattle(), sy.Direct()),
    "chain of 20, generalised-alpha": (chain, sy.GeneralisedAlpha(), None),
    "chain of 20, XPBD": (chain, sy.SymplecticEuler(), sy.Xpbd()),
    "pendulum, RATTLE direct": (pendulum, sy.Rattle(), sy.Direct()),
    "shots with drag, velocity Verlet": (shots, sy.Rattle(), None),
    "shots with drag, RK4": (shots, sy.RungeKutta4(), None),
}
STAGES = tuple(CASES)


def compare(name: str, worlds: int, steps: int, repeats: int) -> tuple[float, float]:
    """Cost of space over plane of one pair of worlds, built anew, and how far they are apart [m]."""
    scene, integrator, solver = CASES[name]
    method = sy.Method(integrator, solver, dt=DT)
    space, plane = (
        sy.World(scene(planar), worlds=worlds, method=method) for planar in (False, True)
    )
    space.step(steps)
    plane.step(steps)
    apart = np.abs(space.particles.position - plane.particles.position).max()
    start = {world: world.snapshot() for world in (space, plane)}

    def again(world: sy.World) -> None:
        world.restore(start[world])
        world.step(steps)

    times = record.interleave(
        {"space": partial(again, space), "plane": partial(again, plane)}, repeats=repeats
    )
    return times["space"] / times["plane"], float(apart)


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure and write planar.json to `output`.

    Args:
        quick: Few worlds and one repeat: shows that it runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with each of `STAGES` as it begins.
    """
    worlds, steps, repeats, builds = (8, 2, 1, 1) if quick else (WORLDS, STEPS, REPEATS, BUILDS)
    figures = []
    for name in CASES:
        announce(name)
        pairs = [compare(name, worlds, steps, repeats) for _ in range(builds)]
        figures += [
            Figure(
                name=f"{name}: space over plane",
                measured=float(np.median([ratio for ratio, _ in pairs])),
                at_least=1.4,
            ),
            Figure(
                name=f"{name}: apart",
                measured=max(apart for _, apart in pairs),
                unit="m",
                at_most=1e-12,
            ),
        ]
    record.write(
        "planar",
        {"quick": quick, "figures": [figure.record() for figure in figures]},
        directory=output,
    )
    return figures
