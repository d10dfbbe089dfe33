"""Colliders: every shape of a scene that something can touch, as rows of arrays.

A collider placed in the world is ``PLACED`` numbers: its centre, its rotation row by row, and its sizes (of a sphere
the radius; of a capsule radius and half length, along y; of a box half the edges). A half-space has a point of its
plane for a centre, and its normal is its y axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..scene.body import Body
from ..scene.contacts import Ground
from ..scene.particle import Particle
from ..scene.scene import Scene
from ..scene.shapes import Capsule, Hollow, Shape, Sphere, rotation_matrix

SPHERE, BOX, CAPSULE, HALF_SPACE = range(4)
PLACED = 15
CENTRE, TURN, SIZE = 0, 3, 12


@dataclass(frozen=True)
class Colliders:
    """All colliders of a scene: parts of bodies first, then particles with a radius, then grounds.

    Attributes:
        kind: SPHERE, BOX, CAPSULE or HALF_SPACE, (n,) int64.
        owner: the body, particle or ground that each belongs to.
        place: centres in the frame of the owner [m], (n, 3).
        turn: rotations in that frame, (n, 3, 3).
        size: sizes [m], (n, 3).
    """

    kind: np.ndarray
    owner: tuple[Any, ...]
    place: np.ndarray
    turn: np.ndarray
    size: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    def of(self, *owners: Any) -> list[int]:
        """Which belong to the given things."""
        wanted = {id(thing) for thing in owners}
        return [k for k, thing in enumerate(self.owner) if id(thing) in wanted]


def kind_and_size(shape: Shape) -> tuple[int, tuple[float, float, float]]:
    """Kind and sizes [m] of a shape; a hollow one meets others by its outside."""
    if isinstance(shape, Hollow):
        return kind_and_size(shape.outer)
    if isinstance(shape, Sphere):
        return SPHERE, (shape.radius, 0.0, 0.0)
    if isinstance(shape, Capsule):
        return CAPSULE, (shape.radius, shape.half_length, 0.0)
    x, y, z = shape.half_size
    return BOX, (x, y, z)


def colliders_of(scene: Scene, *, points: bool = False) -> Colliders:
    """The colliders of a scene; ``points``: with particles that have no radius."""
    kinds: list[int] = []
    owners: list[Any] = []
    places: list[Any] = []
    turns: list[np.ndarray] = []
    sizes: list[tuple[float, float, float]] = []
    for body in scene.of(Body):
        for part in body.placed:
            kind, size = kind_and_size(part.shape)
            kinds.append(kind)
            owners.append(body)
            places.append(part.offset)
            turns.append(rotation_matrix(np.array(part.orientation)))
            sizes.append(size)
    for particle in scene.of(Particle):
        if points or particle.radius > 0.0:
            kinds.append(SPHERE)
            owners.append(particle)
            places.append(np.zeros(3))
            turns.append(np.eye(3))
            sizes.append((particle.radius, 0.0, 0.0))
    for ground in scene.of(Ground):
        kinds.append(HALF_SPACE)
        owners.append(ground)
        places.append(np.array(ground.normal) * ground.height)
        turns.append(frame_of(np.array(ground.normal)))
        sizes.append((0.0, 0.0, 0.0))
    return Colliders(
        kind=np.array(kinds, dtype=np.int64),
        owner=tuple(owners),
        place=np.array(places, dtype=np.float64).reshape(-1, 3),
        turn=np.array(turns, dtype=np.float64).reshape(-1, 3, 3),
        size=np.array(sizes, dtype=np.float64).reshape(-1, 3),
    )


def frame_of(normal: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) whose y axis is the unit vector ``normal``."""
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(normal, helper)
    x /= np.linalg.norm(x)
    return np.stack([x, normal, np.cross(x, normal)], axis=1)
