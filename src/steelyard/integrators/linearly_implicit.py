"""Linearly implicit Runge-Kutta method of two stages, ROS2: no iteration, one sparse factor per step.

For y = (x, v), y' = F(y), A its derivative, g = 1 - 1/sqrt(2):

    (1 - g h A) k1 = F(y),   (1 - g h A) k2 = F(y + h k1) - 2 k1,   y += h (3 k1 + k2)/2.

The positions are eliminated, which leaves S = M - g h D - (g h)^2 K on the velocities (``integrators.implicit``).

Order 2 whatever A is (a W-method): clipped stiffness and user-written forces, which have no derivative here, cost no
order. L-stable: an undamped spring is stable at every step and loses what the step cannot resolve, of its amplitude
(g h w)^4/2 a step where that is small. Stiff networks lose rounding of about (h w)^2 2e-16 in what moves softly.
Conserves linear momentum. Far from rest, springs that turn or buckle within a step may feed energy in, as no bound
holds for nonlinear forces. Stiff springs count as plain anchored ones. Refuses links, riders and contacts.

Source: Verwer, Spee, Blom & Hundsdorfer (1999), *A second-order Rosenbrock method applied to photochemical
dispersion problems*.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import sum_forces
from ..math.lanes import fma, load, splat, store
from ..math.vectors import load_vector, store_vector
from ..model.tape import (
    H_DT,
    H_MASS,
    H_PARTICLES,
    H_POSITION,
    H_REACH,
    H_UNKNOWNS,
    H_VELOCITY,
    H_WORK,
)
from ..solvers.base import Solver
from ..stage import stage
from .base import Integrator, Recipe
from .implicit import (
    UNKNOWN,
    add_stiffness_product,
    factorise_motion,
    load_force,
    solve_motion,
)


@dataclass(frozen=True)
class LinearlyImplicit(Integrator):
    """Second-order, L-stable, no iteration (see the module)."""

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float, ...]] = (0.0, 1.0)
    reach: ClassVar[float] = 1.0 - 1.0 / math.sqrt(2.0)
    work: ClassVar[int] = 6

    def recipe(self, solver: Solver | None) -> Recipe:
        """Two stages that share one factor."""
        first = (sum_forces, 0), (factorise_motion, 0), (ros2_first, 0)
        return (*first, (sum_forces, 1), (ros2_second, 1))

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Every spring is stable."""
        return math.inf


@stage
def ros2_first(tape, s, skip, part):
    """S k1 = f + r K v for the velocities' rates; the state becomes y + h k1.

    Work rows, three per particle: v1 - 2 k1 of the positions (0 where immovable), then k1 of the velocities.
    """
    dt = load(s, tape[H_DT])
    reach = load(s, tape[H_REACH])
    zero = splat(0.0)
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    for row in range(count):
        store(s, work + row, zero)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        x, y, z = load_force(tape, s, k)
        store_vector(s, tape[k + 2], x, y, z)
    add_stiffness_product(tape, s, tape[H_VELOCITY], reach)
    solve_motion(tape, s, skip)
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        for component in range(3):
            row = tape[k] + component
            rate = load(s, tape[k + 2] + component)
            v = load(s, tape[H_VELOCITY] + row)
            moving = fma(reach, rate, v)
            v = fma(dt, rate, v)
            x = tape[H_POSITION] + row
            store(s, x, fma(dt, moving, load(s, x)))
            store(s, tape[H_VELOCITY] + row, v)
            store(s, work + row, v - (moving + moving))
            store(s, work + count + row, rate)


@stage
def ros2_second(tape, s, skip, part):
    """S k2 = f - 2 M k1 + r K (v - 2 k1); then the other half of the step."""
    half = splat(0.5) * load(s, tape[H_DT])
    reach = load(s, tape[H_REACH])
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        twice = splat(-2.0) * load(s, tape[H_MASS] + tape[k + 1])
        x, y, z = load_force(tape, s, k)
        ax, ay, az = load_vector(s, work + count + tape[k])
        store_vector(s, tape[k + 2], fma(twice, ax, x), fma(twice, ay, y), fma(twice, az, z))
    add_stiffness_product(tape, s, work, reach)
    solve_motion(tape, s, skip)
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        for component in range(3):
            row = tape[k] + component
            rate = load(s, tape[k + 2] + component)
            v = load(s, tape[H_VELOCITY] + row)
            rest = load(s, work + row)
            # k1 + k2 of the positions, with k1 = (v - rest)/2 and k2 = rest + r rate.
            moving = fma(splat(0.5), v + rest, reach * rate)
            x = tape[H_POSITION] + row
            store(s, x, fma(half, moving, load(s, x)))
            store(s, tape[H_VELOCITY] + row, fma(half, load(s, work + count + row) + rate, v))
