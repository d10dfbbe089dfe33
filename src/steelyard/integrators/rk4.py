"""The classical Runge-Kutta method on positions and velocities.

With y = (x, v), f(y) = (v, a(x, v)) and the step h:

    k1 = f(y),  k2 = f(y + h k1/2),  k3 = f(y + h k2/2),  k4 = f(y + h k3),  y += h (k1 + 2 k2 + 2 k3 + k4)/6.

Bodies turn by the method of Munthe-Kaas on the same stages (``rk4_bodies_part``).

Order 4. An undamped spring is stable while h w < 2 sqrt 2, and loses (h w)^6/72 of its energy at each step below
that; pure damping is stable while its rate times h is below 2.785. Conserves linear momentum; energy and angular
momentum to its order. Stiff springs count as plain anchored ones, under the same limits. Across the kink of a bungee
or of a float the order drops. Refuses links, riders and contacts.

Source: Kutta (1901); Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, II.1; Munthe-Kaas (1998).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..forces.accumulate import gather_bodies, load_bodies, sum_forces, tell_rk4_time
from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..math.rotations import (
    in_frame,
    load_quaternion,
    load_turn,
    store_unit_quaternion,
    turned_by,
)
from ..math.vectors import cross, load_vector, store_vector
from ..model.tape import (
    BODY,
    H_ACCELERATION,
    H_BODIES,
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
from ..stage import Stage, stage
from .base import Acting, Integrator, Recipe
from .rotor import flag_nonfinite_bodies, weight_torque

# Rows between the state at the step's start and the sums: a multiple of 64 rows (4 KiB) apart, a load from one waits
# for the store to the other, and a step of 64 particles takes up to a quarter longer.
_APART = 9


@dataclass(frozen=True)
class RungeKutta4(Integrator):
    """Classical Runge-Kutta method (see the module)."""

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = (0.0, 0.5, 0.5, 1.0)
    work: ClassVar[int] = 12
    spare_work: ClassVar[int] = _APART
    body_work: ClassVar[int] = 31
    moves_bodies: ClassVar[bool] = True
    tells_time: ClassVar[bool] = True

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Four evaluations, each with its part of the sum."""
        around: tuple[Stage, ...] = (sum_forces,)
        if acting.wrenches:
            around = (load_bodies, sum_forces, gather_bodies)
        if acting.explosions:
            around = (tell_rk4_time, *around)
        steps = (rk4_part, rk4_bodies_part) if acting.bodies else (rk4_part,)
        return tuple((each, part) for part in range(4) for each in (*around, *steps))

    def order(self) -> int:
        """Fourth order."""
        return 4

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2 sqrt 2."""
        return 2.0 * math.sqrt(2.0)


@inner
def _advance_row(s, part, weight, reach, row, start, total, rate):
    """One number of the state, from its rate at the state at hand; ``start`` and ``total`` are its work rows."""
    if part == 0:
        store(s, start, load(s, row))
        store(s, total, rate)
    else:
        sum_ = fma(weight, rate, load(s, total))
        store(s, total, sum_)
        if part == 3:
            rate = sum_
    store(s, row, fma(reach, rate, load(s, start)))


@inner
def _advance_vector(s, part, weight, reach, row, start, total, x, y, z):
    _advance_row(s, part, weight, reach, row, start, total, x)
    _advance_row(s, part, weight, reach, row + 1, start + 1, total + 1, y)
    _advance_row(s, part, weight, reach, row + 2, start + 2, total + 2, z)


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
    total = start + 2 * count + _APART
    for p in range(tape[H_PARTICLES]):
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            v = load(s, tape[H_VELOCITY] + row)
            a = load(s, tape[H_ACCELERATION] + row)
            if tape[H_FORCED] != 0:
                a = fma(inverse, load(s, tape[H_FORCE] + row), a)
            if tape[H_DAMPED] != 0:
                a = fma(-load(s, tape[H_DAMPING] + p), v, a)
            place = tape[H_POSITION] + row
            _advance_row(s, part, weight, reach, place, start + row, total + row, v)
            place = tape[H_VELOCITY] + row
            row += count
            _advance_row(s, part, weight, reach, place, start + row, total + row, a)


@stage
def rk4_bodies_part(tape, s, skip, part):
    """The same for bodies: x' = v, v' = a + F/m - c v, L' = torque - c L, and the orientation by Munthe-Kaas.

    q = exp(u/2) q0 with the rotation vector u from the step's start, u' = w - u x w/2 + u x (u x w)/12: spin that
    stands still in space is exact.

    Work rows: x, v, L and q at the step's start; the sums of the rates of x, v, L and u; u and 0.
    """
    dt = load(s, tape[H_DT])
    zero = splat(0.0)
    weight = splat(1.0 if part == 0 or part == 3 else 2.0)
    reach = dt * splat(1.0 / 6.0 if part == 3 else 1.0 if part == 2 else 0.5)
    at = tape[H_BODIES]
    for index in range(tape[at]):
        body = at + 1 + BODY * index
        start = tape[body + 10]
        total = start + 13
        turn = tape[body + 1]
        f, w, x, y, z = load_turn(s, turn)
        vx, vy, vz = load_vector(s, tape[body + 2])
        lx, ly, lz = load_vector(s, tape[body + 3])
        ox, oy, oz = in_frame(s, tape[body + 7], f, w, x, y, z, lx, ly, lz)
        wrench = tape[body + 4]
        push = load(s, tape[body + 5])
        brake = -load(s, tape[body + 9])
        fx, fy, fz = load_vector(s, wrench)
        ax, ay, az = load_vector(s, tape[body + 8])
        ax = fma(brake, vx, fma(push, fx, ax))
        ay = fma(brake, vy, fma(push, fy, ay))
        az = fma(brake, vz, fma(push, fz, az))
        brake = -load(s, tape[body + 9] + 1)
        rx, ry, rz = load_vector(s, wrench + 3)
        if tape[body + 12] >= 0:
            gx, gy, gz = weight_torque(tape, s, body)
            rx = rx + gx
            ry = ry + gy
            rz = rz + gz
            ax = zero
            ay = zero
            az = zero
        rx = fma(brake, lx, rx)
        ry = fma(brake, ly, ry)
        rz = fma(brake, lz, rz)
        _advance_vector(s, part, weight, reach, tape[body], start, total, vx, vy, vz)
        _advance_vector(s, part, weight, reach, tape[body + 2], start + 3, total + 3, ax, ay, az)
        _advance_vector(s, part, weight, reach, tape[body + 3], start + 6, total + 6, rx, ry, rz)
        turned = start + 25
        if part == 0:
            for k in range(4):
                store(s, start + 9 + k, load(s, turn + k))
            store_vector(s, turned, zero, zero, zero)
        ux, uy, uz = load_vector(s, turned)
        cx, cy, cz = cross(ux, uy, uz, ox, oy, oz)
        dx, dy, dz = cross(ux, uy, uz, cx, cy, cz)
        ox = fma(splat(1.0 / 12.0), dx, fma(splat(-0.5), cx, ox))
        oy = fma(splat(1.0 / 12.0), dy, fma(splat(-0.5), cy, oy))
        oz = fma(splat(1.0 / 12.0), dz, fma(splat(-0.5), cz, oz))
        _advance_vector(s, part, weight, reach, turned, turned + 3, total + 9, ox, oy, oz)
        before = load_quaternion(s, start + 9)
        after = turned_by(*load_vector(s, turned), *before)
        store_unit_quaternion(s, turn, *after)
    if part == 3:
        flag_nonfinite_bodies(tape, s)
