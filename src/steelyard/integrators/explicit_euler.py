"""Explicit Euler in the source's order: x += h v, then v += h a, then v *= d^h.

Order 1. Conserves nothing: an undamped spring gains energy at every step, |amplification|^2 = 1 + (h w)^2;
with damping d per second it is stable only where (h w)^2 < d^(-h) - 1. Here for comparison with the source
(Millington, *Game Physics Engine Development*, Particle::integrate).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import accumulate_forces, tell_time
from ..forces.drag import add_drag
from ..forces.stiff_spring import flow_stiff_springs
from ..kernel import inner
from ..math.lanes import load, splat, store
from ..math.pointers import axes
from ..model.tape import (
    H_ACCELERATION,
    H_DRIFT,
    H_DT,
    H_FORCE,
    H_FORCED,
    H_INVERSE_MASS,
    H_NOW,
    H_POSITION,
    H_VELOCITY,
)
from ..solvers.base import Solver
from ..stage import stage
from .base import Acting, Integrator, Recipe
from .motion import damp


@dataclass(frozen=True)
class ExplicitEuler(Integrator):
    """The source's integrator (see the module)."""

    sums_drag: ClassVar[bool] = True
    tells_time: ClassVar[bool] = True
    solver_stages: ClassVar[tuple[bool, ...]] = (False,)

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Integrate; contacts are resolved afterwards."""
        own = (explicit_euler_step, 0)
        return (own,) if solver is None else (own, (solver.stage, 0))

    def order(self) -> int:
        """First order."""
        return 1

    def stable_limit(self) -> float:
        """No undamped spring is stable."""
        return 0.0


@inner
def _integrate(tape, s, dt):
    """x += h v, then v += h a, each product rounded as in the source: its resolver breaks ties by the last bit."""
    at = tape[H_DRIFT]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            x = tape[H_POSITION] + row
            v = tape[H_VELOCITY] + row
            a = load(s, tape[H_ACCELERATION] + row)
            if tape[H_FORCED] != 0:
                a = a + load(s, tape[H_FORCE] + row) * inverse
            store(s, x, load(s, x) + load(s, v) * dt)
            store(s, v, load(s, v) + a * dt)


@stage
def explicit_euler_step(tape, s, skip, half):
    """Integrate; contacts are resolved afterwards."""
    if tape[H_NOW] >= 0:
        tell_time(tape, s, splat(0.0))
    accumulate_forces(tape, s)
    add_drag(tape, s)
    _integrate(tape, s, load(s, tape[H_DT]))
    damp(tape, s)
    flow_stiff_springs(tape, s)
