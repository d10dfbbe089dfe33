"""Rigid clusters: particles held by rods, and loads that ride on them, moved as one frame.

The same motion as RATTLE's on those rods and riders. What they can do is everything that leaves the sum of
impulses and its moment about the start's places at zero. So the position stage puts the frame where

    sum m (x1 - x) = 0,    sum m r0 x (x1 - x) = 0,    x1 = c1 + R r1,

for positions x moved by all other forces, with arms r about the centre of mass: r0 at the start, r1 at the end
but for the rotation R; they differ where a load moves over its deck. With R by the vector g = tan(angle / 2) times its
axis, (R - 1) r = 2 (g x r + g x (g x r)) / (1 + g.g), and the inertia J of the particles held by rods, the moment is

    J g + g x J g + sum over loads of m r0 x (g x r1 + g x (g x r1)) = (1 + g.g) L/2,    L = sum m r0 x (x - c1 - r1),

three equations of second degree, without a root (Moser & Veselov 1991; ``cluster_turn``). Impulses follow from
displacements, not from places, so that rounding takes no momentum; places have the exact shape, which therefore
cannot drift. The velocity stage gives all particles V + w x r, loads their motion over the deck besides.

Forces are summed into the mean displacement and the moment once a stage. What a pass adds to them are the impulses of
contacts and links on the few particles that these touch; the others are placed when the stage ends.

Record: count n of particles, loads k, touched particles, rows of places (3n), masses of loads (k), mass and its
inverse, inertia (6), work; three corners that carry the frame, as 3p; per particle or load, touched ones first: 3p,
arm, mass, and the load's work or -1; per load: row of minus the start's weights, rows of weights, rates and work (arm,
r0, r1, motion), count, then arms of its deck.
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
    BASE,
    BEFORE,
    CENTRE,
    CLUSTER_HEAD,
    DELTA,
    ENTRY,
    H_CLUSTERS,
    H_FREE,
    H_IMPULSE,
    H_POSITION,
    H_START,
    H_VELOCITY,
    INERTIA,
    INVERSE,
    LOAD_HEAD,
    MEAN,
    MOTION,
    SHIFT,
    TURN,
)
from .cluster_turn import cluster_end, cluster_loads, turn


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
    mx = m * x
    my = m * y
    mz = m * z
    store(s, row, fma(my, y, fma(mz, z, load(s, row))))
    store(s, row + 1, fma(-mx, y, load(s, row + 1)))
    store(s, row + 2, fma(mx, x, fma(mz, z, load(s, row + 2))))
    store(s, row + 3, fma(-mx, z, load(s, row + 3)))
    store(s, row + 4, fma(-my, z, load(s, row + 4)))
    store(s, row + 5, fma(mx, x, fma(my, y, load(s, row + 5))))


@inner
def _mean_arm(tape, s, rider, weights):
    """Mean of a deck's arms with given weights."""
    zero = splat(0.0)
    x = zero
    y = zero
    z = zero
    for k in range(tape[rider + 4]):
        weight = load(s, weights + k)
        ax, ay, az = load_vector(s, tape[rider + LOAD_HEAD + k])
        x = fma(weight, ax, x)
        y = fma(weight, ay, y)
        z = fma(weight, az, z)
    return x, y, z


