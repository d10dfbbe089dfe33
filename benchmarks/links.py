"""Methods for links beside MuJoCo and beside each other: a step of chains with heavy ends, the direct solver and ten
sweeps, a pendulum to 1e-6 m.

Chains of twenty links of 1 m, let go level, in maximal coordinates on both sides: worlds differ by how they were
shaken, a tenth of a millimetre a second at most, so that none meets an easier stretch than another. MuJoCo steps at
.01 s, of which its cost does not depend, generalised-alpha at 1/60 s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

import steelyard as sy
from benchmarks import record
from benchmarks.engine_scenes import build
from benchmarks.figures import Announce, Figure
from benchmarks.peers import mujoco_scenes
from benchmarks.references import pendulum
from benchmarks.scenes import ParticleScene, bridge

STAGES = ("chains", "sweeps", "pendulum")
LINKS = 20
WORLDS = 1024
#: End mass over that of the others, and what the method keeps of unresolved oscillations.
ENDS = ((1.0, 0.3), (1e3, 0.3), (1e6, 0.0))
SHAKEN = 1e-4
STEPS = 20
SECONDS, TOLERANCE = 10.0, 1e-6

HINGE = """<mujoco><option timestep="{dt}" integrator="RK4" gravity="0 -9.81 0">
<flag contact="disable"/></option><worldbody><body><joint type="hinge" axis="0 0 1"/>
<inertial pos="1 0 0" mass="1" diaginertia="1e-12 1e-12 1e-12"/></body></worldbody></mujoco>"""


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure and write links.json to `output`.

    Args:
        quick: Few worlds and one repeat: shows that it runs, says nothing about speed.
        output: Folder of the results.
        announce: Called with each of `STAGES` as it begins.
    """
    worlds, repeats = (8, 1) if quick else (WORLDS, 9)
    announce("chains")
    figures = []
    for ratio, rho_inf in ENDS:
        ours, theirs, settled = chain_costs(ratio, rho_inf, worlds=worlds, repeats=repeats)
        name = f"chain of {LINKS}, end x {ratio:g}"
        figures += [
            Figure(name=f"{name}: generalised-alpha", measured=1e6 * ours, unit="us/step"),
            Figure(name=f"{name}: MuJoCo", measured=1e6 * theirs, unit="us/step"),
            Figure(name=f"{name}: cost beside MuJoCo", measured=ours / theirs, at_most=0.2),
            Figure(name=f"{name}: worlds that settled", measured=settled, at_least=1.0),
        ]
    announce("sweeps")
    figures += sweep_costs(worlds=worlds, repeats=repeats)
    announce("pendulum")
    figures += pendulum_costs(worlds=worlds, repeats=repeats)
    payload = {"quick": quick, "worlds": worlds, "figures": [figure.record() for figure in figures]}
    record.write("links", payload, directory=output)
    return figures


def heavy_chain(ratio: float, *, links: int = LINKS) -> ParticleScene:
    """Links level from the origin, the last particle `ratio` kg, the others 1 kg."""
    position = np.zeros((links, 3))
    position[:, 0] = np.arange(1, links + 1)
    mass = np.ones(links)
    mass[-1] = ratio
    return ParticleScene(
        position=position,
        velocity=np.zeros((links, 3)),
        mass=mass,
        rods=tuple((k, k + 1, 1.0) for k in range(links - 1)),
        pins=((0, (0.0, 0.0, 0.0), 1.0),),
    )


def chain_costs(
    ratio: float, rho_inf: float, *, worlds: int, repeats: int
) -> tuple[float, float, float]:
    """CPU time of a step and world, ours and MuJoCo's [s], and the share of our worlds that settled."""
    scene = heavy_chain(ratio)
    world = sy.World(
        build(scene), worlds=worlds, method=sy.Method(sy.GeneralisedAlpha(rho_inf=rho_inf))
    )
    kick = np.random.default_rng(0).uniform(-SHAKEN, SHAKEN, world.particles.velocity.shape)
    world.particles.velocity[:] = kick
    model, data = mujoco_scenes.build(scene, dt=0.01)
    steps = STEPS if repeats > 1 else 2
    times = record.interleave(
        {
            "ours": partial(world.step, steps),
            "theirs": partial(mujoco.mj_step, model, data, nstep=10 * steps),
        },
        repeats=repeats,
    )
    settled = float((world.health == 0).mean())
    return times["ours"] / steps / worlds, times["theirs"] / (10 * steps), settled


