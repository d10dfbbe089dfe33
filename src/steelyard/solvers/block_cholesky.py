"""Cholesky factor of a symmetric matrix of 6 x 6 blocks in its envelope: every block row from its first block on.

A block is six rows of the scratch, one per column of it, of which the first six entries are used: so a column is one
vector register, and products of blocks run at 36 multiplications of vectors. The factor overwrites the matrix; behind
each column of a diagonal block, in entry ``INVERSE``, stands one over its pivot.

Source: George & Liu, *Computer Solution of Large Sparse Positive Definite Systems*, chapter 4 (envelope methods).
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..math.lanes import fma, load, one_lane, splat, store

#: Rows of a block.
SIX = 6
INVERSE = 6


@inner
def clear_rows(h, first, last):
    """Rows of zeros."""
    zero = splat(0.0)
    for row in range(first, last):
        store(h, row, zero)


@inner
def _less_product(h, x, y, c0, c1, c2, c3, c4, c5):
    """Columns of C - X Y^T, of blocks whose first rows are ``x`` and ``y``."""
    for d in range(SIX):
        column = load(h, x + d)
        row = y + d
        c0 = fma(splat(-h[row, 0]), column, c0)
        c1 = fma(splat(-h[row, 1]), column, c1)
        c2 = fma(splat(-h[row, 2]), column, c2)
        c3 = fma(splat(-h[row, 3]), column, c3)
        c4 = fma(splat(-h[row, 4]), column, c4)
        c5 = fma(splat(-h[row, 5]), column, c5)
    return c0, c1, c2, c3, c4, c5


@inner
def _load_block(h, row):
    """Six columns."""
    return (
        load(h, row), load(h, row + 1), load(h, row + 2), load(h, row + 3), load(h, row + 4), load(h, row + 5)
    )  # fmt: skip


@inner
def _store_block(h, row, c0, c1, c2, c3, c4, c5):
    """Six columns."""
    store(h, row, c0)
    store(h, row + 1, c1)
    store(h, row + 2, c2)
    store(h, row + 3, c3)
    store(h, row + 4, c4)
    store(h, row + 5, c5)


@inner
def _finish_column(h, row, column, pivot):
    """Store a column of the factor, and one over its pivot."""
    inverse = 1.0 / sqrt(pivot)
    store(h, row, column * splat(inverse))
    h[row, INVERSE] = inverse


@inner
def _factorise_diagonal(h, row, c0, c1, c2, c3, c4, c5):
    """Cholesky factor of a block of six columns; whether its pivots are above 0.

    Columns are taken out by those over their pivots, so that no root stands in the way of the next.
    """
    pivot = one_lane(c0, 0)
    good = pivot > 0.0
    _finish_column(h, row, c0, pivot)
    over = c0 * splat(1.0 / pivot)
    c1 = fma(splat(-one_lane(c0, 1)), over, c1)
    c2 = fma(splat(-one_lane(c0, 2)), over, c2)
    c3 = fma(splat(-one_lane(c0, 3)), over, c3)
    c4 = fma(splat(-one_lane(c0, 4)), over, c4)
    c5 = fma(splat(-one_lane(c0, 5)), over, c5)
    pivot = one_lane(c1, 1)
    good = good and pivot > 0.0
    _finish_column(h, row + 1, c1, pivot)
    over = c1 * splat(1.0 / pivot)
    c2 = fma(splat(-one_lane(c1, 2)), over, c2)
    c3 = fma(splat(-one_lane(c1, 3)), over, c3)
    c4 = fma(splat(-one_lane(c1, 4)), over, c4)
    c5 = fma(splat(-one_lane(c1, 5)), over, c5)
    pivot = one_lane(c2, 2)
    good = good and pivot > 0.0
    _finish_column(h, row + 2, c2, pivot)
    over = c2 * splat(1.0 / pivot)
    c3 = fma(splat(-one_lane(c2, 3)), over, c3)
    c4 = fma(splat(-one_lane(c2, 4)), over, c4)
    c5 = fma(splat(-one_lane(c2, 5)), over, c5)
    pivot = one_lane(c3, 3)
    good = good and pivot > 0.0
    _finish_column(h, row + 3, c3, pivot)
    over = c3 * splat(1.0 / pivot)
    c4 = fma(splat(-one_lane(c3, 4)), over, c4)
    c5 = fma(splat(-one_lane(c3, 5)), over, c5)
    pivot = one_lane(c4, 4)
    good = good and pivot > 0.0
    _finish_column(h, row + 4, c4, pivot)
    over = c4 * splat(1.0 / pivot)
    c5 = fma(splat(-one_lane(c4, 5)), over, c5)
    pivot = one_lane(c5, 5)
    _finish_column(h, row + 5, c5, pivot)
    return good and pivot > 0.0


@inner
def _divide(h, diagonal, c0, c1, c2, c3, c4, c5):
    """Columns of X with X L^T = C for the factor L of a diagonal block."""
    c0 = c0 * splat(h[diagonal, INVERSE])
    row = diagonal
    c1 = fma(splat(-h[row, 1]), c0, c1)
    c2 = fma(splat(-h[row, 2]), c0, c2)
    c3 = fma(splat(-h[row, 3]), c0, c3)
    c4 = fma(splat(-h[row, 4]), c0, c4)
    c5 = fma(splat(-h[row, 5]), c0, c5)
    row = diagonal + 1
    c1 = c1 * splat(h[row, INVERSE])
    c2 = fma(splat(-h[row, 2]), c1, c2)
    c3 = fma(splat(-h[row, 3]), c1, c3)
    c4 = fma(splat(-h[row, 4]), c1, c4)
    c5 = fma(splat(-h[row, 5]), c1, c5)
    row = diagonal + 2
    c2 = c2 * splat(h[row, INVERSE])
    c3 = fma(splat(-h[row, 3]), c2, c3)
    c4 = fma(splat(-h[row, 4]), c2, c4)
    c5 = fma(splat(-h[row, 5]), c2, c5)
    row = diagonal + 3
    c3 = c3 * splat(h[row, INVERSE])
    c4 = fma(splat(-h[row, 4]), c3, c4)
    c5 = fma(splat(-h[row, 5]), c3, c5)
    row = diagonal + 4
    c4 = c4 * splat(h[row, INVERSE])
    c5 = fma(splat(-h[row, 5]), c4, c5)
    c5 = c5 * splat(h[diagonal + 5, INVERSE])
    return c0, c1, c2, c3, c4, c5


@inner
def factorise(h, n, first, start, blocks):
    """Factor L L^T in place.

    Args:
        h: pointer to the rows of the blocks.
        n: pointer to integers.
        first: where in ``n`` the first block column of every block row stands.
        start: where in ``n`` the first row of every block row stands.
        blocks: number of block rows.

    Returns:
        Whether all pivots are above 0.
    """
    good = True
    for i in range(blocks):
        fi = n[first + i]
        own = n[start + i]
        for j in range(fi, i):
            fj = n[first + j]
            other = n[start + j]
            row = own + SIX * (j - fi)
            c0, c1, c2, c3, c4, c5 = _load_block(h, row)
            for k in range(max(fi, fj), j):
                c0, c1, c2, c3, c4, c5 = _less_product(
                    h, own + SIX * (k - fi), other + SIX * (k - fj), c0, c1, c2, c3, c4, c5
                )
            c0, c1, c2, c3, c4, c5 = _divide(h, other + SIX * (j - fj), c0, c1, c2, c3, c4, c5)
            _store_block(h, row, c0, c1, c2, c3, c4, c5)
        diagonal = own + SIX * (i - fi)
        c0, c1, c2, c3, c4, c5 = _load_block(h, diagonal)
        for k in range(fi, i):
            row = own + SIX * (k - fi)
            c0, c1, c2, c3, c4, c5 = _less_product(h, row, row, c0, c1, c2, c3, c4, c5)
        good = _factorise_diagonal(h, diagonal, c0, c1, c2, c3, c4, c5) and good
    return good


@inner
def solve_factored(h, n, first, start, blocks, x):
    """Overwrite the right-hand side, from row ``x`` of ``h`` on one row per block, by the solution."""
    for i in range(blocks):
        fi = n[first + i]
        own = n[start + i]
        part = load(h, x + i)
        for k in range(fi, i):
            row = own + SIX * (k - fi)
            for d in range(SIX):
                part = fma(splat(-h[x + k, d]), load(h, row + d), part)
        diagonal = own + SIX * (i - fi)
        for c in range(SIX):
            # Entries before c are done; what this takes from them again is put back below.
            store(h, x + i, part)
            value = h[x + i, c] * h[diagonal + c, INVERSE]
            part = fma(splat(-value), load(h, diagonal + c), part)
            h[x + blocks, c] = value
        store(h, x + i, load(h, x + blocks))
    for i in range(blocks - 1, -1, -1):
        fi = n[first + i]
        own = n[start + i]
        diagonal = own + SIX * (i - fi)
        for c in range(SIX - 1, -1, -1):
            value = h[x + i, c]
            for r in range(c + 1, SIX):
                value -= h[diagonal + c, r] * h[x + i, r]
            h[x + i, c] = value * h[diagonal + c, INVERSE]
        for k in range(fi, i):
            row = own + SIX * (k - fi)
            for d in range(SIX):
                value = h[x + k, d]
                for r in range(SIX):
                    value -= h[row + d, r] * h[x + i, r]
                h[x + k, d] = value
