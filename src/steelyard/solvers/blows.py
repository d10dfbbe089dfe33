"""Blows one by one: how velocities pass through what touches, as along the balls of Newton's cradle.

Solids that touch are hit at once by a step, but in truth one after another: the first ball of a cradle stops at the
second before the third has felt anything. One solve for all contacts shares the blow out among them instead. So the
blows of a step are first played through alone, without friction and without what holds otherwise, from the velocities
of the step's start: the pair that closes fastest is parted as restitution says, then the next, until none closes.
The normal velocities with which this ends are those that the solve of the velocity stage has to reach.

A pair is parted at once, however many contacts it has, so that what falls flat stays flat. Its closing speed is that at
which its surfaces meet, which free motion has raised since the start.

Source: Han & Gilmore (1993), *Multiple-Body Impact Motion with Friction*, sequences of impacts.
"""

from __future__ import annotations

from math import sqrt

from ..constraints.contact_rows import (
    accelerate,
    add_impulse,
    contact_at,
    contact_ends,
    relative_velocity,
)
from ..constraints.solids import solid_at, symmetric_times
from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import (
    C_ARM_A,
    C_ARM_B,
    C_CHANGE,
    C_LEAST,
    C_NORMAL,
    C_REBOUND,
    C_RESTITUTION,
    C_SHIFT,
    C_SPEED,
    END_A,
    END_B,
    S_GRADIENT,
    S_INVERSE_INERTIA,
    S_MOVES,
    S_PUSH,
    SOLIDS,
    START_ROW,
)
from .rigid_sweeps import mobility_along

# What does not act in the velocity stage wants less than this.
_OPEN = -1e29
# Blows per contact after which no more are played; sweeps over the contacts of a pair, and where these end.
_BLOWS, _SWEEPS, _SETTLED = 20, 40, 1e-12
# Closing speed, over that of the fastest, that is none.
_STILL = 1e-9


@inner
def start_velocities(tape, s, rigid, k):
    """Velocities of all solids of lane k at the step's start into S_GRADIENT."""
    start = tape[rigid + START_ROW]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(3):
            s[at + S_GRADIENT + c] = s[LANES * (start + 6 * i + c) + k] * s[at + S_MOVES]
        a, b, c = symmetric_times(
            s, at + S_INVERSE_INERTIA, s[LANES * (start + 6 * i + 3) + k], s[LANES * (start + 6 * i + 4) + k],
            s[LANES * (start + 6 * i + 5) + k],
        )  # fmt: skip
        s[at + S_GRADIENT + 3] = a
        s[at + S_GRADIENT + 4] = b
        s[at + S_GRADIENT + 5] = c


@inner
def _closing(s, c, a, b):
    """Speed with which a contact closes, and that with which its surfaces meet."""
    u, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
    speed = max(-u, 0.0)
    return speed, sqrt(max(speed * speed + s[c + C_SHIFT], 0.0))


@inner
def _part(tape, s, n, rigid, first, count):
    """Part the pair of a contact: normal impulses after which none of its contacts wants more."""
    one = n[tape[rigid + END_A] + first]
    other = n[tape[rigid + END_B] + first]
    for i in range(count):
        if n[tape[rigid + END_A] + i] == one and n[tape[rigid + END_B] + i] == other:
            c = contact_at(tape, rigid, i)
            a, b = contact_ends(tape, n, rigid, i)
            speed, meets = _closing(s, c, a, b)
            # Wanted velocity, and the impulse so far.
            s[c + C_SPEED] = s[c + C_RESTITUTION] * meets if speed > 0.0 else 0.0
            s[c + C_SPEED + 1] = 0.0
    for _ in range(_SWEEPS):
        change = 0.0
        most = 0.0
        for i in range(count):
            same = n[tape[rigid + END_A] + i] == one and n[tape[rigid + END_B] + i] == other
            c = contact_at(tape, rigid, i)
            if same and s[c + C_LEAST] > _OPEN:
                a, b = contact_ends(tape, n, rigid, i)
                u, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
                before = s[c + C_SPEED + 1]
                after = max(before + (s[c + C_SPEED] - u) / s[c + C_SPEED + 2], 0.0)
                if after != before:
                    for end in range(2):
                        solid = a if end == 0 else b
                        if solid >= 0:
                            for k in range(6):
                                s[solid + S_PUSH + k] = 0.0
                    add_impulse(s, c, a, b, S_PUSH, after - before, 0.0, 0.0)
                    accelerate(s, a, S_PUSH, S_GRADIENT)
                    if b >= 0:
                        accelerate(s, b, S_PUSH, S_GRADIENT)
                    s[c + C_SPEED + 1] = after
                    s[c + C_CHANGE] = 1.0
                change = max(change, abs(after - before))
                most = max(most, after)
        if change <= _SETTLED * most:
            break


@inner
def _passes(tape, s, n, rigid, count):
    """Whether a blow falls on a solid that another pair touches."""
    for i in range(count):
        if s[contact_at(tape, rigid, i) + C_REBOUND] > 0.0:
            one = n[tape[rigid + END_A] + i]
            other = n[tape[rigid + END_B] + i]
            for j in range(count):
                if s[contact_at(tape, rigid, j) + C_LEAST] > _OPEN:
                    a = n[tape[rigid + END_A] + j]
                    b = n[tape[rigid + END_B] + j]
                    shared = a in (one, other) or (b >= 0 and b in (one, other))
                    if shared and (a != one or b != other):
                        return True
    return False


@inner
def pass_blows(tape, s, n, rigid, k, count):
    """Play through the blows of lane k; contacts that took part get what they must leave with.

    Where there is one blow alone, or none, nothing changes.
    """
    if not _passes(tape, s, n, rigid, count):
        return
    start_velocities(tape, s, rigid, k)
    fastest = 0.0
    for i in range(count):
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        s[c + C_CHANGE] = 0.0
        s[c + C_SHIFT] = 0.0
        give = mobility_along(s, c, a, C_ARM_A, C_NORMAL)
        if b >= 0:
            give += mobility_along(s, c, b, C_ARM_B, C_NORMAL)
        s[c + C_SPEED + 2] = give
        if s[c + C_REBOUND] > 0.0:
            speed, _ = _closing(s, c, a, b)
            meets = s[c + C_REBOUND] / s[c + C_RESTITUTION]
            s[c + C_SHIFT] = meets * meets - speed * speed
            fastest = max(fastest, meets)
    for _ in range(_BLOWS * count):
        worst = _STILL * fastest
        found = -1
        for i in range(count):
            c = contact_at(tape, rigid, i)
            if s[c + C_LEAST] > _OPEN:
                a, b = contact_ends(tape, n, rigid, i)
                speed, _ = _closing(s, c, a, b)
                if speed > worst:
                    worst = speed
                    found = i
        if found < 0:
            break
        _part(tape, s, n, rigid, found, count)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        if s[c + C_CHANGE] != 0.0:
            a, b = contact_ends(tape, n, rigid, i)
            u, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
            s[c + C_LEAST] = max(u, 0.0)
