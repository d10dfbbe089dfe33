"""Implicit midpoint rule: the forces at the mean of both ends of the step (``integrators.one_leg`` with s = 1/2).

Order 2, symplectic, time-reversible. A-stable: an undamped spring is stable at every step and keeps its amplitude,
turning by 2 atan(h w/2) a step; so it conserves the energy of linear forces, and linear and angular momentum of all
springs, to the tolerance. Energy of other forces it keeps near, without drift, while the step resolves them. What it
does not resolve rings on undamped, and strong damping makes such a mode change sign at each step: use
LinearlyImplicit there. Nor does Newton's method converge where springs turn by much in a step (a cloth of 20 x 20 at
60 Hz); such worlds are flagged. Stiff springs count as plain anchored ones. Refuses links, riders and contacts, and
user-written forces, which its iteration cannot call.

Source: Hairer, Lubich & Wanner, *Geometric Numerical Integration*, II.1, IV.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..solvers.base import Solver
from .base import Acting, Integrator, Recipe
from .one_leg import one_leg_recipe


@dataclass(frozen=True)
class ImplicitMidpoint(Integrator):
    """Implicit midpoint rule by Newton's method (see the module).

    Args:
        passes: most passes; a world that needs more is flagged in ``world.health``.
        tolerance: of the last pass's correction of positions, over the largest coordinate.
    """

    passes: int = 30
    tolerance: float = 1e-12

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = ()
    reach: ClassVar[float] = 0.5
    work: ClassVar[int] = 6

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Newton's method for the state at mid-step, then on to the end."""
        return one_leg_recipe(self.passes)

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Every spring is stable."""
        return math.inf
