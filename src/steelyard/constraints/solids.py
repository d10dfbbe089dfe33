"""Solids: what contacts push, bodies and particles alike, gathered from one lane and scattered back.

A particle is a solid that does not turn, a body with a pivot one that only turns, an immovable body neither.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import (
    S_FREE,
    S_INERTIA,
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_MASS,
    S_MOVES,
    S_PLACE,
    S_ROTATION,
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
def symmetric_times(s, at, x, y, z):
    """A symmetric matrix in six entries (xx, yx, yy, zx, zy, zz) times a vector."""
    return (
        s[at] * x + s[at + 1] * y + s[at + 3] * z,
        s[at + 1] * x + s[at + 2] * y + s[at + 4] * z,
        s[at + 3] * x + s[at + 4] * y + s[at + 5] * z,
    )


@inner
def _rotation(s, q, k, out):
    """Nine entries of the rotation matrix, row by row, of the quaternion in rows ``q`` of lane k."""
    w = s[LANES * q + k]
    x = s[LANES * (q + 1) + k]
    y = s[LANES * (q + 2) + k]
    z = s[LANES * (q + 3) + k]
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
    """Places, masses, rotations and velocities of lane k."""
    record = tape[rigid + SOLID_RECORDS]
    at = tape[rigid + SOLID_WORK]
    for _ in range(tape[rigid + SOLIDS]):
        x = tape[record]
        q = tape[record + 1]
        v = tape[record + 2]
        momentum = tape[record + 3]
        moves = (tape[record + 7] & 1) != 0
        turns = (tape[record + 7] & 2) != 0
        for c in range(3):
            s[at + S_PLACE + c] = s[LANES * (x + c) + k]
            s[at + S_FREE + c] = s[LANES * (v + c) + k] if moves else 0.0
        inverse = s[LANES * tape[record + 4] + k] if moves else 0.0
        s[at + S_INVERSE] = inverse
        s[at + S_MASS] = 1.0 / inverse if moves else 1.0
        s[at + S_MOVES] = 1.0 if moves else 0.0
        s[at + S_TURNS] = 1.0 if turns else 0.0
        if q >= 0:
            _rotation(s, q, k, at + S_ROTATION)
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
        record += SOLID
        at += SOLID_ENTRIES


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
