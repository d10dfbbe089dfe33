"""Cost per world against the number of worlds and of planks, and memory per world; one core.

All worlds are at different times of a motion that goes on for ever, so no number of worlds meets an
easier stretch of it, and worlds that are stepped together differ.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import steelyard as sy
from benchmarks import record
from benchmarks.engine_scenes import build
from benchmarks.figures import Announce, Figure
from benchmarks.references import equilibrium
from benchmarks.scenes import ParticleScene, artillery, tumbling_platform

STAGES = ("memory", "worlds", "planks")
DT = 0.01
WORLDS = (1, 4, 16, 64, 256, 1024, 4096, 16384)
PLANKS = (6, 12, 24, 48, 96)
PLANK_WORLDS = 1024
#: Steps of one call of `World.step`, and the least number of world steps that is timed at once.
STEPS = 10
TIMED_WORLD_STEPS = 20_000
PHASES, PHASE = 64, 0.05

DIRECT = sy.Method(sy.Rattle(), sy.Direct(), dt=DT)
SCENES: Mapping[str, tuple[Callable[[], ParticleScene], sy.Method]] = {
    "platform": (tumbling_platform, DIRECT),
    "bridge": (lambda: swinging_bridge(6), DIRECT),
    "ballistic": (artillery, sy.Method(sy.ClosedForm(), dt=DT)),
}


def long_bridge(planks: int) -> ParticleScene:
    """The suspended bridge with any number of planks; with 6 it is the bridge of the scenes.

    The ends flare out as those of the short one do, and every plank between them hangs from cables
    of 4 m, so all cables are taut at rest whatever the length.
    """
    pair, side = np.divmod(np.arange(2 * planks), 2)
    place = pair - 0.5 * (planks - 1)
    flare = 5.0 * place / (planks - 1)
    position = np.stack(
        [1.9 * place + 0.1 * flare, np.full(pair.shape, 4.0), 2.0 * side - 1.0], axis=1
    )
    anchor = np.stack(
        [1.9 * place + 0.3 * flare, np.full(pair.shape, 6.0), 1.6 * side - 0.8], axis=1
    )
    from_end = np.minimum(pair, planks - 1 - pair)
    length = 3.0 + 0.5 * np.minimum(from_end, 2)
    return ParticleScene(
        position=position,
        velocity=np.zeros_like(position),
        mass=np.ones(2 * planks),
        rods=tuple((2 * k, 2 * k + 1, 2.0) for k in range(planks)),
        cables=tuple((p, p + 2, 1.9) for p in range(2 * planks - 2)),
        supports=tuple(
            (p, (float(x), float(y), float(z)), float(length[p]))
            for p, (x, y, z) in enumerate(anchor)
        ),
        damping=0.9,
    )


def swinging_bridge(planks: int) -> ParticleScene:
    """The bridge let go from its rest under 5 kg on one particle at midspan; without damping."""
    scene = long_bridge(planks)
    mass = scene.mass.copy()
    mass[planks - planks % 2] += 5.0
    loaded = equilibrium(replace(scene, mass=mass))
    return replace(scene, position=loaded.position, damping=1.0)


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure and write scaling.json and .png to `output`.

    Args:
        quick: Few worlds and planks, one repeat: shows that it runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with each of `STAGES` as it begins.
    """
    counts = WORLDS[:3] if quick else WORLDS
    planks = PLANKS[:2] if quick else PLANKS
    announce("memory")
    figures = [figure for name in SCENES for figure in memory(name)]
    announce("worlds")
    by_worlds = {
        name: cost([(build(scene()), worlds) for worlds in counts], method, quick=quick)
        for name, (scene, method) in SCENES.items()
    }
    announce("planks")
    width = counts[-1] if quick else PLANK_WORLDS
    bridges = [(build(swinging_bridge(count)), width) for count in planks]
    by_planks = cost(bridges, DIRECT, quick=quick)
    exponent, factor = np.polyfit(np.log(planks), np.log(by_planks), 1)
    for name, costs in by_worlds.items():
        figures += [
            Figure(
                name=f"{name}: CPU time per step and world, {worlds} worlds",
                measured=value,
                unit="us",
            )
            for worlds, value in zip(counts, costs, strict=True)
            if worlds in (1, PLANK_WORLDS, counts[-1])
        ]
    figures.append(
        Figure(name="bridge: exponent of the cost in planks", measured=float(exponent), unit="")
    )
    payload = {
        "quick": quick,
        "dt": DT,
        "steps_per_call": STEPS,
        "units": "us of CPU time per step and world",
        "figures": [figure.record() for figure in figures],
        "worlds": counts,
        "cost_by_worlds": by_worlds,
        "planks": planks,
        "plank_worlds": width,
        "cost_by_planks": by_planks,
        "exponent": exponent,
    }
    record.write("scaling", payload, directory=output)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6))
    _draw_worlds(left, counts, by_worlds)
    _draw_planks(right, planks, by_planks, float(exponent), float(np.exp(factor)))
    right.set_title(f"bridge, {width} worlds")
    figure.tight_layout()
    figure.savefig(output / "scaling.png", dpi=120)
    plt.close(figure)
    return figures


