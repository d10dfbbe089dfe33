"""The contacts of one world: pairs that are near, the points of each, and what the last step knew of them.

Pairs come from the broad phase and are tried by the narrow phase. A point is kept where the gap may close within
the step, so that fast bodies meet the surface and not what lies behind it. A full buffer keeps the deepest points.
Points take their impulse from the stored ones: by id, then, within their pair, from the nearest that is left; one to
one, since a point that serves two lets stacks fall.
"""

from __future__ import annotations

from ..constraints.brakes import has_brake, prepare_brake, release_brake
from ..constraints.contact_rows import (
    contact_at,
    contact_ends,
    contact_vector,
    length,
    prepare_rows,
    relative_velocity,
)
from ..constraints.solids import is_free, solid_at, symmetric_times
from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import (
    C_BEFORE,
    C_BRAKE_BEFORE,
    C_COMPLIANCE,
    C_EARLIER,
    C_FRICTION,
    C_GAP,
    C_HELD,
    C_ID,
    C_IMPULSE,
    C_LATE,
    C_LEAST,
    C_MOVED,
    C_PLACE,
    C_REBOUND,
    C_RESTITUTION,
    C_ROLLING,
    C_SPINNING,
    CAPACITY,
    COLLIDER,
    COLLIDER_RECORDS,
    COLLIDERS,
    END_A,
    END_B,
    MATCHED,
    NARROW_WORK,
    OVERFLOW_ROW,
    PLACED_WORK,
    POINTS_WORK,
    S_END,
    S_FREE,
    S_INVERSE_INERTIA,
    S_PLACE,
    S_STEP,
    S_VELOCITY,
    SOLID,
    SOLID_RECORDS,
    SOLIDS,
    STORED,
    STORED_ROW,
    T_BRAKE,
    T_HELD,
    T_ID,
    T_IMPULSE,
    T_PLACE,
    T_REBOUND,
)
from .broad_phase import (
    colliders_of_pair,
    follow_colliders,
    meeting_of,
    near_pairs,
    pair_at,
    solid_of,
    turns_of_pairs,
)
from .narrow_phase import IDS, POINT, collide
from .placement import MOVE, PLACED_ENTRIES, REACH

# Gap [m] beyond what both may move at which points are still kept: what just touches at the end must be known before.
_SLACK = 1e-9
# Solids that turn less against each other [rad] within a step turn no feature towards one that was not known: what
# they do besides, a plane between them that was held from the start still parts. Balls have no features.
_FAR = 0.05
# How far a point may be from a stored one of its pair to take its impulse, over the reach of its colliders.
_NEAR = 0.25


@inner
def _spin(tape, s, rigid, i, field):
    """Angular velocity in a field of a solid, or 0 where turning changes nothing: of balls, and of scenery (-1)."""
    if i < 0 or tape[tape[rigid + SOLID_RECORDS] + SOLID * i + 7] & 4 == 0:
        return 0.0, 0.0, 0.0
    at = solid_at(tape, rigid, i) + field + 3
    return s[at], s[at + 1], s[at + 2]


@inner
def _turn_far(tape, s, rigid, one, other, dt):
    """Whether two solids turn far against each other within a step, by the velocities with which they drift."""
    x, y, z = _spin(tape, s, rigid, one, S_STEP)
    u, v, w = _spin(tape, s, rigid, other, S_STEP)
    return dt * length(x - u, y - v, z - w) > _FAR


