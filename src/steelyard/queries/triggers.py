"""What triggers see of a step: for all of them, all things and all worlds, in one kernel.

A thing is in a trigger at the end of a step if one of its shapes overlaps the volume there. If it was not in it before,
its path is swept (``sweeps``) as the trigger sees it: between its place in the trigger's frame at the step's start,
wherever it was put since the last one ended, and that at its end. Balls about both tell what is nowhere near.
"""

from __future__ import annotations

from math import atan2, sqrt

from ..kernel import inner, kernel
from ..math.pointers import doubles_at
from ..model.colliders import BOX, CAPSULE, CENTRE, PLACED, SIZE, TURN
from .casts import nearest
from .sweeps import ANGLE, ARM, AXIS, FROM, NEVER, PATH, ROTATION, WAY, sweep

#: Words of a trigger: kind of its volume, rows of place and orientation of what carries it or -1, first of its looks
#: and the first behind them, and the first row of what it sees.
VOLUME_KIND, CARRIER_PLACE, CARRIER_TURN, FIRST_LOOK, LAST_LOOK, SEEN_ROW, TRIGGER_WORDS = range(7)
#: Numbers of a trigger: sizes, place, orientation, and the radius of a ball about it.
VOLUME_SIZE, VOLUME_PLACE, VOLUME_TURN, VOLUME_BALL, TRIGGER_NUMBERS = 0, 3, 6, 10, 11
#: Words of a look at a thing: rows of its place and orientation, its first collider and the first behind them, and
#: which particle it is; -1 for what a body or a particle has not.
THING_PLACE, THING_TURN, FIRST_COLLIDER, LAST_COLLIDER, PARTICLE, LOOK_WORDS = range(6)
# A pose: place, quaternion, rotation.
_QUATERNION, _ROTATION, _POSE = 3, 7, 16
# Poses of trigger and thing at start and end, then a path.
_TRIGGER, _THING, _PATH = 0, 2 * _POSE, 4 * _POSE
#: Numbers to work in, beside those of ``casts``.
POSES = _PATH + PATH
# Balls are larger by this, over their radii, than rounding makes distances.
_ROUNDING = 1e-9


@inner
def _product(aw, ax, ay, az, bw, bx, by, bz):
    """Quaternion of the turn b and then a."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
    )


@inner
def _conjugate_product(f, a, b):
    """Of two poses, the turn of b in the frame of a."""
    a += _QUATERNION
    b += _QUATERNION
    return _product(f[a], -f[a + 1], -f[a + 2], -f[a + 3], f[b], f[b + 1], f[b + 2], f[b + 3])


@inner
def _write_turn(f, at, w, x, y, z):
    """Quaternion and rotation of a pose."""
    q = at + _QUATERNION
    f[q] = w
    f[q + 1] = x
    f[q + 2] = y
    f[q + 3] = z
    r = at + _ROTATION
    f[r] = 1.0 - 2.0 * (y * y + z * z)
    f[r + 1] = 2.0 * (x * y - w * z)
    f[r + 2] = 2.0 * (x * z + w * y)
    f[r + 3] = 2.0 * (x * y + w * z)
    f[r + 4] = 1.0 - 2.0 * (x * x + z * z)
    f[r + 5] = 2.0 * (y * z - w * x)
    f[r + 6] = 2.0 * (x * z - w * y)
    f[r + 7] = 2.0 * (y * z + w * x)
    f[r + 8] = 1.0 - 2.0 * (x * x + y * y)


@inner
def _read_place(f, at, state, row, w):
    for k in range(3):
        f[at + k] = state[row + k, w]


@inner
def _read_turn(f, at, state, row, w):
    if row < 0:
        _write_turn(f, at, 1.0, 0.0, 0.0, 0.0)
    else:
        _write_turn(f, at, state[row, w], state[row + 1, w], state[row + 2, w], state[row + 3, w])


@inner
def _turned(f, at, x, y, z):
    """A vector in a pose's frame along the world's axes."""
    r = at + _ROTATION
    return (
        f[r] * x + f[r + 1] * y + f[r + 2] * z,
        f[r + 3] * x + f[r + 4] * y + f[r + 5] * z,
        f[r + 6] * x + f[r + 7] * y + f[r + 8] * z,
    )


@inner
def _turned_back(f, at, x, y, z):
    """A vector along the world's axes in a pose's frame."""
    r = at + _ROTATION
    return (
        f[r] * x + f[r + 3] * y + f[r + 6] * z,
        f[r + 1] * x + f[r + 4] * y + f[r + 7] * z,
        f[r + 2] * x + f[r + 5] * y + f[r + 8] * z,
    )


@inner
def _seen(f, at, x, y, z):
    """A place in the world in a pose's frame."""
    return _turned_back(f, at, x - f[at], y - f[at + 1], z - f[at + 2])


