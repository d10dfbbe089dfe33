"""Solids: what contacts push, bodies and particles alike, gathered from one lane and scattered back.

A particle is a solid that does not turn, a body with a pivot one that only turns, an immovable body neither.
"""

from __future__ import annotations

from math import sqrt

from ..integrators.rotor import ORDER, turn_freely
from ..kernel import inner
from ..math.lanes import splat
from ..math.pointers import LANES
from ..model.rigid_layout import (
    JOINTS,
    PACK_ROW,
    REST,
    REST_ROW,
    S_BASE,
    S_END,
    S_END_ROTATION,
    S_FREE,
    S_GEOMETRIC,
    S_INERTIA,
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_JOINED,
    S_MASS,
    S_MIDDLE,
    S_MOVES,
    S_PLACE,
    S_PUSH,
    S_ROTATION,
    S_STEP,
    S_TURN,
    S_TURNS,
    S_VELOCITY,
    SOLID,
    SOLID_ENTRIES,
    SOLID_RECORDS,
    SOLID_WORK,
    SOLIDS,
)


@inner
def solid_at(tape, rigid, i):
    """First entry of a solid's work."""
    return tape[rigid + SOLID_WORK] + SOLID_ENTRIES * i


@inner
def is_free(s, solid):
    """Whether anything moves a solid: not if it is immovable or asleep."""
    return s[solid + S_MOVES] != 0.0 or s[solid + S_TURNS] != 0.0


@inner
def rest_at(tape, rigid, i, k):
    """Entry of how long a solid has been at rest in lane k, of scenes in which things may sleep."""
    return LANES * (tape[rigid + REST_ROW] + REST * i) + k


@inner
def symmetric_times(s, at, x, y, z):
    """A symmetric matrix in six entries (xx, yx, yy, zx, zy, zz) times a vector."""
    return (
        s[at] * x + s[at + 1] * y + s[at + 3] * z,
        s[at + 1] * x + s[at + 2] * y + s[at + 4] * z,
        s[at + 3] * x + s[at + 4] * y + s[at + 5] * z,
    )


@inner
def _rotation(s, q, stride, out):
    """Nine entries of the rotation matrix, row by row, of the quaternion at entry ``q`` and every ``stride`` on."""
    w = s[q]
    x = s[q + stride]
    y = s[q + 2 * stride]
    z = s[q + 3 * stride]
    two = 2.0 / (w * w + x * x + y * y + z * z)
    s[out] = 1.0 - two * (y * y + z * z)
    s[out + 1] = two * (x * y - w * z)
    s[out + 2] = two * (x * z + w * y)
    s[out + 3] = two * (x * y + w * z)
    s[out + 4] = 1.0 - two * (x * x + z * z)
    s[out + 5] = two * (y * z - w * x)
    s[out + 6] = two * (x * z - w * y)
    s[out + 7] = two * (y * z + w * x)
    s[out + 8] = 1.0 - two * (x * x + y * y)


@inner
def _turned(s, row, k, rotation, out):
    """R M R^T of the symmetric matrix in rows ``row`` of lane k, into six entries."""
    xx = s[LANES * row + k]
    yx = s[LANES * (row + 1) + k]
    yy = s[LANES * (row + 2) + k]
    zx = s[LANES * (row + 3) + k]
    zy = s[LANES * (row + 4) + k]
    zz = s[LANES * (row + 5) + k]
    entry = out
    for i in range(3):
        a = s[rotation + 3 * i]
        b = s[rotation + 3 * i + 1]
        c = s[rotation + 3 * i + 2]
        u = a * xx + b * yx + c * zx
        v = a * yx + b * yy + c * zy
        w = a * zx + b * zy + c * zz
        for j in range(i + 1):
            s[entry] = (
                u * s[rotation + 3 * j] + v * s[rotation + 3 * j + 1] + w * s[rotation + 3 * j + 2]
            )
            entry += 1


