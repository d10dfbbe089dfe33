"""Which colliders of one world may touch within the step: of few all pairs are tried, of many those that a tree finds.

A pair is told by its colliders a and b: its number is a times the number of colliders, plus b. Its order is fixed: the
first can move, and comes first in the scene if both can.

Pairs come in turns, of which each has few: without a tree a turn is a pair; with one every collider that can move has
a turn with half-spaces, and then all have one with others. So their order is the same.
"""

from __future__ import annotations

from ..constraints.solids import is_free, solid_at
from ..kernel import inner
from ..model.colliders import BOX, CAPSULE, HALF_SPACE, SIZE
from ..model.rigid_layout import (
    BOXES,
    COLLIDER,
    COLLIDER_RECORDS,
    COLLIDERS,
    GROUPS,
    MEETING,
    MEETING_RECORDS,
    NEAR,
    PAIR,
    PAIR_RECORDS,
    PAIRS,
    PARTING_RECORDS,
    PARTINGS,
    PLACED_WORK,
    PLANES,
    SOLID,
    SOLID_RECORDS,
    SOLIDS,
    TREES,
)
from .hierarchy import (
    BOX_NUMBERS,
    STACK,
    box_of,
    clear_tree,
    find_meeting,
    insert_leaf,
    is_ready,
    is_within,
    remove_leaf,
    tree_numbers,
    tree_words,
)
from .placement import MOVE, PLACED_ENTRIES, REACH

#: Colliders from which on a tree is kept.
MANY = 32
# By what boxes of the tree are larger than they must be: over the reach, and over what may move within a step.
_ROOM, _STEPS = 0.1, 2.0
# Share of leaves that have left their boxes from which on the tree is planted anew.
_STRAYED = 0.25


@inner
def _record(tape, rigid, i):
    """A collider's record."""
    return tape[rigid + COLLIDER_RECORDS] + COLLIDER * i


@inner
def _placed(tape, rigid, i):
    """A collider as it is placed."""
    return tape[rigid + PLACED_WORK] + PLACED_ENTRIES * i


@inner
def solid_of(tape, rigid, i):
    """Solid of a collider, -1 for scenery."""
    return tape[_record(tape, rigid, i) + 1]


@inner
def colliders_of_pair(tape, rigid, pair):
    """Both colliders of a pair."""
    return pair // tape[rigid + COLLIDERS], pair % tape[rigid + COLLIDERS]


@inner
def meeting_of(tape, rigid, a, b):
    """Record of how two colliders meet: rows of restitution and friction, -1 where they do not."""
    group = tape[_record(tape, rigid, a) + 4]
    other = tape[_record(tape, rigid, b) + 4]
    return tape[rigid + MEETING_RECORDS] + MEETING * (tape[rigid + GROUPS] * group + other)


@inner
def may_meet(tape, rigid, a, b):
    """Whether two colliders are of different things that may touch."""
    if tape[meeting_of(tape, rigid, a, b)] < 0:
        return False
    one = solid_of(tape, rigid, a)
    other = solid_of(tape, rigid, b)
    key = min(one, other) * tape[rigid + SOLIDS] + max(one, other)
    low = tape[rigid + PARTING_RECORDS]
    end = low + tape[rigid + PARTINGS]
    high = end
    while low < high:
        middle = (low + high) // 2
        if tape[middle] < key:
            low = middle + 1
        else:
            high = middle
    joined = low < end and tape[low] == key
    return one != other and not joined


@inner
def half_extent(s, kind, at, k):
    """Half the length [m] of a placed collider along an axis of the world."""
    if kind == CAPSULE:
        return s[at + SIZE] + s[at + SIZE + 1] * abs(s[at + 3 + 3 * k + 1])
    if kind != BOX:
        return s[at + SIZE]
    total = 0.0
    for j in range(3):
        total += s[at + SIZE + j] * abs(s[at + 3 + 3 * k + j])
    return total


@inner
def write_box(s, kind, at, margin, out):
    """The box about a placed collider and a margin; whether it is finite."""
    finite = True
    for k in range(3):
        half = half_extent(s, kind, at, k) + margin
        s[out + k] = s[at + k] - half
        s[out + 3 + k] = s[at + k] + half
        # Of what is not finite a difference is not 0.
        finite = finite and s[out + k] - s[out + k] + s[out + 3 + k] - s[out + 3 + k] == 0.0
    return finite


@inner
def _contains(s, outer, inside):
    """Whether a box holds another."""
    holds = True
    for k in range(3):
        holds = holds and s[outer + k] <= s[inside + k] and s[inside + 3 + k] <= s[outer + 3 + k]
    return holds


@inner
def _tree_of(tape, rigid, k):
    """Where words and boxes of the tree of lane k stand, and a box behind them."""
    leaves = tape[rigid + PLANES]
    boxes = tape[rigid + BOXES] + k * (tree_numbers(leaves) + BOX_NUMBERS)
    return tape[rigid + TREES] + k * tree_words(leaves), boxes, boxes + tree_numbers(leaves)


