"""Motion and links in one sparse factorisation: the matrix of ``model.saddle``, assembled, factorised, solved.

    [M (1 + r c) - r D - r'^2 K + sum of l (1, -1; -1, 1)   J^T] [dx]   [right side of the particles]
    [J                                                      0  ] [dl] = [right side of the links    ]

The sum is the geometric stiffness of links with multiplier l, tension over length: the second derivative of l g with
g = (d.d - L^2)/2, which on the constraint is the familiar tension (1 - u u^T)/length and needs no square root. Links
that push count nothing in it, so the matrix of the motion is positive definite. Slack cables have no row in J and -1 on
the diagonal. A rider's rows are constant.
"""

from __future__ import annotations

from ..constraints.riders import DECK, HEAD
from ..integrators.implicit import (
    UNKNOWN,
    add_drag_blocks,
    add_float_blocks,
    add_spring_blocks,
)
from ..kernel import inner
from ..math.lanes import fma, load, select, splat, store
from ..math.pointers import axes
from ..model.tape import (
    H_BACKWARD,
    H_CONSTANTS,
    H_DAMPING,
    H_FACTOR,
    H_FORWARD,
    H_LINKS,
    H_MASS,
    H_MATRIX,
    H_MATRIX_ROWS,
    H_REACH,
    H_RIDERS,
    H_SADDLE_LINKS,
    H_SADDLE_RIDERS,
    H_UNKNOWNS,
    LINK,
    SADDLE_LINK,
)
from ..stage import stage
from . import sparse_ldl

# What is solved for: positions at the step's end, or accelerations and velocities, in which masses alone resist.
MOTION, MASSES = 0, 1
# Constants of a method that uses this matrix: 0 is r'^2, 1 is r / r'^2.
_SQUARE, _RATE = 0, 1


@inner
def _masses(tape, s, rate):
    zero = splat(0.0)
    for row in range(tape[H_MATRIX_ROWS]):
        store(s, tape[H_MATRIX] + row, zero)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        mass = load(s, tape[H_MASS] + tape[k + 1])
        mass = fma(mass * rate, load(s, tape[H_DAMPING] + tape[k + 1]), mass)
        target = tape[k + 3]
        store(s, target, mass)
        store(s, target + 2, mass)
        store(s, target + 5, mass)


@inner
def _links(tape, s, square):
    """Rows of J and the geometric stiffness, times ``square``."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        k = tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index
        taut = load(s, tape[link + 15])
        store(s, tape[k + 1], taut - splat(1.0))
        d = tape[link + 13]
        for axis in range(axes(s)):
            part = taut * load(s, d + axis)
            if tape[k + 2] >= 0:
                store(s, tape[k + 2] + axis, part)
            if tape[k + 3] >= 0:
                store(s, tape[k + 3] + axis, -part)
        pull = square * load(s, tape[link + 12]) * taut
        lowest = load(s, tape[k + 9])
        pull = select(pull > lowest, pull, lowest)
        for axis in range(axes(s)):
            own = axis * (axis + 3) // 2
            a = tape[k + 4] + own
            b = tape[k + 5] + own
            store(s, a, load(s, a) + pull)
            store(s, b, load(s, b) + pull)
            both = tape[k + 6 + axis]
            store(s, both, load(s, both) - pull)


@inner
def _riders(tape, s):
    one = splat(1.0)
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        count = tape[at + 6]
        for p in range(count + 1):
            for axis in range(axes(s)):
                entry = tape[k + 1 + 3 * p + axis]
                if entry >= 0:
                    value = one if p == 0 else load(s, tape[at + 9] + p - 1)
                    store(s, entry, value)
        at += HEAD + DECK * count
        k += 4 + 3 * count


@stage
def solve_saddle(tape, s, skip, part):
    """Right sides := matrix^-1 right sides; ``part`` is MOTION or MASSES."""
    zero = splat(0.0)
    square = load(s, tape[H_CONSTANTS] + _SQUARE)
    rate = square * load(s, tape[H_CONSTANTS] + _RATE)
    if part == MASSES:
        square = zero
        rate = zero
    _masses(tape, s, rate)
    if part == MOTION:
        reach = load(s, tape[H_REACH])
        add_spring_blocks(tape, s, reach)
        add_drag_blocks(tape, s, rate)
        add_float_blocks(tape, s, reach)
    _links(tape, s, square)
    _riders(tape, s)
    sparse_ldl.factor(tape, tape[H_FACTOR], s)
    sparse_ldl.forward(tape, tape[H_FORWARD], s)
    sparse_ldl.backward(tape, tape[H_BACKWARD], s)
