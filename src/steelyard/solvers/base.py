"""What every solver states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..stage import Stage


@dataclass(frozen=True)
class Solver:
    """Base of the solver settings."""

    #: Whether it finds displacements and velocities at constraint level (stages) or impulses afterwards.
    staged: ClassVar[bool] = True
    #: Whether it solves all constraints through one sparse matrix.
    sparse: ClassVar[bool] = False
    #: Whether shorter steps take away all that it errs by.
    exact: ClassVar[bool] = False
    #: Whether it holds springs and bungees as constraints that give way; else they are forces.
    compliant: ClassVar[bool] = False

    #: Whether it holds contacts of bodies and particles as solids, by velocities before the drift.
    rigid: ClassVar[bool] = False

    @property
    def closes_joints(self) -> bool:
        """Whether its position stage drifts bodies that are joined, to close joints where the step ends."""
        return False

    @property
    def for_bodies(self) -> Solver:
        """The same method where bodies touch or are joined; itself, if it has no other form there."""
        return self

    @property
    def start(self) -> Stage:
        """Of a rigid solver: what it notes before the first kick."""
        raise NotImplementedError

    @property
    def stage(self) -> Stage:
        """What puts positions (half 0) or velocities (half 1) on the constraints."""
        raise NotImplementedError
