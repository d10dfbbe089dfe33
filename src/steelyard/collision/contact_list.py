"""The contacts of one world: pairs that are near, the points of each, and what the last step knew of them.

Pairs are tried by balls about their colliders, then by the narrow phase. A point is kept where the gap may close within
the step, so that fast bodies meet the surface and not what lies behind it. A full buffer keeps the deepest points.
Points take their impulse from the stored ones: by id, then, within their pair, from the nearest that is left; one to
one, since a point that serves two lets stacks fall.
"""

from __future__ import annotations

from ..constraints.contact_rows import (
    contact_at,
    contact_ends,
    contact_vector,
    length,
    prepare_rows,
    relative_velocity,
)
from ..constraints.solids import is_free, solid_at
from ..kernel import inner
from ..math.pointers import LANES, doubles_at
from ..model.colliders import HALF_SPACE, PLACED, SPHERE
from ..model.rigid_layout import (
    C_BEFORE,
    C_COMPLIANCE,
    C_EARLIER,
    C_FRICTION,
    C_GAP,
    C_HELD,
    C_ID,
    C_IMPULSE,
    C_LATE,
    C_LEAST,
    C_PLACE,
    C_REBOUND,
    C_RESTITUTION,
    CAPACITY,
    COLLIDER,
    COLLIDER_RECORDS,
    COLLIDERS,
    CONTACT_ENTRIES,
    CONTACT_WORK,
    END_A,
    END_B,
    G_PLACE,
    G_REACH,
    G_SIZE,
    G_TURN,
    GEOMETRY,
    MATCHED,
    NARROW_WORK,
    NUMBERS,
    OVERFLOW_ROW,
    PAIR,
    PAIR_RECORDS,
    PAIRS,
    PLACED_WORK,
    POINTS_WORK,
    S_END,
    S_FREE,
    S_MOVES,
    S_PLACE,
    S_STEP,
    S_TURNS,
    SETTINGS,
    STORED,
    STORED_ROW,
    T_HELD,
    T_ID,
    T_IMPULSE,
    T_PLACE,
    T_REBOUND,
)
from .narrow_phase import IDS, POINT, collide

# Gap [m] beyond what both may move at which points are still kept: what just touches at the end must be known before.
_SLACK = 1e-9
# What moves less within a step, over its reach, turns no feature towards another that was not known.
_FAR = 0.05
# How far a point may be from a stored one of its pair to take its impulse, over the reach of its colliders.
_NEAR = 0.25

# Behind what the narrow phase reads of a placed collider: its reach and how far it may move within the step.
_REACH, _MOVE, PLACED_ENTRIES = PLACED, PLACED + 1, PLACED + 2


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
            s[at + _REACH] = 0.0
            s[at + _MOVE] = 0.0
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
            s[at + _REACH] = reach
            v = solid + S_FREE
            speed = s[solid + S_MOVES] * length(s[v], s[v + 1], s[v + 2])
            if s[solid + S_TURNS] != 0.0:
                arm = reach + length(
                    s[at] - s[solid + place],
                    s[at + 1] - s[solid + place + 1],
                    s[at + 2] - s[solid + place + 2],
                )
                speed += arm * length(s[v + 3], s[v + 4], s[v + 5])
            s[at + _MOVE] = speed * dt
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


@inner
def _apart(s, kind, a, b, margin):
    """Whether the balls about two colliders, or that about a and a half-space b, are further apart than the margin."""
    dx = s[a] - s[b]
    dy = s[a + 1] - s[b + 1]
    dz = s[a + 2] - s[b + 2]
    reach = s[a + _REACH] + s[b + _REACH] + margin
    if kind == HALF_SPACE:
        return dx * s[b + 4] + dy * s[b + 7] + dz * s[b + 10] > reach
    return dx * dx + dy * dy + dz * dz > reach * reach


@inner
def is_fast(tape, s, rigid):
    """Whether a collider may move far within the step, over its reach."""
    at = tape[rigid + PLACED_WORK]
    for _ in range(tape[rigid + COLLIDERS]):
        if s[at + _MOVE] > _FAR * s[at + _REACH]:
            return True
        at += PLACED_ENTRIES
    return False


@inner
def _pair_solids(tape, s, rigid, pair):
    """Solids of a pair, of which the second is -1 where nothing moves it, and whether something moves one of them."""
    record = tape[rigid + PAIR_RECORDS] + PAIR * pair
    colliders = tape[rigid + COLLIDER_RECORDS]
    one = tape[colliders + COLLIDER * tape[record] + 1]
    other = _movable(tape, s, rigid, tape[colliders + COLLIDER * tape[record + 1] + 1])
    return one, other, other >= 0 or _movable(tape, s, rigid, one) >= 0


