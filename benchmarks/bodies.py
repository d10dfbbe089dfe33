"""Rigid bodies beside MuJoCo, and Drake where installed, on one core: a stack, a heap, a ragdoll; growth; rays.

MuJoCo steps one world per model and is timed on some of the worlds; the engine steps all of them. What both are held
to stands beside the cost: penetration, gaps of joints, and the largest gain of energy between looks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.figures import Announce, Figure
from benchmarks.peers import drake
from benchmarks.peers.mujoco_bodies import BodyFlight, BodySettings

STAGES = ("stack", "heap", "ragdoll", "growth", "broad phase", "rays")
DT = 0.01
Measured = dict[str, dict[str, float]]
Readings = dict[str, Callable[[], Any]]
#: Of Drake, by name; none where it is not installed.
WAYS = drake.WAYS if drake.INSTALLED else {}


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure all and write bodies.json to ``output``."""
    results: dict[str, Any] = {}
    figures: list[Figure] = []
    for name in STAGES:
        announce(name)
        results[name], found = _MEASURES[name](quick)
        figures += found
    payload = {
        "quick": quick, "dt": DT,
        "units": {"per_step": "us", "penetration, gap": "m", "gain": "of the start's energy above its end"},
        "figures": [figure.record() for figure in figures], "scenes": results,
    }  # fmt: skip
    record.write("bodies", payload, directory=output)
    draw_heap(results["heap"]["methods"], output / "bodies_heap.png")
    return figures


def stack(count: int) -> sy.Scene:
    """Boxes of a metre on each other."""
    scene = sy.Scene()
    for i in range(count):
        scene.add(sy.Body(position=(0, 0.5 + i, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    return _grounded(scene)


def heap(count: int, seed: int, turns: Any = None) -> sy.Scene:
    """Boxes and balls in turn, strewn above the ground; with orientations (count, 4) of one's own."""
    rng = np.random.default_rng(seed)
    scene = sy.Scene()
    wide = 0.6 * np.sqrt(count)
    for i in range(count):
        half = rng.uniform(0.2, 0.5, 3)
        shape = sy.Sphere(float(half[0])) if i % 2 else sy.Box(tuple(half))
        x, z = rng.uniform(-0.5 * wide, 0.5 * wide, 2)
        place = (x, 1.0 + 1.1 * i, z)
        turn = rng.normal(size=4)
        turn = turn if turns is None else turns[i]
        scene.add(sy.Body(position=place, orientation=tuple(turn), parts=shape))
    return _grounded(scene)


def _grounded(scene: sy.Scene) -> sy.Scene:
    scene.add(sy.Ground(friction=0.6))
    scene.add(sy.Collisions(friction=0.6))
    return scene


def _world(scene: sy.Scene, worlds: int, dt: float = DT, *, sleeps: bool = True) -> sy.World:
    solver = sy.ProximalNewton() if sleeps else sy.ProximalNewton(rest_time=None)
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), solver, dt=dt))


def _timed(
    functions: dict[str, tuple[Callable[[], object], float]], repeats: int
) -> dict[str, float]:
    """CPU time of each per step of one world [us], in turns; given what to call and how many such steps that is."""
    times = record.interleave(
        {name: call for name, (call, _) in functions.items()}, repeats=repeats
    )
    return {name: 1e6 * times[name] / functions[name][1] for name in functions}


