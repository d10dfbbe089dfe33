"""The rotation of a rigid cluster over a step: Newton's method on the moment's equation of ``clusters``."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import any_lane, fma, load, select, splat, store
from ..math.vectors import cross, dot, load_vector, solve, store_vector, symmetric_product
from ..model.tape import (
    AFTER,
    BEFORE,
    CLUSTER_HEAD,
    ENTRY,
    H_TOLERANCE,
    H_UNSETTLED,
    INERTIA,
    INVERSE,
    LOAD_HEAD,
    TURN,
)

_ITERATIONS = 12
# Newton's method squares the error: what a change leaves is about its square. It may be this share of the tolerance.
_SHARE = 1e-4


@inner
def cluster_loads(tape, at):
    """Where the records of a cluster's loads begin."""
    return at + CLUSTER_HEAD + ENTRY * (tape[at] + tape[at + 1])


@inner
def cluster_end(tape, at):
    """Where the record of the next cluster begins."""
    end = cluster_loads(tape, at)
    for _ in range(tape[at + 1]):
        end += LOAD_HEAD + tape[end + 4]
    return end


@inner
def turn(tape, s, at, hx, hy, hz, worlds):
    """Find the turn that solves the moment's equation, from the one at hand; it stays in the work rows.

    At first that is none, where the equation's derivative is the inertia.
    """
    zero = splat(0.0)
    one = splat(1.0)
    two = splat(2.0)
    allowed = fma(splat(_SHARE), load(s, tape[H_TOLERANCE]), splat(1e-20))
    work = tape[at + 7]
    row = work + INERTIA
    j00 = load(s, row)
    j10 = load(s, row + 1)
    j11 = load(s, row + 2)
    j20 = load(s, row + 3)
    j21 = load(s, row + 4)
    j22 = load(s, row + 5)
    x, y, z = load_vector(s, work + TURN)
    at_rest = worlds & (dot(x, y, z, x, y, z) <= zero)
    if any_lane(at_rest):
        u, v, w = symmetric_product(s, work + INVERSE, hx, hy, hz)
        x = select(at_rest, u, x)
        y = select(at_rest, v, y)
        z = select(at_rest, w, z)
    moving = worlds
    for _ in range(_ITERATIONS):
        u, v, w = symmetric_product(s, row, x, y, z)
        gx, gy, gz = cross(x, y, z, u, v, w)
        square = dot(x, y, z, x, y, z) + one
        ex = fma(square, hx, -u) - gx
        ey = fma(square, hy, -v) - gy
        ez = fma(square, hz, -w) - gz
        # Derivative of the particles' part: J + [g] J - [J g] - 2 h g^T, column by column.
        sx = -two * x
        sy = -two * y
        sz = -two * z
        ax, ay, az = cross(x, y, z, j00, j10, j20)
        ax = fma(hx, sx, j00 + ax)
        ay = fma(hy, sx, j10 + ay) - w
        az = fma(hz, sx, j20 + az) + v
        bx, by, bz = cross(x, y, z, j10, j11, j21)
        bx = fma(hx, sy, j10 + bx) + w
        by = fma(hy, sy, j11 + by)
        bz = fma(hz, sy, j21 + bz) - u
        cx, cy, cz = cross(x, y, z, j20, j21, j22)
        cx = fma(hx, sz, j20 + cx) - v
        cy = fma(hy, sz, j21 + cy) + u
        cz = fma(hz, sz, j22 + cz)
        rider = cluster_loads(tape, at)
        for _ in range(tape[at + 1]):
            # Of a load's: t + g x t with t = g x r1, between r0 and the change of g.
            px, py, pz = load_vector(s, tape[rider + 3] + BEFORE)
            rx, ry, rz = load_vector(s, tape[rider + 3] + AFTER)
            tx, ty, tz = cross(x, y, z, rx, ry, rz)
            ox, oy, oz = cross(x, y, z, tx, ty, tz)
            ox, oy, oz = cross(px, py, pz, tx + ox, ty + oy, tz + oz)
            ex = ex - ox
            ey = ey - oy
            ez = ez - oz
            # Columns of (g.r) 1 + g r^T - 2 r g^T - [r], and p x them.
            along = dot(x, y, z, rx, ry, rz)
            ox, oy, oz = cross(
                px, py, pz, fma(-rx, x, along), fma(ry, sx, fma(y, rx, -rz)), fma(rz, sx, fma(z, rx, ry))
            )  # fmt: skip
            ax = ax + ox
            ay = ay + oy
            az = az + oz
            ox, oy, oz = cross(
                px, py, pz, fma(rx, sy, fma(x, ry, rz)), fma(-ry, y, along), fma(rz, sy, fma(z, ry, -rx))
            )  # fmt: skip
            bx = bx + ox
            by = by + oy
            bz = bz + oz
            ox, oy, oz = cross(
                px, py, pz, fma(rx, sz, fma(x, rz, -ry)), fma(ry, sz, fma(y, rz, rx)), fma(-rz, z, along)
            )  # fmt: skip
            cx = cx + ox
            cy = cy + oy
            cz = cz + oz
            rider += LOAD_HEAD + tape[rider + 4]
        ox, oy, oz = solve(ax, ay, az, bx, by, bz, cx, cy, cz, ex, ey, ez)
        x = x + select(moving, ox, zero)
        y = y + select(moving, oy, zero)
        z = z + select(moving, oz, zero)
        moving = moving & (dot(ox, oy, oz, ox, oy, oz) > allowed)
        if not any_lane(moving):
            break
    store_vector(s, work + TURN, x, y, z)
    flag = tape[H_UNSETTLED]
    store(s, flag, select(moving, one, load(s, flag)))
