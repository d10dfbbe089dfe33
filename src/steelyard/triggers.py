"""Triggers in a world: looked at after every step, for all worlds at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .queries.ask import Hits
from .scene.shapes import quaternion_times, rotation_matrix
from .scene.triggers import Trigger

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True)
class Events:
    """What a trigger saw.

    Attributes:
        things: what it looks for.
        inside: which of them are in it, (worlds, things) bool, after the last step; so all that follows.
        entered: which came in within that step.
        stayed: which were in it before too.
        left: which went out within it.
        entries: how often each has come in since the worlds began, or began anew, (worlds, things) int64.
        exits: how often each has gone out.
    """

    things: tuple[Any, ...]
    inside: np.ndarray
    entered: np.ndarray
    stayed: np.ndarray
    left: np.ndarray
    entries: np.ndarray
    exits: np.ndarray


def events_of(world: World, trigger: Trigger) -> Events:
    """See ``World.events``."""
    if trigger not in world.scene or not isinstance(trigger, Trigger):
        raise KeyError(
            f"World.events: this {type(trigger).__name__} is no Trigger of the world's scene; add it."
        )
    inside, before = (world._view(trigger, name) > 0.0 for name in ("inside", "before"))
    return Events(
        things=tuple(trigger.watched(world.scene)),
        inside=inside,
        entered=inside & ~before,
        stayed=inside & before,
        left=before & ~inside,
        entries=world._view(trigger, "entries").astype(np.int64),
        exits=world._view(trigger, "exits").astype(np.int64),
    )


def watch(world: World) -> None:
    """Write to the state what all triggers see now."""
    for trigger in world.scene.of(Trigger):
        things = trigger.watched(world.scene)
        if not things:
            continue
        place, turn = pose_of(world, trigger)
        hits = world.queries.overlap(trigger.shape, place, orientation=turn, only=things)
        now = _inside(hits, things)
        inside, before = world._view(trigger, "inside"), world._view(trigger, "before")
        before[:] = inside
        inside[:] = now
        world._view(trigger, "entries")[:] += now & (before == 0.0)
        world._view(trigger, "exits")[:] += ~now & (before > 0.0)


def pose_of(world: World, trigger: Trigger) -> tuple[np.ndarray, np.ndarray]:
    """Place and orientation, (3,) and (4,), or (worlds, 1, 3) and (worlds, 1, 4) where a body carries it."""
    place, turn = np.array(trigger.place), np.array(trigger.orientation)
    if trigger.body is None:
        return place, turn
    k = world._index(trigger.body)
    carried = world.bodies.orientation[:, k]
    centre = world.bodies.position[:, k] + rotation_matrix(carried) @ place
    return centre[:, None], quaternion_times(carried, turn)[:, None]


def _inside(hits: Hits, things: list[Any]) -> np.ndarray:
    """Which of the things were hit, (worlds, things)."""
    place = {id(thing): k for k, thing in enumerate(hits.things)}
    which = np.array([place[id(thing)] for thing in things])
    return np.asarray((hits.thing[:, 0, :, None] == which).any(axis=1))
