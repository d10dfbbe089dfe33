"""Health: what has gone wrong in which world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.parameters import PARTICLES, RIGID

if TYPE_CHECKING:
    from ..world import World

NONFINITE, UNSETTLED, OUT_OF_RANGE, OVERFLOW = 1, 2, 4, 8


def health_flags(world: World) -> np.ndarray:
    """Flags of every world, shape (worlds,) uint8, see ``World.health``."""
    broken = world._view(PARTICLES, "nonfinite")[:, 0] > 0.0
    late = world._view(PARTICLES, "unsettled")[:, 0] > 0.0
    flags = NONFINITE * broken + UNSETTLED * late
    for thing, name in world.model.places:
        if name == "length":
            wound_up = ~(world._view(thing, name)[:, 0] > 0.0)
            flags |= OUT_OF_RANGE * wound_up
    if (RIGID, "overflow") in world.model.places:
        flags |= OVERFLOW * (world._view(RIGID, "overflow")[:, 0] > 0.0)
    return flags.astype(np.uint8)
