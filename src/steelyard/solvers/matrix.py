"""The direct solver's matrix A = J M^-1 J^T: assembled block by block from the index tape, then factorised.

A particle couples the rows that act on it through its inverse mass; a rigid cluster couples all rows that act on
its particles through its six degrees of freedom: with a row's force f and moment g about the centre of mass,
A_rs = f_r . f_s / M + g_r . I^-1 g_s.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import spatial
from ..math.vectors import (
    cross,
    dot,
    load_coordinates,
    load_vector,
    store_vector,
    symmetric_product,
)
from ..model.tape import (
    H_FACTOR,
    H_LINK_COUPLINGS,
    H_LINK_DIAGONALS,
    H_LINK_MASKS,
    H_LINKS,
    H_MASK,
    H_MATRIX,
    H_MATRIX_ROWS,
    H_PADDING,
    H_POINT_DIAGONALS,
    H_POINT_LINKS,
    H_POINT_POINTS,
    H_REFERENCES,
    H_USED_MASK,
    H_WRENCH_PRODUCTS,
    H_WRENCHES,
    LINK,
)
from . import block_ldl


@inner
def _wrench(tape, s, k):
    """Forces and moments of a block's three rows on a cluster, and the motion they cause; the next record."""
    zero = splat(0.0)
    wrench = tape[k]
    frame = tape[k + 4]
    count = tape[k + 5]
    k += 6
    if frame >= 0:
        share = zero
        x = zero
        y = zero
        z = zero
        for index in range(count):
            coefficient = load(s, tape[k + 2 * index])
            rx, ry, rz = load_vector(s, tape[k + 2 * index + 1])
            share = share + coefficient
            x = fma(coefficient, rx, x)
            y = fma(coefficient, ry, y)
            z = fma(coefficient, rz, z)
        for row in range(3):
            fx, fy, fz = load_vector(s, frame + 3 * row)
            gx, gy, gz = cross(x, y, z, fx, fy, fz)
            store_vector(s, wrench + 6 * row, share * fx, share * fy, share * fz)
            store_vector(s, wrench + 6 * row + 3, gx, gy, gz)
        return k + 2 * count
    for row in range(18):
        store(s, wrench + row, zero)
    for index in range(count):
        end = k + 4 * index
        row = wrench + 6 * tape[end]
        sign = load(s, tape[end + 2])
        dx, dy, dz = load_vector(s, tape[end + 1])
        dx = sign * dx
        dy = sign * dy
        dz = sign * dz
        rx, ry, rz = load_vector(s, tape[end + 3])
        gx, gy, gz = cross(rx, ry, rz, dx, dy, dz)
        fx, fy, fz = load_vector(s, row)
        store_vector(s, row, fx + dx, fy + dy, fz + dz)
        fx, fy, fz = load_vector(s, row + 3)
        store_vector(s, row + 3, fx + gx, fy + gy, fz + gz)
    return k + 4 * count


@inner
def _add_wrenches(tape, s, skip):
    """Couplings through clusters."""
    at = tape[H_WRENCHES]
    k = at + 1
    for _ in range(tape[at]):
        wrench = tape[k]
        inverse = load(s, tape[k + 1])
        inertia = tape[k + 2]
        k = _wrench(tape, s, k)
        for row in range(3):
            force = wrench + 6 * row
            x, y, z = load_vector(s, force)
            store_vector(s, force + 18, inverse * x, inverse * y, inverse * z)
            x, y, z = load_vector(s, force + 3)
            x, y, z = symmetric_product(s, inertia, x, y, z)
            store_vector(s, force + 21, x, y, z)
    at = tape[H_WRENCH_PRODUCTS]
    for index in range(tape[at]):
        k = at + 1 + 6 * index
        if skip[tape[k + 4]] == 0 and skip[tape[k + 5]] == 0:
            own = tape[k + 1] != 0
            entry = tape[k]
            for row in range(3):
                w = tape[k + 2] + 6 * row
                a, b, c = load_vector(s, w)
                d, e, f = load_vector(s, w + 3)
                for column in range(row + 1 if own else 3):
                    z = tape[k + 3] + 6 * column
                    value = fma(a, load(s, z), load(s, entry))
                    value = fma(b, load(s, z + 1), value)
                    value = fma(c, load(s, z + 2), value)
                    value = fma(d, load(s, z + 3), value)
                    value = fma(e, load(s, z + 4), value)
                    store(s, entry, fma(f, load(s, z + 5), value))
                    entry += 1


