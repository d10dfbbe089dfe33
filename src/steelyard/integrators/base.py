"""What every integrator states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from ..solvers.base import Solver
from ..stage import Stage

Recipe = tuple[tuple[Stage, int], ...]


class Acting(NamedTuple):
    """Kinds of forces that a scene declares; stages are compiled for those alone."""

    springs: bool = False
    gravities: bool = False
    buoyancies: bool = False
    written: bool = False
    drags: bool = False
    stiff_springs: bool = False
    bodies: bool = False
    points: bool = False
    wrenches: bool = False
    applied: bool = False
    thrusts: bool = False
    surfaces: bool = False
    explosions: bool = False
    joints: bool = False

    @property
    def particles_forced(self) -> bool:
        """Whether any is a force whose rows are those of particles."""
        return self.springs or self.gravities or self.buoyancies or self.written or self.explosions

    @property
    def summed(self) -> bool:
        """Whether any is a force that is summed."""
        return self.particles_forced or self.wrenches


@dataclass(frozen=True)
class Integrator:
    """Base of the integrator settings."""

    #: Share of the step over which damping and drag act at a time.
    damping_share: ClassVar[float] = 1.0
    #: Whether drag is a force like all others, and not a flow of its own.
    sums_drag: ClassVar[bool] = False
    #: Whether it takes the acceleration as one function of place and speed: damping as a rate, drag and stiff springs
    #: as forces like all others.
    smooth: ClassVar[bool] = False
    #: Whether what is linear in one particle (anchored springs, damping, drag) is a flow of its own.
    linear: ClassVar[bool] = False
    #: Whether it needs closed forms of damping instead of powers.
    flies: ClassVar[bool] = False
    #: When user-written forces are evaluated, as a share of the step, before each part of it (None: not before that
    #: part); empty if they cannot be.
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0,)
    #: Share of the step by which implicit methods reach ahead: their matrix is M - r D - r^2 K with r = reach dt.
    reach: ClassVar[float] = 0.0
    #: Scratch rows that it works in, per particle, beside these, and per body.
    work: ClassVar[int] = 0
    spare_work: ClassVar[int] = 0
    body_work: ClassVar[int] = 0
    #: Whether it tells forces the time at which they are evaluated.
    tells_time: ClassVar[bool] = False
    #: Whether it moves rigid bodies, and turns them by the exact flow of a free rotor.
    moves_bodies: ClassVar[bool] = False
    turns_freely: ClassVar[bool] = False
    #: Whether it works with a solver of displacements and velocities (True), of impulses (False).
    solver_stages: ClassVar[tuple[bool, ...]] = ()

    #: Whether part of its step runs backwards in time.
    reverses: ClassVar[bool] = False
    #: Whether its step is divided where impacts are, or kinks of the forces.
    splits: ClassVar[bool] = False

    @property
    def divisions(self) -> int:
        """Most events that divide a step."""
        return 0

    @property
    def fractions(self) -> tuple[float, ...]:
        """Length of each substep over that of the step."""
        return (1.0,)

    #: Whether it holds links and riders in an iteration of its own, without a solver.
    holds_links: ClassVar[bool] = False

    def constants(self, dt: float) -> tuple[float, ...]:
        """Numbers that its stages find in rows of the scratch, given the step [s]."""
        return ()

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Stages of a step in order, each with its part: of most methods 0, or 1 for what follows the new positions.

        Args:
            solver: what holds the constraints; None where there are none.
            acting: what forces there are.
        """
        raise NotImplementedError

    def parts(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Stages of one of the parts into which events divide a step; none where they do not."""
        return ()

    def order(self) -> int:
        """Order of convergence on smooth motion."""
        raise NotImplementedError

    def stable_limit(self) -> float:
        """Largest stable dt times angular frequency of an undamped spring; 0 if none, inf if all."""
        raise NotImplementedError
