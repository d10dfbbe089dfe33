"""How deep surfaces lie in each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..collision.narrow_phase import ALL_POINTS, POINT, WORK, collide
from ..kernel import kernel
from ..math.pointers import doubles_at
from ..model.colliders import PLACED
from ..queries.placed import colliders_in, placed_colliders

if TYPE_CHECKING:
    from ..world import World

_OUT = 2 * PLACED
_MEMORY = _OUT + ALL_POINTS * POINT + WORK


@kernel
def _deepest(kinds, placed, pairs, memory, deepest):
    """Depth of the deepest point of all pairs, 0 without any, of every world into ``deepest``."""
    m = doubles_at(memory.ctypes.data)
    for w in range(placed.shape[0]):
        most = 0.0
        for p in range(pairs.shape[0]):
            a = pairs[p, 0]
            b = pairs[p, 1]
            for k in range(PLACED):
                m[k] = placed[w, a, k]
                m[PLACED + k] = placed[w, b, k]
            count = collide(m, kinds[a], 0, kinds[b], PLACED, _OUT, _OUT + ALL_POINTS * POINT, 0.0)
            for i in range(count):
                most = max(most, -m[_OUT + POINT * i + 3])
        deepest[w] = most


def penetration_of(world: World) -> np.ndarray:
    """See ``World.penetration``."""
    deepest = np.zeros(world.worlds)
    pairs = world.model.pairs
    if len(pairs):
        kinds = colliders_in(world).kind
        _deepest(kinds, placed_colliders(world), pairs, np.zeros(_MEMORY), deepest)
    return deepest
