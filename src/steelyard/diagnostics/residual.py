"""How far links are from what they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene.links import Cable, CableConstraint
from ..scene.scene import LINKS
from .spans import spans, values

if TYPE_CHECKING:
    from ..world import World


def link_residuals(world: World) -> np.ndarray:
    """(distance - length)/length of every link, shape (worlds, links); slack cables count 0."""
    links = world.scene.of(*LINKS)
    if not links:
        return np.zeros((world.worlds, 0))
    over = np.linalg.norm(spans(world, links), axis=2) / values(world, links, "length") - 1.0
    cables = [k for k, link in enumerate(links) if isinstance(link, Cable | CableConstraint)]
    over[:, cables] = np.maximum(over[:, cables], 0.0)
    return np.asarray(over)
