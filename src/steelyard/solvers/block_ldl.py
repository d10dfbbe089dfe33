"""Sparse block LDL^T over an index tape: the same few operations for every scene.

Tape of one factorisation, block rows in elimination order::

    count, then per block row I:
        diagonal, inverse, reference, block, count of J, then per J < I:
            A_IJ, P_IJ, inverse_J, J, count of K, then per K < J in both patterns:
                A_IK, P_JK, K

A holds the matrix and, after elimination, U = L D; P = L. ``diagonal`` are six rows (00 10 11 20 21 22),
off-diagonal blocks nine, row by row. Blocks whose flag in ``skip`` is set do not take part. Where blocks stand for
coordinates, the scratch of a planar scene makes them 2 x 2, in the same rows.

Source: Golub & Van Loan, *Matrix Computations*, 4.1; pivots below 1e-10 of the matrix's own diagonal mark a
row that depends on earlier ones: its inverse is set to 0, which leaves that row out.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, load_z, select, splat, store, store_z
from ..math.pointers import axes
from ..math.vectors import load_coordinates, store_coordinates

_PIVOT = 1e-10


@inner
def _inverse_pivot(pivot, reference):
    zero = splat(0.0)
    return select(pivot > splat(_PIVOT) * reference, splat(1.0) / pivot, zero)


@inner
def _invert(s, a, out, reference):
    """Inverse of a symmetric 3 x 3 block by LDL^T, dependent rows left out."""
    a10 = load(s, a + 1)
    a20 = load_z(s, a + 3)
    i0 = _inverse_pivot(load(s, a), load(s, reference))
    l10 = a10 * i0
    l20 = a20 * i0
    i1 = _inverse_pivot(fma(-l10, a10, load(s, a + 2)), load(s, reference + 1))
    m10 = -l10
    if axes(s) == 2:
        store(s, out, fma(m10 * m10, i1, i0))
        store(s, out + 1, m10 * i1)
        store(s, out + 2, i1)
        return
    t21 = fma(-l20, a10, load(s, a + 4))
    l21 = t21 * i1
    last = fma(-l21, t21, fma(-l20, a20, load(s, a + 5)))
    i2 = _inverse_pivot(last, load(s, reference + 2))
    m21 = -l21
    m20 = fma(l21, l10, -l20)
    store(s, out, fma(m20 * m20, i2, fma(m10 * m10, i1, i0)))
    store(s, out + 1, fma(m20 * m21, i2, m10 * i1))
    store(s, out + 2, fma(m21 * m21, i2, i1))
    store(s, out + 3, m20 * i2)
    store(s, out + 4, m21 * i2)
    store(s, out + 5, i2)


@inner
def _subtract_products(tape, at, count, s, skip, target):
    """target -= sum of A_IK P_JK^T over the block's product records; the nine sums stay in registers."""
    a00 = load(s, target)
    a01 = load(s, target + 1)
    a02 = load_z(s, target + 2)
    a10 = load(s, target + 3)
    a11 = load(s, target + 4)
    a12 = load_z(s, target + 5)
    a20 = load_z(s, target + 6)
    a21 = load_z(s, target + 7)
    a22 = load_z(s, target + 8)
    for product in range(count):
        record = at + 3 * product
        if skip[tape[record + 2]] == 0:
            left = tape[record]
            right = tape[record + 1]
            for column in range(axes(s)):
                x = -load(s, left + column)
                y = -load(s, left + 3 + column)
                z = -load_z(s, left + 6 + column)
                b0 = load(s, right + column)
                b1 = load(s, right + 3 + column)
                b2 = load_z(s, right + 6 + column)
                a00 = fma(x, b0, a00)
                a01 = fma(x, b1, a01)
                a02 = fma(x, b2, a02)
                a10 = fma(y, b0, a10)
                a11 = fma(y, b1, a11)
                a12 = fma(y, b2, a12)
                a20 = fma(z, b0, a20)
                a21 = fma(z, b1, a21)
                a22 = fma(z, b2, a22)
    store(s, target, a00)
    store(s, target + 1, a01)
    store_z(s, target + 2, a02)
    store(s, target + 3, a10)
    store(s, target + 4, a11)
    store_z(s, target + 5, a12)
    store_z(s, target + 6, a20)
    store_z(s, target + 7, a21)
    store_z(s, target + 8, a22)


@inner
def _subtract_square(s, target, left, right):
    """Lower half of target -= left right^T, where the product is symmetric."""
    entry = 0
    for row in range(axes(s)):
        x, y, z = load_coordinates(s, left + 3 * row)
        for column in range(row + 1):
            bx, by, bz = load_coordinates(s, right + 3 * column)
            value = fma(-x, bx, load(s, target + entry))
            store(s, target + entry, fma(-z, bz, fma(-y, by, value)))
            entry += 1


