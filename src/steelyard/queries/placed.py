"""Colliders of all worlds, placed: what queries look at."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Owned:
    """The colliders of a scene, and by the kind of their owners which these are and which owner each is of."""

    colliders: Colliders
    bodies: tuple[np.ndarray, np.ndarray]
    particles: tuple[np.ndarray, np.ndarray]
    grounds: tuple[int, ...]


_known: WeakKeyDictionary[Model, Owned] = WeakKeyDictionary()


def colliders_in(world: World) -> Colliders:
    """The colliders of a world's scene; particles without a radius are points."""
    return _owned(world).colliders


def _owned(world: World) -> Owned:
    """Found once for each model of a world."""
    if world.model not in _known:
        colliders = colliders_of(world.scene, points=True)
        place = {
            id(thing): k
            for kind in (Body, Particle)
            for k, thing in enumerate(world.scene.of(kind))
        }

        def of(kind: type) -> tuple[np.ndarray, np.ndarray]:
            own = [k for k, owner in enumerate(colliders.owner) if isinstance(owner, kind)]
            which = [place[id(colliders.owner[k])] for k in own]
            return np.array(own, dtype=np.int64), np.array(which, dtype=np.int64)

        grounds = tuple(k for k, owner in enumerate(colliders.owner) if isinstance(owner, Ground))
        _known[world.model] = Owned(colliders, of(Body), of(Particle), grounds)
    return _known[world.model]


def owners_in(world: World) -> tuple[tuple[Any, ...], np.ndarray]:
    """The things that have colliders, and which of them each collider is of."""
    things: list[Any] = []
    place: dict[int, int] = {}
    owners = colliders_in(world).owner
    for owner in owners:
        if id(owner) not in place:
            place[id(owner)] = len(things)
            things.append(owner)
    return tuple(things), np.array([place[id(owner)] for owner in owners], dtype=np.int64)


def placed_colliders(world: World) -> np.ndarray:
    """All colliders where they are now, (worlds, colliders, PLACED)."""
    owned = _owned(world)
    colliders = owned.colliders
    placed = np.zeros((world.worlds, len(colliders), PLACED))
    placed[..., SIZE : SIZE + 3] = colliders.size
    own, which = owned.bodies
    if len(own):
        turn = rotation_matrix(world.bodies.orientation[:, which])
        place = np.einsum("wkij,kj->wki", turn, colliders.place[own])
        placed[:, own, CENTRE : CENTRE + 3] = world.bodies.position[:, which] + place
        turned = turn @ colliders.turn[own]
        placed[:, own, TURN : TURN + 9] = turned.reshape(world.worlds, -1, 9)
    own, which = owned.particles
    if len(own):
        placed[:, own, CENTRE : CENTRE + 3] = world.particles.position[:, which]
        placed[:, own, TURN : TURN + 9] = np.eye(3).ravel()
        radius = np.atleast_2d(world._get((PARTICLES, "radius")))
        placed[:, own, SIZE] = np.broadcast_to(radius, (world.worlds, radius.shape[1]))[:, which]
    for k in owned.grounds:
        handle = world[colliders.owner[k]]
        normal = np.broadcast_to(handle.normal, (world.worlds, 3))
        height = np.broadcast_to(handle.height, (world.worlds,))
        placed[:, k, CENTRE : CENTRE + 3] = normal * height[:, None]
        placed[:, k, TURN + 1 : TURN + 9 : 3] = normal
    return placed
