"""Triggers in a world: looked at after every step, for all worlds at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from .model.colliders import BOX, CAPSULE, Colliders, kind_and_size
from .model.parameters import BODIES, PARTICLES
from .queries.casts import MEMORY
from .queries.placed import colliders_in
from .queries.triggers import LOOK_WORDS, POSES, TRIGGER_NUMBERS, TRIGGER_WORDS, look
from .scene.particle import Particle
from .scene.shapes import quaternion_times, rotation_matrix
from .scene.triggers import SEEN, Trigger

if TYPE_CHECKING:
    from .model.compile import Model
    from .world import World


@dataclass(frozen=True)
class Events:
    """What a trigger saw.

    What passed through within one step has both ``entered`` and ``left``. As seen from the trigger, paths are taken to
    be straight from where a step, or substep, begins to where it ends, and turns to be even.

    Attributes:
        things: what it looks for.
        inside: which of them are in it, (worlds, things) bool, after the last step; so all that follows.
        entered: which came in within that step.
        stayed: which were in it before too.
        left: which went out within it.
        entries: how often each has come in since the worlds began, or began anew, (worlds, things) int64.
        exits: how often each has gone out.
        entry_time: when each last came in [s], as ``World.time``; nan if never.
    """

    things: tuple[Any, ...]
    inside: np.ndarray
    entered: np.ndarray
    stayed: np.ndarray
    left: np.ndarray
    entries: np.ndarray
    exits: np.ndarray
    entry_time: np.ndarray


def events_of(world: World, trigger: Trigger) -> Events:
    """See ``World.events``."""
    if trigger not in world.scene or not isinstance(trigger, Trigger):
        raise KeyError(
            f"World.events: this {type(trigger).__name__} is no Trigger of the world's scene; add it."
        )
    seen = {name: world._view(trigger, name) for name in SEEN}
    inside, entered, left = (seen[name] > 0.0 for name in ("inside", "entered", "left"))
    return Events(
        things=tuple(trigger.watched(world.scene)),
        inside=inside,
        entered=entered,
        stayed=inside & ~entered,
        left=left,
        entries=seen["entries"].astype(np.int64),
        exits=seen["exits"].astype(np.int64),
        entry_time=seen["entry_time"].copy(),
    )


@dataclass(frozen=True)
class _Tables:
    """What the kernel is told of a model's triggers, see ``queries.triggers``.

    Attributes:
        poses: rows of the state that hold the poses of all things, and others.
        colliders: of the scene.
        arrays: of triggers, volumes, looks and balls.
    """

    poses: int
    colliders: Colliders
    arrays: tuple[np.ndarray, ...]


_known: WeakKeyDictionary[Model, _Tables] = WeakKeyDictionary()


def _tables(world: World) -> _Tables:
    """Laid out once for each model of a world."""
    if world.model not in _known:
        _known[world.model] = _lay_out(world)
    return _known[world.model]


def _lay_out(world: World) -> _Tables:
    places = world.model.places
    colliders = colliders_in(world)
    balls = _balls(colliders)
    triggers: list[Any] = []
    volumes: list[Any] = []
    looks: list[Any] = []
    radii: list[float] = []
    for trigger in world.scene.of(Trigger):
        things = trigger.watched(world.scene)
        if not things:
            continue
        kind, size = kind_and_size(trigger.shape)
        carrier = _rows(world, trigger.body)[:2]
        triggers.append(
            (kind, *carrier, len(looks), len(looks) + len(things), places[trigger, "inside"][0])
        )
        ball = _ball(kind, np.array(size))
        volumes.append((*size, *trigger.place, *trigger.orientation, ball))
        for thing in things:
            own = colliders.of(thing)
            place, turn, particle = _rows(world, thing)
            looks.append((place, turn, own[0], own[-1] + 1, particle))
            radii.append(balls[own].max())
    ends = [sum(places[key, name]) for key, name in _POSES if (key, name) in places]
    return _Tables(
        poses=max(ends, default=0),
        colliders=colliders,
        arrays=(
            np.array(triggers, dtype=np.int64).reshape(-1, TRIGGER_WORDS),
            np.array(volumes, dtype=np.float64).reshape(-1, TRIGGER_NUMBERS),
            np.array(looks, dtype=np.int64).reshape(-1, LOOK_WORDS),
            np.array(radii, dtype=np.float64),
        ),
    )


_POSES = ((PARTICLES, "position"), (BODIES, "position"), (BODIES, "orientation"))


def _rows(world: World, thing: Any) -> tuple[int, int, int]:
    """Rows of place and orientation of a thing, and which particle it is; -1 for what it has not."""
    if thing is None:
        return -1, -1, -1
    places, k = world.model.places, world._index(thing)
    if isinstance(thing, Particle):
        return places[PARTICLES, "position"][0] + 3 * k, -1, k
    return (
        places[BODIES, "position"][0] + 3 * k,
        places[BODIES, "orientation"][0] + 4 * k,
        -1,
    )


def _ball(kind: int, size: np.ndarray) -> float:
    """Radius [m] of the ball about a shape's centre that holds it."""
    if kind == BOX:
        return float(np.linalg.norm(size))
    return float(size[0] + size[1]) if kind == CAPSULE else float(size[0])


def _balls(colliders: Colliders) -> np.ndarray:
    """Radii [m] of balls about the origins of their owners that hold the colliders, (n,)."""
    own = [_ball(kind, size) for kind, size in zip(colliders.kind, colliders.size, strict=True)]
    return np.linalg.norm(colliders.place, axis=1) + np.array(own)


def poses(world: World) -> np.ndarray:
    """A copy of the state's first rows, which hold the poses of all things: where a step begins."""
    return world.state[: _tables(world).poses, : world.worlds].copy()


def watch(world: World, start: np.ndarray, fresh: bool) -> None:
    """Write to the state what all triggers see of a step, or a substep.

    ``start``: ``poses`` as it began; ``fresh``: it is a step, or the first substep of one.
    """
    tables = _tables(world)
    radius = world.model.parameters.values[PARTICLES, "radius"]
    colliders = tables.colliders
    look(
        *tables.arrays,
        colliders.kind,
        colliders.place,
        colliders.turn,
        colliders.size,
        np.ascontiguousarray(radius if radius.ndim == 2 else radius[:, None]),
        start,
        world.state,
        world.worlds,
        world.row(PARTICLES, "time"),
        world.method.substep,
        fresh,
        np.zeros(MEMORY),
        np.zeros(POSES),
    )


def pose_of(world: World, trigger: Trigger) -> tuple[np.ndarray, np.ndarray]:
    """Place and orientation, (3,) and (4,), or (worlds, 1, 3) and (worlds, 1, 4) where a body carries it."""
    place, turn = np.array(trigger.place), np.array(trigger.orientation)
    if trigger.body is None:
        return place, turn
    k = world._index(trigger.body)
    carried = world.bodies.orientation[:, k]
    centre = world.bodies.position[:, k] + rotation_matrix(carried) @ place
    return centre[:, None], quaternion_times(carried, turn)[:, None]