@inner
def _scale(s, a, inverse, out):
    """out = a inverse, ``inverse`` symmetric in six rows."""
    d00 = load(s, inverse)
    d10 = load(s, inverse + 1)
    d11 = load(s, inverse + 2)
    d20 = load_z(s, inverse + 3)
    d21 = load_z(s, inverse + 4)
    d22 = load_z(s, inverse + 5)
    for row in range(axes(s)):
        x, y, z = load_coordinates(s, a + 3 * row)
        store_coordinates(
            s,
            out + 3 * row,
            fma(z, d20, fma(y, d10, x * d00)),
            fma(z, d21, fma(y, d11, x * d10)),
            fma(z, d22, fma(y, d21, x * d20)),
        )


@inner
def factor(tape, at, s, skip):
    """Factorise in place; ``tape[at]`` starts the tape above. ``skip`` (blocks,) flags blocks left out."""
    rows = tape[at]
    at += 1
    for _ in range(rows):
        diagonal = tape[at]
        inverse = tape[at + 1]
        reference = tape[at + 2]
        here = skip[tape[at + 3]] == 0
        columns = tape[at + 4]
        at += 5
        for _ in range(columns):
            a = tape[at]
            p = tape[at + 1]
            column_inverse = tape[at + 2]
            there = here and skip[tape[at + 3]] == 0
            products = tape[at + 4]
            at += 5
            if there:
                if products > 0:
                    _subtract_products(tape, at, products, s, skip, a)
                if column_inverse >= 0:
                    _scale(s, a, column_inverse, p)
                    _subtract_square(s, diagonal, a, p)
            at += 3 * products
        if here and inverse >= 0:
            _invert(s, diagonal, inverse, reference)


@inner
def forward(tape, at, s, skip):
    """y_I = r_I - sum of P_IJ y_J, in place.

    Tape: count, then per block row: y, block, count, then per J: P_IJ, y_J, J.
    """
    rows = tape[at]
    at += 1
    for _ in range(rows):
        y = tape[at]
        here = skip[tape[at + 1]] == 0
        columns = tape[at + 2]
        at += 3
        if here:
            y0, y1, y2 = load_coordinates(s, y)
            for column in range(columns):
                p = tape[at + 3 * column]
                x = tape[at + 3 * column + 1]
                if skip[tape[at + 3 * column + 2]] == 0:
                    x0, x1, x2 = load_coordinates(s, x)
                    p0, p1, p2 = load_coordinates(s, p)
                    y0 = fma(p2, -x2, fma(p1, -x1, fma(p0, -x0, y0)))
                    p0, p1, p2 = load_coordinates(s, p + 3)
                    y1 = fma(p2, -x2, fma(p1, -x1, fma(p0, -x0, y1)))
                    if axes(s) == 3:
                        p0, p1, p2 = load_coordinates(s, p + 6)
                        y2 = fma(p2, -x2, fma(p1, -x1, fma(p0, -x0, y2)))
            store_coordinates(s, y, y0, y1, y2)
        at += 3 * columns


@inner
def backward(tape, at, s, skip):
    """z_I = D_I^-1 y_I - sum over later K of P_KI^T z_K, in place.

    Tape: count, then per block row, last first: y, inverse, block, count, then per
    K: P_KI, z_K, K.
    """
    rows = tape[at]
    at += 1
    for _ in range(rows):
        y = tape[at]
        inverse = tape[at + 1]
        here = skip[tape[at + 2]] == 0
        columns = tape[at + 3]
        at += 4
        if here:
            y0, y1, y2 = load_coordinates(s, y)
            d10 = load(s, inverse + 1)
            d20 = load_z(s, inverse + 3)
            d21 = load_z(s, inverse + 4)
            z0 = fma(d20, y2, fma(d10, y1, load(s, inverse) * y0))
            z1 = fma(d21, y2, fma(load(s, inverse + 2), y1, d10 * y0))
            z2 = fma(load_z(s, inverse + 5), y2, fma(d21, y1, d20 * y0))
            for column in range(columns):
                p = tape[at + 3 * column]
                x = tape[at + 3 * column + 1]
                if skip[tape[at + 3 * column + 2]] == 0:
                    x0, x1, x2 = load_coordinates(s, x)
                    p0, p3, p6 = load(s, p), load(s, p + 3), load_z(s, p + 6)
                    z0 = fma(p6, -x2, fma(p3, -x1, fma(p0, -x0, z0)))
                    p1, p4, p7 = load(s, p + 1), load(s, p + 4), load_z(s, p + 7)
                    z1 = fma(p7, -x2, fma(p4, -x1, fma(p1, -x0, z1)))
                    p2, p5, p8 = load_z(s, p + 2), load_z(s, p + 5), load_z(s, p + 8)
                    z2 = fma(p8, -x2, fma(p5, -x1, fma(p2, -x0, z2)))
            store_coordinates(s, y, z0, z1, z2)
        at += 3 * columns
