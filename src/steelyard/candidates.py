"""What is measured, charted and chosen from: methods by name, which of them can step a scene, and what a step costs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from .diagnostics.kinks import kink_sides
from .integrators.backward_euler import BackwardEuler
from .integrators.base import Integrator
from .integrators.closed_form import ClosedForm
from .integrators.composed_rattle import ComposedRattle
from .integrators.explicit_euler import ExplicitEuler
from .integrators.exponential import ExponentialRungeKutta
from .integrators.generalised_alpha import GeneralisedAlpha
from .integrators.impact_rattle import ImpactRattle
from .integrators.implicit_midpoint import ImplicitMidpoint
from .integrators.kink_rk4 import KinkRungeKutta4
from .integrators.linearly_implicit import LinearlyImplicit
from .integrators.rattle import Rattle
from .integrators.rk4 import RungeKutta4
from .integrators.rotor import parts_of
from .integrators.symplectic_euler import SymplecticEuler
from .math.pointers import LANES
from .methods import Method, joined_or_touching
from .scene.contacts import Collisions, Ground, LinePlatform
from .scene.forces import AnchoredBungee, Bungee, Buoyancy, Drag
from .scene.joints import JOINTS
from .scene.links import Cable, CableConstraint
from .scene.rider import Rider
from .scene.scene import CONTACTS, LINKS, SPRINGS, Scene
from .solvers.base import Solver
from .solvers.direct import Direct
from .solvers.gauss_seidel import GaussSeidel
from .solvers.proximal_newton import ProximalNewton
from .solvers.soft_step import SoftStep
from .solvers.swept_bodies import SweptBodies
from .solvers.worst_first import WorstFirst
from .solvers.xpbd import Xpbd

if TYPE_CHECKING:
    from .model.compile import Model

#: Scratch [KiB] that the nearest cache holds, about: what is beyond costs more.
_NEAR = 48.0
#: Looks at which kinks are counted.
_SAMPLES = 1_000
#: Looks at which contacts are counted.
_LOOKS = 60


@dataclass(frozen=True)
class Candidate:
    """A method at any step.

    Attributes:
        name: what charts and tables call it.
        integrator: how it advances.
        solver: what holds links and contacts; None for scenes without any.
    """

    name: str
    integrator: Integrator
    solver: Solver | None = None

    def at(self, dt: float) -> Method:
        """The method with a step [s]."""
        return Method(self.integrator, self.solver, dt=dt)

    def runs(self, events: float) -> float:
        """How often a block of worlds runs through its step, with so many events in it that divide it.

        Each takes two trials and a part of the step, until the world of the block that meets most of them is through.
        """
        most = self.integrator.divisions
        if events <= 0.0 or most == 0:
            return 1.0
        chances = np.exp(-events) * np.cumprod([1.0, *(events / k for k in range(1, most))])
        turns = (1.0 - np.cumsum(chances) ** LANES).sum()
        return 1.0 + 3.0 * float(turns)

    def work(
        self, scene: Scene, model: Model, dt: float, contacts: float = 0.0
    ) -> tuple[float, ...]:
        """What a step's cost is made of.

        That is 1, particles, words on the tape, springs, drags, parts of bodies' turns, KiB of scratch beyond
        ``_NEAR``, and contacts of bodies, of which there are so many at a time (``contacts_at_a_time``). Kernels work
        through the tape, but a force with a root and a division is dearer than its words. Bodies that turn freely do
        so in parts, the more the faster they spin and the longer the step.
        """
        springs = scene.of(*SPRINGS)
        everything = [*scene.particles, *scene.bodies]
        drags = sum(
            len(everything if drag.particles is None else drag.particles) for drag in scene.of(Drag)
        )
        longest = dt * max(map(abs, self.integrator.fractions))
        turns = sum(
            parts_of(body.angular_momentum, np.asarray(body.inertia), longest)
            if self.integrator.turns_freely
            else 1
            for body in scene.bodies
            if body.movable
        )
        far = max(model.rows * LANES * 8 / 1024 - _NEAR, 0.0)
        counts = (1, len(scene.particles), model.words, len(springs), drags, turns, far, contacts)
        return tuple(map(float, counts))


#: What is measured, charted and chosen from.
CANDIDATES = (
    Candidate("explicit Euler", ExplicitEuler()),
    Candidate("symplectic Euler", SymplecticEuler()),
    Candidate("velocity Verlet", Rattle()),
    Candidate("RK4", RungeKutta4()),
    Candidate("RK4, kinks inside", KinkRungeKutta4()),
    Candidate("exponential", ExponentialRungeKutta()),
    Candidate("linearly implicit", LinearlyImplicit()),
    Candidate("backward Euler", BackwardEuler()),
    Candidate("implicit midpoint", ImplicitMidpoint()),
    Candidate("closed form", ClosedForm()),
    Candidate("velocity Verlet, order 4", ComposedRattle()),
    Candidate("velocity Verlet, order 6", ComposedRattle(substeps=9)),
    Candidate("RATTLE, direct", Rattle(), Direct()),
    Candidate("RATTLE, impacts inside, direct", ImpactRattle(), Direct()),
    Candidate("RATTLE of order 4, direct", ComposedRattle(), Direct()),
    Candidate("RATTLE of order 6, direct", ComposedRattle(substeps=9), Direct()),
    Candidate("generalised-alpha", GeneralisedAlpha()),
    Candidate("RATTLE, Gauss-Seidel x 4", Rattle(), GaussSeidel(passes=4)),
    Candidate("RATTLE, Gauss-Seidel x 16", Rattle(), GaussSeidel(passes=16)),
    Candidate("RATTLE, Gauss-Seidel x 64", Rattle(), GaussSeidel(passes=64)),
    Candidate("symplectic Euler, direct", SymplecticEuler(), Direct()),
    Candidate("XPBD x 20", SymplecticEuler(), Xpbd(substeps=20)),
    Candidate("explicit Euler, worst first", ExplicitEuler(), WorstFirst()),
    Candidate("bodies, proximal Newton", Rattle(), ProximalNewton()),
    Candidate("bodies, Gauss-Seidel x 10", Rattle(), SweptBodies(passes=10)),
    Candidate("bodies, Gauss-Seidel x 30", Rattle(), SweptBodies(passes=30)),
    Candidate("bodies, worst first", Rattle(), SweptBodies(passes=2, worst=True)),
    Candidate("bodies, soft step x 4", Rattle(), SoftStep(substeps=4)),
    Candidate("bodies, soft step x 8", Rattle(), SoftStep(substeps=8)),
)


@cache
def cost_table() -> dict[str, list[float]]:
    """Cost per step and world [us] by method: what each part of ``Candidate.work`` costs."""
    text = files("steelyard").joinpath("costs.json").read_text()
    table: dict[str, list[float]] = json.loads(text)["coefficients"]
    return table


def candidates(scene: Scene) -> Iterator[Candidate]:
    """The candidates that can step a scene; with a solver, or with events resolved, only where there may be any."""
    impacts = bool(scene.of(Cable, CableConstraint, Ground, LinePlatform, Collisions))
    kinks = bool(scene.of(Bungee, AnchoredBungee, Buoyancy))
    held = bool(scene.of(*LINKS, *CONTACTS, Rider, *JOINTS))
    bodies = joined_or_touching(scene)
    for candidate in CANDIDATES:
        if bodies != (candidate.solver is not None and candidate.solver.rigid):
            continue
        holds = candidate.solver is not None or candidate.integrator.holds_links
        dividing = kinks if candidate.integrator.smooth else impacts
        if held == holds and (dividing or not candidate.integrator.splits):
            try:
                candidate.at(1.0).refuse(scene)
            except ValueError:
                continue
            yield candidate


def contacts_at_a_time(scene: Scene, horizon: float) -> float:
    """Mean number of contacts of bodies over the horizon [s], of a run at 60 Hz; 0 of scenes without any."""
    from .world import World

    method = Method(Rattle(), ProximalNewton())
    if not joined_or_touching(scene):
        return 0.0
    world = World(scene, method=method)
    if not world.model.touching:
        return 0.0
    steps = max(round(horizon / method.dt), 1)
    looks = min(steps, _LOOKS)
    found = []
    for _ in range(looks):
        world.step(steps // looks)
        found.append(int(world.contacts.count[0]))
    return float(np.mean(found))


def kinks_per_second(scene: Scene, horizon: float) -> float:
    """How often forces of a scene have a kink, over the horizon [s] from its start; 0 where that cannot be followed."""
    from .world import World

    method = Method(RungeKutta4(), dt=horizon / _SAMPLES)
    world = World(scene, method=method)
    sides = kink_sides(world)
    count = 0
    for _ in range(_SAMPLES):
        world.step()
        before, sides = sides, kink_sides(world)
        count += int((sides != before).sum())
    return 0.0 if world.health[0] else count / horizon
