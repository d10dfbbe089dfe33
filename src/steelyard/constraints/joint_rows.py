"""Rows of joints in one world: errors of their coordinates, directions in which they push, and impulses.

With the frames of both ends in the world, d from b's place to a's and axes e of b, U of a, the coordinates are e_k . d
for shifts, e_j . U_k for turns, the angle of U_1 about U_0 against e_1, and |d|. A row pushes along the derivative of
its coordinate, so that what it does is what virtual work says.
"""

from __future__ import annotations

from math import atan2, floor, pi, sqrt

from ..kernel import inner
from ..math.lanes import load_at
from ..math.pointers import LANES, doubles_at
from ..model.rigid_layout import (
    DRIVE,
    DRIVE_ROWS,
    DRIVES_AT,
    EQUAL,
    FRAME_WORK,
    J_BEFORE,
    J_COMPLIANCE,
    J_DAMPING,
    J_ERROR,
    J_FORCE,
    J_HIGH,
    J_IMPULSE,
    J_KIND,
    J_LEAST,
    J_LOW,
    J_OFFSET,
    J_STIFFNESS,
    J_TORQUE_A,
    J_TORQUE_B,
    J_WEIGHT,
    JOINT,
    JOINT_BROKEN,
    JOINT_DRIVES,
    JOINT_LENGTH,
    JOINT_RECORDS,
    LIMIT,
    MOTOR,
    NUMBERS,
    OFF,
    ROW_ENTRIES,
    ROW_WORK,
    S_MOVES,
    S_TURNS,
    SOLIDS,
    SPRING,
    WIDE_ROW,
)
from .solids import solid_at
from .wide_rows import finish_wide_row, velocity_along

_HUGE = 1e300
ERRORS, DIRECTIONS, ALL = range(3)


@inner
def joint_at(tape, rigid, j):
    """Record of a joint."""
    return tape[rigid + JOINT_RECORDS] + JOINT * j


@inner
def row_at(tape, rigid, i):
    """First entry of a row's work."""
    return tape[rigid + ROW_WORK] + ROW_ENTRIES * i


@inner
def joint_solids(tape, rigid, joint):
    """Work of both solids; of the world that of one more that stands still."""
    b = tape[joint + 2]
    return solid_at(tape, rigid, tape[joint + 1]), solid_at(
        tape, rigid, b if b >= 0 else tape[rigid + SOLIDS]
    )


@inner
def _frame(s, numbers, local, place, turn, out):
    """Place and axes (in columns, row by row) of a joint's end in the world."""
    for i in range(3):
        r0 = s[turn + 3 * i]
        r1 = s[turn + 3 * i + 1]
        r2 = s[turn + 3 * i + 2]
        s[out + i] = s[place + i] + (
            r0 * numbers[local] + r1 * numbers[local + 1] + r2 * numbers[local + 2]
        )
        for k in range(3):
            s[out + 3 + 3 * i + k] = (
                r0 * numbers[local + 3 + k]
                + r1 * numbers[local + 6 + k]
                + r2 * numbers[local + 9 + k]
            )


@inner
def _axis(s, frame, k):
    return s[frame + 3 + k], s[frame + 6 + k], s[frame + 9 + k]


@inner
def _shift_row(s, row, x, y, z, ax, ay, az, bx, by, bz):
    """A push along (x, y, z), of a at a place on it, of b at the same, or at one of its own."""
    s[row + J_FORCE] = x
    s[row + J_FORCE + 1] = y
    s[row + J_FORCE + 2] = z
    s[row + J_TORQUE_A] = ay * z - az * y
    s[row + J_TORQUE_A + 1] = az * x - ax * z
    s[row + J_TORQUE_A + 2] = ax * y - ay * x
    s[row + J_TORQUE_B] = by * z - bz * y
    s[row + J_TORQUE_B + 1] = bz * x - bx * z
    s[row + J_TORQUE_B + 2] = bx * y - by * x


@inner
def _turn_row(s, row, x, y, z):
    """A couple along (x, y, z)."""
    for k in range(3):
        s[row + J_FORCE + k] = 0.0
    for at in range(2):
        torque = row + (J_TORQUE_A if at == 0 else J_TORQUE_B)
        s[torque] = x
        s[torque + 1] = y
        s[torque + 2] = z


