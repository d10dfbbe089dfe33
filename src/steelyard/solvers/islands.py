"""Islands: solids that contacts join, solved apart, each in an order that keeps the factor's envelope small.

Solids are visited breadth first from one end of the island, which a first visit finds, and eliminated in reverse
(Cuthill & McKee 1969; George 1971).
"""

from __future__ import annotations

from ..constraints.joint_rows import joint_at, joint_solids
from ..constraints.solids import is_free
from ..kernel import inner
from ..model.rigid_layout import (
    ADJACENT,
    DEGREES,
    END_A,
    END_B,
    FIRST,
    HELD,
    ISLAND,
    JOINTS,
    LIST,
    LOCAL,
    ORDER,
    SOLIDS,
    STARTS,
)
from .block_cholesky import SIX

#: Of what no visit has come to.
UNSEEN = -1
_SEEN, _DONE = -2, -3


@inner
def join_all(tape, s, n, rigid, count):
    """Bonds by so many contacts and by all joints, of what is free to move."""
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        a, b = joint_solids(tape, rigid, joint)
        one = tape[joint + 1] if is_free(s, a) else -1
        other = tape[joint + 2] if is_free(s, b) else -1
        # The first end of a bond can move.
        n[tape[rigid + END_A] + count + j] = one if one >= 0 else other
        n[tape[rigid + END_B] + count + j] = other if one >= 0 else -1
    _join(tape, n, rigid, count + tape[rigid + JOINTS])


@inner
def _join(tape, n, rigid, count):
    """Bonds of every solid, contacts and then joints, as lists one behind the other; no solid has an island yet."""
    solids = tape[rigid + SOLIDS]
    degrees = tape[rigid + DEGREES]
    adjacent = tape[rigid + ADJACENT]
    for i in range(solids + 1):
        n[degrees + i] = 0
    for i in range(solids):
        n[tape[rigid + LOCAL] + i] = UNSEEN
    for end in range(2):
        ends = tape[rigid + (END_A if end == 0 else END_B)]
        for i in range(count):
            solid = n[ends + i]
            if solid >= 0:
                n[degrees + solid] += 1
    total = 0
    for i in range(solids + 1):
        own = n[degrees + i]
        n[degrees + i] = total
        total += own
    # Each start moves to its list's end as the list fills, which is the next one's start: moved back below.
    for i in range(count):
        for end in range(2):
            solid = n[tape[rigid + (END_A if end == 0 else END_B)] + i]
            if solid >= 0:
                n[adjacent + n[degrees + solid]] = i
                n[degrees + solid] += 1
    for i in range(solids, 0, -1):
        n[degrees + i] = n[degrees + i - 1]
    n[degrees] = 0


@inner
def visit(tape, n, rigid, seed, mark):
    """Solids of the seed's island breadth first, into the order; how many. ``mark``: what they are marked with."""
    order = tape[rigid + ORDER]
    local = tape[rigid + LOCAL]
    degrees = tape[rigid + DEGREES]
    n[order] = seed
    n[local + seed] = mark
    size = 1
    at = 0
    while at < size:
        solid = n[order + at]
        for entry in range(n[degrees + solid], n[degrees + solid + 1]):
            contact = n[tape[rigid + ADJACENT] + entry]
            other = n[tape[rigid + END_A] + contact]
            if other == solid:
                other = n[tape[rigid + END_B] + contact]
            if other >= 0 and n[local + other] != mark:
                n[local + other] = mark
                n[order + size] = other
                size += 1
        at += 1
    return size


@inner
def gather_island(tape, n, rigid, seed, count):
    """The island of a solid: its solids in order of elimination, contacts, joints, and the factor's envelope.

    Bonds from ``count`` on are joints. Numbers of solids, contacts and joints and the factor's rows become those of the
    island at hand.
    """
    order = tape[rigid + ORDER]
    local = tape[rigid + LOCAL]
    degrees = tape[rigid + DEGREES]
    first = tape[rigid + FIRST]
    size = visit(tape, n, rigid, seed, _SEEN)
    size = visit(tape, n, rigid, n[order + size - 1], _DONE)
    for i in range(size // 2):
        other = n[order + size - 1 - i]
        n[order + size - 1 - i] = n[order + i]
        n[order + i] = other
    for i in range(size):
        n[local + n[order + i]] = i
        n[first + i] = i
    contacts = 0
    joints = 0
    for i in range(size):
        solid = n[order + i]
        for entry in range(n[degrees + solid], n[degrees + solid + 1]):
            contact = n[tape[rigid + ADJACENT] + entry]
            other = n[tape[rigid + END_A] + contact]
            if other == solid:
                other = n[tape[rigid + END_B] + contact]
            if other < 0 or n[local + other] < i:
                if contact < count:
                    n[tape[rigid + LIST] + contacts] = contact
                    contacts += 1
                else:
                    n[tape[rigid + HELD] + joints] = contact - count
                    joints += 1
                if other >= 0:
                    n[first + i] = min(n[first + i], n[local + other])
    rows = 0
    for i in range(size):
        n[tape[rigid + STARTS] + i] = rows
        rows += SIX * (i - n[first + i] + 1)
    island = tape[rigid + ISLAND]
    n[island] = size
    n[island + 1] = contacts
    n[island + 2] = joints
    n[island + 3] = rows