def cost(scenes: Sequence[tuple[sy.Scene, int]], method: sy.Method, *, quick: bool) -> list[float]:
    """CPU time per step and world [us] of each of several (scene, number of worlds), in turns."""
    timed: dict[str, Callable[[], None]] = {}
    steps, stepped = {}, []
    for scene, worlds in scenes:
        world = sy.World(scene, worlds=worlds, method=method)
        spread_phases(world)
        calls = 1 if quick else max(1, TIMED_WORLD_STEPS // (STEPS * worlds))
        key = str(len(timed))
        timed[key] = _stepper(world, calls)
        steps[key] = calls * STEPS * worlds
        stepped.append(world)
    times = record.interleave(timed, repeats=1 if quick else 7)
    if any(world.health.any() for world in stepped):
        raise ArithmeticError("A world is flagged in its health: its cost is not that of a motion.")
    return [1e6 * times[key] / steps[key] for key in timed]


def spread_phases(world: sy.World) -> None:
    """Put every world at another time of the motion of the first, `PHASES` times over and again."""
    single = sy.World(world.scene, method=world.method)
    for phase in range(min(PHASES, world.worlds)):
        world.particles.position[phase::PHASES] = single.particles.position
        world.particles.velocity[phase::PHASES] = single.particles.velocity
        single.step(round(PHASE / world.method.dt))


def memory(name: str) -> list[Figure]:
    """Bytes per world of a scene, as stated and as allocated, against the rows that it needs."""
    scene, method = SCENES[name]
    built = build(scene())
    # Multiples of the block of worlds that need no padding, so that the difference is exact.
    small, large = (_allocated(built, method, 8 * odd) for odd in (511, 1023))
    needed = 8 * needed_rows(scene())
    stated = sy.World(built, worlds=1, method=method).bytes_per_world
    allocated = (large - small) / (8 * (1023 - 511))
    return [
        Figure(name=f"{name}: bytes per world, stated", measured=stated, unit="B", at_most=needed),
        Figure(
            name=f"{name}: bytes per world, allocated",
            measured=allocated,
            unit="B",
            # A world's share of what Python allocates for itself is less than a byte.
            at_most=needed + 1.0,
        ),
    ]


def needed_rows(scene: ParticleScene) -> int:
    """Numbers that a world must keep: positions, velocities, tensions, time and two flags.

    Where all particles are joined to all others they are one frame, whose rods need no tensions.
    """
    count = len(scene.mass)
    rods = 0 if 2 * len(scene.rods) == count * (count - 1) else len(scene.rods)
    return 6 * count + rods + len(scene.cables) + len(scene.supports) + 3


def _allocated(scene: sy.Scene, method: sy.Method, worlds: int) -> int:
    sy.World(scene, worlds=8, method=method).step()
    tracemalloc.start()
    world = sy.World(scene, worlds=worlds, method=method)
    world.step()
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return held


def _stepper(world: sy.World, calls: int) -> Callable[[], None]:
    def step() -> None:
        for _ in range(calls):
            world.step(STEPS)

    return step


def _draw_worlds(panel: Axes, counts: Sequence[int], costs: Mapping[str, Sequence[float]]) -> None:
    for name, values in costs.items():
        panel.plot(counts, values, "o-", label=name)
    panel.set_xlabel("worlds")
    panel.set_ylabel("CPU time per step and world [µs]")
    panel.set_title("three scenes, one core")
    _finish(panel, counts)


def _draw_planks(
    panel: Axes, planks: Sequence[int], costs: Sequence[float], exponent: float, factor: float
) -> None:
    panel.plot(planks, costs, "o", color="C1", label="measured")
    fitted = factor * np.asarray(planks, dtype=np.float64) ** exponent
    panel.plot(planks, fitted, "-", color="C1", alpha=0.6, label=f"fit: planks^{exponent:.2f}")
    linear = costs[0] * np.asarray(planks, dtype=np.float64) / planks[0]
    panel.plot(planks, linear, ":", color="grey", label="linear")
    panel.set_xlabel("planks")
    panel.set_ylabel("CPU time per step and world [µs]")
    _finish(panel, planks)


def _finish(panel: Axes, ticks: Sequence[int]) -> None:
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xticks(list(ticks), [str(tick) for tick in ticks])
    panel.minorticks_off()
    panel.grid(True, alpha=0.3)
    panel.legend(frameon=False)
