"""Worst first: the source's resolver of contacts (Millington, *Game Physics Engine Development*, ch. 7).

After integration every violated rod, cable and contact becomes a contact with a normal, a penetration and a
restitution. Repeatedly the one that closes fastest is resolved: its velocity by an impulse, its penetration
by moving the particles in proportion to inverse mass; contacts that share a particle have their penetration
updated. Added here: Coulomb friction on contacts with scenery and between particles, as an impulse against
the tangential velocity of at most mu times the normal impulse.

As in the source, a contact resolved without penetration is taken to have moved its particles by what its place in
the list moved last, in this step or an earlier one; those moves are part of the state. Ties go to the
contact generated first. Its error does not fall with iterations; with many it can diverge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..collision.geometry import contact_geometry
from ..kernel import inner
from ..math.pointers import LANES, offset
from ..model.tape import (
    CONTACT,
    H_ACCELERATION,
    H_CONTACTS,
    H_CONTACTS_MOST,
    H_DT,
    H_ENDS,
    H_GENERATORS,
    H_LINKS,
    H_MOVES,
    H_PARTICLES,
    H_PASSES,
    H_POSITION,
    H_VALUES,
    LINK,
)
from ..stage import Stage, stage
from .base import Solver
from .body_settings import BodySettings
from .swept_bodies import SweptBodies

# Columns of the local contact list.
_NX, _NY, _NZ, _DEPTH, _RESTITUTION, _FRICTION, _MOVE_A, _MOVE_B = 0, 1, 2, 3, 4, 5, 6, 9


@dataclass(frozen=True)
class WorstFirst(BodySettings):
    """The source's contact resolver (see the module).

    Args:
        iterations: resolutions per step; 0 means twice the number of contacts found, as the source does.
        slop, broad_phase, contacts, rest_speed, rest_time: of scenes of bodies, see ``BodySettings``.
    """

    iterations: int = 0
    staged: ClassVar[bool] = False

    @property
    def for_bodies(self) -> Solver:
        """The worst contact or joint of bodies first."""
        per_row = self.iterations == 0
        return SweptBodies(
            passes=self.iterations or 2, worst=True, per_row=per_row, **self.body_settings
        )

    @property
    def stage(self) -> Stage:
        """Puts a half step on the constraints."""
        return worst_first_stage


@inner
def _add(s, record, lane, ends, values, count, nx, ny, nz, depth, restitution, friction):
    """Append a contact; ``ends`` keeps where its record lies on the tape."""
    ends[count] = record
    values[12 * count + _NX] = nx
    values[12 * count + _NY] = ny
    values[12 * count + _NZ] = nz
    values[12 * count + _DEPTH] = depth
    values[12 * count + _RESTITUTION] = restitution
    values[12 * count + _FRICTION] = friction
    return count + 1


@inner
def _find(tape, s, lane, ends, values):
    """All contacts of one world, in the order in which their generators were added."""
    count = 0
    links = tape[H_LINKS]
    contacts = tape[H_CONTACTS]
    at = tape[H_GENERATORS]
    for index in range(tape[at]):
        kind = tape[at + 1 + 2 * index]
        item = tape[at + 2 + 2 * index]
        if kind == 0:
            link = links + 1 + LINK * item
            xa = tape[link]
            xb = tape[link + 1]
            dx = s[xb, lane] - s[xa, lane]
            dy = s[xb + 1, lane] - s[xa + 1, lane]
            dz = s[xb + 2, lane] - s[xa + 2, lane]
            size = math.sqrt(dx * dx + dy * dy + dz * dz)
            over = size - s[tape[link + 8], lane]
            cable = tape[link + 10] != 0
            if (over >= 0.0 if cable else over != 0.0) and size > 0.0:
                sign = 1.0 if cable or over > 0.0 else -1.0
                scale = sign * (1.0 / size)
                count = _add(
                    s,
                    link,
                    lane,
                    ends,
                    values,
                    count,
                    dx * scale,
                    dy * scale,
                    dz * scale,
                    abs(over),
                    s[tape[link + 11], lane] if cable else 0.0,
                    0.0,
                )
        else:
            contact = contacts + 1 + CONTACT * item
            gap = s[tape[contact + 17], lane]
            if gap < 0.0:
                frame = tape[contact + 16]
                count = _add(
                    s,
                    contact,
                    lane,
                    ends,
                    values,
                    count,
                    s[frame, lane],
                    s[frame + 1, lane],
                    s[frame + 2, lane],
                    -gap,
                    s[tape[contact + 13], lane],
                    s[tape[contact + 14], lane],
                )
    return count


@inner
def _separation(s, lane, va, vb, values, c):
    """Separating velocity along the normal."""
    x = s[va, lane] - s[vb, lane]
    y = s[va + 1, lane] - s[vb + 1, lane]
    z = s[va + 2, lane] - s[vb + 2, lane]
    return x * values[12 * c + _NX] + y * values[12 * c + _NY] + z * values[12 * c + _NZ]


@inner
def _rows(tape, links_end, record):
    """Rows (xa, xb, va, vb, ma, mb) of a link or contact record."""
    if record < links_end:
        return (
            tape[record],
            tape[record + 1],
            tape[record + 2],
            tape[record + 3],
            tape[record + 6],
            tape[record + 7],
        )
    return (
        tape[record + 1],
        tape[record + 2],
        tape[record + 3],
        tape[record + 4],
        tape[record + 7],
        tape[record + 8],
    )


@inner
def _resolve(tape, s, lane, position, zero_row, rows, values, c, dt):
    """Velocity, friction and penetration of one contact."""
    xa, xb, va, vb, ma, mb = rows
    inverse_a = s[ma, lane]
    inverse_b = s[mb, lane]
    total = inverse_a + inverse_b
    if total <= 0.0:
        return
    restitution = values[12 * c + _RESTITUTION]
    speed = _separation(s, lane, va, vb, values, c)
    if speed <= 0.0:
        wanted = -speed * restitution
        # Speed that this step's acceleration alone brought is not bounced: it would never come to rest.
        gained = 0.0
        for k in range(3):
            pull = 0.0
            if xa < zero_row:
                pull += s[tape[H_ACCELERATION] + xa - position + k, lane]
            if xb < zero_row:
                pull -= s[tape[H_ACCELERATION] + xb - position + k, lane]
            gained += pull * values[12 * c + k]
        gained *= dt
        if gained < 0.0:
            wanted += restitution * gained
            if wanted < 0.0:
                wanted = 0.0
        impulse = (wanted - speed) / total
        for k in range(3):
            push = values[12 * c + k] * impulse
            s[va + k, lane] += push * inverse_a
            if inverse_b > 0.0:
                s[vb + k, lane] += push * -inverse_b
        friction = values[12 * c + _FRICTION]
        if friction > 0.0:
            speed = _separation(s, lane, va, vb, values, c)
            x = s[va, lane] - s[vb, lane] - speed * values[12 * c + _NX]
            y = s[va + 1, lane] - s[vb + 1, lane] - speed * values[12 * c + _NY]
            z = s[va + 2, lane] - s[vb + 2, lane] - speed * values[12 * c + _NZ]
            slip = math.sqrt(x * x + y * y + z * z)
            if slip > 0.0:
                brake = min(slip / total, friction * impulse) / slip
                for k, part in enumerate((x, y, z)):
                    s[va + k, lane] -= part * brake * inverse_a
                    if inverse_b > 0.0:
                        s[vb + k, lane] += part * brake * inverse_b
    depth = values[12 * c + _DEPTH]
    if depth > 0.0:
        for k in range(3):
            move = values[12 * c + k] * (depth / total)
            values[12 * c + _MOVE_A + k] = move * inverse_a
            s[xa + k, lane] += move * inverse_a
            if inverse_b > 0.0:
                values[12 * c + _MOVE_B + k] = move * -inverse_b
                s[xb + k, lane] += move * -inverse_b
            else:
                values[12 * c + _MOVE_B + k] = 0.0


@inner
def _resolve_world(tape, s, lane, ends, values, position, zero_row, dt):
    """Resolve the contacts of one world of the block.

    Args:
        ends: work entries, tape positions of contacts.
        values: work entries, rows of twelve per contact.
        position: first row of the positions.
        zero_row: rows from here on are no particle's.
    """
    moves = tape[H_MOVES]
    for c in range(tape[H_CONTACTS_MOST]):
        for k in range(6):
            values[12 * c + _MOVE_A + k] = s[moves + 6 * c + k, lane]
    count = _find(tape, s, lane, ends, values)
    links = tape[H_LINKS]
    links_end = links + 1 + LINK * tape[links]
    limit = tape[H_PASSES] if tape[H_PASSES] > 0 else 2 * count
    for _ in range(limit):
        worst = -1
        lowest = math.inf
        for c in range(count):
            rows = _rows(tape, links_end, ends[c])
            speed = _separation(s, lane, rows[2], rows[3], values, c)
            if speed < lowest and (speed < 0.0 or values[12 * c + _DEPTH] > 0.0):
                lowest = speed
                worst = c
        if worst < 0:
            break
        rows = _rows(tape, links_end, ends[worst])
        _resolve(tape, s, lane, position, zero_row, rows, values, worst, dt)
        for c in range(count):
            other = _rows(tape, links_end, ends[c])
            for end in range(2):
                x = other[end]
                if x >= zero_row:
                    continue
                moved = -1
                if x == rows[0]:
                    moved = _MOVE_A
                elif x == rows[1]:
                    moved = _MOVE_B
                if moved >= 0:
                    along = 0.0
                    for k in range(3):
                        along += values[12 * worst + moved + k] * values[12 * c + k]
                    values[12 * c + _DEPTH] += along if end == 1 else -along
    for c in range(tape[H_CONTACTS_MOST]):
        for k in range(6):
            s[moves + 6 * c + k, lane] = values[12 * c + _MOVE_A + k]


@stage
def worst_first_stage(tape, s, skip, half):
    """Contacts of the source's method, world after world."""
    contact_geometry(tape, s)
    past = tape[H_POSITION] + 3 * tape[H_PARTICLES]
    ends = offset(skip, tape[H_ENDS])
    values = offset(s, LANES * tape[H_VALUES])
    for k in range(LANES):
        _resolve_world(tape, s, k, ends, values, tape[H_POSITION], past, s[tape[H_DT], k])
