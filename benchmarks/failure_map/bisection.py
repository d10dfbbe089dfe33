"""Boundaries along one axis, many rows at a time: the worlds of a batch are the points of the search."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: Tells for points of shape (rows, points) which of them hold.
Holds = Callable[[Array], npt.NDArray[np.bool_]]


def first_loss(
    holds: Holds, rows: int, grid: Array, *, rounds: int, points: int
) -> tuple[Array, Array]:
    """Where each row first stops holding on its way up the grid, and where it next holds again.

    Args:
        holds: what to ask.
        rows: number of rows.
        grid: (n,) rising; narrower gaps between losses and gains than its own are not seen.
        rounds: rounds after the scan of the grid.
        points: points a round puts between the two that enclose a boundary; 1 bisects.

    Returns:
        Two arrays (rows,): 0 where a row never holds, inf where it never stops or never holds again.
    """
    scanned = holds(np.tile(grid, (rows, 1)))
    count = np.arange(len(grid))
    lost = np.where(scanned.all(axis=1), len(grid), scanned.argmin(axis=1))
    later = scanned & (count > lost[:, None])
    regained = np.where(later.any(axis=1), later.argmax(axis=1), len(grid))
    found = []
    for index, held in ((lost, True), (regained, False)):
        inside = (index > 0) & (index < len(grid))
        edge = np.where(index == 0, 0.0, np.inf)
        if inside.any():
            edge = np.where(inside, _refine(holds, grid, index, held, rounds, points), edge)
        found.append(edge)
    return found[0], found[1]


def _refine(
    holds: Holds, grid: Array, index: npt.NDArray[np.intp], held: bool, rounds: int, points: int
) -> Array:
    """Boundary of each row between the grid's points ``index - 1``, which is ``held``, and ``index``."""
    high = grid[np.clip(index, 1, len(grid) - 1)]
    low = grid[np.clip(index, 1, len(grid) - 1) - 1]
    share = np.linspace(0.0, 1.0, points + 2)
    rows = np.arange(len(index))
    for _ in range(rounds):
        values = low[:, None] * (high / low)[:, None] ** share
        other = np.ones(values.shape, dtype=bool)
        # The ends are known.
        other[:, 0] = False
        other[:, 1:-1] = holds(values[:, 1:-1]) != held
        first = other.argmax(axis=1)
        low, high = values[rows, first - 1], values[rows, first]
    return np.sqrt(low * high)
