"""What every integrator states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Integrator:
    """Base of the integrator settings."""

    #: Code on the tape.
    code: ClassVar[int] = 0
    #: Share of the step over which damping and drag act at a time.
    damping_share: ClassVar[float] = 1.0
    #: Whether it works with a solver of displacements and velocities (True), of impulses (False).
    solver_stages: ClassVar[tuple[bool, ...]] = ()

    def order(self) -> int:
        """Order of convergence on smooth motion."""
        raise NotImplementedError

    def stable_limit(self) -> float:
        """Largest stable dt times angular frequency of an undamped spring; 0 if none, inf if all."""
        raise NotImplementedError