def sweep_costs(*, worlds: int, repeats: int) -> list[Figure]:
    """The direct solver beside ten sweeps of Gauss-Seidel: cost of a step, and what each leaves of the links."""
    scenes = {f"chain of {links}": heavy_chain(1.0, links=links) for links in (3, 5, 10, 20)}
    figures = []
    for name, scene in {**scenes, "bridge": bridge()}.items():
        solvers = {"direct": sy.Direct(), "ten sweeps": sy.GaussSeidel(passes=10)}
        running = {
            solver: sy.World(
                build(scene), worlds=worlds, method=sy.Method(sy.Rattle(), made, dt=0.01)
            )
            for solver, made in solvers.items()
        }
        random = np.random.default_rng(0)
        kick = random.uniform(-SHAKEN, SHAKEN, running["direct"].particles.velocity.shape)
        for world in running.values():
            world.particles.velocity[:] += kick
        times = record.interleave(
            {solver: partial(world.step, STEPS) for solver, world in running.items()},
            repeats=repeats,
        )
        for solver, world in running.items():
            cost = 1e6 * times[solver] / STEPS / worlds
            left = float(world.residual.max())
            most = 1e-12 if solver == "direct" else None
            figures += [
                Figure(name=f"{name}: {solver}", measured=cost, unit="us/step"),
                Figure(
                    name=f"{name}: {solver}, residual", measured=left, unit="share", at_most=most
                ),
            ]
        ratio = times["direct"] / times["ten sweeps"]
        figures.append(
            Figure(name=f"{name}: direct beside ten sweeps", measured=ratio, at_most=1.0)
        )
    return figures


def pendulum_costs(*, worlds: int, repeats: int) -> list[Figure]:
    """CPU time of 10 s of a pendulum from 90 degrees to 1e-6 m, at the fewest steps that hold it."""
    angle, _ = pendulum([SECONDS], length=1.0)
    exact = np.array([np.sin(angle[0]), -np.cos(angle[0])])
    bob = ParticleScene(
        position=np.array([[1.0, 0.0, 0.0]]),
        velocity=np.zeros((1, 3)),
        mass=np.ones(1),
        pins=((0, (0.0, 0.0, 0.0), 1.0),),
    )

    def ours(parts: int, count: int, *, copies: int = 1) -> sy.World:
        method = sy.Method(sy.ComposedRattle(substeps=parts), sy.Direct(), dt=SECONDS / count)
        return sy.World(build(bob), worlds=copies, method=method)

    def swing(world: sy.World, count: int) -> None:
        world.reset()
        world.step(count)

    def error(parts: int, count: int) -> float:
        world = ours(parts, count)
        world.step(count)
        return float(np.abs(world.particles.position[0, 0, :2] - exact).max())

    def hinge(count: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model = mujoco.MjModel.from_xml_string(HINGE.format(dt=SECONDS / count))
        return model, mujoco.MjData(model)

    def fall(model: mujoco.MjModel, data: mujoco.MjData, count: int) -> None:
        mujoco.mj_resetData(model, data)
        mujoco.mj_step(model, data, nstep=count)

    def hinge_error(count: int) -> float:
        model, data = hinge(count)
        fall(model, data, count)
        found = np.array([np.cos(data.qpos[0]), np.sin(data.qpos[0])])
        return float(np.abs(found - exact).max())

    theirs = fewest(hinge_error, range(400, 800, 10))
    functions: dict[str, Callable[[], object]] = {"MuJoCo": partial(fall, *hinge(theirs), theirs)}
    copies = {"MuJoCo": 1}
    figures = [Figure(name="pendulum to 1e-6 m: MuJoCo's steps", measured=theirs, unit="steps")]
    for parts, ladder in ((5, range(800, 1200, 10)), (9, range(200, 400, 10))):
        count = fewest(partial(error, parts), ladder)
        order = sy.ComposedRattle(substeps=parts).order()
        figures.append(
            Figure(name=f"pendulum to 1e-6 m: order {order}, steps", measured=count, unit="steps")
        )
        for some in (worlds, 1):
            name = f"order {order}, {some} worlds" if some > 1 else f"order {order}, one world"
            functions[name] = partial(swing, ours(parts, count, copies=some), count)
            copies[name] = some
    times = record.interleave(functions, repeats=repeats)
    costs = {name: time / copies[name] for name, time in times.items()}
    figures += [
        Figure(name=f"pendulum to 1e-6 m: {name}", measured=1e6 * cost, unit="us")
        for name, cost in costs.items()
    ]
    figures += [
        Figure(
            name=f"pendulum to 1e-6 m: {name} beside MuJoCo's RK4 hinge",
            measured=cost / costs["MuJoCo"],
            at_most=1.0 if copies[name] > 1 else None,
        )
        for name, cost in costs.items()
        if name != "MuJoCo"
    ]
    return figures


def fewest(error: Callable[[int], float], ladder: Sequence[int]) -> int:
    """The least number of steps of a ladder whose error is within the tolerance.

    Raises:
        ArithmeticError: None is.
    """
    for count in ladder:
        if error(count) <= TOLERANCE:
            return count
    raise ArithmeticError(f"no number of steps up to {ladder[-1]} holds {TOLERANCE:g} m")
