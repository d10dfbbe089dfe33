"""Bodies by sweeps: what ``GaussSeidel`` and ``WorstFirst`` are where bodies touch or are joined."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.rigid_layout import N_SWEEPS, N_WORST
from ..stage import Stage
from .rigid_stages import RigidSolver
from .rigid_sweeps import sweep_island


@dataclass(frozen=True)
class SweptBodies(RigidSolver):
    """Projected Gauss-Seidel on velocities, warm started, then on the push that parts overlaps.

    Args:
        passes: sweeps per stage; with ``worst``, how often something is mended.
        worst: whether the worst contact, or row of a joint, is mended first, as the source engine does, instead of one
            after the other.
        per_row: whether that is as often for each contact and joint there is.
    """

    passes: int = 20
    worst: bool = False
    per_row: bool = True

    @property
    def island(self) -> Stage:
        """Sweeps."""
        return sweep_island

    @property
    def own_settings(self) -> dict[int, float]:
        """Sweeps, and their order."""
        return {N_SWEEPS: self.passes, N_WORST: self.worst * (2.0 if self.per_row else 1.0)}