@inner
def _collide_pair(tape, s, rigid, pair, within, moves):
    """Write the points of a pair; how many.

    Args:
        within: largest gap [m].
        moves: 1.0 to add what both may move within the step, else 0.0.
    """
    record = tape[rigid + PAIR_RECORDS] + PAIR * pair
    placed = tape[rigid + PLACED_WORK]
    colliders = tape[rigid + COLLIDER_RECORDS]
    a = placed + PLACED_ENTRIES * tape[record]
    b = placed + PLACED_ENTRIES * tape[record + 1]
    kind_b = tape[colliders + COLLIDER * tape[record + 1]]
    margin = within + moves * (s[a + _MOVE] + s[b + _MOVE])
    if _apart(s, kind_b, a, b, margin):
        return 0
    kind_a = tape[colliders + COLLIDER * tape[record]]
    points = tape[rigid + POINTS_WORK]
    return collide(s, kind_a, a, kind_b, b, points, tape[rigid + NARROW_WORK], margin)


@inner
def _put_contact(tape, s, n, rigid, k, pair, source, place, one, other):
    """Write a point of a pair as a contact."""
    record = tape[rigid + PAIR_RECORDS] + PAIR * pair
    c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * place
    for i in range(C_ID):
        s[c + i] = s[source + i]
    s[c + C_ID] = IDS * pair + s[source + C_ID]
    s[c + C_RESTITUTION] = s[LANES * tape[record + 2] + k]
    s[c + C_FRICTION] = s[LANES * tape[record + 3] + k]
    n[tape[rigid + END_A] + place] = one
    n[tape[rigid + END_B] + place] = other


@inner
def find_contacts(tape, s, n, rigid, k, kept):
    """Write the contacts of lane k, of what is free to move, to the work area; how many.

    Args:
        kept: places of the buffer that are taken by what sleeps.
    """
    capacity = tape[rigid + CAPACITY] - kept
    count = 0
    lost = False
    for pair in range(tape[rigid + PAIRS]):
        one, other, free = _pair_solids(tape, s, rigid, pair)
        if free:
            for point in range(_collide_pair(tape, s, rigid, pair, _SLACK, 1.0)):
                source = tape[rigid + POINTS_WORK] + POINT * point
                place = count
                if count == capacity:
                    lost = True
                    place = _shallowest(tape, s, rigid, count, s[source + C_GAP])
                if place >= 0:
                    _put_contact(tape, s, n, rigid, k, pair, source, place, one, other)
                    if count < capacity:
                        count += 1
    if lost:
        s[LANES * tape[rigid + OVERFLOW_ROW] + k] = 1.0
    return count


@inner
def _foreseen(tape, s, n, rigid, i, dt):
    """Depth that a contact may have where the step ends: that of the start, or what the solve has left it."""
    c = contact_at(tape, rigid, i)
    late = abs(s[c + C_LATE])
    if late > 0.0:
        return 1.0 - late
    a, b = contact_ends(tape, n, rigid, i)
    u, _, _ = relative_velocity(s, c, a, b, S_STEP)
    return s[c + C_GAP] + dt * min(u, 0.0)


@inner
def find_late_contacts(tape, s, n, rigid, k, kept, count, dt, slop):
    """Add the contacts of lane k that overlap where the step ends, with velocities that would not let them.

    One that is known already is taken as it is there. What overlapped from the start may stay as deep, and what the
    solve left to overlap too.

    Returns:
        How many contacts there are then, and whether there is a new one.
    """
    capacity = tape[rigid + CAPACITY] - kept
    known = count
    found = False
    for pair in range(tape[rigid + PAIRS]):
        one, other, free = _pair_solids(tape, s, rigid, pair)
        points = _collide_pair(tape, s, rigid, pair, -slop, 0.0) if free else 0
        if points > 0:
            deepest = 0.0
            for i in range(known):
                c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i
                if s[c + C_ID] // IDS == pair:
                    deepest = min(deepest, _foreseen(tape, s, n, rigid, i, dt))
            for point in range(points):
                source = tape[rigid + POINTS_WORK] + POINT * point
                place = count
                for i in range(known):
                    c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i
                    if s[c + C_ID] == IDS * pair + s[source + C_ID]:
                        place = i
                late = s[source + C_GAP] < deepest - slop
                if late and place >= capacity:
                    s[LANES * tape[rigid + OVERFLOW_ROW] + k] = 1.0
                elif late:
                    found = True
                    c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * place
                    _put_contact(tape, s, n, rigid, k, pair, source, place, one, other)
                    a = solid_at(tape, rigid, one)
                    b = solid_at(tape, rigid, other) if other >= 0 else -1
                    prepare_rows(s, c, a, b, S_END)
                    u, _, _ = relative_velocity(s, c, a, b, S_STEP)
                    # Never to part: that would take energy from nowhere.
                    s[c + C_LEAST] = min(u + (deepest - s[c + C_GAP]) / dt, 0.0)
                    s[c + C_LATE] = deepest - 1.0
                    s[c + C_EARLIER] = 0.0
                    s[c + C_FRICTION] = 0.0
                    s[c + C_HELD] = 0.0
                    s[c + C_REBOUND] = 0.0
                    s[c + C_COMPLIANCE] = 0.0
                    # An impulse along another normal would be none of a start.
                    for axis in range(3):
                        s[c + C_IMPULSE + axis] = 0.0
                    if place == count:
                        count += 1
    return count, found


