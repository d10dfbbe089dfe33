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
def _put_rows(s, at, width, n, a, b, c, x, y, z, u, v, w):
    """A 3 x 3 block of the system, (a b c), (x y z), (u v w) times the factors ``n``."""
    normal, f00, f01, f11 = n
    store(s, at, normal * a)
    store(s, at + 1, normal * b)
    store(s, at + 2, normal * c)
    at += width
    store(s, at, fma(f01, u, f00 * x))
    store(s, at + 1, fma(f01, v, f00 * y))
    store(s, at + 2, fma(f01, w, f00 * z))
    at += width
    store(s, at, fma(f11, u, f01 * x))
    store(s, at + 1, fma(f11, v, f01 * y))
    store(s, at + 2, fma(f11, w, f01 * z))


@inner
def put_motion_rows(tape, s, skip, k, row, width, factors, first):
    """Rows of a contact's system: normal times row 0 of (W)_c, and a symmetric 2 x 2 matrix times rows 1 and 2.

    Args:
        k: product record of the contact, see ``relative_motion``.
        row: first entry of its three rows, ``width`` apart; columns are slots less ``first``.
        factors: normal, then entries 00, 01 and 11 of the matrix.
    """
    w = tape[k + 1]
    a = load(s, w)
    b = load(s, w + 1)
    c = load(s, w + 3)
    y = load(s, w + 2)
    z = load(s, w + 4)
    _put_rows(s, row + tape[k] - first, width, factors, a, b, c, b, y, z, c, z, load(s, w + 5))
    for other in range(tape[k + 4]):
        o = k + 5 + 4 * other
        if skip[tape[o + 3]] == 0:
            at = row + tape[o + 1] - first
            m = tape[o]
            a = load(s, m)
            b = load(s, m + 1)
            c = load(s, m + 2)
            x = load(s, m + 3)
            y = load(s, m + 4)
            z = load(s, m + 5)
            u = load(s, m + 6)
            v = load(s, m + 7)
            last = load(s, m + 8)
            if tape[o + 2] == 0:
                _put_rows(s, at, width, factors, a, b, c, x, y, z, u, v, last)
            else:
                _put_rows(s, at, width, factors, a, x, u, b, y, v, c, z, last)
