"""Parameters of a model: values that a person may assign, shared by all worlds or one per world.

A parameter is stored as a person gives it, (size,) if shared and (size, worlds) if per world.
``Slot`` is a group of scratch rows computed from one or more of them. Shared slots are written into
every scratch once; slots that differ between worlds are laid out in one array that the stepping
kernel copies in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

#: The thing under which all particles' state and parameters are kept.
PARTICLES = "particles"
#: And all bodies'.
BODIES = "bodies"
#: Owner of what the contacts of bodies keep.
RIGID = "rigid"

Key = tuple[Any, str]


@dataclass(frozen=True)
class Slot:
    """Scratch rows ``row`` ... ``row + size - 1`` computed from parameters ``keys``."""

    row: int
    size: int
    keys: tuple[Key, ...]
    compute: Callable[..., np.ndarray]


class Parameters:
    """Values by key (thing, name), and the rows that follow from them."""

    def __init__(self) -> None:
        self.values: dict[Key, np.ndarray] = {}
        self.checks: dict[Key, Callable[[np.ndarray], None]] = {}
        self.slots: list[Slot] = []

    def declare(
        self, key: Key, value: Any, check: Callable[[np.ndarray], None] | None = None
    ) -> None:
        """Make ``value`` (a scalar or a vector) assignable under ``key``.

        Args:
            key: the thing and the parameter's name.
            value: what it is until something is assigned.
            check: raises where what is to be assigned does not go with other parameters; what the
                parameter alone must be, the thing's ``LIMITS`` say.
        """
        self.values[key] = np.atleast_1d(np.asarray(value, dtype=np.float64))
        if check is not None:
            self.checks[key] = check

    def rows(self, width: int) -> tuple[list[tuple[int, np.ndarray]], np.ndarray, np.ndarray]:
        """All slots evaluated.

        Args:
            width: padded number of worlds.

        Returns:
            Shared rows as (row, values (size,)), own rows (n, width) and their row numbers (n,).
        """
        shared = []
        own: list[np.ndarray] = []
        own_rows: list[int] = []
        for slot in self.slots:
            value = np.asarray(slot.compute(*(self.values[key] for key in slot.keys)))
            if value.ndim == 1:
                shared.append((slot.row, value))
            else:
                worlds = value.shape[1]
                padded = np.empty((value.shape[0], width))
                padded[:, :worlds] = value
                padded[:, worlds:] = value[:, -1:]
                own.append(padded)
                own_rows.extend(range(slot.row, slot.row + slot.size))
        stacked = np.concatenate(own) if own else np.empty((0, width))
        return shared, np.ascontiguousarray(stacked), np.asarray(own_rows, dtype=np.int64)