@inner
def cluster_frames(tape, s, velocity):
    """Arms and inertia of every cluster at the current positions, with loads where the deck's coefficients say.

    Places ask for the centre of mass too, and start without a turn.
    """
    zero = splat(0.0)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        count = tape[at]
        work = tape[at + 7]
        ex, ey, ez, fx, fy, fz, nx, ny, nz = _axes(tape, s, at)
        for k in range(count):
            u, v, w = load_vector(s, tape[at + 3] + 3 * k)
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
        rider = cluster_loads(tape, at)
        for k in range(tape[at + 1]):
            m = load(s, tape[at + 4] + k)
            x, y, z = _mean_arm(tape, s, rider, tape[rider])
            x = -x
            y = -y
            z = -z
            store_vector(s, tape[rider + 3] + ARM, x, y, z)
            _add_point(s, work + INVERSE, m, x, y, z)
            sx = fma(m, x, sx)
            sy = fma(m, y, sy)
            sz = fma(m, z, sz)
            rider += LOAD_HEAD + tape[rider + 4]
        if tape[at + 1] > 0:
            inverse = load(s, tape[at + 5] + 1)
            sx = sx * inverse
            sy = sy * inverse
            sz = sz * inverse
            _add_point(s, work + INVERSE, -load(s, tape[at + 5]), sx, sy, sz)
            for k in range(count):
                _move(s, work + ARMS + 3 * k, sx, sy, sz)
            rider = cluster_loads(tape, at)
            for _ in range(tape[at + 1]):
                _move(s, tape[rider + 3] + ARM, sx, sy, sz)
                rider += LOAD_HEAD + tape[rider + 4]
        store_vector(s, work + SHIFT, sx, sy, sz)
        symmetric_inverse(s, work + INVERSE, work + INVERSE)
        if not velocity:
            x, y, z = _mean(tape, s, at, tape[H_POSITION])
            store_vector(s, work + CENTRE, x, y, z)
            store_vector(s, work + TURN, zero, zero, zero)
        at = cluster_end(tape, at)


@inner
def _move(s, row, x, y, z):
    """Subtract a vector from three rows."""
    ax, ay, az = load_vector(s, row)
    store_vector(s, row, ax - x, ay - y, az - z)


@inner
def _mean(tape, s, at, rows):
    """Mean of a cluster's rows weighted by mass."""
    zero = splat(0.0)
    x = zero
    y = zero
    z = zero
    for k in range(tape[at] + tape[at + 1]):
        entry = at + CLUSTER_HEAD + ENTRY * k
        m = load(s, tape[entry + 2])
        a, b, c = load_vector(s, rows + tape[entry])
        x = fma(m, a, x)
        y = fma(m, b, y)
        z = fma(m, c, z)
    inverse = load(s, tape[at + 5] + 1)
    return x * inverse, y * inverse, z * inverse


@inner
def _move_loads(tape, s, at, velocity):
    """Motion of loads over the deck, r0 and r1 of their moment; what they shift the centre by, or its speed."""
    zero = splat(0.0)
    work = tape[at + 7]
    inverse = load(s, tape[at + 5] + 1)
    x0, y0, z0 = load_vector(s, work + SHIFT)
    dx = zero
    dy = zero
    dz = zero
    if not velocity:
        dx = x0
        dy = y0
        dz = z0
    rider = cluster_loads(tape, at)
    for k in range(tape[at + 1]):
        own = tape[rider + 3]
        m = load(s, tape[at + 4] + k)
        if velocity:
            x, y, z = _mean_arm(tape, s, rider, tape[rider + 2])
            store_vector(s, own + MOTION, x, y, z)
        else:
            x, y, z = load_vector(s, own + ARM)
            store_vector(s, own + BEFORE, m * (x + x0), m * (y + y0), m * (z + z0))
            x, y, z = _mean_arm(tape, s, rider, tape[rider + 1])
            x = x + x0
            y = y + y0
            z = z + z0
            store_vector(s, own + AFTER, x, y, z)
        share = -m * inverse
        dx = fma(share, x, dx)
        dy = fma(share, y, dy)
        dz = fma(share, z, dz)
        rider += LOAD_HEAD + tape[rider + 4]
    if not velocity:
        # Arms of loads: less the centre of mass at the end, which is the start's less the shift.
        rider = cluster_loads(tape, at)
        for _ in range(tape[at + 1]):
            own = tape[rider + 3]
            _move(s, own + AFTER, x0 - dx, y0 - dy, z0 - dz)
            ax, ay, az = load_vector(s, own + AFTER)
            x, y, z = load_vector(s, own + ARM)
            store_vector(s, own + MOTION, ax - x - dx, ay - y - dy, az - z - dz)
            rider += LOAD_HEAD + tape[rider + 4]
    return dx, dy, dz