@inner
def gather_solids(tape, s, rigid, k):
    """Places, masses, rotations and velocities of lane k; what sleeps is gathered as immovable."""
    record = tape[rigid + SOLID_RECORDS]
    at = tape[rigid + SOLID_WORK]
    for i in range(tape[rigid + SOLIDS]):
        x = tape[record]
        q = tape[record + 1]
        v = tape[record + 2]
        momentum = tape[record + 3]
        awake = tape[rigid + REST_ROW] < 0 or s[rest_at(tape, rigid, i, k)] >= 0.0
        moves = awake and (tape[record + 7] & 1) != 0
        turns = awake and (tape[record + 7] & 2) != 0
        for c in range(3):
            s[at + S_PLACE + c] = s[LANES * (x + c) + k]
            s[at + S_FREE + c] = s[LANES * (v + c) + k] if moves else 0.0
        inverse = s[LANES * tape[record + 4] + k] if moves else 0.0
        s[at + S_INVERSE] = inverse
        s[at + S_MASS] = 1.0 / inverse if moves else 1.0
        s[at + S_MOVES] = 1.0 if moves else 0.0
        s[at + S_TURNS] = 1.0 if turns else 0.0
        if q >= 0:
            _rotation(s, LANES * q + k, LANES, at + S_ROTATION)
        else:
            for c in range(9):
                s[at + S_ROTATION + c] = 1.0 if c % 4 == 0 else 0.0
        if turns:
            _turned(s, tape[record + 5], k, at + S_ROTATION, at + S_INERTIA)
            _turned(s, tape[record + 6], k, at + S_ROTATION, at + S_INVERSE_INERTIA)
            a, b, c = symmetric_times(
                s, at + S_INVERSE_INERTIA, s[LANES * momentum + k], s[LANES * (momentum + 1) + k],
                s[LANES * (momentum + 2) + k],
            )  # fmt: skip
            s[at + S_FREE + 3] = a
            s[at + S_FREE + 4] = b
            s[at + S_FREE + 5] = c
        else:
            for c in range(6):
                s[at + S_INERTIA + c] = 1.0 if c == 0 or c == 2 or c == 5 else 0.0
                s[at + S_INVERSE_INERTIA + c] = 0.0
            for c in range(3):
                s[at + S_FREE + 3 + c] = 0.0
        for c in range(6):
            s[at + S_STEP + c] = 0.0
            s[at + S_GEOMETRIC + c] = 0.0
            s[at + S_BASE + c] = 0.0
            s[at + S_JOINED + c] = 0.0
        # With what lies behind: a velocity is loaded with it, and a NaN of another world must not stay there.
        for c in range(8):
            s[at + S_VELOCITY + c] = 0.0
        record += SOLID
        at += SOLID_ENTRIES
    if tape[rigid + JOINTS] > 0:
        # One more: the world, to which joints may hold.
        for c in range(SOLID_ENTRIES):
            s[at + c] = 0.0
        for c in range(3):
            s[at + S_ROTATION + 4 * c] = 1.0
            s[at + S_END_ROTATION + 4 * c] = 1.0


@inner
def scatter_velocities(tape, s, rigid, k):
    """Add what contacts changed, S_VELOCITY as linear and angular impulses, to velocities and momenta of lane k."""
    record = tape[rigid + SOLID_RECORDS]
    at = tape[rigid + SOLID_WORK]
    for _ in range(tape[rigid + SOLIDS]):
        flags = tape[record + 7]
        if flags & 1 != 0:
            inverse = s[at + S_INVERSE]
            for c in range(3):
                s[LANES * (tape[record + 2] + c) + k] += inverse * s[at + S_VELOCITY + c]
        if flags & 2 != 0:
            for c in range(3):
                s[LANES * (tape[record + 3] + c) + k] += s[at + S_VELOCITY + 3 + c]
        record += SOLID
        at += SOLID_ENTRIES