def _stack(quick: bool) -> tuple[Any, list[Figure]]:
    """Ten boxes that stand."""
    worlds, settle, steps = (8, 50, 5) if quick else (256, 400, 50)
    calls: dict[str, tuple[Callable[[], object], float]] = {}
    worlds_of = {}
    for name in ("awake", "asleep"):
        ours = _world(stack(10), worlds, sleeps=name == "asleep")
        ours.bodies.position[:, :, 0] += 1e-3 * np.random.default_rng(0).uniform(size=(worlds, 10))
        ours.step(settle)
        worlds_of[name] = ours
        calls[name] = (lambda ours=ours: ours.step(steps), worlds * steps)
    flights: dict[str, Any] = {}
    for cone in ("pyramidal", "elliptic"):
        flight = BodyFlight(stack(10), BodySettings(dt=DT, cone=cone))
        flight.step(settle)
        flights[f"MuJoCo, {cone}"] = flight
        calls[f"MuJoCo, {cone}"] = (lambda flight=flight: flight.step(20 * steps), 20 * steps)
    for name, way in WAYS.items():
        flight = drake.flight(stack(10), DT, way)
        flight.step(settle)
        flights[name] = flight
        calls[name] = (lambda flight=flight: flight.step(20 * steps), 20 * steps)
    cost = _timed(calls, 1 if quick else 7)
    top = {name: float(flight.position[-1, 1]) for name, flight in flights.items()}
    deep = {name: flight.penetration for name, flight in flights.items()}
    for name, ours in worlds_of.items():
        deep[name] = float(ours.penetration.max())
        top[name] = float(ours.bodies.position[:, -1, 1].min())
    assert quick or worlds_of["asleep"].bodies.asleep.all()
    found = {
        name: {"per_step": cost[name], "penetration": deep[name], "top": top[name]} for name in cost
    }
    theirs = [name for name in flights if name.startswith("MuJoCo")]
    best = min(cost[name] for name in theirs)
    return found, [
        Figure(name="stack of ten: MuJoCo over ours, kept awake", measured=best / cost["awake"], at_least=5.0),
        Figure(name="stack of ten: MuJoCo over ours, as it is", measured=best / cost["asleep"], at_least=5.0),
        Figure(name="stack of ten: penetration", measured=deep["awake"], unit="m",
               at_most=min(deep[name] for name in theirs)),
        Figure(name="stack of ten: asleep over awake", measured=cost["asleep"] / cost["awake"], unit="",
               at_most=0.02),
    ]  # fmt: skip


def _read_world(world: sy.World) -> tuple[Callable[[], None], Readings]:
    """What steps worlds by five, and what is read of them."""
    readings: Readings = {
        "energy": lambda: world.energy.copy(),
        "penetration": lambda: float(world.penetration.max()),
        "gap": lambda: float(world.joints.gap.max(initial=0.0)),
    }
    return lambda: world.step(5), readings


def _read_flight(flight: Any) -> tuple[Callable[[], None], Readings]:
    """The same of MuJoCo or Drake."""
    readings: Readings = {
        "energy": lambda: np.array([flight.energy]),
        "penetration": lambda: flight.penetration,
        "gap": lambda: flight.gap,
    }
    return lambda: flight.step(5), readings


def watch(step: Callable[[], None], read: Readings, looks: int) -> dict[str, float]:
    """Largest of what is read at looks; of energy the largest gain of a world between them over its whole fall."""
    most = dict.fromkeys((name for name in read if name != "energy"), 0.0)
    energies = [read["energy"]()]
    for _ in range(looks):
        step()
        for name in most:
            most[name] = max(most[name], float(read[name]()))
        energies.append(read["energy"]())
    each = np.array(energies)
    falls = np.maximum(each[0] - each.min(axis=0), 1e-300)
    return {**most, "gain": max(0.0, float((np.diff(each, axis=0) / falls).max()))}


#: Ways to hold a heap, by name.
SOLVERS: dict[str, Any] = {
    "proximal Newton": sy.ProximalNewton(),
    "Gauss-Seidel x 3": sy.GaussSeidel(3),
    "Gauss-Seidel x 5": sy.GaussSeidel(5),
    "Gauss-Seidel x 10": sy.GaussSeidel(10),
    "Gauss-Seidel x 30": sy.GaussSeidel(30),
    "worst first": sy.WorstFirst(),
    "soft step x 4": sy.SoftStep(substeps=4),
    "soft step x 8": sy.SoftStep(substeps=8),
}


