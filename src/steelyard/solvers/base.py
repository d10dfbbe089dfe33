"""What every solver states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Solver:
    """Base of the solver settings."""

    #: Whether it finds displacements and velocities at constraint level (stages) or impulses afterwards.
    staged: ClassVar[bool] = True
    #: Code on the tape.
    code: ClassVar[int] = 0

    def refusals(self, things: list[object]) -> list[str]:
        """Reasons, in words, why this solver cannot take a scene of these things."""
        return []
