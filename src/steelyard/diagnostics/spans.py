"""What joins two particles, or a particle and an anchor, of all worlds at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.body import BodyPoint
from ..scene.shapes import rotation_matrix

if TYPE_CHECKING:
    from ..scene.particle import Particle
    from ..world import World


def values(world: World, things: Sequence[Any], name: str) -> np.ndarray:
    """A number of every thing, shape (1, things) where all worlds share them all, else (worlds, things)."""
    parts = [_value(world, thing, name) for thing in things]
    if all(part.ndim == 1 for part in parts):
        return np.concatenate(parts)[None]
    return np.concatenate([np.broadcast_to(part, (world.worlds, 1)) for part in parts], axis=1)


def spans(world: World, things: Sequence[Any]) -> np.ndarray:
    """From the second end to the first [m], shape (worlds, things, 3)."""
    place = {id(particle): p for p, particle in enumerate(world.scene.particles)}
    position = world.particles.position
    ends = [thing.a if hasattr(thing, "a") else thing.particle for thing in things]
    ends += [thing.b for thing in things if hasattr(thing, "b")]
    points = {id(end): end for end in ends if isinstance(end, BodyPoint)}
    if points:
        place |= {key: len(place) + k for k, key in enumerate(points)}
        placed = [place_of(world, point)[:, None] for point in points.values()]
        position = np.concatenate([position, *placed], axis=1)
    first = [place[id(end)] for end in ends[: len(things)]]
    second = np.empty((world.worlds, len(things), 3))
    for k, thing in enumerate(things):
        if not hasattr(thing, "b"):
            second[:, k] = _value(world, thing, "anchor")
    joined = [k for k, thing in enumerate(things) if hasattr(thing, "b")]
    second[:, joined] = position[:, [place[id(things[k].b)] for k in joined]]
    return np.asarray(position[:, first] - second)


def place_of(world: World, end: Particle | BodyPoint) -> np.ndarray:
    """Position of a particle or of a point of a body [m], shape (worlds, 3)."""
    k = world._index(end.body if isinstance(end, BodyPoint) else end)
    if not isinstance(end, BodyPoint):
        return world.particles.position[:, k]
    turn = rotation_matrix(world.bodies.orientation[:, k])
    return np.asarray(world.bodies.position[:, k] + turn @ np.array(end.place))


def _value(world: World, thing: Any, name: str) -> np.ndarray:
    """A parameter or a part of the state, (size,) or (worlds, size)."""
    if (thing, name) in world.model.places:
        return world._view(thing, name)
    return world._get((thing, name))