@inner
def _place_trigger(f, at, trigger, volume, state, w):
    """Pose of a trigger."""
    p = VOLUME_PLACE
    q = VOLUME_TURN
    if trigger[CARRIER_PLACE] < 0:
        for k in range(3):
            f[at + k] = volume[p + k]
        _write_turn(f, at, volume[q], volume[q + 1], volume[q + 2], volume[q + 3])
    else:
        _read_place(f, at, state, trigger[CARRIER_PLACE], w)
        _read_turn(f, at, state, trigger[CARRIER_TURN], w)
        x, y, z = _turned(f, at, volume[p], volume[p + 1], volume[p + 2])
        f[at] += x
        f[at + 1] += y
        f[at + 2] += z
        o = at + _QUATERNION
        w, x, y, z = _product(
            f[o], f[o + 1], f[o + 2], f[o + 3], volume[q], volume[q + 1], volume[q + 2], volume[q + 3]
        )  # fmt: skip
        length = sqrt(w * w + x * x + y * y + z * z)
        _write_turn(f, at, w / length, x / length, y / length, z / length)


@inner
def _comes_near(f, reach):
    """Whether the thing's path, seen from the trigger, passes within reach; and whether it ends there."""
    ax, ay, az = _seen(f, _TRIGGER, f[_THING], f[_THING + 1], f[_THING + 2])
    t = _THING + _POSE
    bx, by, bz = _seen(f, _TRIGGER + _POSE, f[t], f[t + 1], f[t + 2])
    square = reach * reach * (1.0 + _ROUNDING)
    ends = bx * bx + by * by + bz * bz <= square
    dx = bx - ax
    dy = by - ay
    dz = bz - az
    long = dx * dx + dy * dy + dz * dz
    share = -(ax * dx + ay * dy + az * dz)
    share = min(max(share / long, 0.0), 1.0) if long > 0.0 else 0.0
    ax += share * dx
    ay += share * dy
    az += share * dz
    return ax * ax + ay * ay + az * az <= square, ends


@inner
def _place_of(f, at, place):
    """Where a place in a pose's frame is in the world."""
    x, y, z = _turned(f, at, place[0], place[1], place[2])
    return f[at] + x, f[at + 1] + y, f[at + 2] + z


@inner
def _size(m, at, size, radius):
    """Sizes of a placed collider; a particle's radius, unless below 0, counts for its own."""
    for k in range(3):
        m[at + SIZE + k] = size[k]
    if radius >= 0.0:
        m[at + SIZE] = radius


@inner
def _place_at_end(m, f, place, turn):
    """Put the second collider where the thing is at the step's end."""
    thing = _THING + _POSE
    x, y, z = _place_of(f, thing, place)
    m[PLACED + CENTRE] = x
    m[PLACED + CENTRE + 1] = y
    m[PLACED + CENTRE + 2] = z
    for j in range(3):
        x, y, z = _turned(f, thing, turn[0, j], turn[1, j], turn[2, j])
        m[PLACED + TURN + j] = x
        m[PLACED + TURN + 3 + j] = y
        m[PLACED + TURN + 6 + j] = z


@inner
def _turn_over(f):
    """Unit axis and angle [rad] by which the thing turns in the trigger's frame, written to the path."""
    aw, ax, ay, az = _conjugate_product(f, _TRIGGER, _THING)
    bw, bx, by, bz = _conjugate_product(f, _TRIGGER + _POSE, _THING + _POSE)
    w, x, y, z = _product(bw, bx, by, bz, aw, -ax, -ay, -az)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = sqrt(x * x + y * y + z * z)
    f[_PATH + ANGLE] = 2.0 * atan2(sine, w)
    f[_PATH + AXIS] = x / sine if sine > 0.0 else 0.0
    f[_PATH + AXIS + 1] = y / sine if sine > 0.0 else 0.0
    f[_PATH + AXIS + 2] = z / sine if sine > 0.0 else 0.0


@inner
def _write_path(m, f, kind, place, turn):
    """The path of a collider of the thing in the trigger's frame."""
    x, y, z = _place_of(f, _THING, place)
    ax, ay, az = _seen(f, _TRIGGER, x, y, z)
    x, y, z = _place_of(f, _THING + _POSE, place)
    bx, by, bz = _seen(f, _TRIGGER + _POSE, x, y, z)
    f[_PATH + FROM] = ax
    f[_PATH + FROM + 1] = ay
    f[_PATH + FROM + 2] = az
    f[_PATH + WAY] = bx - ax
    f[_PATH + WAY + 1] = by - ay
    f[_PATH + WAY + 2] = bz - az
    for j in range(3):
        x, y, z = _turned(f, _THING, turn[0, j], turn[1, j], turn[2, j])
        x, y, z = _turned_back(f, _TRIGGER, x, y, z)
        f[_PATH + ROTATION + j] = x
        f[_PATH + ROTATION + 3 + j] = y
        f[_PATH + ROTATION + 6 + j] = z
    # A turn moves no ball about its centre: only the segment of a capsule, and the corners of a box.
    arm = 0.0
    if kind == CAPSULE:
        arm = m[PLACED + SIZE + 1]
    elif kind == BOX:
        for k in range(3):
            arm += m[PLACED + SIZE + k] ** 2
        arm = sqrt(arm)
    f[_PATH + ARM] = arm


