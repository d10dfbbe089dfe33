"""How deep surfaces lie in each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..collision.broad_phase import MANY, can_move, may_meet
from ..collision.hierarchy import (
    BOX_NUMBERS,
    STACK,
    box_of,
    find_meeting,
    tree_numbers,
    tree_words,
)
from ..collision.narrow_phase import ALL_POINTS, POINT, WORK, collide
from ..kernel import inner, kernel
from ..math.pointers import doubles_at
from ..model.colliders import HALF_SPACE, PLACED
from ..model.tape import H_RIGID
from ..queries.casts import plant
from ..queries.placed import colliders_in, placed_colliders

if TYPE_CHECKING:
    from ..world import World

_OUT = 2 * PLACED
_WORK = _OUT + ALL_POINTS * POINT
_MEMORY = _WORK + WORK


@inner
def _depth(tape, m, kinds, placed, a, b):
    """Depth of the deepest point of two colliders that can meet, 0 without any."""
    rigid = tape[H_RIGID]
    most = 0.0
    if (can_move(tape, rigid, a) or can_move(tape, rigid, b)) and may_meet(tape, rigid, a, b):
        for k in range(PLACED):
            m[k] = placed[a, k]
            m[PLACED + k] = placed[b, k]
        for i in range(collide(m, kinds[a], 0, kinds[b], PLACED, _OUT, _WORK, 0.0)):
            most = max(most, -m[_OUT + POINT * i + 3])
    return most


@kernel
def _deepest(tape, kinds, placed, finite, memory, words, boxes, deepest):
    """Depth of the deepest point of all pairs, 0 without any, of every world into ``deepest``.

    ``finite`` tells which colliders have an end; the others stand behind them.
    """
    m = doubles_at(memory.ctypes.data)
    n = kinds.shape[0]
    box = boxes.shape[0] - BOX_NUMBERS
    found = words.shape[0] - n
    stack = found - STACK
    for w in range(placed.shape[0]):
        most = 0.0
        if n >= MANY:
            plant(kinds, placed[w], finite, words, boxes)
        for a in range(n):
            first = a + 1
            if n >= MANY and finite[a]:
                for k in range(BOX_NUMBERS):
                    boxes[box + k] = boxes[box_of(0, a) + k]
                for i in range(find_meeting(words, 0, boxes, 0, n, box, stack, found)):
                    if words[found + i] > a:
                        most = max(most, _depth(tape, m, kinds, placed[w], a, words[found + i]))
                while first < n and finite[first]:
                    first += 1
            for b in range(first, n):
                most = max(most, _depth(tape, m, kinds, placed[w], a, b))
        deepest[w] = most


def penetration_of(world: World) -> np.ndarray:
    """See ``World.penetration``."""
    deepest = np.zeros(world.worlds)
    if world.model.touching:
        kinds = colliders_in(world).kind
        words = np.zeros(tree_words(len(kinds)) + STACK + len(kinds), dtype=np.int64)
        boxes = np.zeros(tree_numbers(len(kinds)) + BOX_NUMBERS)
        _deepest(
            world.model.tape, kinds, placed_colliders(world), kinds != HALF_SPACE, np.zeros(_MEMORY), words, boxes,
            deepest,
        )  # fmt: skip
    return deepest
