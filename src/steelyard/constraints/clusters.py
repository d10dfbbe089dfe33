"""Rigid clusters: particles held by rods, and loads that ride on them, moved as one frame.

The same motion as RATTLE's on those rods and riders. What they can do is everything that leaves the sum of
impulses and its moment about the start's places at zero. So the position stage puts the frame where

    sum m (x1 - x) = 0,    sum m r0 x (x1 - x) = 0,    x1 = c1 + R r1,

for positions x moved by all other forces, with arms r about the centre of mass: r0 at the start, r1 at the end
but for the rotation R; they differ where a load moves over its deck. With R by a quaternion (q0, q) and the
inertia J of the particles held by rods, the moment is

    q0 J q + q x J q + sum over loads of m/2 r0 x (R - 1) r1 = L/2,    L = sum m r0 x (x - c1 - r1),

three equations (Moser & Veselov 1991; ``cluster_turn``). Impulses follow from displacements, not from
places, so that rounding takes no momentum; places have the exact shape, which therefore cannot drift. The
velocity stage gives all particles V + w x r, loads their motion over the deck besides.

Record: count n, loads k, rows of places (3n), masses (n), masses of loads (k), mass and its inverse, inertia (6), work;
three corners that carry the frame; n particles; per load: particle, row of minus the start's weights, rows of
weights, rates and work (arm, r0, r1, motion), count, then arms of its deck. Particles stand as 3p.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.vectors import (
    cross,
    dot,
    load_vector,
    store_vector,
    symmetric_inverse,
    symmetric_product,
    unit,
)
from ..model.tape import (
    AFTER,
    ARM,
    ARMS,
    BEFORE,
    CENTRE,
    CLUSTER_HEAD,
    H_CLUSTERS,
    H_IMPULSE,
    H_POSITION,
    H_START,
    INERTIA,
    INVERSE,
    LOAD_HEAD,
    MOTION,
    SHIFT,
    TURN,
)
from .cluster_turn import turn


@inner
def _axes(tape, s, at):
    """Axes of the frame: along the corners' first side, in their triangle, and normal to it."""
    position = tape[H_POSITION]
    ax, ay, az = load_vector(s, position + tape[at + 8])
    bx, by, bz = load_vector(s, position + tape[at + 9])
    cx, cy, cz = load_vector(s, position + tape[at + 10])
    ex, ey, ez = unit(bx - ax, by - ay, bz - az)
    nx, ny, nz = cross(ex, ey, ez, cx - ax, cy - ay, cz - az)
    nx, ny, nz = unit(nx, ny, nz)
    fx, fy, fz = cross(nx, ny, nz, ex, ey, ez)
    return ex, ey, ez, fx, fy, fz, nx, ny, nz


@inner
def _turn_inertia(s, row, out, ex, ey, ez, fx, fy, fz, nx, ny, nz):
    """out = R M R^T for a symmetric matrix in six rows and the columns e, f, n of R."""
    u, v, w = symmetric_product(s, row, ex, fx, nx)
    store(s, out, dot(ex, fx, nx, u, v, w))
    u, v, w = symmetric_product(s, row, ey, fy, ny)
    store(s, out + 1, dot(ex, fx, nx, u, v, w))
    store(s, out + 2, dot(ey, fy, ny, u, v, w))
    u, v, w = symmetric_product(s, row, ez, fz, nz)
    store(s, out + 3, dot(ex, fx, nx, u, v, w))
    store(s, out + 4, dot(ey, fy, ny, u, v, w))
    store(s, out + 5, dot(ez, fz, nz, u, v, w))


@inner
def _add_point(s, row, m, x, y, z):
    """Add the inertia of a mass at an arm to a matrix in six rows."""
    zero = splat(0.0)
    mx = m * x
    my = m * y
    mz = m * z
    store(s, row, fma(my, y, fma(mz, z, load(s, row))))
    store(s, row + 1, fma(zero - mx, y, load(s, row + 1)))
    store(s, row + 2, fma(mx, x, fma(mz, z, load(s, row + 2))))
    store(s, row + 3, fma(zero - mx, z, load(s, row + 3)))
    store(s, row + 4, fma(zero - my, z, load(s, row + 4)))
    store(s, row + 5, fma(mx, x, fma(my, y, load(s, row + 5))))


