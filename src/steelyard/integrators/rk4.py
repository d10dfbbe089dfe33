"""The classical Runge-Kutta method on positions and velocities.

With y = (x, v), f(y) = (v, a(x, v)) and the step h:

    k1 = f(y),  k2 = f(y + h k1/2),  k3 = f(y + h k2/2),  k4 = f(y + h k3),  y += h (k1 + 2 k2 + 2 k3 + k4)/6.

Order 4. An undamped spring is stable while h w < 2 sqrt 2, and loses (h w)^6/72 of its energy at each step below
that; pure damping is stable while its rate times h is below 2.785. Conserves linear momentum; energy and angular
momentum to its order. Stiff springs count as plain anchored ones, under the same limits. Across the kink of a bungee
or of a float the order drops. Refuses links, riders and contacts.

Source: Kutta (1901); Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, II.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import sum_forces
from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..model.tape import (
    H_ACCELERATION,
    H_DAMPED,
    H_DAMPING,
    H_DT,
    H_FORCE,
    H_FORCED,
    H_INVERSE_MASS,
    H_PARTICLES,
    H_POSITION,
    H_VELOCITY,
    H_WORK,
)
from ..solvers.base import Solver
from ..stage import stage
from .base import Acting, Integrator, Recipe


@dataclass(frozen=True)
class RungeKutta4(Integrator):
    """Classical Runge-Kutta method (see the module)."""

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0, 0.5, 0.5, 1.0)
    work: ClassVar[int] = 12

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Four evaluations, each with its part of the sum."""
        return tuple((each, part) for part in range(4) for each in (sum_forces, rk4_part))

    def order(self) -> int:
        """Fourth order."""
        return 4

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2 sqrt 2."""
        return 2.0 * math.sqrt(2.0)


@stage
def rk4_part(tape, s, skip, part):
    """Add the rates at this state to the sums and go on to the state of the next part.

    Work rows: positions and velocities at the step's start, then the sums of their rates.
    """
    dt = load(s, tape[H_DT])
    weight = splat(1.0 if part == 0 or part == 3 else 2.0)
    reach = dt * splat(1.0 / 6.0 if part == 3 else 1.0 if part == 2 else 0.5)
    count = 3 * tape[H_PARTICLES]
    start = tape[H_WORK]
    total = start + 2 * count
    for p in range(tape[H_PARTICLES]):
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            x = load(s, tape[H_POSITION] + row)
            v = load(s, tape[H_VELOCITY] + row)
            a = load(s, tape[H_ACCELERATION] + row)
            if tape[H_FORCED] != 0:
                a = fma(inverse, load(s, tape[H_FORCE] + row), a)
            if tape[H_DAMPED] != 0:
                a = fma(splat(0.0) - load(s, tape[H_DAMPING] + p), v, a)
            rate_x = v
            rate_v = a
            if part == 0:
                store(s, start + row, x)
                store(s, start + count + row, v)
                store(s, total + row, v)
                store(s, total + count + row, a)
            else:
                sum_x = fma(weight, v, load(s, total + row))
                sum_v = fma(weight, a, load(s, total + count + row))
                store(s, total + row, sum_x)
                store(s, total + count + row, sum_v)
                if part == 3:
                    rate_x = sum_x
                    rate_v = sum_v
            store(s, tape[H_POSITION] + row, fma(reach, rate_x, load(s, start + row)))
            store(s, tape[H_VELOCITY] + row, fma(reach, rate_v, load(s, start + count + row)))
