"""The rotation of a rigid cluster over a step: Newton's method on the moment's equation of ``clusters``."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import any_lane, fma, load, select, splat, sqrt, store
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
def turn_root(x, y, z):
    """q0 of a unit quaternion."""
    least = splat(1e-3)
    root = splat(1.0) - dot(x, y, z, x, y, z)
    return sqrt(select(root > least, root, least))


@inner
def turn(tape, s, at, hx, hy, hz, worlds):
    """Find the quaternion that solves the moment's equation, from the one at hand; it stays in the work rows.

    At first that is of no turn, where the equation's derivative is the inertia.
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
    root = turn_root(x, y, z)
    moving = worlds
    for _ in range(_ITERATIONS):
        u, v, w = symmetric_product(s, row, x, y, z)
        gx, gy, gz = cross(x, y, z, u, v, w)
        ex = hx - fma(root, u, gx)
        ey = hy - fma(root, v, gy)
        ez = hz - fma(root, w, gz)
        # Derivative of the particles' part: q0 J - (J q) q^T / q0 + [q] J - [J q], column by column.
        share = -one / root
        sx = share * x
        sy = share * y
        sz = share * z
        ax, ay, az = cross(x, y, z, j00, j10, j20)
        ax = fma(u, sx, fma(root, j00, ax))
        ay = fma(v, sx, fma(root, j10, ay)) - w
        az = fma(w, sx, fma(root, j20, az)) + v
        bx, by, bz = cross(x, y, z, j10, j11, j21)
        bx = fma(u, sy, fma(root, j10, bx)) + w
        by = fma(v, sy, fma(root, j11, by))
        bz = fma(w, sy, fma(root, j21, bz)) - u
        cx, cy, cz = cross(x, y, z, j20, j21, j22)
        cx = fma(u, sz, fma(root, j20, cx)) - v
        cy = fma(v, sz, fma(root, j21, cy)) + u
        cz = fma(w, sz, fma(root, j22, cz))
        rider = cluster_loads(tape, at)
        for _ in range(tape[at + 1]):
            # Of a load's: (R - 1) r = 2 (q0 q x r + q x (q x r)), between r0 and the change of q.
            px, py, pz = load_vector(s, tape[rider + 3] + BEFORE)
            rx, ry, rz = load_vector(s, tape[rider + 3] + AFTER)
            tx, ty, tz = cross(x, y, z, rx, ry, rz)
            ox, oy, oz = cross(x, y, z, tx, ty, tz)
            ox, oy, oz = cross(px, py, pz, fma(root, tx, ox), fma(root, ty, oy), fma(root, tz, oz))
            ex = fma(-two, ox, ex)
            ey = fma(-two, oy, ey)
            ez = fma(-two, oz, ez)
            # Columns of -t q^T/q0 - [q0 r + t] + (q.r) 1 - r q^T, and p x them.
            nx = fma(root, rx, tx)
            ny = fma(root, ry, ty)
            nz = fma(root, rz, tz)
            along = dot(x, y, z, rx, ry, rz)
            ox = fma(tx, sx, fma(-rx, x, along))
            oy = fma(ty, sx, fma(-ry, x, -nz))
            oz = fma(tz, sx, fma(-rz, x, ny))
            ox, oy, oz = cross(px, py, pz, ox, oy, oz)
            ax = fma(two, ox, ax)
            ay = fma(two, oy, ay)
            az = fma(two, oz, az)
            ox = fma(tx, sy, fma(-rx, y, nz))
            oy = fma(ty, sy, fma(-ry, y, along))
            oz = fma(tz, sy, fma(-rz, y, -nx))
            ox, oy, oz = cross(px, py, pz, ox, oy, oz)
            bx = fma(two, ox, bx)
            by = fma(two, oy, by)
            bz = fma(two, oz, bz)
            ox = fma(tx, sz, fma(-rx, z, -ny))
            oy = fma(ty, sz, fma(-ry, z, nx))
            oz = fma(tz, sz, fma(-rz, z, along))
            ox, oy, oz = cross(px, py, pz, ox, oy, oz)
            cx = fma(two, ox, cx)
            cy = fma(two, oy, cy)
            cz = fma(two, oz, cz)
            rider += LOAD_HEAD + tape[rider + 4]
        ox, oy, oz = solve(ax, ay, az, bx, by, bz, cx, cy, cz, ex, ey, ez)
        x = x + select(moving, ox, zero)
        y = y + select(moving, oy, zero)
        z = z + select(moving, oz, zero)
        root = turn_root(x, y, z)
        moving = moving & (dot(ox, oy, oz, ox, oy, oz) > allowed)
        if not any_lane(moving):
            break
    store_vector(s, work + TURN, x, y, z)
    flag = tape[H_UNSETTLED]
    store(s, flag, select(moving, one, load(s, flag)))