def _heap(quick: bool) -> tuple[Any, list[Figure]]:
    """Ten boxes and ten balls that fall and come to rest, 10 s, from the same starts in both engines."""
    worlds, seconds, starts = (4, 0.5, 2) if quick else (32, 10.0, 8)
    rng = np.random.default_rng(5)
    turns = rng.normal(size=(worlds, 20, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    calls: dict[str, tuple[Callable[[], object], float]] = {}
    found: Measured = {}

    def start(solver: Any, dt: float, count: int) -> sy.World:
        method = sy.Method(sy.Rattle(), solver, dt=dt)
        world = sy.World(heap(20, 1), worlds=count, method=method)
        world.bodies.orientation[:] = turns[:count]
        return world

    def mujoco(index: int, dt: float, cone: Any) -> BodyFlight:
        return BodyFlight(heap(20, 1, turns[index]), BodySettings(dt=dt, cone=cone))

    def drake_flight(index: int, dt: float, way: Any) -> Any:
        return drake.flight(heap(20, 1, turns[index]), dt, way)

    for name, solver in SOLVERS.items():
        for dt in (DT, 1 / 60):
            steps = round(seconds / dt)
            key = f"{name}, dt {dt:.4f}"
            found[key] = watch(*_read_world(start(solver, dt, starts)), steps // 5)
            calls[key] = (
                lambda solver=solver, dt=dt, steps=steps: start(solver, dt, worlds).step(steps),
                worlds * seconds,
            )
    # CENIC chooses its steps itself, below the largest: two of these will do.
    peers = [
        *((f"MuJoCo {cone}", mujoco, cone, dt) for cone in ("elliptic", "pyramidal") for dt in (0.002, 0.005, DT)),
        *((name, drake_flight, way, dt) for name, way in WAYS.items() for dt in (0.005, DT)),
    ]  # fmt: skip
    for name, peer, how, dt in peers:
        # Drake takes up to half a minute for each.
        flown = 2 if peer is drake_flight else starts
        steps = round(seconds / dt)
        key = f"{name}, dt {dt:.4f}"
        each = [watch(*_read_flight(peer(k, dt, how)), steps // 5) for k in range(flown)]
        found[key] = {name: max(one[name] for one in each) for name in each[0]}

        def fly(
            peer: Any = peer, how: Any = how, dt: float = dt, steps: int = steps, flown: int = flown
        ) -> None:
            for k in range(flown):
                peer(k, dt, how).step(steps)

        calls[key] = (fly, flown * seconds)
    cost = _timed(calls, 1 if quick else 3)
    for name in found:
        found[name]["per_second"] = cost[name]
    ratios = {}
    for theirs in found:
        if theirs.startswith("MuJoCo"):
            able = {
                ours: cost[theirs] / cost[ours]
                for ours in found
                if not ours.startswith(("MuJoCo", "Drake"))
                and all(found[ours][k] <= found[theirs][k] for k in ("penetration", "gain"))
            }
            best = max(able, key=lambda ours: able[ours], default=None)
            ratios[theirs] = {"by": best, "ratio": able[best] if best else 0.0}
    return {"methods": found, "ratios": ratios}, [
        Figure(
            name="heap of 20: MuJoCo over ours of no larger penetration and gain, the least of its settings",
            measured=min(entry["ratio"] for entry in ratios.values()),
            at_least=3.0,
        ),
    ]


#: Colours and lines of peers in the heap's picture; ours have the others.
PEER_STYLES = {
    "MuJoCo elliptic": ("#000000", "s--"),
    "MuJoCo pyramidal": ("#888888", "s--"),
    "Drake SAP": ("#000000", "^:"),
    "Drake CENIC 1e-3": ("#555555", "v:"),
    "Drake CENIC 1e-5": ("#999999", "D:"),
}


def draw_heap(found: Measured, path: Path) -> None:
    """Cost against penetration and against the gain of energy, of every method and step."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, panels = plt.subplots(1, 2, figsize=(12.5, 4.6))
    families = list(dict.fromkeys(name.rpartition(", dt ")[0] for name in found))
    for family in families:
        points = [entry for name, entry in found.items() if name.rpartition(", dt ")[0] == family]
        points.sort(key=lambda entry: entry["per_second"])
        colour, style = PEER_STYLES.get(family, (None, "o-"))
        for panel, measure in zip(panels, ("penetration", "gain"), strict=True):
            panel.plot(
                [max(entry[measure], 1e-12) for entry in points],
                [entry["per_second"] / 1e3 for entry in points],
                style,
                label=family,
                color=colour,
            )
    for panel, label in zip(
        panels,
        ("deepest penetration", "largest gain of energy between looks [share of the fall]"),
        strict=True,
    ):
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel(label)
        panel.set_ylabel("CPU time per simulated second\nand world [ms]")
        panel.grid(visible=True, which="major", alpha=0.3)
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_minor_formatter(NullFormatter())
    panels[0].set_xticks([1e-4, 1e-3, 1e-2, 0.1], [".1 mm", "1 mm", "1 cm", "10 cm"])
    for panel in panels:
        low, high = panel.get_ylim()
        ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500) if low <= t <= high]
        panel.set_yticks(ticks, [str(t) for t in ticks])
    panels[1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    figure.suptitle(
        "Ten boxes and ten balls fall and come to rest: down and left is better", x=0.01, ha="left"
    )
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _ragdoll(quick: bool) -> tuple[Any, list[Figure]]:
    """A ragdoll that falls from half a metre, 4 s."""
    worlds, steps, peers = (4, 40, 2) if quick else (128, 400, 8)
    rng = np.random.default_rng(6)
    spin = rng.normal(size=(worlds, 12, 3))

    def start(solver: Any, count: int) -> sy.World:
        method = sy.Method(sy.Rattle(), solver, dt=DT)
        world = sy.World(sy.scenes.ragdoll(height=0.5), worlds=count, method=method)
        world.bodies.angular_velocity = spin[:count]
        return world

    def peer(index: int) -> BodyFlight:
        flight = BodyFlight(sy.scenes.ragdoll(height=0.5), BodySettings(dt=DT))
        flight.push(np.zeros((12, 3)), spin[index])
        return flight

    def fly() -> None:
        for index in range(peers):
            peer(index).step(steps)

    found = {
        name: watch(*_read_world(start(solver, min(worlds, 16))), steps // 5)
        for name, solver in SOLVERS.items()
    }
    each = [watch(*_read_flight(peer(index)), steps // 5) for index in range(peers)]
    found["MuJoCo"] = {name: max(one[name] for one in each) for name in each[0]}
    calls: dict[str, tuple[Callable[[], object], float]] = {
        name: (lambda solver=solver: start(solver, worlds).step(steps), float(worlds * steps))
        for name, solver in SOLVERS.items()
    }
    cost = _timed({**calls, "MuJoCo": (fly, peers * steps)}, 1)
    for name in found:
        found[name]["per_step"] = cost[name]

    def over_cheapest(*measures: str) -> float:
        """Cost of MuJoCo over that of ours which is no worse by these measures."""
        theirs = found["MuJoCo"]
        able = (cost[n] for n in SOLVERS if all(found[n][m] <= theirs[m] for m in measures))
        return cost["MuJoCo"] / min(able, default=math.inf)

    return found, [
        Figure(
            name="ragdoll: MuJoCo over the cheapest of ours with joints no more open",
            measured=over_cheapest("gap"),
            at_least=8.0,
        ),
        Figure(
            name="ragdoll: the same with no larger gain of energy either",
            measured=over_cheapest("gap", "gain"),
        ),
        Figure(
            name="ragdoll: gap of joints, proximal Newton",
            measured=found["proximal Newton"]["gap"],
            unit="m",
            at_most=5e-3,
        ),
    ]


def _growth(quick: bool) -> tuple[Any, list[Figure]]:
    """Heaps of more and more bodies in one world, for 4 s."""
    counts: Sequence[int] = (10, 20) if quick else (10, 20, 40, 80, 160)
    steps = 20 if quick else 400
    calls = {
        str(count): (lambda count=count: _world(heap(count, 2), 1).step(steps), float(steps))
        for count in counts
    }
    cost = _timed(calls, 1)
    exponent = float(
        np.polyfit(np.log(counts), np.log([cost[str(count)] for count in counts]), 1)[0]
    )
    found = {"per_step": cost, "exponent": exponent}
    return found, [
        Figure(name="growth with the number of bodies", measured=exponent, unit="", at_most=1.3)
    ]


def strewn(count: int) -> sy.Scene:
    """Boxes and balls in turn that fall on a ground whose size grows with their number."""
    rng = np.random.default_rng(4)
    scene = sy.Scene()
    wide = 0.9 * np.sqrt(count)
    for i in range(count):
        half = rng.uniform(0.2, 0.5, 3)
        shape = sy.Sphere(float(half[0])) if i % 2 else sy.Box(tuple(half))
        x, z = rng.uniform(-0.5 * wide, 0.5 * wide, 2)
        place = (x, rng.uniform(1.0, 8.0), z)
        scene.add(sy.Body(position=place, orientation=tuple(rng.normal(size=4)), parts=shape))
    return _grounded(scene)


#: Ways to find what is near.
PHASES: tuple[Literal["pairs", "tree"], ...] = ("pairs", "tree")


def _broad_phase(quick: bool) -> tuple[Any, list[Figure]]:
    """Many bodies in one world by ten sweeps, for 2 s, with all pairs tried and with a tree."""
    counts: Sequence[int] = (10, 20) if quick else (10, 20, 40, 80, 160, 320, 640, 1280)
    steps = 10 if quick else 200
    calls = {}
    for count in counts:
        for phase in PHASES:
            solver = sy.GaussSeidel(10, rest_time=None, broad_phase=phase)
            method = sy.Method(sy.Rattle(), solver, dt=DT)
            calls[f"{count} by {phase}"] = (
                lambda count=count, method=method: sy.World(strewn(count), method=method).step(
                    steps
                ),
                float(steps),
            )
    cost = _timed(calls, 1 if quick else 3)
    found = {
        phase: {str(count): cost[f"{count} by {phase}"] for count in counts} for phase in PHASES
    }
    most = str(counts[-1])
    return {"per_step": found}, [
        Figure(
            name=f"{most} bodies: all pairs over a tree",
            measured=found["pairs"][most] / found["tree"][most],
        )
    ]


def _rays(quick: bool) -> tuple[Any, list[Figure]]:
    """A thousand rays against a hundred bodies: with a tree, and trying all."""

    rng = np.random.default_rng(0)
    rays = 50 if quick else 1000
    world = _world(heap(100, 3), 1)
    start, way = rng.uniform(-15, 15, (rays, 3)) + np.array((0, 20, 0)), rng.normal(size=(rays, 3))

    def cast(many: int) -> None:
        queries = type(world.queries)
        kept, queries.many = queries.many, many
        try:
            for _ in range(3):
                world.queries.ray(start, way)
        finally:
            queries.many = kept

    calls = {"tree": (lambda: cast(1), 3.0 * rays), "all": (lambda: cast(10**9), 3.0 * rays)}
    cost = _timed(calls, 1 if quick else 7)
    ratio = cost["all"] / cost["tree"]
    return {"per_ray": cost}, [
        Figure(name="1000 rays, 100 bodies: all over tree", measured=ratio, at_least=5.0)
    ]


_MEASURES = {
    "stack": _stack,
    "heap": _heap,
    "ragdoll": _ragdoll,
    "growth": _growth,
    "broad phase": _broad_phase,
    "rays": _rays,
}
