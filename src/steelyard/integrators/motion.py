"""The pieces that integrators are made of: kick, drift, damp."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..model.tape import (
    H_ACCELERATION,
    H_CONSTRAINED,
    H_DAMPED,
    H_DAMPING,
    H_DRIFT,
    H_FORCE,
    H_FORCED,
    H_FREE,
    H_IMPULSE,
    H_INVERSE_MASS,
    H_PARTICLES,
    H_POSITION,
    H_SINGLES,
    H_START,
    H_VELOCITY,
)


@inner
def kick(tape, s, dt):
    """v += dt (a + F/m) for every particle but those on a stiff spring, whose flow holds all of it."""
    at = tape[H_DRIFT]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            a = load(s, tape[H_ACCELERATION] + row)
            if tape[H_FORCED] != 0:
                a = fma(inverse, load(s, tape[H_FORCE] + row), a)
            v = tape[H_VELOCITY] + row
            store(s, v, fma(dt, a, load(s, v)))


@inner
def damp(tape, s):
    """v *= damping^(share of the step); the powers lie in the damping rows."""
    if tape[H_DAMPED] != 0:
        for p in range(tape[H_PARTICLES]):
            factor = load(s, tape[H_DAMPING] + p)
            for component in range(axes(s)):
                v = tape[H_VELOCITY] + 3 * p + component
                store(s, v, load(s, v) * factor)


@inner
def drift(tape, s, dt):
    """x += dt v; with constraints the start is kept and the result also becomes the free position."""
    at = tape[H_DRIFT]
    constrained = tape[H_CONSTRAINED] != 0
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        for component in range(axes(s)):
            row = 3 * p + component
            x = load(s, tape[H_POSITION] + row)
            moved = fma(dt, load(s, tape[H_VELOCITY] + row), x)
            if constrained:
                store(s, tape[H_START] + row, x)
                store(s, tape[H_FREE] + row, moved)
            store(s, tape[H_POSITION] + row, moved)


@inner
def add_stage_velocity(tape, s, dt):
    """v += M^-1 impulse / dt: what the position stage's impulses did to the velocities."""
    inverse_dt = splat(1.0) / dt
    at = tape[H_DRIFT]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        weight = load(s, tape[H_INVERSE_MASS] + p) * inverse_dt
        for component in range(axes(s)):
            row = 3 * p + component
            v = tape[H_VELOCITY] + row
            store(s, v, fma(weight, load(s, tape[H_IMPULSE] + row), load(s, v)))


@inner
def keep_free_velocity(tape, s):
    """Free rows = velocities, from which the velocity stage starts; rigid clusters sum theirs up at once."""
    at = tape[H_SINGLES]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        for axis in range(axes(s)):
            row = 3 * p + axis
            store(s, tape[H_FREE] + row, load(s, tape[H_VELOCITY] + row))
