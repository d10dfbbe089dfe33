"""Symplectic Euler: v += h a, then x += h v with the new velocity.

Order 1 in the positions. Conserves a nearby energy; a spring is stable while h w < 2. Damping and drag act
by their exact flow before the kick. Bodies take their gyroscopic term implicitly, by one step of Newton's method (Catto
2015), and turn by the new angular velocity; this loses angular momentum and energy at first order, and is stable.
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
from ..model.tape import H_DT
from ..solvers.base import Solver
from ..solvers.stages import begin_step
from ..stage import Stage, stage
from .base import Acting, Integrator, Recipe
from .motion import damp, drift, kick
from .rotor import damp_bodies, flag_nonfinite_bodies, kick_bodies, turn_implicitly


@dataclass(frozen=True)
class SymplecticEuler(Integrator):
    """Semi-implicit Euler (see the module)."""

    solver_stages: ClassVar[tuple[bool, ...]] = (True, False)
    moves_bodies: ClassVar[bool] = True
    tells_time: ClassVar[bool] = True

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Damp, kick and drift, then the constraints."""
        own = symplectic_euler_step(acting)
        if solver is None:
            return ((own, 0),)
        if not solver.staged:
            return ((move_controls, 0), (own, 0), (solver.stage, 0))
        return (
            (begin_step, 0),
            (move_controls, 0),
            (own, 0),
            (solver.stage, 0),
            (solver.stage, 1),
        )

    def order(self) -> int:
        """First order."""
        return 1

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@cache
def symplectic_euler_step(acting: Acting) -> Stage:
    """Damp, kick and drift under the forces of a scene; constraints follow."""
    summed, drags, stiff_springs = acting.summed, acting.drags, acting.stiff_springs
    bodies, loaded, explosions = acting.bodies, acting.wrenches, acting.explosions
    accumulate = acting_forces(acting)

    @stage
    def symplectic_euler_step(tape, s, skip, half):
        dt = load(s, tape[H_DT])
        if explosions:
            tell_time(tape, s, splat(0.0))
        if summed:
            accumulate(tape, s)
        damp(tape, s)
        if drags:
            flow_drag(tape, s, False)
        if bodies:
            damp_bodies(tape, s)
            kick_bodies(tape, s, dt, loaded)
            turn_implicitly(tape, s, dt)
            flag_nonfinite_bodies(tape, s)
        kick(tape, s, dt)
        drift(tape, s, dt)
        if stiff_springs:
            flow_stiff_springs(tape, s)

    return symplectic_euler_step
