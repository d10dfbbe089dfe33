"""How a load on a deck is shared by the particles around it."""

from __future__ import annotations

import numpy as np


def bilinear_weights(x: np.ndarray | float, z: np.ndarray | float) -> np.ndarray:
    """Shares of the four corners (x0 z0), (x0 z1), (x1 z0), (x1 z1) of a cell.

    Args:
        x: place across the cell, in [0, 1], any shape.
        z: place along the other side, in [0, 1], the same shape.

    Returns:
        Weights of shape (..., 4) with sum 1.
    """
    x = np.asarray(x, dtype=np.float64)
    z = np.asarray(z, dtype=np.float64)
    return np.stack([(1 - x) * (1 - z), (1 - x) * z, x * (1 - z), x * z], axis=-1)


def lumped_masses(base: np.ndarray, weights: np.ndarray, load: float) -> np.ndarray:
    """Masses [kg] of a deck on which a load is spread, instead of a Rider.

    Cheaper than a rider and wrong in two ways: the load's share has the inertia of the corners, not of a
    mass at its place, and its motion over the deck pushes nothing.

    Args:
        base: masses of the bare deck [kg], shape (particles,).
        weights: shares, shape (..., particles), 0 away from the load.
        load: mass of the load [kg].
    """
    return np.asarray(base) + load * np.asarray(weights)
