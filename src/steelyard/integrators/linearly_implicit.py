"""Linearly implicit method of two stages: the L-stable diagonally implicit Runge-Kutta method of order 2, one pass of
Newton's method a stage.

With g = 1 - 1/sqrt(2) and F(y) the rates of y = (x, v):

    y1 = y + g h F(y1),   y2 = y + (1 - g) h F(y1) + g h F(y2),   y := y2.

Each stage is a leg of ``integrators.one_leg`` with S = M - g h D - (g h)^2 K, factorised where the stage is
expected: x + g h v, and x + h v1. That the matrix belongs to the place of the forces is what holds stiff springs
that turn by much in a step; with the matrix of the step's start alone (Rosenbrock methods) a cloth at 60 Hz blows
up.

Order 2. L-stable: an undamped spring is stable at every step and loses what the step cannot resolve, of its
amplitude (g h w)^4/2 a step where that is small. Conserves linear momentum; where stiff networks drift freely, to
rounding of about (h w)^2 2e-16. No bound holds for forces that are not linear: springs that turn by much within a
step may feed energy in. A cloth of 20 x 20 let fall for 1 s at 60 Hz holds with one pass to h w = 105 of its fastest
mode, with two to 330, with four to 1,050 (BackwardEuler: all). Stiff springs count as plain anchored ones. User-
written forces are taken where the stage is expected: order 2, or 1 in what depends on velocity. Refuses links,
riders and contacts.

Source: Alexander (1977), *Diagonally implicit Runge-Kutta methods for stiff ODEs*.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..model.tape import H_ACTIVE, H_DT, H_PARTICLES, H_POSITION, H_REACH, H_VELOCITY, H_WORK
from ..solvers.base import Solver
from ..stage import stage
from .base import Acting, Integrator, Recipe
from .one_leg import one_leg, one_leg_begin

_GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


@dataclass(frozen=True)
class LinearlyImplicit(Integrator):
    """Second order, L-stable (see the module).

    Args:
        passes: most passes of Newton's method in each stage; with more than one, a world that needs more is flagged in
            ``world.health``.
        tolerance: of the last pass's correction of positions, over the largest coordinate.
    """

    passes: int = 1
    tolerance: float = 1e-12

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = (None, _GAMMA, 1.0)
    reach: ClassVar[float] = _GAMMA
    work: ClassVar[int] = 6

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Two legs; the second begins where the first has led."""
        first, second = one_leg(self.passes, 1), one_leg(self.passes, 2)
        return ((one_leg_begin, 0), *first, (second_leg_begin, 1), *second)

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Every spring is stable."""
        return math.inf


@stage
def second_leg_begin(tape, s, skip, part):
    """Work rows := y + (1 - g) h F(y1), with F(y1) = (y1 - y)/(g h); the leg starts from the velocities of y1."""
    store(s, tape[H_ACTIVE], splat(1.0))
    reach = load(s, tape[H_REACH])
    ahead = load(s, tape[H_DT]) - reach
    grown = ahead / reach
    start = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            row = 3 * p + axis
            v = load(s, tape[H_VELOCITY] + row)
            u = load(s, start + count + row)
            x = fma(ahead, v, load(s, start + row))
            store(s, start + row, x)
            store(s, start + count + row, fma(grown, v - u, u))
            store(s, tape[H_POSITION] + row, fma(reach, v, x))
