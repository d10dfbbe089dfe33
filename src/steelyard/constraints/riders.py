"""Riders: a particle held at the weighted mean of others, x = sum of w_i x_i, three rows each.

Record on the tape: x, v, impulse, multipliers, slot, inverse mass, count of deck particles, weights, rates, work
rows (coefficients, then velocity multipliers), then per deck particle: x, v, impulse, inverse mass. Riders on a
rigid cluster (``clusters``) have no rows and no record here. How the weights move stands apart, for all of them:
count, weights, rates, accelerations, coefficients.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..model.tape import H_MOVERS, H_RIDERS

HEAD = 10
DECK = 4


@inner
def rider_offset(s, tape, rider, component):
    """x - sum of w_i x_i, one component."""
    weights = tape[rider + 7]
    value = load(s, tape[rider] + component)
    for k in range(tape[rider + 6]):
        x = tape[rider + HEAD + DECK * k]
        value = fma(-load(s, weights + k), load(s, x + component), value)
    return value


@inner
def rider_slip(s, tape, rider, component):
    """v - sum of (w_i v_i + dw_i/dt x_i), one component."""
    weights = tape[rider + 7]
    rates = tape[rider + 8]
    value = load(s, tape[rider + 1] + component)
    for k in range(tape[rider + 6]):
        deck = rider + HEAD + DECK * k
        value = fma(-load(s, weights + k), load(s, tape[deck + 1] + component), value)
        value = fma(-load(s, rates + k), load(s, tape[deck] + component), value)
    return value


@inner
def rider_coefficients(tape, s):
    """Keep minus the present weights, the deck's coefficients: they direct the impulses."""
    at = tape[H_MOVERS]
    for index in range(tape[at]):
        mover = at + 1 + 5 * index
        for k in range(tape[mover]):
            store(s, tape[mover + 4] + k, -load(s, tape[mover + 1] + k))


@inner
def rider_advance(tape, s, dt):
    """Move the weights over ``dt`` at constant acceleration."""
    at = tape[H_MOVERS]
    for index in range(tape[at]):
        mover = at + 1 + 5 * index
        for k in range(tape[mover]):
            rate = load(s, tape[mover + 2] + k)
            gain = dt * load(s, tape[mover + 3] + k)
            mean = fma(splat(0.5), gain, rate)
            store(s, tape[mover + 1] + k, fma(dt, mean, load(s, tape[mover + 1] + k)))
            store(s, tape[mover + 2] + k, rate + gain)


@inner
def rider_multiplier(tape, rider, velocity):
    """First row of a rider's multipliers: of the position stage, or of the velocity stage."""
    return tape[rider + 9] + tape[rider + 6] if velocity else tape[rider + 3]


@inner
def rider_impulses(tape, s, velocity):
    """Add every rider's impulse to the load and, weighted, with the opposite sign to its deck."""
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        count = tape[at + 6]
        for component in range(axes(s)):
            part = load(s, rider_multiplier(tape, at, velocity) + component)
            f = tape[at + 2] + component
            store(s, f, load(s, f) + part)
            for k in range(count):
                f = tape[at + HEAD + DECK * k + 2] + component
                coefficient = load(s, tape[at + 9] + k)
                store(s, f, fma(coefficient, part, load(s, f)))
        at += HEAD + DECK * count
