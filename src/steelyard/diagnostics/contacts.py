"""Contacts: what touches what after a step, where, and with which force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..collision.manifold import IDS
from ..model.parameters import RIGID
from ..model.rigid_layout import STORED, T_BRAKE, T_ID, T_IMPULSE, T_PLACE
from ..model.tape import H_RIGID
from ..queries.placed import owners_in

if TYPE_CHECKING:
    from ..world import World


@dataclass(frozen=True)
class Contacts:
    """Contacts of all worlds in a buffer of ``capacity`` places each, of which the first ``count`` are taken.

    Attributes:
        things: bodies, particles and grounds that something can touch.
        first: index of each contact's first thing among them, which can move; -1 in places that are free,
            (worlds, capacity) int64.
        second: index of its other thing.
        place: [m], (worlds, capacity, 3).
        impulse: on the first thing [N s], in the second half of the last step, (worlds, capacity, 3).
        force: the same over the time in which it acted [N].
        torque: of spinning and rolling on the first thing [N m].
    """

    things: tuple[Any, ...]
    first: np.ndarray
    second: np.ndarray
    place: np.ndarray
    impulse: np.ndarray
    force: np.ndarray
    torque: np.ndarray

    @property
    def count(self) -> np.ndarray:
        """Number of contacts, (worlds,)."""
        return (self.first >= 0).sum(axis=1)

    def force_on(self, thing: Any) -> np.ndarray:
        """Sum of the contact forces on a thing [N], (worlds, 3)."""
        index = next((k for k, known in enumerate(self.things) if known is thing), None)
        sign = (self.first == index).astype(np.float64) - (self.second == index)
        return np.asarray(np.einsum("wc,wck->wk", sign, self.force))


def contacts_of(world: World) -> Contacts:
    """See ``World.contacts``."""
    if (RIGID, "contacts") not in world.model.places:
        raise ValueError(
            f"World.contacts: {world.method.solver} keeps no list of contacts in this scene; it must be one for bodies "
            "that touch something. Use ProximalNewton()."
        )
    rigid = world.model.tape[H_RIGID]
    size = int(world.model.tape[rigid + STORED])
    stored = world._view(RIGID, "contacts").reshape(world.worlds, -1, size)
    # What lies behind the last is of no meaning.
    taken = np.logical_and.accumulate(stored[..., T_ID] > 0.0, axis=1)
    pair = np.where(taken, (stored[..., T_ID].astype(np.int64) - 1) // IDS, 0)
    things, index = owners_in(world)
    first, second = (np.where(taken, index[ends], -1) for ends in divmod(pair, len(index)))
    impulse = stored[..., T_IMPULSE : T_IMPULSE + 3].copy()
    turning = np.zeros_like(impulse)
    if size > T_BRAKE:
        turning = stored[..., T_BRAKE : T_BRAKE + 3].copy()
    duration = 0.5 * world.method.substep
    return Contacts(
        things=things,
        first=first,
        second=second,
        place=stored[..., T_PLACE : T_PLACE + 3].copy(),
        impulse=impulse,
        force=impulse / duration,
        torque=turning / duration,
    )