@inner
def start_clusters(tape, s, velocity):
    """What a stage's free rows alone make of every cluster: mean motion and moment, without impulses.

    Arms sum to zero with the masses as weights, so the moment needs no centre.
    """
    zero = splat(0.0)
    free = tape[H_VELOCITY] if velocity else tape[H_FREE]
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        work = tape[at + 7]
        dx, dy, dz = _move_loads(tape, s, at, velocity)
        store_vector(s, work + DELTA, dx, dy, dz)
        ux = zero
        uy = zero
        uz = zero
        lx = zero
        ly = zero
        lz = zero
        for k in range(tape[at] + tape[at + 1]):
            entry = at + CLUSTER_HEAD + ENTRY * k
            p = tape[entry]
            m = load(s, tape[entry + 2])
            x, y, z = load_vector(s, free + p)
            if not velocity:
                a, b, c = load_vector(s, tape[H_START] + p)
                x = x - a
                y = y - b
                z = z - c
            ux = fma(m, x, ux)
            uy = fma(m, y, uy)
            uz = fma(m, z, uz)
            if tape[entry + 3] >= 0:
                a, b, c = load_vector(s, tape[entry + 3] + MOTION)
                x = x - a
                y = y - b
                z = z - c
            rx, ry, rz = load_vector(s, tape[entry + 1])
            x, y, z = cross(rx, ry, rz, x, y, z)
            lx = fma(m, x, lx)
            ly = fma(m, y, ly)
            lz = fma(m, z, lz)
        inverse = load(s, tape[at + 5] + 1)
        store_vector(
            s, work + BASE, fma(inverse, ux, dx), fma(inverse, uy, dy), fma(inverse, uz, dz)
        )
        store_vector(s, work + BASE + 3, lx, ly, lz)
        at = cluster_end(tape, at)


@inner
def clear_touched(tape, s):
    """No impulses on touched particles; those of the others are not read before a stage ends."""
    zero = splat(0.0)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        for k in range(tape[at + 2]):
            p = tape[at + CLUSTER_HEAD + ENTRY * k]
            store_vector(s, tape[H_IMPULSE] + p, zero, zero, zero)
        at = cluster_end(tape, at)


@inner
def _pushed(tape, s, at):
    """Mean motion and moment with the impulses on touched particles."""
    work = tape[at + 7]
    inverse = load(s, tape[at + 5] + 1)
    ux, uy, uz = load_vector(s, work + BASE)
    lx, ly, lz = load_vector(s, work + BASE + 3)
    for k in range(tape[at + 2]):
        entry = at + CLUSTER_HEAD + ENTRY * k
        x, y, z = load_vector(s, tape[H_IMPULSE] + tape[entry])
        ux = fma(inverse, x, ux)
        uy = fma(inverse, y, uy)
        uz = fma(inverse, z, uz)
        rx, ry, rz = load_vector(s, tape[entry + 1])
        x, y, z = cross(rx, ry, rz, x, y, z)
        lx = lx + x
        ly = ly + y
        lz = lz + z
    return ux, uy, uz, lx, ly, lz


