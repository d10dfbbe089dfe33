"""Velocity Verlet with constraints: RATTLE (Andersen 1983), with contacts as in nonsmooth RATTLE.

    damp h/2, kick h/2, drift h, position stage (gradients of the step's start),
    kick h/2, damp h/2, velocity stage (gradients of the step's end).

Order 2, symplectic and time-reversible without damping and contacts; a spring is stable while h w < 2, with
phase error (h w)^2/24 per radian. Bodies are kicked alike and turn freely in between (``integrators.rotor``): without
torque their motion is exact to rounding. Damping and drag are exact flows of half a step on either side. Impacts
are resolved to the step (order 1 in their time), after Capobianco, Harsch, Eugster & Leine (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

from ..constraints.controls import move_controls
from ..forces.accumulate import acting_forces, tell_time
from ..forces.drag import flow_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..math.lanes import load, splat
from ..model.tape import FRESH, H_BLOCKS, H_DT
from ..solvers.base import Solver
from ..solvers.stages import begin_step
from ..stage import Stage, stage
from .base import Acting, Integrator, Recipe
from .motion import damp, drift, kick
from .rotor import damp_bodies, drift_bodies, flag_nonfinite_bodies, kick_bodies


@dataclass(frozen=True)
class Rattle(Integrator):
    """Velocity Verlet, with constraints RATTLE (see the module)."""

    damping_share: ClassVar[float] = 0.5
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0, 1.0)
    solver_stages: ClassVar[tuple[bool, ...]] = (True,)
    moves_bodies: ClassVar[bool] = True
    tells_time: ClassVar[bool] = True
    turns_freely: ClassVar[bool] = True

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Both halves, each followed by its stage of the constraints."""
        first, second = rattle_halves(acting)
        if solver is None:
            return ((first, 0), (second, 1))
        if solver.rigid:
            kicked, drifted = rattle_parts(acting)
            drift = () if acting.joints and solver.closes_joints else ((drifted, 0),)
            return (
                (solver.start, 0), (kicked, 0), (solver.stage, 0), *drift, (second, 1), (solver.stage, 1)
            )  # fmt: skip
        return (
            (begin_step, 0),
            (move_controls, 0),
            (first, 0),
            (solver.stage, 0),
            (second, 1),
            (solver.stage, 1),
        )

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@cache
def rattle_parts(acting: Acting) -> tuple[Stage, Stage]:
    """The first half in two, for a solver that finds velocities before anything has moved: kick, and drift."""
    summed, drags, stiff_springs = acting.summed, acting.drags, acting.stiff_springs
    bodies, loaded, explosions = acting.bodies, acting.wrenches, acting.explosions
    accumulate = acting_forces(acting)

    @stage
    def rattle_kick(tape, s, skip, half):
        """The contacts of the position stage follow."""
        if explosions:
            tell_time(tape, s, splat(0.0))
        if summed:
            accumulate(tape, s)
        damp(tape, s)
        if drags:
            flow_drag(tape, s, False)
        if bodies:
            damp_bodies(tape, s)
            kick_bodies(tape, s, splat(0.5) * load(s, tape[H_DT]), loaded)
        kick(tape, s, splat(0.5) * load(s, tape[H_DT]))

    @stage
    def rattle_drift(tape, s, skip, half):
        """The second half follows."""
        if bodies:
            drift_bodies(tape, s, load(s, tape[H_DT]))
        drift(tape, s, load(s, tape[H_DT]))
        if stiff_springs:
            flow_stiff_springs(tape, s)

    return rattle_kick, rattle_drift


@cache
def rattle_halves(acting: Acting) -> tuple[Stage, Stage]:
    """Both halves for the forces of a scene: up to the drift, and from the new positions on."""
    summed, drags, stiff_springs = acting.summed, acting.drags, acting.stiff_springs
    bodies, loaded, surfaces = acting.bodies, acting.wrenches, acting.surfaces
    explosions = acting.explosions
    accumulate = acting_forces(acting)

    @stage
    def rattle_first_half(tape, s, skip, half):
        """The position stage follows."""
        dt = load(s, tape[H_DT])
        if explosions:
            tell_time(tape, s, splat(0.0))
        # Forces of place alone are those that the step before ended with.
        if summed and (surfaces or skip[tape[H_BLOCKS] + FRESH] != 0):
            accumulate(tape, s)
        damp(tape, s)
        if drags:
            flow_drag(tape, s, False)
        if bodies:
            damp_bodies(tape, s)
            kick_bodies(tape, s, splat(0.5) * dt, loaded)
            drift_bodies(tape, s, dt)
        kick(tape, s, splat(0.5) * dt)
        drift(tape, s, dt)
        if stiff_springs:
            flow_stiff_springs(tape, s)

    @stage
    def rattle_second_half(tape, s, skip, half):
        """The velocity stage follows."""
        if explosions:
            tell_time(tape, s, splat(1.0))
        if summed:
            accumulate(tape, s)
        kick(tape, s, splat(0.5) * load(s, tape[H_DT]))
        if bodies:
            kick_bodies(tape, s, splat(0.5) * load(s, tape[H_DT]), loaded)
            damp_bodies(tape, s)
            flag_nonfinite_bodies(tape, s)
        if drags:
            flow_drag(tape, s, True)
        damp(tape, s)

    return rattle_first_half, rattle_second_half