@inner
def any_turns_far(tape, s, rigid, dt):
    """Whether a solid turns far within the step, by its own velocity and the impulses of a solve."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        p = at + S_VELOCITY + 3
        x, y, z = symmetric_times(s, at + S_INVERSE_INERTIA, s[p], s[p + 1], s[p + 2])
        u, v, w = _spin(tape, s, rigid, i, S_FREE)
        # Half of it: two may turn against each other.
        far = dt * length(u + x, v + y, w + z) > 0.5 * _FAR
        if far and tape[tape[rigid + SOLID_RECORDS] + SOLID * i + 7] & 4 != 0:
            return True
    return False


@inner
def _ends(tape, s, rigid, a, b):
    """Solids of a pair of colliders, of which the second is -1 where nothing moves it."""
    return solid_of(tape, rigid, a), _movable(tape, s, rigid, solid_of(tape, rigid, b))


@inner
def _collide_pair(tape, s, rigid, a, b, within, moves):
    """Write the points of a pair; how many.

    Args:
        within: largest gap [m].
        moves: 1.0 to add what both may move within the step, else 0.0.
    """
    colliders = tape[rigid + COLLIDER_RECORDS]
    one = tape[rigid + PLACED_WORK] + PLACED_ENTRIES * a
    other = tape[rigid + PLACED_WORK] + PLACED_ENTRIES * b
    kind_a = tape[colliders + COLLIDER * a]
    kind_b = tape[colliders + COLLIDER * b]
    margin = within + moves * (s[one + MOVE] + s[other + MOVE])
    points = tape[rigid + POINTS_WORK]
    return collide(s, kind_a, one, kind_b, other, points, tape[rigid + NARROW_WORK], margin)


@inner
def _id(tape, rigid, a, b, source):
    """Id of a point of a pair, in a world."""
    return IDS * (a * tape[rigid + COLLIDERS] + b) + source


@inner
def _put_contact(tape, s, n, rigid, k, a, b, source, place):
    """Write a point of a pair as a contact."""
    one, other = _ends(tape, s, rigid, a, b)
    meeting = meeting_of(tape, rigid, a, b)
    c = contact_at(tape, rigid, place)
    for i in range(C_ID):
        s[c + i] = s[source + i]
    s[c + C_ID] = _id(tape, rigid, a, b, s[source + C_ID])
    s[c + C_RESTITUTION] = s[LANES * tape[meeting] + k]
    s[c + C_FRICTION] = s[LANES * tape[meeting + 1] + k]
    release_brake(s, c)
    if tape[meeting + 2] >= 0:
        s[c + C_SPINNING] = s[LANES * tape[meeting + 2] + k]
        s[c + C_ROLLING] = s[LANES * tape[meeting + 3] + k]
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
    follow_colliders(tape, s, n, rigid, k)
    for turn in range(turns_of_pairs(tape, rigid)):
        for i in range(near_pairs(tape, s, n, rigid, k, turn, _SLACK, 1.0)):
            a, b = pair_at(tape, n, rigid, i)
            for point in range(_collide_pair(tape, s, rigid, a, b, _SLACK, 1.0)):
                source = tape[rigid + POINTS_WORK] + POINT * point
                place = count
                if count == capacity:
                    lost = True
                    place = _shallowest(tape, s, rigid, count, s[source + C_GAP])
                if place >= 0:
                    _put_contact(tape, s, n, rigid, k, a, b, source, place)
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
def _begin_late(tape, s, n, rigid, i, deepest, dt):
    """Let a contact be solved where the step ends: its pair may be ``deepest`` [m] there, below 0."""
    c = contact_at(tape, rigid, i)
    a, b = contact_ends(tape, n, rigid, i)
    prepare_rows(s, c, a, b, S_END)
    u, _, _ = relative_velocity(s, c, a, b, S_STEP)
    # Never to part: that would take energy from nowhere.
    s[c + C_LEAST] = min(u + (deepest - s[c + C_GAP]) / dt, 0.0)
    s[c + C_LATE] = deepest - 1.0
    s[c + C_EARLIER] = 0.0
    s[c + C_FRICTION] = 0.0
    s[c + C_HELD] = 0.0
    s[c + C_MOVED] = 0.0
    s[c + C_REBOUND] = 0.0
    s[c + C_COMPLIANCE] = 0.0
    release_brake(s, c)
    # An impulse along another normal would be none of a start.
    for axis in range(3):
        s[c + C_IMPULSE + axis] = 0.0


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
    follow_colliders(tape, s, n, rigid, k)
    for turn in range(turns_of_pairs(tape, rigid)):
        for i in range(near_pairs(tape, s, n, rigid, k, turn, -slop, 0.0)):
            a, b = pair_at(tape, n, rigid, i)
            points = 0
            one, other = _ends(tape, s, rigid, a, b)
            if _turn_far(tape, s, rigid, one, other, dt):
                points = _collide_pair(tape, s, rigid, a, b, -slop, 0.0)
            deepest = 0.0
            if points > 0:
                first = _id(tape, rigid, a, b, 0)
                for j in range(known):
                    known_id = s[contact_at(tape, rigid, j) + C_ID]
                    if known_id >= first and known_id < first + IDS:
                        deepest = min(deepest, _foreseen(tape, s, n, rigid, j, dt))
            for point in range(points):
                source = tape[rigid + POINTS_WORK] + POINT * point
                place = count
                for j in range(known):
                    own = _id(tape, rigid, a, b, s[source + C_ID])
                    if s[contact_at(tape, rigid, j) + C_ID] == own:
                        place = j
                late = s[source + C_GAP] < deepest - slop
                if late and place >= capacity:
                    s[LANES * tape[rigid + OVERFLOW_ROW] + k] = 1.0
                elif late:
                    found = True
                    _put_contact(tape, s, n, rigid, k, a, b, source, place)
                    _begin_late(tape, s, n, rigid, place, deepest, dt)
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
        own = s[contact_at(tape, rigid, i) + C_GAP]
        if own > gap:
            gap = own
            found = i
    return found


@inner
def prepare_contacts(tape, s, n, rigid, count):
    """Frames and arms of all contacts."""
    for i in range(count):
        c = contact_at(tape, rigid, i)
        a = solid_at(tape, rigid, n[tape[rigid + END_A] + i])
        b = n[tape[rigid + END_B] + i]
        b = solid_at(tape, rigid, b) if b >= 0 else -1
        prepare_rows(s, c, a, b, S_PLACE)
        if has_brake(s, c):
            prepare_brake(s, c, a, b)


@inner
def _stored(tape, rigid, j, field, k):
    """Entry of a stored contact's field in lane k."""
    return LANES * (tape[rigid + STORED_ROW] + tape[rigid + STORED] * j + field) + k


