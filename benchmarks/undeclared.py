"""What features cost that a scene does not use: velocity Verlet as it is against the same with no other kernel in it.

The bare methods below are the integrator's own pieces, less all that the scene does not declare: drag, stiff springs,
constraints, and forces of other kinds. Both step the same worlds, in turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.figures import Announce, Figure

ext = sy.extension
STAGES = ("flight", "springs")
WORLDS, STEPS, PAIRS = 1024, 100, 15
#: Where arrays lie in memory makes steps as short as these differ by a quarter: the median is over worlds built anew.
BUILDS = 15
H_DT, H_FORCE, H_PARTICLES = ext.tape.H_DT, ext.tape.H_FORCE, ext.tape.H_PARTICLES


@ext.stage
def bare_first_half(tape, s, skip, part):  # type: ignore[no-untyped-def]
    """Kick and drift."""
    dt = ext.load(s, tape[H_DT])
    ext.damp(tape, s)
    ext.kick(tape, s, ext.splat(0.5) * dt)
    ext.drift(tape, s, dt)


@ext.stage
def bare_second_half(tape, s, skip, part):  # type: ignore[no-untyped-def]
    """Kick."""
    ext.kick(tape, s, ext.splat(0.5) * ext.load(s, tape[H_DT]))
    ext.damp(tape, s)


@ext.inner
def sum_springs(tape, s):  # type: ignore[no-untyped-def]
    """Forces of springs alone."""
    for row in range(3 * tape[H_PARTICLES] + 3):
        ext.store(s, tape[H_FORCE] + row, ext.splat(0.0))
    ext.add_springs(tape, s)


@ext.stage
def sprung_first_half(tape, s, skip, part):  # type: ignore[no-untyped-def]
    """Springs, kick and drift."""
    dt = ext.load(s, tape[H_DT])
    if skip[tape[ext.tape.H_BLOCKS] + ext.tape.FRESH] != 0:
        sum_springs(tape, s)
    ext.damp(tape, s)
    ext.kick(tape, s, ext.splat(0.5) * dt)
    ext.drift(tape, s, dt)


@ext.stage
def sprung_second_half(tape, s, skip, part):  # type: ignore[no-untyped-def]
    """Springs and kick."""
    sum_springs(tape, s)
    ext.kick(tape, s, ext.splat(0.5) * ext.load(s, tape[H_DT]))
    ext.damp(tape, s)


@dataclass(frozen=True)
class Bare(ext.Integrator):
    """Velocity Verlet for particles under constant acceleration alone."""

    damping_share: ClassVar[float] = 0.5

    def recipe(self, solver: ext.Solver | None, acting: ext.Acting) -> ext.Recipe:
        """Both halves."""
        return ((bare_first_half, 0), (bare_second_half, 1))


@dataclass(frozen=True)
class Sprung(ext.Integrator):
    """Velocity Verlet for particles on springs alone."""

    damping_share: ClassVar[float] = 0.5

    def recipe(self, solver: ext.Solver | None, acting: ext.Acting) -> ext.Recipe:
        """Both halves."""
        return ((sprung_first_half, 0), (sprung_second_half, 1))


def flight() -> sy.Scene:
    """Four particles in free fall."""
    scene = sy.Scene()
    for k in range(4):
        scene.add(sy.Particle(position=(k, 0.0, 0.0), velocity=(0.0, 3.0, 1.0)))
    return scene


def springs() -> sy.Scene:
    """Six particles in a ring of springs."""
    scene = sy.Scene()
    angles = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    ring = [scene.add(sy.Particle(position=(np.cos(a), np.sin(a), 0.1 * a))) for a in angles]
    for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
        scene.add(sy.Spring(a, b, 20.0, 0.8))
    return scene


def compare(name: str, scene: sy.Scene, bare: sy.Integrator, *, quick: bool) -> float:
    """CPU time of a step over that of the bare method, in worlds built anew.

    Raises:
        ArithmeticError: they do not step alike.
    """
    worlds, steps = (16, 2) if quick else (WORLDS, STEPS)
    whole = sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle()))
    alone = sy.World(scene, worlds=worlds, method=sy.Method(bare))
    for _ in range(3):
        whole.step(2)
        alone.step(2)
    if not np.array_equal(whole.particles.position, alone.particles.position):
        raise ArithmeticError(f"{name}: the bare method is not the same method")
    times = record.interleave(
        {"whole": partial(whole.step, steps), "bare": partial(alone.step, steps)},
        repeats=1 if quick else PAIRS,
    )
    return times["whole"] / times["bare"]


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure and write undeclared.json to `output`."""
    figures = []
    for name, scene, bare in (("flight", flight(), Bare()), ("springs", springs(), Sprung())):
        announce(name)
        ratios = [compare(name, scene, bare, quick=quick) for _ in range(1 if quick else BUILDS)]
        figures.append(
            Figure(
                name=f"{name}: a step over one without the kernels it does not use",
                measured=float(np.median(ratios)),
                at_most=1.02,
            )
        )
    record.write(
        "undeclared",
        {"quick": quick, "figures": [figure.record() for figure in figures]},
        directory=output,
    )
    return figures