@inner
def _movable(tape, s, rigid, i):
    """A solid's index, or -1 where nothing moves it."""
    return i if i >= 0 and is_free(s, solid_at(tape, rigid, i)) else -1


@inner
def _shallowest(tape, s, rigid, count, gap):
    """The contact with the largest gap, or -1 if that is no larger than ``gap``."""
    found = -1
    for i in range(count):
        own = s[tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i + C_GAP]
        if own > gap:
            gap = own
            found = i
    return found


@inner
def prepare_contacts(tape, s, n, rigid, count):
    """Frames and arms of all contacts."""
    for i in range(count):
        c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i
        a = solid_at(tape, rigid, n[tape[rigid + END_A] + i])
        b = n[tape[rigid + END_B] + i]
        prepare_rows(s, c, a, solid_at(tape, rigid, b) if b >= 0 else -1, S_PLACE)


@inner
def _stored(tape, rigid, j, field, k):
    """Entry of a stored contact's field in lane k."""
    return LANES * (tape[rigid + STORED_ROW] + STORED * j + field) + k


@inner
def _take(tape, s, n, rigid, k, c, j):
    """Give a contact what is stored in place j."""
    at = _stored(tape, rigid, j, T_IMPULSE, k)
    t0, t1, t2 = contact_vector(s, c, s[at], s[at + LANES], s[at + 2 * LANES])
    s[c + C_BEFORE] = t0 if t0 > 0.0 else 0.0
    s[c + C_BEFORE + 1] = t1
    s[c + C_BEFORE + 2] = t2
    s[c + C_REBOUND] = s[_stored(tape, rigid, j, T_REBOUND, k)]
    s[c + C_HELD] = s[_stored(tape, rigid, j, T_HELD, k)]
    s[c + C_EARLIER] = 1.0
    n[tape[rigid + MATCHED] + j] = 1


@inner
def match_contacts(tape, s, n, rigid, k, count, kept):
    """Impulses and rebounds of the stored contacts, but of those that sleep, to those at hand."""
    old = kept
    capacity = tape[rigid + CAPACITY]
    while old < capacity and s[_stored(tape, rigid, old, T_ID, k)] > 0.0:
        n[tape[rigid + MATCHED] + old] = 0
        old += 1
    hint = kept
    for i in range(count):
        c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i
        s[c + C_BEFORE] = 0.0
        s[c + C_BEFORE + 1] = 0.0
        s[c + C_BEFORE + 2] = 0.0
        s[c + C_REBOUND] = 0.0
        s[c + C_HELD] = 0.0
        s[c + C_EARLIER] = 0.0
        wanted = s[c + C_ID] + 1.0
        for step in range(old - kept):
            j = hint + step
            if j >= old:
                j -= old - kept
            if s[_stored(tape, rigid, j, T_ID, k)] == wanted:
                _take(tape, s, n, rigid, k, c, j)
                hint = j + 1
                break
    for i in range(count):
        c = tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i
        if s[c + C_EARLIER] == 0.0:
            _match_nearest(tape, s, n, rigid, k, c, kept, old)


@inner
def _match_nearest(tape, s, n, rigid, k, c, kept, old):
    """Take from the nearest contact of the pair that serves no other."""
    pair = s[c + C_ID] // IDS
    a = tape[rigid + PAIR_RECORDS] + PAIR * int(pair)
    reach = s[tape[rigid + PLACED_WORK] + PLACED_ENTRIES * tape[a] + _REACH]
    least = (_NEAR * reach) ** 2
    nearest = -1
    for j in range(kept, old):
        stored = s[_stored(tape, rigid, j, T_ID, k)] - 1.0
        if n[tape[rigid + MATCHED] + j] == 0 and stored // IDS == pair:
            at = _stored(tape, rigid, j, T_PLACE, k)
            dx = s[at] - s[c + C_PLACE]
            dy = s[at + LANES] - s[c + C_PLACE + 1]
            dz = s[at + 2 * LANES] - s[c + C_PLACE + 2]
            square = dx * dx + dy * dy + dz * dz
            if square < least:
                least = square
                nearest = j
    if nearest >= 0:
        _take(tape, s, n, rigid, k, c, nearest)