@inner
def _assemble(tape, s, skip):
    """Matrix A = J M^-1 J^T of all blocks from the stored gradients, frames and weights."""
    zero = splat(0.0)
    for row in range(tape[H_MATRIX_ROWS]):
        store(s, tape[H_MATRIX] + row, zero)
    at = tape[H_LINK_DIAGONALS]
    for index in range(tape[at]):
        k = at + 1 + 4 * index
        x, y, z = load_coordinates(s, tape[k + 1])
        square = dot(x, y, z, x, y, z)
        store(s, tape[k], square * (load(s, tape[k + 2]) + load(s, tape[k + 3])))
    at = tape[H_LINK_COUPLINGS]
    for index in range(tape[at]):
        k = at + 1 + 5 * index
        dx, dy, dz = load_coordinates(s, tape[k + 1])
        ex, ey, ez = load_coordinates(s, tape[k + 2])
        product = dot(dx, dy, dz, ex, ey, ez)
        weight = load(s, tape[k + 3]) * load(s, tape[k + 4])
        store(s, tape[k], fma(weight, product, load(s, tape[k])))
    at = tape[H_POINT_DIAGONALS]
    for index in range(tape[at]):
        k = at + 1 + 3 * index
        weight = load(s, tape[k + 1])
        weight = weight * weight * load(s, tape[k + 2])
        for row in (0, 2, 5):
            store(s, tape[k] + row, load(s, tape[k] + row) + weight)
    at = tape[H_POINT_LINKS]
    for index in range(tape[at]):
        k = at + 1 + 6 * index
        weight = load(s, tape[k + 2]) * load(s, tape[k + 3]) * load(s, tape[k + 4])
        d = tape[k + 5]
        x = weight * load(s, d)
        y = weight * load(s, d + 1)
        z = weight * load(s, d + 2)
        frame = tape[k + 1]
        for row in range(3):
            value = load(s, tape[k] + 3 * row)
            value = fma(load(s, frame + 3 * row), x, value)
            value = fma(load(s, frame + 3 * row + 1), y, value)
            value = fma(load(s, frame + 3 * row + 2), z, value)
            store(s, tape[k] + 3 * row, value)
    at = tape[H_POINT_POINTS]
    for index in range(tape[at]):
        k = at + 1 + 6 * index
        weight = load(s, tape[k + 3]) * load(s, tape[k + 4]) * load(s, tape[k + 5])
        for row in range(3):
            f = tape[k + 1] + 3 * row
            x = weight * load(s, f)
            y = weight * load(s, f + 1)
            z = weight * load(s, f + 2)
            for column in range(3):
                g = tape[k + 2] + 3 * column
                value = fma(x, load(s, g), load(s, tape[k] + 3 * row + column))
                value = fma(y, load(s, g + 1), value)
                store(s, tape[k] + 3 * row + column, fma(z, load(s, g + 2), value))
    _add_wrenches(tape, s, skip)


@inner
def _factorise(tape, s, skip):
    """Mask slack cables, keep the diagonal as pivots' reference, and factorise all but W."""
    one = splat(1.0)
    at = tape[H_LINK_MASKS]
    for index in range(tape[at]):
        k = at + 1 + 3 * index
        store(s, tape[k], load(s, tape[k]) * load(s, tape[k + 1]) * load(s, tape[k + 2]))
    at = tape[H_PADDING]
    for index in range(tape[at]):
        k = at + 1 + 2 * index
        taken = load(s, tape[k + 1])
        store(s, tape[k], fma(load(s, tape[k]), taken, one - taken))
    at = tape[H_REFERENCES]
    for index in range(tape[at]):
        k = at + 1 + 2 * index
        store(s, tape[k], load(s, tape[k + 1]))
    block_ldl.factor(tape, tape[H_FACTOR], spatial(s), skip)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        slot = tape[at + 1 + LINK * index + 15]
        if slot >= 0:
            store(s, tape[H_USED_MASK] + slot, load(s, tape[H_MASK] + slot))


@inner
def refactor(tape, s, skip):
    """Gradients are those stored; assemble and factorise anew."""
    _assemble(tape, s, skip)
    _factorise(tape, s, skip)
