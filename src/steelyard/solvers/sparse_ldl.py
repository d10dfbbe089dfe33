"""Sparse LDL^T by scalar rows over an index tape, for symmetric matrices that are not definite.

Row i, in elimination order: for every earlier j of its pattern u_ij = a_ij - sum over k < j of u_ik l_jk and
l_ij = u_ij / d_j, then d_i = a_ii - sum of u_ik l_ik. The matrix is overwritten by u and d; l and 1 / d have rows of
their own. Sums come in *runs*, (first row of one factor, first row of the other, length), wherever entries stand next
to each other.

Tape of a factorisation::

    count, then per row:
        count of targets, then per target: u, l, 1/d_j, count of runs, the runs
        d, 1/d, whether it is a constraint, count of runs, the runs

No pivots are sought: the order must be one in which none can vanish (``model.saddle``). The pivot of a constraint is a
difference of what its particles yield and what earlier constraints hold of them; below 1e-13 of these it is rounding,
the row depends on the earlier ones, and its inverse is set to 0, which leaves it out.

Source: Golub & Van Loan, *Matrix Computations*, 4.1; quasidefinite matrices: Vanderbei (1995).
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import absolute, fma, load, select, splat, store

_PIVOT = 1e-13


@inner
def _subtract_runs(tape, at, count, s, value):
    """Value less the sum of the products of the runs at ``at``."""
    for run in range(count):
        left = tape[at + 3 * run]
        right = tape[at + 3 * run + 1]
        for k in range(tape[at + 3 * run + 2]):
            value = fma(-load(s, left + k), load(s, right + k), value)
    return value


@inner
def _size_of_runs(tape, at, count, s):
    """Sum of the absolute products of the runs at ``at``."""
    value = splat(0.0)
    for run in range(count):
        left = tape[at + 3 * run]
        right = tape[at + 3 * run + 1]
        for k in range(tape[at + 3 * run + 2]):
            value = value + absolute(load(s, left + k) * load(s, right + k))
    return value


@inner
def factor(tape, at, s):
    """Factorise in place; ``tape[at]`` starts the tape above."""
    zero = splat(0.0)
    one = splat(1.0)
    rows = tape[at]
    at += 1
    for _ in range(rows):
        targets = tape[at]
        at += 1
        for _ in range(targets):
            u = tape[at]
            count = tape[at + 3]
            value = _subtract_runs(tape, at + 4, count, s, load(s, u))
            store(s, u, value)
            store(s, tape[at + 1], value * load(s, tape[at + 2]))
            at += 4 + 3 * count
        count = tape[at + 3]
        pivot = _subtract_runs(tape, at + 4, count, s, load(s, tape[at]))
        if tape[at + 2] != 0:
            size = splat(_PIVOT) * _size_of_runs(tape, at + 4, count, s)
            stands = absolute(pivot) > size
            pivot = one / select(stands, pivot, one)
            store(s, tape[at + 1], select(stands, pivot, zero))
        else:
            store(s, tape[at + 1], one / pivot)
        at += 4 + 3 * count


@inner
def forward(tape, at, s):
    """y_i = r_i - sum of l_ij y_j, in place. Tape: count, then per row: y, count of runs, runs (l, y)."""
    rows = tape[at]
    at += 1
    for _ in range(rows):
        y = tape[at]
        count = tape[at + 1]
        store(s, y, _subtract_runs(tape, at + 2, count, s, load(s, y)))
        at += 2 + 3 * count


@inner
def backward(tape, at, s):
    """z_i = y_i / d_i - sum over later k of l_ki z_k, in place.

    Tape: count, then per row, last first: y, 1/d, count of runs, runs (l, z).
    """
    rows = tape[at]
    at += 1
    for _ in range(rows):
        y = tape[at]
        count = tape[at + 2]
        value = load(s, y) * load(s, tape[at + 1])
        store(s, y, _subtract_runs(tape, at + 3, count, s, value))
        at += 3 + 3 * count
