"""On which side of the kinks of its forces a world is: bungees taut or slack, floats dry, partly in or under."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene.forces import AnchoredBungee, Bungee, Buoyancy
from .spans import place_of, spans, values

if TYPE_CHECKING:
    from ..world import World


def kink_sides(world: World) -> np.ndarray:
    """Whether each bungee is taut, then of each float whether it touches the water and whether it is wholly under.

    Returns:
        Shape (worlds, bungees + 2 floats), bool.
    """
    sides = [np.zeros((world.worlds, 0), dtype=bool)]
    bungees = world.scene.of(Bungee, AnchoredBungee)
    if bungees:
        length = np.linalg.norm(spans(world, bungees), axis=2)
        sides.append(length > values(world, bungees, "rest_length"))
    for force in world.scene.of(Buoyancy):
        handle = world[force]
        depth = handle.surface - place_of(world, force.particle)[:, 1]
        sides += [(depth > -handle.half_depth)[:, None], (depth > handle.half_depth)[:, None]]
    return np.concatenate(sides, axis=1)