@inner
def _place(tape, s, at, target, count, finish):
    """Positions of the first ``count`` entries in the frame.

    To ``finish``, their impulse rows become those of the whole motion.
    """
    two = splat(2.0)
    work = tape[at + 7]
    x, y, z = load_vector(s, work + TURN)
    ux, uy, uz = load_vector(s, work + MEAN)
    dx, dy, dz = load_vector(s, work + DELTA)
    cx, cy, cz = load_vector(s, work + CENTRE)
    # R - 1 = 2 ([g] + g g^T - g.g) / (1 + g.g).
    square = dot(x, y, z, x, y, z)
    share = two / (splat(1.0) + square)
    d00 = share * fma(x, x, -square)
    d11 = share * fma(y, y, -square)
    d22 = share * fma(z, z, -square)
    d01 = share * fma(x, y, -z)
    d10 = share * fma(x, y, z)
    d02 = share * fma(x, z, y)
    d20 = share * fma(x, z, -y)
    d12 = share * fma(y, z, -x)
    d21 = share * fma(y, z, x)
    for k in range(count):
        entry = at + CLUSTER_HEAD + ENTRY * k
        p = tape[entry]
        own = tape[entry + 3]
        rx, ry, rz = load_vector(s, tape[entry + 1])
        mx = ux
        my = uy
        mz = uz
        if own < 0:
            ex = rx + dx
            ey = ry + dy
            ez = rz + dz
        else:
            ex, ey, ez = load_vector(s, own + AFTER)
            x, y, z = load_vector(s, own + MOTION)
            mx = mx + x
            my = my + y
            mz = mz + z
        mx = mx + dot(d00, d01, d02, ex, ey, ez)
        my = my + dot(d10, d11, d12, ex, ey, ez)
        mz = mz + dot(d20, d21, d22, ex, ey, ez)
        store_vector(s, target + p, cx + (rx + mx), cy + (ry + my), cz + (rz + mz))
        if finish:
            m = load(s, tape[entry + 2])
            x, y, z = load_vector(s, tape[H_FREE] + p)
            a, b, c = load_vector(s, tape[H_START] + p)
            x = m * (mx - (x - a))
            y = m * (my - (y - b))
            z = m * (mz - (z - c))
            store_vector(s, tape[H_IMPULSE] + p, x, y, z)


@inner
def _spread(tape, s, at, target, count):
    """Velocities of the first ``count`` entries from the frame's."""
    work = tape[at + 7]
    vx, vy, vz = load_vector(s, work + MEAN)
    wx, wy, wz = load_vector(s, work + TURN)
    for k in range(count):
        entry = at + CLUSTER_HEAD + ENTRY * k
        rx, ry, rz = load_vector(s, tape[entry + 1])
        x, y, z = cross(wx, wy, wz, rx, ry, rz)
        x = x + vx
        y = y + vy
        z = z + vz
        if tape[entry + 3] >= 0:
            a, b, c = load_vector(s, tape[entry + 3] + MOTION)
            x = x + a
            y = y + b
            z = z + c
        store_vector(s, target + tape[entry], x, y, z)


@inner
def place_clusters(tape, s, target, velocity, worlds):
    """Move every cluster as the impulses at hand make it, and put its touched particles in their frame.

    Frames of other ``worlds`` than those in the mask keep their rotation.
    """
    half = splat(0.5)
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        work = tape[at + 7]
        ux, uy, uz, lx, ly, lz = _pushed(tape, s, at)
        store_vector(s, work + MEAN, ux, uy, uz)
        if velocity:
            wx, wy, wz = symmetric_product(s, work + INVERSE, lx, ly, lz)
            store_vector(s, work + TURN, wx, wy, wz)
            _spread(tape, s, at, target, tape[at + 2])
        else:
            turn(tape, s, at, half * lx, half * ly, half * lz, worlds)
            _place(tape, s, at, target, tape[at + 2], False)
        at = cluster_end(tape, at)


@inner
def finish_clusters(tape, s, target, velocity):
    """Put all particles of every cluster where the last pass moved it.

    After positions, their impulse rows become those of the whole motion, rods and riders included.
    """
    at = tape[H_CLUSTERS] + 1
    for _ in range(tape[tape[H_CLUSTERS]]):
        count = tape[at] + tape[at + 1]
        if velocity:
            _spread(tape, s, at, target, count)
        else:
            _place(tape, s, at, target, count, True)
        at = cluster_end(tape, at)