@inner
def _mean_arm(tape, s, rider, weights):
    """Mean of a deck's arms with given weights."""
    zero = splat(0.0)
    x = zero
    y = zero
    z = zero
    for k in range(tape[rider + 5]):
        weight = load(s, weights + k)
        ax, ay, az = load_vector(s, tape[rider + LOAD_HEAD + k])
        x = fma(weight, ax, x)
        y = fma(weight, ay, y)
        z = fma(weight, az, z)
    return x, y, z


@inner
def cluster_frames(tape, s):
    """Arms and inertia of every cluster at the current positions, with loads where the deck's coefficients say."""
    zero = splat(0.0)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        count = tape[at]
        work = tape[at + 7]
        ex, ey, ez, fx, fy, fz, nx, ny, nz = _axes(tape, s, at)
        for k in range(count):
            u, v, w = load_vector(s, tape[at + 2] + 3 * k)
            x = dot(ex, fx, nx, u, v, w)
            y = dot(ey, fy, ny, u, v, w)
            z = dot(ez, fz, nz, u, v, w)
            store_vector(s, work + ARMS + 3 * k, x, y, z)
        _turn_inertia(
            s, tape[at + 6], work + INERTIA, ex, ey, ez, fx, fy, fz, nx, ny, nz
        )  # fmt: skip
        for row in range(6):
            store(s, work + INVERSE + row, load(s, work + INERTIA + row))
        sx = zero
        sy = zero
        sz = zero
        rider = at + CLUSTER_HEAD + count
        for k in range(tape[at + 1]):
            m = load(s, tape[at + 4] + k)
            x, y, z = _mean_arm(tape, s, rider, tape[rider + 1])
            x = zero - x
            y = zero - y
            z = zero - z
            store_vector(s, tape[rider + 4] + ARM, x, y, z)
            _add_point(s, work + INVERSE, m, x, y, z)
            sx = fma(m, x, sx)
            sy = fma(m, y, sy)
            sz = fma(m, z, sz)
            rider += LOAD_HEAD + tape[rider + 5]
        if tape[at + 1] > 0:
            inverse = load(s, tape[at + 5] + 1)
            sx = sx * inverse
            sy = sy * inverse
            sz = sz * inverse
            _add_point(s, work + INVERSE, zero - load(s, tape[at + 5]), sx, sy, sz)
            for k in range(count):
                _move(s, work + ARMS + 3 * k, sx, sy, sz)
            rider = at + CLUSTER_HEAD + count
            for _ in range(tape[at + 1]):
                _move(s, tape[rider + 4] + ARM, sx, sy, sz)
                rider += LOAD_HEAD + tape[rider + 5]
        store_vector(s, work + SHIFT, sx, sy, sz)
        symmetric_inverse(s, work + INVERSE, work + INVERSE)
        x, y, z = _mean(tape, s, at, tape[H_POSITION], -1)
        store_vector(s, work + CENTRE, x, y, z)
        store_vector(s, work + TURN, zero, zero, zero)
        at = rider


@inner
def _move(s, row, x, y, z):
    """Subtract a vector from three rows."""
    ax, ay, az = load_vector(s, row)
    store_vector(s, row, ax - x, ay - y, az - z)


