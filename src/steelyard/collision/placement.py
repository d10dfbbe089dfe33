"""Colliders of one world where the step has them, from the solids they belong to."""

from __future__ import annotations

from ..constraints.contact_rows import length
from ..constraints.solids import solid_at
from ..kernel import inner
from ..math.pointers import LANES, doubles_at
from ..model.colliders import HALF_SPACE, PLACED, SPHERE
from ..model.rigid_layout import (
    COLLIDER,
    COLLIDER_RECORDS,
    COLLIDERS,
    G_PLACE,
    G_REACH,
    G_SIZE,
    G_TURN,
    GEOMETRY,
    NUMBERS,
    PLACED_WORK,
    S_FREE,
    S_MOVES,
    S_TURNS,
    SETTINGS,
)

#: Behind what the narrow phase reads of a placed collider: its reach and how far it may move within the step [m].
REACH, MOVE, PLACED_ENTRIES = PLACED, PLACED + 1, PLACED + 2


@inner
def place_colliders(tape, s, rigid, k, dt, place, rotation):
    """All colliders of lane k in the world, with solids as in the fields ``place`` and ``rotation``."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    record = tape[rigid + COLLIDER_RECORDS]
    at = tape[rigid + PLACED_WORK]
    for _ in range(tape[rigid + COLLIDERS]):
        kind = tape[record]
        row = tape[record + 3]
        if kind == HALF_SPACE:
            _place_plane(s, row, k, at)
            s[at + REACH] = 0.0
            s[at + MOVE] = 0.0
        else:
            g = SETTINGS + GEOMETRY * tape[record + 2]
            solid = solid_at(tape, rigid, tape[record + 1])
            turn = solid + rotation
            for i in range(3):
                r0 = s[turn + 3 * i]
                r1 = s[turn + 3 * i + 1]
                r2 = s[turn + 3 * i + 2]
                p = g + G_PLACE
                s[at + i] = s[solid + place + i] + (
                    r0 * numbers[p] + r1 * numbers[p + 1] + r2 * numbers[p + 2]
                )
                for j in range(3):
                    t = g + G_TURN + j
                    s[at + 3 + 3 * i + j] = (
                        r0 * numbers[t] + r1 * numbers[t + 3] + r2 * numbers[t + 6]
                    )
                s[at + 12 + i] = numbers[g + G_SIZE + i]
            reach = numbers[g + G_REACH]
            if kind == SPHERE and row >= 0:
                reach = s[LANES * row + k]
                s[at + 12] = reach
            s[at + REACH] = reach
            v = solid + S_FREE
            speed = s[solid + S_MOVES] * length(s[v], s[v + 1], s[v + 2])
            if s[solid + S_TURNS] != 0.0:
                arm = reach + length(
                    s[at] - s[solid + place],
                    s[at + 1] - s[solid + place + 1],
                    s[at + 2] - s[solid + place + 2],
                )
                speed += arm * length(s[v + 3], s[v + 4], s[v + 5])
            s[at + MOVE] = speed * dt
        record += COLLIDER
        at += PLACED_ENTRIES


@inner
def _place_plane(s, row, k, at):
    """A half-space from the rows of its unit normal and its height."""
    x = s[LANES * row + k]
    y = s[LANES * (row + 1) + k]
    z = s[LANES * (row + 2) + k]
    height = s[LANES * (row + 3) + k]
    s[at] = height * x
    s[at + 1] = height * y
    s[at + 2] = height * z
    for i in range(12):
        s[at + 3 + i] = 0.0
    s[at + 4] = x
    s[at + 7] = y
    s[at + 10] = z
