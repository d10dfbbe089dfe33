"""Exponential Runge-Kutta method ETDRK4: what is linear in one particle by its exact flow, all else by four stages.

For a particle the linear part is y'' = -w^2 y - c y', with y = x - centre: w^2 the stiffness over the mass of its
anchored springs and stiff springs, the centre the mean of their anchors, c the rate of its damping, linear drags and
stiff springs. With u = (y, y'), L its matrix, N all other acceleration, e_t = exp(t L) and f_k = phi_k(h L):

    a = e_h/2 u + h/2 phi_1(h L/2) N(u)
    b = e_h/2 u + h/2 phi_1(h L/2) N(u) + h phi_2(h L/2) (N(a) - N(u))
    c = e_h u + h f_1 N(u) + 2 h f_2 (N(b) - N(u))
    u = e_h u + h (f_1 - 3 f_2 + 4 f_3) N(u) + h (2 f_2 - 4 f_3) (N(a) + N(b)) + h (4 f_3 - f_2) N(c)

Order 4. Exact for every step, stiffness and damping: anchored springs without rest length, stiff springs, damping,
linear drag in any wind, constant accelerations and forces, equilibria. Of an anchored spring with a rest length the
part k l0 n is in N. So are springs between particles, bungees, floats and quadratic drag, which are stable as by
RungeKutta4, h w < 2.8. Refuses links, riders and contacts.

Source: Krogstad (2005), *Generalized integrating factor methods for stiff PDEs*, after Cox & Matthews (2002).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import sum_forces
from ..kernel import inner
from ..math.lanes import fma, load, store
from ..math.pointers import axes
from ..model.tape import (
    H_ACCELERATION,
    H_FORCE,
    H_FORCED,
    H_INVERSE_MASS,
    H_PARTICLES,
    H_POSITION,
    H_PROPAGATORS,
    H_VELOCITY,
    H_WORK,
)
from ..solvers.base import Solver
from ..stage import stage
from .base import Acting, Integrator, Recipe

#: Rows of a particle's coefficients: exp(h L/2), exp(h L), then pairs (place, speed) of weights of N.
HALF, WHOLE, WEIGHTS = 0, 4, 8


@dataclass(frozen=True)
class ExponentialRungeKutta(Integrator):
    """Exponential Runge-Kutta method of order 4 (see the module)."""

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    linear: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0, 0.5, 0.5, 1.0)
    work: ClassVar[int] = 12

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Four evaluations of what is not linear."""
        return tuple((each, part) for part in range(4) for each in (sum_forces, exponential_part))

    def order(self) -> int:
        """Fourth order."""
        return 4

    def stable_limit(self) -> float:
        """Every anchored spring without rest length is exact."""
        return math.inf


@inner
def _flow(s, e, y, v):
    """Exponential times (y, v)."""
    return (
        fma(load(s, e), y, load(s, e + 1) * v),
        fma(load(s, e + 2), y, load(s, e + 3) * v),
    )


@inner
def _add(s, weights, index, n, y, v):
    """(y, v) += weight N."""
    row = weights + 2 * index
    return fma(load(s, row), n, y), fma(load(s, row + 1), n, v)


@stage
def exponential_part(tape, s, skip, part):
    """Take N at this state and go on to the state of the next part.

    Work rows, three per particle: y and y' at the step's start, N there, then the sum of N since.
    """
    count = 3 * tape[H_PARTICLES]
    start = tape[H_WORK]
    speed = start + count
    first = speed + count
    total = first + count
    at = tape[H_PROPAGATORS]
    for p in range(tape[at]):
        e = tape[at + 1 + 2 * p]
        centre = tape[at + 2 + 2 * p]
        weights = e + WEIGHTS
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            x = tape[H_POSITION] + row
            n = load(s, tape[H_ACCELERATION] + row)
            if tape[H_FORCED] != 0:
                n = fma(inverse, load(s, tape[H_FORCE] + row), n)
            c = load(s, centre + component)
            if part == 0:
                y = load(s, x) - c
                v = load(s, tape[H_VELOCITY] + row)
                store(s, start + row, y)
                store(s, speed + row, v)
                store(s, first + row, n)
                y, v = _flow(s, e + HALF, y, v)
                y, v = _add(s, weights, 0, n, y, v)
            else:
                y, v = _flow(
                    s,
                    e + HALF if part == 1 else e + WHOLE,
                    load(s, start + row),
                    load(s, speed + row),
                )
                begun = load(s, first + row)
                if part == 1:
                    store(s, total + row, n)
                    y, v = _add(s, weights, 1, begun, y, v)
                    y, v = _add(s, weights, 2, n, y, v)
                elif part == 2:
                    store(s, total + row, load(s, total + row) + n)
                    y, v = _add(s, weights, 3, begun, y, v)
                    y, v = _add(s, weights, 4, n, y, v)
                else:
                    y, v = _add(s, weights, 5, begun, y, v)
                    y, v = _add(s, weights, 6, load(s, total + row), y, v)
                    y, v = _add(s, weights, 7, n, y, v)
            store(s, x, y + c)
            store(s, tape[H_VELOCITY] + row, v)
