"""Sleep: an island at rest for a while is neither solved nor moved until something changes.

Three numbers of the state belong to each solid:

- *rest*: for how long [s] it has been slower than ``ProximalNewton.rest_speed``; asleep, minus one less the number of
  its island's first solid.
- *kick*: a digest of its velocities after the kick, which holds all forces on it; 0 while it is not known.
- *pose*: a digest of its place and orientation.

An island that has been at rest long enough has its velocities put to 0 and is solved once more, from which step its
kicks are known; then it sleeps. What sleeps is kicked as all is, but in place of a solve its velocities are put back to
0. It wakes if a kick or a pose is not that which it fell asleep with, to the bit, if what is awake comes near it, or
if something changes that all of its world share: how surfaces are, where immovable things are, what joints hold.
So nobody has to tell that something was changed, and a world sleeps alike in any batch.
"""

from __future__ import annotations

from ..collision.broad_phase import colliders_of_pair, solid_of
from ..collision.manifold import IDS
from ..constraints.contact_rows import contact_at, length
from ..constraints.solids import is_free, rest_at, solid_at, symmetric_times
from ..kernel import inner
from ..math.digest import EMPTY, digest_number, mix
from ..math.pointers import LANES, doubles_at
from ..model.rigid_layout import (
    C_GAP,
    C_ID,
    CAPACITY,
    END_A,
    END_B,
    LOCAL,
    N_HERTZ,
    N_REST_SPEED,
    N_REST_TIME,
    N_SLOP,
    NUMBERS,
    ORDER,
    REST,
    REST_KICK,
    REST_POSE,
    REST_ROW,
    S_INVERSE_INERTIA,
    SOLID,
    SOLID_RECORDS,
    SOLIDS,
    STORED,
    STORED_ROW,
    WAKER_RECORDS,
    WAKERS,
)
from .islands import UNSEEN, join_all, visit

# Digests of solids that were stopped, and will be known after the next kick.
_STOPPED = 1.0


@inner
def _digest(s, row, count, k, digest):
    """Mix consecutive rows of lane k, if there are any, into a digest."""
    if row >= 0:
        for c in range(count):
            digest = mix(digest, s[LANES * (row + c) + k])
    return digest


@inner
def _kick(tape, s, record, k):
    """Digest of a solid's velocity and angular momentum."""
    digest = _digest(s, tape[record + 2], 3, k, EMPTY)
    return digest_number(_digest(s, tape[record + 3], 3, k, digest))


@inner
def _pose(tape, s, record, k):
    """Digest of a solid's place and orientation."""
    digest = _digest(s, tape[record], 3, k, EMPTY)
    return digest_number(_digest(s, tape[record + 1], 4, k, digest))


@inner
def _shared(tape, s, rigid, k):
    """Digest of what all solids of lane k share."""
    digest = EMPTY
    for i in range(tape[rigid + WAKERS]):
        digest = mix(digest, s[LANES * tape[tape[rigid + WAKER_RECORDS] + i] + k])
    return digest_number(digest)


@inner
def _stop(tape, s, record, k):
    """Put a solid's velocities to 0."""
    for part in range(2, 4):
        row = tape[record + part]
        if row >= 0:
            for c in range(3):
                s[LANES * (row + c) + k] = 0.0


@inner
def _wake_island(tape, s, rigid, k, island):
    """Wake all solids whose rest is that of an island; of all islands for 0."""
    for i in range(tape[rigid + SOLIDS]):
        at = rest_at(tape, rigid, i, k)
        if s[at] < 0.0 and (island == 0.0 or s[at] == island):
            s[at] = 0.0
            s[at + LANES * REST_KICK] = 0.0


@inner
def wake_changed(tape, s, rigid, k):
    """Wake what was changed in lane k since it fell asleep, before the position stage; whether anything is awake."""
    if tape[rigid + REST_ROW] < 0:
        return True
    solids = tape[rigid + SOLIDS]
    asleep = False
    for i in range(solids):
        asleep = asleep or s[rest_at(tape, rigid, i, k)] < 0.0
    if (
        asleep
        and _shared(tape, s, rigid, k) != s[LANES * (tape[rigid + REST_ROW] + REST * solids) + k]
    ):
        _wake_island(tape, s, rigid, k, 0.0)
    awake = False
    for i in range(solids):
        record = tape[rigid + SOLID_RECORDS] + SOLID * i
        at = rest_at(tape, rigid, i, k)
        if s[at] < 0.0:
            same = _pose(tape, s, record, k) == s[at + LANES * REST_POSE]
            if not (same and _kick(tape, s, record, k) == s[at + LANES * REST_KICK]):
                _wake_island(tape, s, rigid, k, s[at])
        elif s[at + LANES * REST_KICK] == _STOPPED:
            s[at + LANES * REST_KICK] = _kick(tape, s, record, k)
    for i in range(solids):
        movable = tape[tape[rigid + SOLID_RECORDS] + SOLID * i + 7] != 0
        awake = awake or (movable and s[rest_at(tape, rigid, i, k)] >= 0.0)
    return awake


@inner
def all_asleep(tape, s, rigid, k):
    """Whether nothing in lane k that can move is awake."""
    if tape[rigid + REST_ROW] < 0:
        return False
    for i in range(tape[rigid + SOLIDS]):
        movable = tape[tape[rigid + SOLID_RECORDS] + SOLID * i + 7] != 0
        if movable and s[rest_at(tape, rigid, i, k)] >= 0.0:
            return False
    return True


