"""Velocity Verlet with constraints: RATTLE (Andersen 1983), with contacts as in nonsmooth RATTLE.

    damp h/2, kick h/2, drift h, position stage (gradients of the step's start),
    kick h/2, damp h/2, velocity stage (gradients of the step's end).

Order 2, symplectic and time-reversible without damping and contacts; a spring is stable while h w < 2, with
phase error (h w)^2/24 per radian. Damping and drag are exact flows of half a step on either side. Impacts
are resolved to the step (order 1 in their time), after Capobianco, Harsch, Eugster & Leine (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..constraints.controls import move_controls
from ..forces.accumulate import accumulate_forces
from ..forces.drag import flow_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..math.lanes import load, splat
from ..model.tape import H_DT
from ..solvers.base import Solver
from ..solvers.stages import begin_step
from ..stage import stage
from .base import Integrator, Recipe
from .motion import damp, drift, kick


@dataclass(frozen=True)
class Rattle(Integrator):
    """Velocity Verlet, with constraints RATTLE (see the module)."""

    damping_share: ClassVar[float] = 0.5
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0, 1.0)
    solver_stages: ClassVar[tuple[bool, ...]] = (True,)

    def recipe(self, solver: Solver | None) -> Recipe:
        """Both halves, each followed by its stage of the constraints."""
        if solver is None:
            return ((rattle_first_half, 0), (rattle_second_half, 1))
        return (
            (begin_step, 0),
            (move_controls, 0),
            (rattle_first_half, 0),
            (solver.stage, 0),
            (rattle_second_half, 1),
            (solver.stage, 1),
        )

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@stage
def rattle_first_half(tape, s, skip, half):
    """Up to the drift; the position stage follows."""
    dt = load(s, tape[H_DT])
    accumulate_forces(tape, s)
    damp(tape, s)
    flow_drag(tape, s, False)
    kick(tape, s, splat(0.5) * dt)
    drift(tape, s, dt)
    flow_stiff_springs(tape, s)


@stage
def rattle_second_half(tape, s, skip, half):
    """From the new positions on; the velocity stage follows."""
    accumulate_forces(tape, s)
    kick(tape, s, splat(0.5) * load(s, tape[H_DT]))
    flow_drag(tape, s, True)
    damp(tape, s)
