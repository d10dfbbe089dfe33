"""How far links are from what they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene.links import Cable, CableConstraint, RodConstraint
from ..scene.scene import LINKS

if TYPE_CHECKING:
    from ..world import World


def link_residuals(world: World) -> np.ndarray:
    """(distance - length)/length of every link, shape (worlds, links); slack cables count 0."""
    position = world.particles.position
    columns = []
    for link in world.scene.of(*LINKS):
        handle = world[link]
        if isinstance(link, RodConstraint | CableConstraint):
            apart = position[:, world._index(link.particle)] - handle.anchor
        else:
            apart = position[:, world._index(link.a)] - position[:, world._index(link.b)]
        over = np.linalg.norm(apart, axis=1) / handle.length - 1.0
        if isinstance(link, Cable | CableConstraint):
            over = np.maximum(over, 0.0)
        columns.append(over)
    return np.stack(columns, axis=1) if columns else np.zeros((world.worlds, 0))
