"""W, the contacts' Schur complement, row by row."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, store


@inner
def relative_motion(tape, s, skip, k, source):
    """(W l)_c for the contact whose product record starts at ``k``: three lane vectors.

    Record: slot, diagonal six rows, block, row of the softness, count, then per other contact: nine rows, its
    slot, whether transposed, its block. ``source`` is the first row of l by slot.
    """
    slot = source + tape[k]
    w = tape[k + 1]
    n = load(s, slot)
    t = load(s, slot + 1)
    u = load(s, slot + 2)
    a = fma(load(s, w + 3), u, fma(load(s, w + 1), t, load(s, w) * n))
    b = fma(load(s, w + 4), u, fma(load(s, w + 2), t, load(s, w + 1) * n))
    c = fma(load(s, w + 5), u, fma(load(s, w + 4), t, load(s, w + 3) * n))
    for other in range(tape[k + 4]):
        o = k + 5 + 4 * other
        if skip[tape[o + 3]] == 0:
            m = tape[o]
            x = source + tape[o + 1]
            n = load(s, x)
            t = load(s, x + 1)
            u = load(s, x + 2)
            if tape[o + 2] == 0:
                a = fma(load(s, m + 2), u, fma(load(s, m + 1), t, fma(load(s, m), n, a)))
                b = fma(load(s, m + 5), u, fma(load(s, m + 4), t, fma(load(s, m + 3), n, b)))
                c = fma(load(s, m + 8), u, fma(load(s, m + 7), t, fma(load(s, m + 6), n, c)))
            else:
                a = fma(load(s, m + 6), u, fma(load(s, m + 3), t, fma(load(s, m), n, a)))
                b = fma(load(s, m + 7), u, fma(load(s, m + 4), t, fma(load(s, m + 1), n, b)))
                c = fma(load(s, m + 8), u, fma(load(s, m + 5), t, fma(load(s, m + 2), n, c)))
    return a, b, c


@inner
def add_motion_row(tape, s, skip, k, axis, row, factor, first):
    """row += factor times row ``axis`` of (W)_c; columns are slots less ``first``."""
    w = tape[k + 1]
    own = row + tape[k] - first
    for column in range(3):
        high = max(axis, column)
        entry = high * (high + 1) // 2 + min(axis, column)
        store(s, own + column, fma(factor, load(s, w + entry), load(s, own + column)))
    for other in range(tape[k + 4]):
        o = k + 5 + 4 * other
        if skip[tape[o + 3]] == 0:
            at = row + tape[o + 1] - first
            for column in range(3):
                entry = 3 * axis + column if tape[o + 2] == 0 else 3 * column + axis
                value = load(s, tape[o] + entry)
                store(s, at + column, fma(factor, value, load(s, at + column)))