@inner
def _put_trigger(m, f, still):
    """Put the first collider where the trigger is at the step's end, or, still, where it is in its own frame."""
    for k in range(3):
        m[CENTRE + k] = 0.0 if still else f[_TRIGGER + _POSE + k]
    for k in range(9):
        own = 1.0 if k % 4 == 0 else 0.0
        m[TURN + k] = own if still else f[_TRIGGER + _POSE + _ROTATION + k]


@kernel
def look(
    triggers, volumes, looks, balls, kinds, places, turns, sizes, radius, start, state, worlds, clock, dt, fresh,
    memory, f,
):  # fmt: skip
    """What all triggers see of a step.

    Args:
        triggers: (triggers, TRIGGER_WORDS) int64.
        volumes: (triggers, TRIGGER_NUMBERS).
        looks: at a thing each, (looks, LOOK_WORDS) int64.
        balls: radii about the origins of bodies that hold all their shapes [m], (looks,).
        kinds: of the colliders, (n,) int64.
        places: of the colliders in the frames of their owners [m], (n, 3).
        turns: their rotations in these, (n, 3, 3).
        sizes: (n, 3) [m].
        radius: of the particles [m], (particles, 1) or (particles, worlds).
        start: the first rows of the state, with all poses, as the step began; (rows, worlds).
        state: as it ended, (state rows, padded worlds); what is seen is written to it (``scene.triggers.SEEN``).
        worlds: number of worlds.
        clock: row of the time [s].
        dt: what the step took [s].
        fresh: whether what was seen to enter and leave before is forgotten.
        memory: (MEMORY,) to work in.
        f: (POSES,) to work in.
    """
    m = doubles_at(memory.ctypes.data)
    path = f[_PATH:]
    for i in range(triggers.shape[0]):
        kind = triggers[i, VOLUME_KIND]
        first = triggers[i, FIRST_LOOK]
        count = triggers[i, LAST_LOOK] - first
        _size(m, 0, volumes[i, VOLUME_SIZE:], -1.0)
        for w in range(worlds):
            _place_trigger(f, _TRIGGER, triggers[i], volumes[i], start, w)
            _place_trigger(f, _TRIGGER + _POSE, triggers[i], volumes[i], state, w)
            for j in range(count):
                thing = looks[first + j]
                ball = balls[first + j]
                size = -1.0
                if thing[PARTICLE] >= 0:
                    size = radius[thing[PARTICLE], w if radius.shape[1] > 1 else 0]
                    ball = size
                _read_place(f, _THING, start, thing[THING_PLACE], w)
                _read_place(f, _THING + _POSE, state, thing[THING_PLACE], w)
                passes, ends = _comes_near(f, ball + volumes[i, VOLUME_BALL])
                row = triggers[i, SEEN_ROW] + j
                before = state[row, w] > 0.0
                inside = False
                if ends:
                    _read_turn(f, _THING + _POSE, state, thing[THING_TURN], w)
                    _put_trigger(m, f, False)
                    for c in range(thing[FIRST_COLLIDER], thing[LAST_COLLIDER]):
                        _size(m, PLACED, sizes[c], size)
                        _place_at_end(m, f, places[c], turns[c])
                        inside = inside or nearest(m, kind, kinds[c], 0.0) >= 0
                share = NEVER
                if not before and (inside or passes):
                    _read_turn(f, _THING, start, thing[THING_TURN], w)
                    _read_turn(f, _THING + _POSE, state, thing[THING_TURN], w)
                    _turn_over(f)
                    _put_trigger(m, f, True)
                    for c in range(thing[FIRST_COLLIDER], thing[LAST_COLLIDER]):
                        _size(m, PLACED, sizes[c], size)
                        _write_path(m, f, kinds[c], places[c], turns[c])
                        share = min(share, sweep(m, kind, kinds[c], path))
                    if inside:
                        share = min(share, 1.0)
                entered = share <= 1.0
                left = not inside and (before or entered)
                state[row, w] = 1.0 if inside else 0.0
                row += count
                state[row, w] = 1.0 if entered or (state[row, w] > 0.0 and not fresh) else 0.0
                row += count
                state[row, w] = 1.0 if left or (state[row, w] > 0.0 and not fresh) else 0.0
                row += count
                state[row, w] += 1.0 if entered else 0.0
                row += count
                state[row, w] += 1.0 if left else 0.0
                row += count
                if entered:
                    state[row, w] = state[clock, w] - (1.0 - share) * dt