@inner
def follow_colliders(tape, s, n, rigid, k):
    """Let the tree of lane k, if there is one, know where the colliders are placed."""
    if tape[rigid + BOXES] < 0:
        return
    leaves = tape[rigid + PLANES]
    tree, boxes, box = _tree_of(tape, rigid, k)
    strayed = leaves
    if is_ready(n, tree):
        strayed = 0
        for i in range(leaves):
            at = _placed(tape, rigid, i)
            write_box(s, tape[_record(tape, rigid, i)], at, s[at + MOVE], box)
            if not _contains(s, box_of(boxes, i), box):
                strayed += 1
    if strayed > _STRAYED * leaves:
        # As after another block of worlds was stepped in the same memory.
        clear_tree(n, tree, leaves)
    for i in range(leaves):
        at = _placed(tape, rigid, i)
        kind = tape[_record(tape, rigid, i)]
        own = box_of(boxes, i)
        within = is_within(n, tree, i)
        write_box(s, kind, at, s[at + MOVE], box)
        if not (within and _contains(s, own, box)):
            if within:
                remove_leaf(n, tree, s, boxes, leaves, i)
            if write_box(s, kind, at, _ROOM * s[at + REACH] + _STEPS * s[at + MOVE], own):
                insert_leaf(n, tree, s, boxes, leaves, i)


@inner
def turns_of_pairs(tape, rigid):
    """In how many turns pairs come."""
    return tape[rigid + PAIRS] if tape[rigid + BOXES] < 0 else 2 * tape[rigid + COLLIDERS]


@inner
def near_pairs(tape, s, n, rigid, k, turn, within, moves):
    """Write pairs of a turn that may come near; how many (see ``pair_at``).

    Args:
        within: largest gap [m].
        moves: 1.0 to add what both may move within the step, else 0.0.
    """
    count = 0
    if tape[rigid + BOXES] < 0:
        record = tape[rigid + PAIR_RECORDS] + PAIR * turn
        count = _keep(tape, s, n, rigid, tape[record], tape[record + 1], within, moves, count)
        return count
    own = turn if turn < tape[rigid + COLLIDERS] else turn - tape[rigid + COLLIDERS]
    if own < tape[rigid + PLANES] and _is_movable(tape, s, rigid, own):
        if turn == own:
            for other in range(tape[rigid + PLANES], tape[rigid + COLLIDERS]):
                if may_meet(tape, rigid, own, other):
                    count = _keep(tape, s, n, rigid, own, other, within, moves, count)
        else:
            tree, boxes, box = _tree_of(tape, rigid, k)
            at = _placed(tape, rigid, own)
            margin = moves * s[at + MOVE] + max(within, 0.0)
            write_box(s, tape[_record(tape, rigid, own)], at, margin, box)
            leaves = tape[rigid + PLANES]
            found = tape[rigid + NEAR] + STACK
            hits = find_meeting(n, tree, s, boxes, leaves, box, tape[rigid + NEAR], found)
            for i in range(hits):
                other = n[found + i]
                # What moves has a turn of its own.
                wanted = other > own or (other < own and not _is_movable(tape, s, rigid, other))
                if wanted and may_meet(tape, rigid, own, other):
                    a = min(own, other)
                    b = max(own, other)
                    if not can_move(tape, rigid, a):
                        a, b = b, a
                    count = _keep(tape, s, n, rigid, a, b, within, moves, count)
    return count


@inner
def can_move(tape, rigid, i):
    """Whether the solid of a collider is none that never moves."""
    solid = solid_of(tape, rigid, i)
    return solid >= 0 and tape[tape[rigid + SOLID_RECORDS] + SOLID * solid + 7] != 0


@inner
def _is_movable(tape, s, rigid, i):
    """Whether anything moves a collider."""
    solid = solid_of(tape, rigid, i)
    return solid >= 0 and is_free(s, solid_at(tape, rigid, solid))


@inner
def _keep(tape, s, n, rigid, a, b, within, moves, count):
    """Write a pair behind ``count`` others if something moves it and it may come near; how many there are then."""
    one = _placed(tape, rigid, a)
    other = _placed(tape, rigid, b)
    margin = within + moves * (s[one + MOVE] + s[other + MOVE])
    free = _is_movable(tape, s, rigid, a) or _is_movable(tape, s, rigid, b)
    if free and not _apart(s, tape[_record(tape, rigid, b)], one, other, margin):
        at = _place_of(tape, rigid, count)
        n[at] = a
        n[at + 1] = b
        return count + 1
    return count


@inner
def _place_of(tape, rigid, i):
    """Where a pair of a turn is written: with a tree behind the nodes and leaves of its walk."""
    leaves = tape[rigid + PLANES] if tape[rigid + BOXES] >= 0 else 0
    stack = STACK if tape[rigid + BOXES] >= 0 else 0
    return tape[rigid + NEAR] + stack + leaves + 2 * i


@inner
def pair_at(tape, n, rigid, i):
    """Colliders of a pair of a turn."""
    at = _place_of(tape, rigid, i)
    return n[at], n[at + 1]


@inner
def _apart(s, kind, a, b, margin):
    """Whether the balls about two colliders, or that about a and a half-space b, are further apart than the margin."""
    dx = s[a] - s[b]
    dy = s[a + 1] - s[b + 1]
    dz = s[a + 2] - s[b + 2]
    reach = s[a + REACH] + s[b + REACH] + margin
    if kind == HALF_SPACE:
        return dx * s[b + 4] + dy * s[b + 7] + dz * s[b + 10] > reach
    return dx * dx + dy * dy + dz * dz > reach * reach
