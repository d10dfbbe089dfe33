"""Soft step: many short steps, a sweep each, with contacts as damped springs.

A step is divided into ``substeps``. In each, one sweep with overlaps and open joints as springs of so many hertz, the
drift, and one sweep without them, which takes the velocity out that these gave ("relax"). Cheap, and never stiffer than
its springs: tall stacks sag, and heavy on light gives way.

Source: Catto (2024), *Solver2D*; Macklin et al. (2019), *Small Steps in Physics Simulation*.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..model.rigid_layout import N_HERTZ, N_RATIO, N_SWEEPS
from ..scene import checks
from ..stage import Stage
from .rigid_stages import RigidSolver
from .rigid_sweeps import sweep_island


@dataclass(frozen=True)
class SoftStep(RigidSolver):
    """Bodies by soft contacts in substeps (see the module).

    Args:
        substeps: parts of a step, at least 1.
        hertz: frequency of the contacts' springs [1/s]; a quarter of the substeps' rate at most is sensible.
        ratio: damping over the critical one.
        slop, broad_phase, contacts, rest_speed, rest_time: see ``BodySettings``.
    """

    substeps: int = 4
    hertz: float = 30.0
    ratio: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        above = checks.Limit(above=0.0, remedy="Use 30 hertz and a ratio of 10.")
        checks.number("SoftStep", "hertz", self.hertz, above)
        checks.number("SoftStep", "ratio", self.ratio, above)

    @property
    def island(self) -> Stage:
        """Sweeps."""
        return sweep_island

    @property
    def own_settings(self) -> dict[int, float]:
        """One sweep, and the springs."""
        return {N_SWEEPS: 1.0, N_HERTZ: self.hertz, N_RATIO: self.ratio}