@inner
def _place_loads(tape, s, at):
    """r0 and r1 of every load for the present weights; the shift between the arms of all others."""
    work = tape[at + 7]
    x0, y0, z0 = load_vector(s, work + SHIFT)
    inverse = load(s, tape[at + 5] + 1)
    dx = x0
    dy = y0
    dz = z0
    rider = at + CLUSTER_HEAD + tape[at]
    for k in range(tape[at + 1]):
        own = tape[rider + 4]
        m = load(s, tape[at + 4] + k)
        x, y, z = load_vector(s, own + ARM)
        half = splat(0.5) * m
        store_vector(s, own + BEFORE, half * (x + x0), half * (y + y0), half * (z + z0))
        x, y, z = _mean_arm(tape, s, rider, tape[rider + 2])
        x = x + x0
        y = y + y0
        z = z + z0
        store_vector(s, own + AFTER, x, y, z)
        share = splat(0.0) - m * inverse
        dx = fma(share, x, dx)
        dy = fma(share, y, dy)
        dz = fma(share, z, dz)
        rider += LOAD_HEAD + tape[rider + 5]
    # Arms of loads: less the centre of mass at the end, which is the start's less the shift.
    rider = at + CLUSTER_HEAD + tape[at]
    for _ in range(tape[at + 1]):
        own = tape[rider + 4]
        _move(s, own + AFTER, x0 - dx, y0 - dy, z0 - dz)
        ax, ay, az = load_vector(s, own + AFTER)
        x, y, z = load_vector(s, own + ARM)
        store_vector(s, own + MOTION, ax - x - dx, ay - y - dy, az - z - dz)
        rider += LOAD_HEAD + tape[rider + 5]
    return dx, dy, dz


@inner
def _row(s, target, base, p):
    """A particle's rows of ``target``, less those of ``base`` if there are any."""
    x, y, z = load_vector(s, target + p)
    if base >= 0:
        a, b, c = load_vector(s, base + p)
        x = x - a
        y = y - b
        z = z - c
    return x, y, z


@inner
def _mean(tape, s, at, target, base):
    """Mean of the rows ``target`` less ``base`` weighted by mass."""
    zero = splat(0.0)
    x = zero
    y = zero
    z = zero
    for k in range(tape[at]):
        m = load(s, tape[at + 3] + k)
        a, b, c = _row(s, target, base, tape[at + CLUSTER_HEAD + k])
        x = fma(m, a, x)
        y = fma(m, b, y)
        z = fma(m, c, z)
    rider = at + CLUSTER_HEAD + tape[at]
    for k in range(tape[at + 1]):
        m = load(s, tape[at + 4] + k)
        a, b, c = _row(s, target, base, tape[rider])
        x = fma(m, a, x)
        y = fma(m, b, y)
        z = fma(m, c, z)
        rider += LOAD_HEAD + tape[rider + 5]
    inverse = load(s, tape[at + 5] + 1)
    return x * inverse, y * inverse, z * inverse


@inner
def _moment(tape, s, at, target, base, cx, cy, cz):
    """Sum of m r x (row less base - c - motion), the motion that of loads over the deck."""
    zero = splat(0.0)
    arms = tape[at + 7] + ARMS
    lx = zero
    ly = zero
    lz = zero
    for k in range(tape[at]):
        m = load(s, tape[at + 3] + k)
        rx, ry, rz = load_vector(s, arms + 3 * k)
        x, y, z = _row(s, target, base, tape[at + CLUSTER_HEAD + k])
        x, y, z = cross(rx, ry, rz, x - cx, y - cy, z - cz)
        lx = fma(m, x, lx)
        ly = fma(m, y, ly)
        lz = fma(m, z, lz)
    rider = at + CLUSTER_HEAD + tape[at]
    for k in range(tape[at + 1]):
        own = tape[rider + 4]
        m = load(s, tape[at + 4] + k)
        rx, ry, rz = load_vector(s, own + ARM)
        x, y, z = _row(s, target, base, tape[rider])
        ax, ay, az = load_vector(s, own + MOTION)
        x, y, z = cross(rx, ry, rz, x - cx - ax, y - cy - ay, z - cz - az)
        lx = fma(m, x, lx)
        ly = fma(m, y, ly)
        lz = fma(m, z, lz)
        rider += LOAD_HEAD + tape[rider + 5]
    return lx, ly, lz


