"""Implicit methods of one leg: the forces are taken at one state within the step, found by Newton's method.

    v_s = v + s h M^-1 f(x_s, v_s),   x_s = x + s h v_s,   then v += (v_s - v)/s,   x += h v_s.

s = 1 is backward Euler, s = 1/2 the implicit midpoint rule. A pass corrects v_s by S^-1 of what is left of the first
equation, S being the matrix of ``integrators.implicit`` with r = s h; it starts from the velocities of the step's
start. A world whose correction is below the tolerance is frozen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..forces.accumulate import sum_forces
from ..math.lanes import absolute, any_lane, fma, load, select, splat, store
from ..math.pointers import axes
from ..math.vectors import load_coordinates, store_coordinates
from ..model.tape import (
    H_ACTIVE,
    H_DT,
    H_MASS,
    H_PARTICLES,
    H_POSITION,
    H_REACH,
    H_TOLERANCE,
    H_UNKNOWNS,
    H_UNSETTLED,
    H_VELOCITY,
    H_WORK,
)
from ..stage import stage
from .implicit import UNKNOWN, factorise_motion, load_force, solve_motion

if TYPE_CHECKING:
    from .base import Recipe


def one_leg(passes: int, part: int) -> Recipe:
    """So many passes at most; with more than one, worlds that need more are flagged."""
    each = sum_forces, factorise_motion, one_leg_correct
    stages = passes * each if passes == 1 else (*(passes * each), flag_unsettled)
    return tuple((stage, part) for stage in stages)


def one_leg_recipe(passes: int) -> Recipe:
    """A step of one leg."""
    return ((one_leg_begin, 0), *one_leg(passes, 0), (one_leg_end, 0))


@stage
def one_leg_begin(tape, s, skip, part):
    """Keep the start in the work rows (positions, then velocities); x_s = x + s h v."""
    reach = load(s, tape[H_REACH])
    store(s, tape[H_ACTIVE], splat(1.0))
    start = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            row = 3 * p + axis
            x = load(s, tape[H_POSITION] + row)
            v = load(s, tape[H_VELOCITY] + row)
            store(s, start + row, x)
            store(s, start + count + row, v)
            store(s, tape[H_POSITION] + row, fma(reach, v, x))


@stage
def one_leg_correct(tape, s, skip, part):
    """One pass: v_s += S^-1 (s h f - M (v_s - v)), x_s = x + s h v_s."""
    active = load(s, tape[H_ACTIVE]) > splat(0.5)
    if any_lane(active):
        reach = load(s, tape[H_REACH])
        zero = splat(0.0)
        start = tape[H_WORK]
        before = start + 3 * tape[H_PARTICLES]
        at = tape[H_UNKNOWNS]
        for index in range(tape[at]):
            k = at + 1 + UNKNOWN * index
            mass = load(s, tape[H_MASS] + tape[k + 1])
            x, y, z = load_force(tape, s, k)
            vx, vy, vz = load_coordinates(s, tape[H_VELOCITY] + tape[k])
            ux, uy, uz = load_coordinates(s, before + tape[k])
            x = fma(mass, ux - vx, reach * x)
            y = fma(mass, uy - vy, reach * y)
            z = fma(mass, uz - vz, reach * z)
            store_coordinates(s, tape[k + 2], x, y, z)
        solve_motion(tape, s, skip)
        change = zero
        far = zero
        for index in range(tape[at]):
            k = at + 1 + UNKNOWN * index
            for component in range(axes(s)):
                row = tape[k] + component
                more = select(active, load(s, tape[k + 2] + component), zero)
                v = load(s, tape[H_VELOCITY] + row) + more
                u = load(s, start + row)
                x = fma(reach, v, u)
                store(s, tape[H_VELOCITY] + row, v)
                store(s, tape[H_POSITION] + row, x)
                more = absolute(reach * more)
                change = select(more > change, more, change)
                # A stiff spring's leg may lie near 0, where only the start says how far rounding reaches.
                x = absolute(x) + absolute(u)
                far = select(x > far, x, far)
        left = change > load(s, tape[H_TOLERANCE]) * far
        store(s, tape[H_ACTIVE], select(left, splat(1.0), zero))


@stage
def flag_unsettled(tape, s, skip, part):
    """Worlds whose last pass still corrected more than the tolerance."""
    late = load(s, tape[H_ACTIVE]) > splat(0.5)
    flag = tape[H_UNSETTLED]
    store(s, flag, select(late, splat(1.0), load(s, flag)))


@stage
def one_leg_end(tape, s, skip, part):
    """From the leg to the step's end."""
    dt = load(s, tape[H_DT])
    outwards = dt / load(s, tape[H_REACH])
    start = tape[H_WORK]
    before = start + 3 * tape[H_PARTICLES]
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            row = 3 * p + axis
            v = load(s, tape[H_VELOCITY] + row)
            u = load(s, before + row)
            store(s, tape[H_POSITION] + row, fma(dt, v, load(s, start + row)))
            store(s, tape[H_VELOCITY] + row, fma(outwards, v - u, u))
