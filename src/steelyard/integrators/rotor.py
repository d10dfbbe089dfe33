"""Rigid bodies: kick, drift, damping, and the free rotor.

Without torque the angular momentum L stands still in space, and the orientation q follows from it alone. So L is what
the state holds: angular velocities in its place, rounded anew at each step, let it drift by 6e-14 in 600 steps.

    q' = q (0, w)/2,    w = I^-1 R(q)^T L    in the body's frame.

``turn_freely`` solves this over a step by its power series in time to order 10, from the series of L in that frame,
L' = L x w. Where |L| tr(I^-1) times the step exceeds 3/8 the step is halved until it does not, each world by itself:
what is left out is below rounding.

Source: Hairer, Lubich & Wanner, *Geometric Numerical Integration*, VII.5; Hairer, Norsett & Wanner, *Solving Ordinary
Differential Equations I*, I.8 (series).
"""

from __future__ import annotations

import math

import numpy as np

from ..kernel import inner
from ..math.lanes import absolute, any_lane, fma, load, select, splat, sqrt, store
from ..math.rotations import (
    in_frame,
    load_quaternion,
    load_turn,
    quaternion_product,
    rotate,
    rotate_back,
    store_unit_quaternion,
)
from ..math.vectors import (
    add_scaled,
    cross,
    dot,
    load_vector,
    solve,
    store_vector,
    symmetric_product,
)
from ..model.tape import (
    BODY,
    H_BODIES,
    H_BODIES_DAMPED,
    H_NONFINITE,
    H_ROTOR,
)

#: Order of the series at which what is left out is below rounding; and one that is near enough to see what overlaps.
ORDER, ROUGH_ORDER = 10, 4
#: Scratch rows of the series: L, w and q.
ROTOR_ROWS = 10 * (ORDER + 1)
_LONGEST = 0.375
_HALVINGS = 12


def parts_of(momentum: np.ndarray, inertia: np.ndarray, dt: float) -> int:
    """In how many parts a step of a free rotor is taken, from its angular momentum (3,) and inertia (3, 3)."""
    angle = abs(dt) * float(np.linalg.norm(momentum)) * float(np.trace(np.linalg.inv(inertia)))
    halvings = math.ceil(math.log2(max(angle / _LONGEST, 1.0)))
    return 1 << min(halvings, _HALVINGS)


@inner
def _series(s, rotor, inverse, order):
    """Coefficients of L, w and q up to the order, from the first ones."""
    zero = splat(0.0)
    for k in range(order):
        lx = zero
        ly = zero
        lz = zero
        qw = zero
        qx = zero
        qy = zero
        qz = zero
        # Sums of L x w and of q (0, w), a product and a sum in one.
        for i in range(k + 1):
            row = rotor + 10 * i
            wx, wy, wz = load_vector(s, rotor + 10 * (k - i) + 3)
            x, y, z = load_vector(s, row)
            lx = fma(y, wz, fma(-z, wy, lx))
            ly = fma(z, wx, fma(-x, wz, ly))
            lz = fma(x, wy, fma(-y, wx, lz))
            w, x, y, z = load_quaternion(s, row + 6)
            qw = qw - dot(x, y, z, wx, wy, wz)
            qx = fma(w, wx, fma(y, wz, fma(-z, wy, qx)))
            qy = fma(w, wy, fma(z, wx, fma(-x, wz, qy)))
            qz = fma(w, wz, fma(x, wy, fma(-y, wx, qz)))
        share = splat(1.0 / (k + 1))
        half = splat(0.5 / (k + 1))
        row = rotor + 10 * (k + 1)
        lx = share * lx
        ly = share * ly
        lz = share * lz
        store_vector(s, row, lx, ly, lz)
        store_vector(s, row + 3, *symmetric_product(s, inverse, lx, ly, lz))
        store(s, row + 6, half * qw)
        store_vector(s, row + 7, half * qx, half * qy, half * qz)


@inner
def _sum_series(s, rotor, time, order):
    """The quaternion at a time."""
    row = rotor + 10 * order + 6
    w, x, y, z = load_quaternion(s, row)
    for _ in range(order):
        row -= 10
        w = fma(w, time, load(s, row))
        x = fma(x, time, load(s, row + 1))
        y = fma(y, time, load(s, row + 2))
        z = fma(z, time, load(s, row + 3))
    return w, x, y, z


@inner
def turn_freely(s, rotor, turn, momentum, inverse, dt, order):
    """Orientation (rows ``turn``) after a time without torque, by a series of some order: ORDER is exact."""
    one = splat(1.0)
    lx, ly, lz = load_vector(s, momentum)
    trace = load(s, inverse) + load(s, inverse + 2) + load(s, inverse + 5)
    angle = absolute(dt) * trace * sqrt(dot(lx, ly, lz, lx, ly, lz))
    parts = one
    for _ in range(_HALVINGS):
        parts = select(angle > splat(_LONGEST) * parts, parts + parts, parts)
    part = dt / parts
    # What does not turn stays as it is, to the bit.
    parts = select(angle > splat(0.0), parts, splat(0.0))
    done = splat(0.0)
    for _ in range(1 << _HALVINGS):
        if not any_lane(done < parts):
            break
        f, w, x, y, z = load_turn(s, turn)
        mx, my, mz = rotate_back(f, w, x, y, z, lx, ly, lz)
        store_vector(s, rotor, mx, my, mz)
        store_vector(s, rotor + 3, *symmetric_product(s, inverse, mx, my, mz))
        store(s, rotor + 6, w)
        store_vector(s, rotor + 7, x, y, z)
        _series(s, rotor, inverse, order)
        store_unit_quaternion(s, turn, *_sum_series(s, rotor, part, order))
        # A world that is through stays as it is, to the bit, however long its neighbours take.
        for k in range(4):
            row = rotor + 6 + k
            store(s, turn + k, select(done < parts, load(s, turn + k), load(s, row)))
        done = done + one


