"""Symplectic Euler: v += h a, then x += h v with the new velocity.

Order 1 in the positions. Conserves a nearby energy; a spring is stable while h w < 2. Damping and drag act
by their exact flow before the kick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import accumulate_forces
from ..forces.drag import flow_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..kernel import inner
from ..model.tape import SYMPLECTIC_EULER
from .base import Integrator
from .motion import damp, drift, kick


@dataclass(frozen=True)
class SymplecticEuler(Integrator):
    """Semi-implicit Euler (see the module)."""

    code: ClassVar[int] = SYMPLECTIC_EULER
    solver_stages: ClassVar[tuple[bool, ...]] = (True, False)

    def order(self) -> int:
        """First order."""
        return 1

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@inner
def symplectic_euler_step(tape, s, dt):
    """Damp, kick and drift; constraints follow."""
    accumulate_forces(tape, s)
    damp(tape, s)
    flow_drag(tape, s, False)
    kick(tape, s, dt)
    drift(tape, s, dt)
    flow_stiff_springs(tape, s)
