"""Sky, ground and grid behind every picture, as an array of pixels."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .camera import View

ZENITH = np.array([158, 190, 214], np.float32)
HAZE = np.array([243, 241, 235], np.float32)
GROUND = np.array([206, 209, 201], np.float32)
GRID = np.array([250, 250, 246], np.float32)

# Distances at which the ground and its grid have faded by 1/e, in camera distances.
GROUND_REACH = 4.0
GRID_REACH = 2.5
GRID_PIXELS = 1.3


def backdrop(view: View) -> NDArray[np.uint8]:
    """Paint what lies behind everything: a sky, and the ground y = 0 with a grid.

    Returns:
        Pixels, shape (height, width, 3).
    """
    rows = np.arange(view.height, dtype=np.float32) + 0.5
    up = (0.5 * view.height - rows) / view.focal
    # The camera does not roll, so how steeply a ray climbs depends on its row alone.
    climb = up * view.axes[1, 1] + view.axes[2, 1]
    picture = np.empty((view.height, view.width, 3), np.float32)

    sky = np.clip(climb, 0.0, 1.0)[:, None] ** 0.6
    picture[:] = (HAZE + sky * 1.3 * (ZENITH - HAZE))[:, None, :]

    if view.eye[1] > 0.0:
        below = climb < -1e-6
        picture[below] = _ground(view, up[below], climb[below])
    return np.clip(picture, 0.0, 255.0).astype(np.uint8)


def _ground(view: View, up: NDArray[np.float32], climb: NDArray[np.float32]) -> NDArray[np.float32]:
    """Colours of the rows of rays that meet the ground, shape (rows, width, 3)."""
    reach = (-view.eye[1] / climb).astype(np.float32)  # along a ray of depth 1, in metres
    near = np.exp(-reach / (GROUND_REACH * view.camera.distance))[:, None]
    base = HAZE + near * (GROUND - HAZE)

    columns = np.arange(view.width, dtype=np.float32) + 0.5
    across = (columns - 0.5 * view.width) / view.focal
    spacing = grid_spacing(view.camera.distance)
    cover = 1.0 - (1.0 - _stripes(view, up, climb, reach, across, 0, spacing)) * (
        1.0 - _stripes(view, up, climb, reach, across, 2, spacing)
    )
    cover *= np.exp(-reach / (GRID_REACH * view.camera.distance))[:, None]
    return base[:, None, :] + cover[:, :, None] * (GRID - base)[:, None, :]


def _stripes(
    view: View,
    up: NDArray[np.float32],
    climb: NDArray[np.float32],
    reach: NDArray[np.float32],
    across: NDArray[np.float32],
    axis: int,
    spacing: float,
) -> NDArray[np.float32]:
    """How much of each pixel the grid lines across one world axis cover, 0 to 1.

    A line is one pixel wide wherever it is; it fades where neighbours come closer than pixels,
    which is what keeps the far grid from flickering.
    """
    right, rise, ahead = (np.float32(part) for part in view.axes[:, axis])
    slope = (rise * up + ahead)[:, None] + right * across[None, :]
    place = np.float32(view.eye[axis]) + reach[:, None] * slope
    per_column = np.abs(reach * right)[:, None]
    per_row = np.abs(
        (reach * rise)[:, None] - (reach * np.float32(view.axes[1, 1]) / climb)[:, None] * slope
    )
    footprint = (per_column + per_row) / np.float32(view.focal)
    offset = np.abs(place - np.round(place / spacing) * np.float32(spacing))
    line = np.clip(0.5 * (GRID_PIXELS + 1.0) - offset / footprint, 0.0, 1.0)
    return line * np.clip(1.0 - 3.0 * footprint / spacing, 0.0, 1.0)


def grid_spacing(distance: float) -> float:
    """Grid spacing [m] for a camera distance [m]: 1, 2 or 5 times a power of ten."""
    wanted = distance / 6.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1.0 + 1e-9))
