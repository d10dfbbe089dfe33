"""Boundaries along one axis, many rows at a time: the worlds of a batch are the points of the search."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: Tells for points of shape (rows, points) which of them hold.
Holds = Callable[[Array], npt.NDArray[np.bool_]]


def first_loss(holds: Holds, rows: int, grid: Array, *, rounds: int) -> tuple[Array, Array]:
    """Where each row first stops holding on its way up the grid, and where it next holds again.

    Every round puts as many points as the grid has between the two that enclose the boundary, so it divides
    the bracket by so many.

    Args:
        holds: what to ask.
        rows: number of rows.
        grid: (points,) rising; narrower gaps between losses and gains than its own are not seen.
        rounds: rounds after the scan of the grid.

    Returns:
        Two arrays (rows,): 0 where a row never holds, inf where it never stops or never holds again.
    """
    scanned = holds(np.tile(grid, (rows, 1)))
    points = np.arange(len(grid))
    lost = np.where(scanned.all(axis=1), len(grid), scanned.argmin(axis=1))
    later = scanned & (points > lost[:, None])
    regained = np.where(later.any(axis=1), later.argmax(axis=1), len(grid))
    return (
        _refine(holds, grid, lost, True, rounds),
        _refine(holds, grid, regained, False, rounds),
    )


def _refine(
    holds: Holds, grid: Array, index: npt.NDArray[np.intp], held: bool, rounds: int
) -> Array:
    """Boundary of each row between the grid's points ``index - 1``, which is ``held``, and ``index``."""
    count = len(grid)
    inside = (index > 0) & (index < count)
    high = grid[np.clip(index, 1, count - 1)]
    low = grid[np.clip(index, 1, count - 1) - 1]
    share = np.linspace(0.0, 1.0, count)
    rows = np.arange(len(index))
    for _ in range(rounds):
        values = low[:, None] * (high / low)[:, None] ** share
        other = holds(values) != held
        # The ends are known.
        other[:, 0], other[:, -1] = False, True
        first = other.argmax(axis=1)
        low, high = values[rows, first - 1], values[rows, first]
    return np.where(inside, np.sqrt(low * high), np.where(index == 0, 0.0, np.inf))
