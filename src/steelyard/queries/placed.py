"""Colliders of all worlds, placed: what queries and triggers look at."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from ..model.colliders import CENTRE, PLACED, SIZE, TURN, Colliders, colliders_of
from ..model.parameters import PARTICLES
from ..scene.body import Body
from ..scene.contacts import Ground
from ..scene.particle import Particle
from ..scene.shapes import rotation_matrix

if TYPE_CHECKING:
    from ..model.compile import Model
    from ..world import World

_known: WeakKeyDictionary[Model, Colliders] = WeakKeyDictionary()


def colliders_in(world: World) -> Colliders:
    """The colliders of a world's scene, found once for each of its models; particles without a radius are points."""
    if world.model not in _known:
        _known[world.model] = colliders_of(world.scene, points=True)
    return _known[world.model]


def placed_colliders(world: World) -> np.ndarray:
    """All colliders where they are now, (worlds, colliders, PLACED)."""
    colliders = colliders_in(world)
    placed = np.zeros((world.worlds, len(colliders), PLACED))
    placed[..., SIZE : SIZE + 3] = colliders.size
    owned = _by_kind(colliders)
    if owned[Body]:
        own = owned[Body]
        which = [world._index(colliders.owner[k]) for k in own]
        turn = rotation_matrix(world.bodies.orientation)[:, which]
        place = np.einsum("wkij,kj->wki", turn, colliders.place[own])
        placed[:, own, CENTRE : CENTRE + 3] = world.bodies.position[:, which] + place
        turned = turn @ colliders.turn[own]
        placed[:, own, TURN : TURN + 9] = turned.reshape(world.worlds, -1, 9)
    if owned[Particle]:
        own = owned[Particle]
        which = [world._index(colliders.owner[k]) for k in own]
        placed[:, own, CENTRE : CENTRE + 3] = world.particles.position[:, which]
        placed[:, own, TURN : TURN + 9] = np.eye(3).ravel()
        radius = np.atleast_2d(world._get((PARTICLES, "radius")))
        placed[:, own, SIZE] = np.broadcast_to(radius, (world.worlds, radius.shape[1]))[:, which]
    for k in owned[Ground]:
        handle = world[colliders.owner[k]]
        normal = np.broadcast_to(handle.normal, (world.worlds, 3))
        height = np.broadcast_to(handle.height, (world.worlds,))
        placed[:, k, CENTRE : CENTRE + 3] = normal * height[:, None]
        placed[:, k, TURN + 1 : TURN + 9 : 3] = normal
    return placed


def _by_kind(colliders: Colliders) -> dict[Any, list[int]]:
    """Numbers of the colliders of bodies, particles and grounds."""
    kinds: dict[Any, list[int]] = {Body: [], Particle: [], Ground: []}
    for k, owner in enumerate(colliders.owner):
        kinds[next(kind for kind in kinds if isinstance(owner, kind))].append(k)
    return kinds