@inner
def weight_torque(tape, s, body):
    """Torque m R d x a about the pivot of what accelerates the centre of mass, which lies at d."""
    f, w, x, y, z = load_turn(s, tape[body + 1])
    dx, dy, dz = rotate(f, w, x, y, z, *load_vector(s, tape[body + 12]))
    mass = load(s, tape[body + 11])
    ax, ay, az = load_vector(s, tape[body + 8])
    return cross(mass * dx, mass * dy, mass * dz, ax, ay, az)


@inner
def kick_bodies(tape, s, dt, loaded):
    """v += dt (a + F/m), L += dt torque; ``loaded``: whether there are forces beside the acceleration."""
    at = tape[H_BODIES]
    for index in range(tape[at]):
        body = at + 1 + BODY * index
        pivoted = tape[body + 12] >= 0
        if pivoted:
            add_scaled(s, tape[body + 3], dt, *weight_torque(tape, s, body))
        else:
            add_scaled(s, tape[body + 2], dt, *load_vector(s, tape[body + 8]))
        if loaded:
            wrench = tape[body + 4]
            add_scaled(s, tape[body + 3], dt, *load_vector(s, wrench + 3))
            if not pivoted:
                push = dt * load(s, tape[body + 5])
                add_scaled(s, tape[body + 2], push, *load_vector(s, wrench))


@inner
def drift_bodies(tape, s, dt):
    """x += dt v, and the rotation of a free rotor."""
    at = tape[H_BODIES]
    for index in range(tape[at]):
        body = at + 1 + BODY * index
        add_scaled(s, tape[body], dt, *load_vector(s, tape[body + 2]))
        turn_freely(s, tape[H_ROTOR], tape[body + 1], tape[body + 3], tape[body + 7], dt, ORDER)


@inner
def turn_implicitly(tape, s, dt):
    """Positions by the new velocities, and a turn of first order with the gyroscopic term implicit.

    In the body's frame I (w' - w) + h w' x I w' = 0, by one step of Newton's method from w' = w.
    """
    one = splat(1.0)
    zero = splat(0.0)
    half = splat(0.5) * dt
    at = tape[H_BODIES]
    for index in range(tape[at]):
        body = at + 1 + BODY * index
        add_scaled(s, tape[body], dt, *load_vector(s, tape[body + 2]))
        inertia = tape[body + 6]
        f, w, x, y, z = load_turn(s, tape[body + 1])
        la, lb, lc = rotate_back(f, w, x, y, z, *load_vector(s, tape[body + 3]))
        a, b, c = symmetric_product(s, tape[body + 7], la, lb, lc)
        ra, rb, rc = cross(a, b, c, la, lb, lc)
        # Columns of I + h (w x I - L x).
        ax, ay, az = _gyroscopic_column(s, inertia, dt, a, b, c, la, lb, lc, one, zero, zero)
        bx, by, bz = _gyroscopic_column(s, inertia, dt, a, b, c, la, lb, lc, zero, one, zero)
        cx, cy, cz = _gyroscopic_column(s, inertia, dt, a, b, c, la, lb, lc, zero, zero, one)
        da, db, dc = solve(ax, ay, az, bx, by, bz, cx, cy, cz, dt * ra, dt * rb, dt * rc)
        a = a - da
        b = b - db
        c = c - dc
        a, b, c = rotate(f, w, x, y, z, a, b, c)
        pw, px, py, pz = quaternion_product(zero, a, b, c, w, x, y, z)
        turn = tape[body + 1]
        w = fma(half, pw, w)
        x = fma(half, px, x)
        y = fma(half, py, y)
        z = fma(half, pz, z)
        store_unit_quaternion(s, turn, w, x, y, z)
        # What the new angular velocity means for the momentum, the new orientation says.
        f, w, x, y, z = load_turn(s, turn)
        store_vector(s, tape[body + 3], *in_frame(s, inertia, f, w, x, y, z, a, b, c))


@inner
def _gyroscopic_column(s, inertia, dt, a, b, c, la, lb, lc, x, y, z):
    """(I + h (w x I - L x)) times a vector: the derivative of I w' + h w' x I w'."""
    mx, my, mz = symmetric_product(s, inertia, x, y, z)
    px, py, pz = cross(a, b, c, mx, my, mz)
    qx, qy, qz = cross(x, y, z, la, lb, lc)
    return fma(dt, px + qx, mx), fma(dt, py + qy, my), fma(dt, pz + qz, mz)


@inner
def damp_bodies(tape, s):
    """v and L times the powers of damping that lie in the damping rows."""
    if tape[H_BODIES_DAMPED] != 0:
        at = tape[H_BODIES]
        for index in range(tape[at]):
            body = at + 1 + BODY * index
            for k in range(2):
                factor = load(s, tape[body + 9] + k)
                row = tape[body + 2 + k]
                for axis in range(3):
                    store(s, row + axis, factor * load(s, row + axis))


@inner
def flag_nonfinite_bodies(tape, s):
    """Set the flag of worlds in which a body is not finite."""
    zero = splat(0.0)
    sum_ = zero
    at = tape[H_BODIES]
    for index in range(tape[at]):
        body = at + 1 + BODY * index
        for part in range(4):
            for axis in range(3):
                sum_ = fma(load(s, tape[body + part] + axis), zero, sum_)
    flag = tape[H_NONFINITE]
    store(s, flag, select(sum_ <= zero, load(s, flag), splat(1.0)))
