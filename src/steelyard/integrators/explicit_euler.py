"""Explicit Euler in the source's order: x += h v, then v += h a, then v *= d^h.

Order 1. Conserves nothing: an undamped spring gains energy at every step, |amplification|^2 = 1 + (h w)^2;
with damping d per second it is stable only where (h w)^2 < d^(-h) - 1. Here for comparison with the source
(Millington, *Game Physics Engine Development*, Particle::integrate).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import accumulate_forces
from ..forces.drag import add_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..kernel import kernel
from ..model.tape import EXPLICIT_EULER
from .base import Integrator
from .motion import damp, drift, kick


@dataclass(frozen=True)
class ExplicitEuler(Integrator):
    """The source's integrator (see the module)."""

    code: ClassVar[int] = EXPLICIT_EULER
    solver_stages: ClassVar[tuple[bool, ...]] = (False,)

    def order(self) -> int:
        """First order."""
        return 1

    def stable_limit(self) -> float:
        """No undamped spring is stable."""
        return 0.0


@kernel
def explicit_euler_step(tape, s, dt):
    """Integrate; contacts are resolved afterwards."""
    accumulate_forces(tape, s)
    add_drag(tape, s)
    drift(tape, s, dt)
    kick(tape, s, dt)
    damp(tape, s)
    flow_stiff_springs(tape, s)
