"""What Ballistic looks like: gun, target, shot, wind and marks on the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import steelyard as sy
from steelyard_envs.ballistic_flight import MUZZLE

Vector = Sequence[float] | NDArray[np.float64]

UP = np.array([0.0, 1.0, 0.0])
BARREL = 2.6
TRAIL = 40  # straight pieces of a trail
FAINT, MUTED = (150, 160, 160, 170), (128, 136, 138)
# The wind is shown by an arrow beside the gun, a metre long for so much wind [m/s].
WIND_PLACE, WIND_SCALE = (-5.0, 1.2, -1.0), 4.0
_palette = sy.draw.palette


def draw_field(drawing: sy.draw.Drawing, far: float, wind: Vector, *, seen: bool) -> None:
    """Rings on the ground up to the range ``far`` [m], and the wind (x, z) [m/s] as an arrow."""
    for reach in (0.25 * far, 0.5 * far, 0.75 * far, far):
        drawing.circle(
            (0.0, 0.01, 0.0), reach, color=FAINT, fill=False, normal=(0, 1, 0), width=0.1, layer=-1
        )
        place = (-0.42 * reach, 0.005 * far + 0.012 * reach, 0.907 * reach)
        drawing.text(f"{reach:g} m", position=place, color=MUTED)
    speed = math.hypot(*wind)
    note = f"wind {speed:.1f} m/s" + ("" if seen else " (hidden)")
    middle = np.array(WIND_PLACE)
    drawing.text(note, position=middle + UP, color=_palette.WIND)
    if speed > 0.0:
        along = np.array([wind[0], 0.0, wind[1]]) / speed
        aside = np.array([along[2], 0.0, -along[0]])
        length = max(speed / WIND_SCALE, 1.0)
        tip = middle + 0.5 * length * along
        drawing.line(middle - 0.5 * length * along, tip, color=_palette.WIND, pixels=3.0, layer=1)
        for side in (-1.0, 1.0):
            end = tip - 0.5 * along + 0.3 * side * aside
            drawing.line(tip, end, color=_palette.WIND, pixels=3.0, layer=1)


def draw_gun(drawing: sy.draw.Drawing, azimuth: float, elevation: float) -> None:
    """A turret on a slab, which turns with the barrel."""
    along = np.array([math.sin(azimuth), 0.0, math.cos(azimuth)])
    aside = np.array([along[2], 0.0, -along[0]])
    ring = (0.0, 0.02, 0.0)
    drawing.circle(ring, 1.4, color=_palette.EARTH, normal=(0, 1, 0), layer=-1)
    corners = [0.3 * UP + a * along + b * aside for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    drawing.face(corners, color=_palette.STEEL, thickness=0.6)
    pivot = MUZZLE * UP
    drawing.circle(pivot - 0.3 * UP, 0.8, color=_palette.STEEL)
    barrel = math.cos(elevation) * along + math.sin(elevation) * UP
    drawing.line(pivot, pivot + BARREL * barrel, color=_palette.INK, width=0.36)


def draw_target(drawing: sy.draw.Drawing, centre: Vector, radius: float) -> None:
    """A ball on a post, with rings that face the gun; its size is what counts as a hit."""
    x, y, z = centre
    reach = math.hypot(x, z)
    to_gun = np.array([-x / reach, 0.0, -z / reach])
    drawing.line((x, 0.0, z), (x, y, z), color=_palette.ROPE, width=0.15 * radius)
    drawing.circle((x, 0.02, z), 0.8 * radius, color=(20, 40, 50, 70), normal=(0, 1, 0), layer=-1)
    for k, part in enumerate((1.0, 0.75, 0.5, 0.25)):
        color = _palette.TARGET if k % 2 == 0 else _palette.NODE
        place = np.asarray(centre) + 0.02 * (k + 1) * to_gun
        drawing.circle(place, part * radius, color=color, normal=to_gun)


def draw_shot(
    drawing: sy.draw.Drawing,
    place: Vector,
    velocity: Vector,
    pull: Vector,
    drag: float,
    age: float,
    radius: float,
) -> None:
    """A shot after ``age`` [s] in flight, with a trail that fades towards the gun."""
    # The closed form holds backwards too.
    trail = [
        [sy.flight(place[c], velocity[c], pull[c], drag, time)[0] for c in range(3)]
        for time in np.linspace(-age, 0.0, TRAIL + 1)
    ]
    for k in range(TRAIL):
        share = (k + 1) / TRAIL
        color = (*_palette.LOAD, int(20 + 200 * share))
        width = (0.2 + 0.4 * share) * radius
        drawing.line(trail[k], trail[k + 1], color=color, width=width, pixels=2.0)
    drawing.circle(place, radius, color=_palette.SHOT)


def draw_mark(drawing: sy.draw.Drawing, place: Vector, radius: float, *, hit: bool) -> None:
    """Where the last shot ended: a burst on the target of that radius, or a stake in the ground."""
    if hit:
        for size, alpha in ((2.4, 70), (1.6, 130), (0.8, 230)):
            drawing.circle(place, size * radius, color=(*_palette.LOAD, alpha))
    elif place[1] < 0.1:
        x, y, z = place
        drawing.circle((x, 0.03, z), 1.2, color=(*_palette.SHOT, 120), normal=(0, 1, 0), layer=-1)
        drawing.line((x, y, z), (x, y + 1.5, z), color=_palette.CONTACT, width=0.12, pixels=2.0)