@inner
def _take(tape, s, n, rigid, k, c, j):
    """Give a contact what is stored in place j."""
    at = _stored(tape, rigid, j, T_IMPULSE, k)
    t0, t1, t2 = contact_vector(s, c, s[at], s[at + LANES], s[at + 2 * LANES])
    s[c + C_BEFORE] = t0 if t0 > 0.0 else 0.0
    s[c + C_BEFORE + 1] = t1
    s[c + C_BEFORE + 2] = t2
    if has_brake(s, c):
        at = _stored(tape, rigid, j, T_BRAKE, k)
        t0, t1, t2 = contact_vector(s, c, s[at], s[at + LANES], s[at + 2 * LANES])
        s[c + C_BRAKE_BEFORE] = t0
        s[c + C_BRAKE_BEFORE + 1] = t1
        s[c + C_BRAKE_BEFORE + 2] = t2
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
        c = contact_at(tape, rigid, i)
        s[c + C_BEFORE] = 0.0
        s[c + C_BEFORE + 1] = 0.0
        s[c + C_BEFORE + 2] = 0.0
        for axis in range(3):
            s[c + C_BRAKE_BEFORE + axis] = 0.0
        s[c + C_REBOUND] = 0.0
        s[c + C_HELD] = 0.0
        s[c + C_MOVED] = 0.0
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
        c = contact_at(tape, rigid, i)
        if s[c + C_EARLIER] == 0.0:
            _match_nearest(tape, s, n, rigid, k, c, kept, old)


@inner
def _match_nearest(tape, s, n, rigid, k, c, kept, old):
    """Take from the nearest contact of the pair that serves no other."""
    pair = s[c + C_ID] // IDS
    a, _ = colliders_of_pair(tape, rigid, int(pair))
    reach = s[tape[rigid + PLACED_WORK] + PLACED_ENTRIES * a + REACH]
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
