"""Contacts: what touches what after a step, where, and with which force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..collision.manifold import IDS
from ..model.parameters import RIGID
from ..model.rigid_layout import STORED, T_ID, T_IMPULSE, T_PLACE

if TYPE_CHECKING:
    from ..world import World


@dataclass(frozen=True)
class Contacts:
    """Contacts of all worlds in a buffer of ``capacity`` places each, of which the first ``count`` are taken.

    Attributes:
        pairs: (thing, other thing) of every pair of colliders that can meet.
        pair: index of each contact's pair, -1 in places that are free, (worlds, capacity) int64.
        place: [m], (worlds, capacity, 3).
        impulse: on the pair's first thing [N s], in the second half of the last step, (worlds, capacity, 3).
        force: the same over the time in which it acted [N].
    """

    pairs: tuple[tuple[Any, Any], ...]
    pair: np.ndarray
    place: np.ndarray
    impulse: np.ndarray
    force: np.ndarray

    @property
    def count(self) -> np.ndarray:
        """Number of contacts, (worlds,)."""
        return (self.pair >= 0).sum(axis=1)

    def force_on(self, thing: Any) -> np.ndarray:
        """Sum of the contact forces on a thing [N], (worlds, 3)."""
        sign = np.array(
            [(a is thing) - (b is thing) for a, b in self.pairs] + [0], dtype=np.float64
        )
        total = np.einsum("wc,wck->wk", sign[self.pair], self.force)
        return np.asarray(total)


def contacts_of(world: World) -> Contacts:
    """See ``World.contacts``."""
    if (RIGID, "contacts") not in world.model.places:
        raise ValueError(
            f"World.contacts: {world.method.solver} keeps no list of contacts in this scene; it must be one for bodies "
            "that touch something. Use ProximalNewton()."
        )
    stored = world._view(RIGID, "contacts").reshape(world.worlds, -1, STORED)
    # What lies behind the last is of no meaning.
    taken = np.logical_and.accumulate(stored[..., T_ID] > 0.0, axis=1)
    pair = np.where(taken, (stored[..., T_ID].astype(np.int64) - 1) // IDS, -1)
    impulse = stored[..., T_IMPULSE : T_IMPULSE + 3].copy()
    return Contacts(
        pairs=world.model.met,
        pair=pair,
        place=stored[..., T_PLACE : T_PLACE + 3].copy(),
        impulse=impulse,
        force=impulse / (0.5 * world.method.substep),
    )