@inner
def hold_sleepers(tape, s, rigid, k):
    """Take back what the kick gave to what sleeps."""
    if tape[rigid + REST_ROW] >= 0:
        for i in range(tape[rigid + SOLIDS]):
            if s[rest_at(tape, rigid, i, k)] < 0.0:
                _stop(tape, s, tape[rigid + SOLID_RECORDS] + SOLID * i, k)


@inner
def wake_touched(tape, s, rigid, k, count):
    """Wake islands that contacts found between what is awake and what sleeps join; whether there were any."""
    found = False
    if tape[rigid + REST_ROW] >= 0:
        for i in range(count):
            pair = int(s[contact_at(tape, rigid, i) + C_ID]) // IDS
            for collider in colliders_of_pair(tape, rigid, pair):
                solid = solid_of(tape, rigid, collider)
                if solid >= 0:
                    island = s[rest_at(tape, rigid, solid, k)]
                    if island < 0.0:
                        _wake_island(tape, s, rigid, k, island)
                        found = True
    return found


@inner
def _sleeps(tape, s, rigid, solid):
    """Whether a solid is held, as scenery is."""
    return solid < 0 or not is_free(s, solid_at(tape, rigid, solid))


@inner
def keep_sleeping_contacts(tape, s, rigid, k):
    """Bring stored contacts of lane k between solids that are held to the front; how many these are."""
    kept = 0
    if tape[rigid + REST_ROW] >= 0:
        for j in range(tape[rigid + CAPACITY]):
            at = LANES * (tape[rigid + STORED_ROW] + tape[rigid + STORED] * j) + k
            if s[at] == 0.0:
                break
            a, b = colliders_of_pair(tape, rigid, int(s[at] - 1.0) // IDS)
            one = solid_of(tape, rigid, a)
            if _sleeps(tape, s, rigid, one) and _sleeps(tape, s, rigid, solid_of(tape, rigid, b)):
                if kept < j:
                    to = LANES * (tape[rigid + STORED_ROW] + tape[rigid + STORED] * kept) + k
                    for field in range(tape[rigid + STORED]):
                        value = s[to + LANES * field]
                        s[to + LANES * field] = s[at + LANES * field]
                        s[at + LANES * field] = value
                kept += 1
    return kept


@inner
def _count_rest(tape, s, n, rigid, k, count, dt):
    """For how long all solids that are awake have been slow, after the velocity stage; whether one is drowsy."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    drowsy = False
    for i in range(tape[rigid + SOLIDS]):
        solid = solid_at(tape, rigid, i)
        at = rest_at(tape, rigid, i, k)
        if is_free(s, solid):
            record = tape[rigid + SOLID_RECORDS] + SOLID * i
            v = LANES * tape[record + 2] + k
            speed = length(s[v], s[v + LANES], s[v + 2 * LANES])
            if tape[record + 3] >= 0:
                p = LANES * tape[record + 3] + k
                x, y, z = symmetric_times(
                    s, solid + S_INVERSE_INERTIA, s[p], s[p + LANES], s[p + 2 * LANES]
                )
                speed = max(speed, length(x, y, z))
            s[at] = s[at] + dt if speed <= numbers[N_REST_SPEED] else 0.0
    for i in range(count):
        # What is still to be pushed apart moves without a velocity.
        pushed = numbers[N_HERTZ] == 0.0
        if pushed and s[contact_at(tape, rigid, i) + C_GAP] < -numbers[N_SLOP]:
            for end in range(2):
                solid = n[tape[rigid + (END_A if end == 0 else END_B)] + i]
                if solid >= 0:
                    s[rest_at(tape, rigid, solid, k)] = 0.0
    for i in range(tape[rigid + SOLIDS]):
        at = rest_at(tape, rigid, i, k)
        drowsy = drowsy or s[at] >= numbers[N_REST_TIME]
        if s[at] >= 0.0 and s[at] < numbers[N_REST_TIME]:
            s[at + LANES * REST_KICK] = 0.0
    return drowsy


@inner
def fall_asleep(tape, s, n, rigid, k, count, dt):
    """Stop islands of lane k that have been at rest for long, and let those sleep that were solved since."""
    if tape[rigid + REST_ROW] >= 0 and _count_rest(tape, s, n, rigid, k, count, dt):
        after = doubles_at(tape[rigid + NUMBERS])[N_REST_TIME]
        join_all(tape, s, n, rigid, count)
        for seed in range(tape[rigid + SOLIDS]):
            free = is_free(s, solid_at(tape, rigid, seed))
            if free and n[tape[rigid + LOCAL] + seed] == UNSEEN:
                size = visit(tape, n, rigid, seed, 0)
                rest = 1e300
                known = True
                for i in range(size):
                    at = rest_at(tape, rigid, n[tape[rigid + ORDER] + i], k)
                    rest = min(rest, s[at])
                    known = known and s[at + LANES * REST_KICK] > _STOPPED
                for i in range(size):
                    solid = n[tape[rigid + ORDER] + i]
                    record = tape[rigid + SOLID_RECORDS] + SOLID * solid
                    at = rest_at(tape, rigid, solid, k)
                    if rest < after:
                        s[at + LANES * REST_KICK] = 0.0
                    else:
                        _stop(tape, s, record, k)
                        if known:
                            s[at] = -1.0 - seed
                            s[at + LANES * REST_POSE] = _pose(tape, s, record, k)
                        else:
                            s[at + LANES * REST_KICK] = _STOPPED
        shared = LANES * (tape[rigid + REST_ROW] + REST * tape[rigid + SOLIDS]) + k
        s[shared] = _shared(tape, s, rigid, k)
