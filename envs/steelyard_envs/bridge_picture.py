"""What Bridge looks like: deck, cables, winches, towers, load, level and wind."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

import steelyard as sy

Array = NDArray[np.float64]

BOARDS = 4  # boards per plank
TOWER, ANCHOR_HEIGHT = 6.3, 6.0  # place of the towers along x and height of the anchors [m]
CRATE = 0.34  # half the side of the load [m]
ARROW = 0.5  # length of the wind's arrow over its force [m/N]
_palette = sy.draw.palette


def draw_deck(drawing: sy.draw.Drawing, near: Array, far: Array) -> None:
    """Boards between node pairs, which lie on the cables along and the rods across.

    Args:
        drawing: What is added to.
        near: Nodes at z = -1, shape (pairs, 3) [m].
        far: Nodes at z = 1, of the same shape.
    """
    for k in range(len(near) - 1):
        for board in range(BOARDS):
            a, b = (board + 0.06) / BOARDS, (board + 0.94) / BOARDS
            corners = [
                side[k] + part * (side[k + 1] - side[k])
                for side, part in ((near, a), (near, b), (far, b), (far, a))
            ]
            drawing.face(corners, color=_palette.TIMBER, thickness=0.07)
        for side in (near, far):
            drawing.line(side[k], side[k + 1], color=_palette.ROPE, width=0.05)
    for a, b in zip(near, far, strict=True):
        drawing.line(a, b, color=_palette.STEEL, width=0.1)


def draw_cables(drawing: sy.draw.Drawing, nodes: Array, anchors: Array, pulls: Array) -> None:
    """Support cables from winches to nodes.

    Args:
        drawing: What is added to.
        nodes: Their lower ends, shape (cables, 3) [m].
        anchors: Their winches, of the same shape.
        pulls: Tension over the winch's stall, shape (cables,); from 1 on the cable is red.
    """
    for node, anchor, pull in zip(nodes, anchors, pulls, strict=True):
        color = _palette.TARGET if pull >= 1.0 else _palette.ROPE
        drawing.line(anchor, node, color=color, width=0.03)
        drawing.circle(node, 0.1, color=_palette.NODE)
        drawing.circle(anchor, 0.16, color=_palette.INK)


def draw_towers(drawing: sy.draw.Drawing) -> None:
    """Two gates and the beams that carry the winches."""
    for z in (-0.8, 0.8):
        beam = (-TOWER, ANCHOR_HEIGHT, z), (TOWER, ANCHOR_HEIGHT, z)
        drawing.line(*beam, color=_palette.STEEL, width=0.12)
        for x in (-TOWER, TOWER):
            drawing.line((x, 0.0, 1.6 * z), (x, ANCHOR_HEIGHT, z), color=_palette.STEEL, width=0.16)
    for x in (-TOWER, TOWER):
        for height, half in ((ANCHOR_HEIGHT, 0.8), (3.0, 1.04)):
            bar = (x, height, -half), (x, height, half)
            drawing.line(*bar, color=_palette.STEEL, width=0.12)


def draw_level(drawing: sy.draw.Drawing, height: float) -> None:
    """Dashes from tower to tower at the height that the deck should have."""
    for x in np.arange(-TOWER, TOWER - 0.2, 0.6):
        dash = (x, height, 1.3), (x + 0.3, height, 1.3)
        drawing.line(*dash, color=_palette.CONTACT, pixels=1.5)


def draw_load(drawing: sy.draw.Drawing, place: Array, along: Array, across: Array) -> None:
    """A crate that stands on the deck.

    Args:
        drawing: What is added to.
        place: Of the load on the deck [m].
        along: Direction along the deck, of any length.
        across: Direction across it, of any length.
    """
    along = along / np.linalg.norm(along)
    up = np.cross(across, along)
    up /= np.linalg.norm(up)
    across = np.cross(along, up)
    middle = place + (0.035 + CRATE) * up
    sides = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = np.array([middle + CRATE * (a * along + b * across) for a, b in sides])
    drawing.face(corners.tolist(), color=_palette.LOAD, thickness=2.0 * CRATE)


def draw_wind(drawing: sy.draw.Drawing, x: float, force: Array) -> None:
    """An arrow under the deck at ``x`` [m] along the force (x, z) [N] of the gust on a node."""
    strength = math.hypot(*force)
    if strength < 0.1:
        return
    along = np.array([force[0], 0.0, force[1]]) / strength
    aside = np.array([along[2], 0.0, -along[0]])
    tip = np.array([x, 1.0, 0.0]) + ARROW * strength * along
    ends = [-2.0 * ARROW * strength * along]
    ends += [0.2 * side * aside - 0.35 * along for side in (-1.0, 1.0)]
    for end in (tip + ends).tolist():
        drawing.line(tip.tolist(), end, color=_palette.WIND, pixels=3.0, layer=1)
