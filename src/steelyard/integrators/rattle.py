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

from ..forces.accumulate import accumulate_forces
from ..forces.drag import flow_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..kernel import inner
from ..math.lanes import splat
from ..model.tape import RATTLE
from .base import Integrator
from .motion import damp, drift, kick


@dataclass(frozen=True)
class Rattle(Integrator):
    """Velocity Verlet, with constraints RATTLE (see the module)."""

    code: ClassVar[int] = RATTLE
    damping_share: ClassVar[float] = 0.5
    solver_stages: ClassVar[tuple[bool, ...]] = (True,)

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@inner
def rattle_first_half(tape, s, dt):
    """Up to the drift; the position stage follows."""
    accumulate_forces(tape, s)
    damp(tape, s)
    flow_drag(tape, s, False)
    kick(tape, s, splat(0.5) * dt)
    drift(tape, s, dt)
    flow_stiff_springs(tape, s)


@inner
def rattle_second_half(tape, s, dt):
    """From the new positions on; the velocity stage follows."""
    accumulate_forces(tape, s)
    kick(tape, s, splat(0.5) * dt)
    flow_drag(tape, s, True)
    damp(tape, s)