@inner
def drift_solids(tape, s, rigid, k, dt, order=ORDER):
    """Where the impulses of the base move all solids of lane k to within the step: eight of them turn at once."""
    solids = tape[rigid + SOLIDS]
    pack = tape[rigid + PACK_ROW]
    for first in range(0, solids, LANES):
        for lane in range(LANES):
            i = first + lane
            record = tape[rigid + SOLID_RECORDS] + SOLID * i
            turns = i < solids and (tape[record + 7] & 2) != 0
            at = solid_at(tape, rigid, i)
            for c in range(4):
                s[LANES * (pack + c) + lane] = (
                    s[LANES * (tape[record + 1] + c) + k] if turns else (1.0 if c == 0 else 0.0)
                )
            for c in range(3):
                s[LANES * (pack + 4 + c) + lane] = (
                    s[LANES * (tape[record + 3] + c) + k] + s[at + S_BASE + 3 + c] if turns else 0.0
                )
            for c in range(6):
                s[LANES * (pack + 7 + c) + lane] = (
                    s[LANES * (tape[record + 6] + c) + k] if turns else 0.0
                )
        turn_freely(s, pack + 13, pack, pack + 4, pack + 7, splat(dt), order)
        for lane in range(min(LANES, solids - first)):
            i = first + lane
            at = solid_at(tape, rigid, i)
            record = tape[rigid + SOLID_RECORDS] + SOLID * i
            for c in range(3):
                v = 0.0
                if s[at + S_MOVES] != 0.0:
                    v = (
                        s[LANES * (tape[record + 2] + c) + k]
                        + s[at + S_INVERSE] * s[at + S_BASE + c]
                    )
                s[at + S_STEP + c] = v
                s[at + S_END + c] = s[at + S_PLACE + c] + dt * v
            # The velocity that the impulses make where rows take them: of the start, or midway.
            x, y, z = symmetric_times(
                s, at + S_INVERSE_INERTIA, s[LANES * (pack + 4) + lane], s[LANES * (pack + 5) + lane],
                s[LANES * (pack + 6) + lane],
            )  # fmt: skip
            s[at + S_STEP + 3] = x
            s[at + S_STEP + 4] = y
            s[at + S_STEP + 5] = z
            if s[at + S_TURNS] != 0.0:
                for c in range(4):
                    s[at + S_TURN + c] = s[LANES * (pack + c) + lane]
                _rotation(s, at + S_TURN, 1, at + S_END_ROTATION)
            else:
                for c in range(9):
                    s[at + S_END_ROTATION + c] = s[at + S_ROTATION + c]


@inner
def drift_by_impulses(tape, s, rigid, k, dt, order=ORDER):
    """The same by the impulses of a solve."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_BASE + c] = s[at + S_VELOCITY + c]
    drift_solids(tape, s, rigid, k, dt, order)


@inner
def end_drift(tape, s, rigid, k):
    """Put all solids of lane k where ``drift_solids`` moved them."""
    for i in range(tape[rigid + SOLIDS]):
        record = tape[rigid + SOLID_RECORDS] + SOLID * i
        at = solid_at(tape, rigid, i)
        if s[at + S_MOVES] != 0.0:
            for c in range(3):
                s[LANES * (tape[record] + c) + k] = s[at + S_END + c]
        if s[at + S_TURNS] != 0.0:
            for c in range(4):
                s[LANES * (tape[record + 1] + c) + k] = s[at + S_TURN + c]


@inner
def linearise_turns(tape, s, rigid, k):
    """Take inertia from the middle of the step, and add geometric stiffness g, times the step, to it.

    So a solve for changes sees how pulls change as solids turn: where nothing is left to change, g does nothing.
    """
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        if s[at + S_TURNS] != 0.0:
            record = tape[rigid + SOLID_RECORDS] + SOLID * i
            # The mean of the quaternions of start and end, to any length.
            sign = 0.0
            for c in range(4):
                sign += s[LANES * (tape[record + 1] + c) + k] * s[at + S_TURN + c]
            sign = 1.0 if sign >= 0.0 else -1.0
            q = at + S_STEP
            for c in range(4):
                s[q + c] = s[LANES * (tape[record + 1] + c) + k] + sign * s[at + S_TURN + c]
            _rotation(s, q, 1, at + S_MIDDLE)
            _turned(s, tape[record + 5], k, at + S_MIDDLE, at + S_INERTIA)
            for e in range(6):
                s[at + S_INERTIA + e] += s[at + S_GEOMETRIC + e]
            _invert(s, at + S_INERTIA, at + S_INVERSE_INERTIA)


@inner
def _invert(s, at, out):
    """Inverse of a symmetric matrix in six entries (xx, yx, yy, zx, zy, zz)."""
    a = s[at + 2] * s[at + 5] - s[at + 4] * s[at + 4]
    b = s[at + 3] * s[at + 4] - s[at + 1] * s[at + 5]
    c = s[at + 1] * s[at + 4] - s[at + 2] * s[at + 3]
    inverse = 1.0 / (s[at] * a + s[at + 1] * b + s[at + 3] * c)
    yy = s[at] * s[at + 5] - s[at + 3] * s[at + 3]
    zy = s[at + 1] * s[at + 3] - s[at] * s[at + 4]
    zz = s[at] * s[at + 2] - s[at + 1] * s[at + 1]
    s[out] = a * inverse
    s[out + 1] = b * inverse
    s[out + 2] = yy * inverse
    s[out + 3] = c * inverse
    s[out + 4] = zy * inverse
    s[out + 5] = zz * inverse


@inner
def kinetic_energy(tape, s, rigid, k, share):
    """Of all solids of lane k [J], with a share of the impulses of the base, where ``drift_solids`` has moved them."""
    total = 0.0
    record = tape[rigid + SOLID_RECORDS]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        if s[at + S_MOVES] != 0.0:
            for c in range(3):
                v = s[LANES * (tape[record + 2] + c) + k]
                v += share * s[at + S_INVERSE] * s[at + S_BASE + c]
                total += 0.5 * s[at + S_MASS] * v * v
        if s[at + S_TURNS] != 0.0:
            # In the frame of the body, whose inertia no solve changes.
            for c in range(3):
                turned = 0.0
                for j in range(3):
                    row = LANES * (tape[record + 3] + j) + k
                    momentum = s[row] + share * s[at + S_BASE + 3 + j]
                    turned += s[at + S_END_ROTATION + 3 * j + c] * momentum
                s[at + S_PUSH + c] = turned
            m = tape[record + 6]
            x = s[at + S_PUSH]
            y = s[at + S_PUSH + 1]
            z = s[at + S_PUSH + 2]
            total += 0.5 * (
                s[LANES * m + k] * x * x
                + s[LANES * (m + 2) + k] * y * y
                + s[LANES * (m + 5) + k] * z * z
            )
            total += (
                s[LANES * (m + 1) + k] * x * y
                + s[LANES * (m + 3) + k] * x * z
                + s[LANES * (m + 4) + k] * y * z
            )
        record += SOLID
    return total


@inner
def rest_solids(tape, s, rigid):
    """Free velocities of nothing."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_FREE + c] = 0.0


