"""Backward Euler: v += h M^-1 f(x, v), x += h v, both at the step's end (``integrators.one_leg`` with s = 1).

Order 1. L-stable: an undamped spring keeps (1 + h^2 w^2)^(-1/2) of its amplitude at each step, so all that the step
does not resolve dies out; the energy of linear springs never rises. Conserves linear momentum, loses angular
momentum. One pass is the linearly implicit form (Baraff & Witkin 1998), of the same order and the same for linear
forces. Stiff springs count as plain anchored ones; user-written forces are taken at the step's start. Refuses links,
riders and contacts.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, IV.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..solvers.base import Solver
from .base import Acting, Integrator, Recipe
from .one_leg import one_leg_recipe


@dataclass(frozen=True)
class BackwardEuler(Integrator):
    """Backward Euler (see the module).

    Args:
        passes: most passes of Newton's method; with more than one, a world that needs more is flagged in
            ``world.health``.
        tolerance: of the last pass's correction of positions, over the largest coordinate.
    """

    passes: int = 1
    tolerance: float = 1e-12

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    reach: ClassVar[float] = 1.0
    work: ClassVar[int] = 6

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Newton's method for the state at the step's end."""
        return one_leg_recipe(self.passes)

    def order(self) -> int:
        """First order."""
        return 1

    def stable_limit(self) -> float:
        """Every spring is stable."""
        return math.inf