@inner
def place_clusters(tape, s, target, worlds):
    """Position stage: put every cluster's particles, moved by all other forces, back in their frame.

    Their impulse rows become those of the whole motion, rods and riders included. Frames of other ``worlds``
    than those in the mask keep their rotation.
    """
    zero = splat(0.0)
    half = splat(0.5)
    two = splat(2.0)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        work = tape[at + 7]
        dx, dy, dz = _place_loads(tape, s, at)
        ux, uy, uz = _mean(tape, s, at, target, tape[H_START])
        ux = ux + dx
        uy = uy + dy
        uz = uz + dz
        lx, ly, lz = _moment(tape, s, at, target, tape[H_START], ux, uy, uz)
        x, y, z, root = turn(tape, s, at, half * lx, half * ly, half * lz, worlds)
        # R - 1 = 2 (q0 [q] + q q^T - q.q).
        square = zero - dot(x, y, z, x, y, z)
        d00 = two * fma(x, x, square)
        d11 = two * fma(y, y, square)
        d22 = two * fma(z, z, square)
        d01 = two * fma(x, y, zero - root * z)
        d10 = two * fma(x, y, root * z)
        d02 = two * fma(x, z, root * y)
        d20 = two * fma(x, z, zero - root * y)
        d12 = two * fma(y, z, zero - root * x)
        d21 = two * fma(y, z, root * x)
        cx, cy, cz = load_vector(s, work + CENTRE)
        rider = at + CLUSTER_HEAD + tape[at]
        for k in range(tape[at] + tape[at + 1]):
            if k < tape[at]:
                p = tape[at + CLUSTER_HEAD + k]
                m = load(s, tape[at + 3] + k)
                rx, ry, rz = load_vector(s, work + ARMS + 3 * k)
                mx = ux
                my = uy
                mz = uz
                ex = rx + dx
                ey = ry + dy
                ez = rz + dz
            else:
                p = tape[rider]
                m = load(s, tape[at + 4] + k - tape[at])
                own = tape[rider + 4]
                rx, ry, rz = load_vector(s, own + ARM)
                ex, ey, ez = load_vector(s, own + AFTER)
                mx, my, mz = load_vector(s, own + MOTION)
                mx = ux + mx
                my = uy + my
                mz = uz + mz
                rider += LOAD_HEAD + tape[rider + 5]
            mx = mx + dot(d00, d01, d02, ex, ey, ez)
            my = my + dot(d10, d11, d12, ex, ey, ez)
            mz = mz + dot(d20, d21, d22, ex, ey, ez)
            x, y, z = _row(s, target, tape[H_START], p)
            row = tape[H_IMPULSE] + p
            ox, oy, oz = load_vector(s, row)
            store_vector(s, row, fma(m, mx - x, ox), fma(m, my - y, oy), fma(m, mz - z, oz))
            store_vector(s, target + p, cx + (rx + mx), cy + (ry + my), cz + (rz + mz))
        at = rider


@inner
def move_clusters(tape, s, target):
    """Velocity stage: give every cluster's particles the velocities of one frame."""
    zero = splat(0.0)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        work = tape[at + 7]
        cx, cy, cz = _mean(tape, s, at, target, -1)
        inverse = load(s, tape[at + 5] + 1)
        rider = at + CLUSTER_HEAD + tape[at]
        for k in range(tape[at + 1]):
            share = zero - load(s, tape[at + 4] + k) * inverse
            x, y, z = _mean_arm(tape, s, rider, tape[rider + 3])
            store_vector(s, tape[rider + 4] + MOTION, x, y, z)
            cx = fma(share, x, cx)
            cy = fma(share, y, cy)
            cz = fma(share, z, cz)
            rider += LOAD_HEAD + tape[rider + 5]
        lx, ly, lz = _moment(tape, s, at, target, -1, cx, cy, cz)
        wx, wy, wz = symmetric_product(s, work + INVERSE, lx, ly, lz)
        for k in range(tape[at]):
            rx, ry, rz = load_vector(s, work + ARMS + 3 * k)
            vx, vy, vz = cross(wx, wy, wz, rx, ry, rz)
            store_vector(s, target + tape[at + CLUSTER_HEAD + k], cx + vx, cy + vy, cz + vz)
        rider = at + CLUSTER_HEAD + tape[at]
        for _ in range(tape[at + 1]):
            own = tape[rider + 4]
            rx, ry, rz = load_vector(s, own + ARM)
            vx, vy, vz = cross(wx, wy, wz, rx, ry, rz)
            x, y, z = load_vector(s, own + MOTION)
            store_vector(s, target + tape[rider], cx + vx + x, cy + vy + y, cz + vz + z)
            rider += LOAD_HEAD + tape[rider + 5]
        at = rider