@inner
def _coordinate(s, row, frames, a, b, k, push):
    """Value of a coordinate; with ``push``, its direction into a row. Solids' places at ``a`` and ``b``."""
    pa = frames
    pb = frames + 12
    dx = s[pa] - s[pb]
    dy = s[pa + 1] - s[pb + 1]
    dz = s[pa + 2] - s[pb + 2]
    ax = s[pa] - s[a]
    ay = s[pa + 1] - s[a + 1]
    az = s[pa + 2] - s[a + 2]
    if k < 3:
        x, y, z = _axis(s, pb, k)
        if push:
            # The axis turns with b: so b is pushed at the same place.
            _shift_row(
                s,
                row,
                x,
                y,
                z,
                ax,
                ay,
                az,
                s[pa] - s[b],
                s[pa + 1] - s[b + 1],
                s[pa + 2] - s[b + 2],
            )
        return x * dx + y * dy + z * dz
    if k == 6:
        distance = sqrt(dx * dx + dy * dy + dz * dz)
        inverse = 1.0 / distance if distance > 0.0 else 0.0
        if push:
            _shift_row(
                s, row, dx * inverse, dy * inverse, dz * inverse, ax, ay, az, s[pb] - s[b],
                s[pb + 1] - s[b + 1], s[pb + 2] - s[b + 2],
            )  # fmt: skip
        return distance
    ux, uy, uz = _axis(s, pa, 1 if k == 5 else 0)
    x, y, z = _axis(s, pb, 1 if k == 3 else 2)
    if push:
        _turn_row(s, row, uy * z - uz * y, uz * x - ux * z, ux * y - uy * x)
    return ux * x + uy * y + uz * z


@inner
def _angle(s, row, frames, push):
    """Angle of a about its first axis against b."""
    ux, uy, uz = _axis(s, frames, 1)
    yx, yy, yz = _axis(s, frames + 12, 1)
    zx, zy, zz = _axis(s, frames + 12, 2)
    if push:
        x, y, z = _axis(s, frames, 0)
        _turn_row(s, row, x, y, z)
    return atan2(ux * zx + uy * zy + uz * zz, ux * yx + uy * yy + uz * yz)


@inner
def measure_joint(tape, s, rigid, k, joint, place, turn, what):
    """Errors of a joint's rows, with the solids' poses in the fields ``place`` and ``turn``.

    Args:
        k: the lane.
        joint: its record.
        place: field of the solids' places.
        turn: field of their rotations.
        what: ERRORS alone; DIRECTIONS of the rows too; or ALL, with their kinds and bounds.

    Places and axes of both ends stay in the work area of frames.
    """
    push = what != ERRORS
    begin = what == ALL
    numbers = doubles_at(tape[rigid + NUMBERS])
    frames = tape[rigid + FRAME_WORK]
    a, b = joint_solids(tape, rigid, joint)
    local = tape[joint + 3]
    _frame(s, numbers, local, a + place, a + turn, frames)
    _frame(s, numbers, local + 12, b + place, b + turn, frames + 12)
    row = row_at(tape, rigid, tape[joint + 4])
    whole = s[LANES * tape[joint + JOINT_BROKEN] + k] == 0.0
    for c in range(7):
        if (tape[joint] >> c) & 1 != 0:
            value = _coordinate(s, row, frames, a + place, b + place, c, push)
            if c == 6:
                value -= s[LANES * tape[joint + JOINT_LENGTH] + k]
            s[row + J_ERROR] = value
            if push:
                _weigh_row(s, row, a, b)
            if begin:
                _begin_row(s, row, EQUAL if whole else OFF, -_HUGE, _HUGE)
            row += ROW_ENTRIES
    for i in range(tape[joint + JOINT_DRIVES]):
        drive = joint + DRIVES_AT + DRIVE * i
        c = tape[drive]
        low = s[LANES * tape[drive + 3] + k]
        high = s[LANES * tape[drive + 4] + k]
        # Its four rows push along one direction.
        if c == 3:
            # Within half a turn of the middle of its limits, so that it does not jump from one to the other.
            middle = 0.5 * (low + high) if low > -_HUGE and high < _HUGE else 0.0
            value = _angle(s, row, frames, push)
            value -= 2.0 * pi * floor((value - middle) / (2.0 * pi) + 0.5)
        else:
            value = _coordinate(s, row, frames, a + place, b + place, c, push)
        if push:
            _weigh_row(s, row, a, b)
        first = row
        for part in range(DRIVE_ROWS):
            if begin:
                _begin_part(tape, s, k, drive, part, row, first, whole)
            if part == 0:
                s[row + J_ERROR] = value - low
            elif part == 1:
                s[row + J_ERROR] = value - high
            elif part == 2:
                s[row + J_ERROR] = 0.0
            else:
                s[row + J_ERROR] = value - s[LANES * tape[drive + 7] + k]
            if push and part > 0 and s[row + J_KIND] != OFF:
                _copy_direction(s, row, first)
            row += ROW_ENTRIES


