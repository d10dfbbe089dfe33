"""What every integrator states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..solvers.base import Solver
from ..stage import Stage

Recipe = tuple[tuple[Stage, int], ...]


@dataclass(frozen=True)
class Integrator:
    """Base of the integrator settings."""

    #: Share of the step over which damping and drag act at a time.
    damping_share: ClassVar[float] = 1.0
    #: Whether drag is a force like all others, and not a flow of its own.
    sums_drag: ClassVar[bool] = False
    #: Whether it needs closed forms of damping instead of powers.
    flies: ClassVar[bool] = False
    #: Whether it works with a solver of displacements and velocities (True), of impulses (False).
    solver_stages: ClassVar[tuple[bool, ...]] = ()

    def recipe(self, solver: Solver | None) -> Recipe:
        """Stages of a step in order, each with its half: 0, or 1 for what follows the new positions.

        Args:
            solver: what holds the constraints; None where there are none.
        """
        raise NotImplementedError

    def order(self) -> int:
        """Order of convergence on smooth motion."""
        raise NotImplementedError

    def stable_limit(self) -> float:
        """Largest stable dt times angular frequency of an undamped spring; 0 if none, inf if all."""
        raise NotImplementedError