@inner
def move_solids(tape, s, rigid, k, dt):
    """Move solids in lane k by their velocities over dt."""
    record = tape[rigid + SOLID_RECORDS]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        if s[at + S_MOVES] != 0.0:
            for c in range(3):
                s[LANES * (tape[record] + c) + k] += dt * s[at + S_VELOCITY + c]
        if s[at + S_TURNS] != 0.0:
            _turn(s, tape[record + 1], k, dt, at + S_VELOCITY + 3)
        record += SOLID


@inner
def _turn(s, q, k, dt, at):
    """Turn a quaternion in lane k by an angular velocity over dt."""
    w = s[LANES * q + k]
    x = s[LANES * (q + 1) + k]
    y = s[LANES * (q + 2) + k]
    z = s[LANES * (q + 3) + k]
    a = 0.5 * dt * s[at]
    b = 0.5 * dt * s[at + 1]
    c = 0.5 * dt * s[at + 2]
    nw = w - a * x - b * y - c * z
    nx = x + a * w + b * z - c * y
    ny = y + b * w + c * x - a * z
    nz = z + c * w + a * y - b * x
    inverse = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    s[LANES * q + k] = nw * inverse
    s[LANES * (q + 1) + k] = nx * inverse
    s[LANES * (q + 2) + k] = ny * inverse
    s[LANES * (q + 3) + k] = nz * inverse


@inner
def pay_for_lifts(tape, s, rigid, k, dt):
    """Take the work that moving solids did against their acceleration out of their own motion in lane k.

    A push knows no energy: what it lifts would fall again, and gain by it.
    """
    record = tape[rigid + SOLID_RECORDS]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        if s[at + S_MOVES] != 0.0:
            work = 0.0
            energy = 0.0
            for c in range(3):
                v = s[LANES * (tape[record + 2] + c) + k]
                work -= s[LANES * (tape[record + 8] + c) + k] * dt * s[at + S_VELOCITY + c]
                energy += 0.5 * v * v
            work *= s[at + S_MASS]
            energy *= s[at + S_MASS]
            turns = s[at + S_TURNS] != 0.0
            if turns:
                p = LANES * tape[record + 3] + k
                a, b, c = symmetric_times(
                    s, at + S_INVERSE_INERTIA, s[p], s[p + LANES], s[p + 2 * LANES]
                )
                energy += 0.5 * (a * s[p] + b * s[p + LANES] + c * s[p + 2 * LANES])
            if work > 0.0 and energy > 0.0:
                share = sqrt(max(1.0 - work / energy, 0.0))
                for c in range(3):
                    s[LANES * (tape[record + 2] + c) + k] *= share
                    if turns:
                        s[LANES * (tape[record + 3] + c) + k] *= share
        record += SOLID