@inner
def _begin_part(tape, s, k, drive, part, row, first, whole):
    """Kind and bounds of a drive's row: lower limit, upper limit, motor or spring."""
    s[row + J_WEIGHT] = s[first + J_WEIGHT]
    if part == 0:
        some = whole and s[LANES * tape[drive + 3] + k] > -_HUGE
        _begin_row(s, row, LIMIT if some else OFF, 0.0, _HUGE)
    elif part == 1:
        some = whole and s[LANES * tape[drive + 4] + k] < _HUGE
        _begin_row(s, row, LIMIT if some else OFF, -_HUGE, 0.0)
    elif part == 2:
        strength = s[LANES * tape[drive + 2] + k]
        some = whole and strength > 0.0
        _begin_row(s, row, MOTOR if some else OFF, -strength, strength)
        s[row + J_LEAST] = s[LANES * tape[drive + 1] + k]
    else:
        stiffness = s[LANES * tape[drive + 5] + k]
        damping = s[LANES * tape[drive + 6] + k]
        some = whole and (stiffness > 0.0 or damping > 0.0)
        _begin_row(s, row, SPRING if some else OFF, -_HUGE, _HUGE)
        s[row + J_STIFFNESS] = stiffness
        s[row + J_DAMPING] = damping


@inner
def _weigh_row(s, row, a, b):
    """Make a row ready, and its mobility; torques on what does not turn are left out."""
    for i in range(3):
        s[row + J_TORQUE_A + i] *= s[a + S_TURNS]
        s[row + J_TORQUE_B + i] *= s[b + S_TURNS]
    t = row + J_TORQUE_B
    s[row + J_WEIGHT] = finish_wide_row(s, row, a, b, s[t], s[t + 1], s[t + 2])


@inner
def _copy_direction(s, row, other):
    """Give a row the direction of another."""
    for i in range(WIDE_ROW + 3):
        s[row + i] = s[other + i]
    s[row + J_WEIGHT] = s[other + J_WEIGHT]


@inner
def _begin_row(s, row, kind, low, high):
    """Kind and bounds of a row, without any impulse."""
    s[row + J_KIND] = kind if s[row + J_WEIGHT] > 0.0 else OFF
    s[row + J_LOW] = low
    s[row + J_HIGH] = high
    s[row + J_LEAST] = 0.0
    s[row + J_BEFORE] = 0.0
    s[row + J_IMPULSE] = 0.0
    s[row + J_OFFSET] = 0.0
    s[row + J_COMPLIANCE] = 1.0


@inner
def row_velocity(s, row, a, b, field):
    """Velocity along a row, by a six-vector of the solids."""
    return velocity_along(s, row, load_at(s, a + field), load_at(s, b + field))


@inner
def add_row_impulse(s, row, a, b, field, value):
    """Add an impulse along a row to a six-vector of both solids."""
    for i in range(3):
        force = s[row + J_FORCE + i] * value
        s[a + field + i] += s[a + S_MOVES] * force
        s[b + field + i] -= s[b + S_MOVES] * force
        s[a + field + 3 + i] += s[row + J_TORQUE_A + i] * value
        s[b + field + 3 + i] -= s[row + J_TORQUE_B + i] * value


@inner
def row_impulse(s, row, u):
    """Impulse along a row at a velocity, beyond what the base holds, and whether it gives way to that."""
    y = s[row + J_BEFORE] + (s[row + J_LEAST] - u) / s[row + J_COMPLIANCE]
    if y <= s[row + J_LOW]:
        return s[row + J_LOW] - s[row + J_OFFSET], False
    if y >= s[row + J_HIGH]:
        return s[row + J_HIGH] - s[row + J_OFFSET], False
    return y - s[row + J_OFFSET], True
