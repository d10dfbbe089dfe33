"""Elimination order and fill turned into the index tapes that factorise and solve."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .network import Network
    from .stiffness import Stiffness

#: Up to so many contacts per world Newton's method on the friction law is worth its dense system.
DENSE_CONTACTS = 8


def lower(row: int, column: int) -> int:
    """Place of an entry of a symmetric block among its six rows."""
    return row * (row + 1) // 2 + column


def add_elimination(n: Network | Stiffness) -> None:
    c = n.c
    right = c.header["right"]
    factor: list[int] = []
    forward: list[int] = []
    backward: list[int] = []
    for i, block in enumerate(n.order):
        contact = i >= n.structural
        columns = n.pattern[i]
        coupled = set(columns)
        factor += [
            n.diagonal[i],
            -1 if contact else n.inverse[i],
            n.reference[i],
            block,
        ]
        factor.append(len(columns))
        for j in columns:
            shared = [k for k in n.pattern[j] if k in coupled and k < n.structural]
            outer = j >= n.structural
            factor += [
                n.a[i, j],
                -1 if outer else n.p[i, j],
                -1 if outer else n.inverse[j],
                n.order[j],
                len(shared),
            ]
            for k in shared:
                factor += [n.a[i, k], n.p[j, k], n.order[k]]
        inner = [j for j in columns if j < n.structural]
        forward += [right + 3 * block, block, len(inner)]
        for j in inner:
            forward += [n.p[i, j], right + 3 * n.order[j], n.order[j]]
    for i in reversed(range(n.structural)):
        later = [k for k in range(i + 1, n.count) if i in n.pattern[k]]
        block = n.order[i]
        backward += [right + 3 * block, n.inverse[i], block, len(later)]
        for k in later:
            backward += [n.p[k, i], right + 3 * n.order[k], n.order[k]]
    c.sections |= {"factor": factor, "forward": forward, "backward": backward}
    c.counts |= {"factor": n.count, "forward": n.count, "backward": n.structural}


def add_contact_system(n: Network) -> None:
    """Copy of W for the solve in which loaded contacts stick, and W's rows by contact."""
    c = n.c
    first = n.structural
    guess, mask = c.header["guess"], c.header["mask"]
    outer = range(first, n.count)
    diagonal = {i: c.take(6) for i in outer}
    inverse = {i: c.take(6) for i in outer}
    pairs = [(i, j) for i in outer for j in n.pattern[i] if j >= first]
    v = {pair: c.take(9) for pair in pairs}
    p = {pair: c.take(9) for pair in pairs}
    copies: list[int] = []
    factor: list[int] = []
    forward: list[int] = []
    backward: list[int] = []
    for i in outer:
        slot = mask + 3 * n.order[i]
        for row in range(3):
            for column in range(row + 1):
                entry = lower(row, column)
                reference = n.reference[i] + row if row == column else -1
                copies += [
                    diagonal[i] + entry,
                    n.diagonal[i] + entry,
                    slot + row,
                    slot + column,
                ]
                copies.append(reference)
        columns = [j for j in n.pattern[i] if j >= first]
        factor += [diagonal[i], inverse[i], n.reference[i], n.order[i], len(columns)]
        forward += [guess + 3 * n.order[i], n.order[i], len(columns)]
        for j in columns:
            other = mask + 3 * n.order[j]
            for row in range(3):
                for column in range(3):
                    entry = 3 * row + column
                    rows = [slot + row, other + column]
                    copies += [v[i, j] + entry, n.a[i, j] + entry, *rows, -1]
            shared = [k for k in n.pattern[j] if k >= first and k in set(columns)]
            factor += [v[i, j], p[i, j], inverse[j], n.order[j], len(shared)]
            for k in shared:
                factor += [v[i, k], p[j, k], n.order[k]]
            forward += [p[i, j], guess + 3 * n.order[j], n.order[j]]
    for i in reversed(outer):
        later = [k for k in range(i + 1, n.count) if i in n.pattern[k]]
        backward += [guess + 3 * n.order[i], inverse[i], n.order[i], len(later)]
        for k in later:
            backward += [p[k, i], guess + 3 * n.order[k], n.order[k]]
    products: list[int] = []
    for block in range(first, n.count):
        i = n.place[block]
        others = [(n.a[i, j], j, 0) for j in n.pattern[i] if j >= first]
        others += [(n.a[k, i], k, 1) for k in range(i + 1, n.count) if i in n.pattern[k]]
        products += [3 * block, n.diagonal[i], block, n.reference[i], len(others)]
        for entry, k, transposed in others:
            products += [entry, 3 * n.order[k], transposed, n.order[k]]
    size = n.count - first
    c.header["dense"] = c.take(3 * size * (3 * size + 1)) if size <= DENSE_CONTACTS else -1
    c.sections |= {
        "contact_copies": copies, "contact_factor": factor, "contact_forward": forward,
        "contact_backward": backward, "contact_products": products,
    }  # fmt: skip
    c.counts |= {
        "contact_factor": size, "contact_forward": size, "contact_backward": size,
        "contact_products": size,
    }  # fmt: skip
