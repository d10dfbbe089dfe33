"""Cables of the direct solver: which are taut, the active set of a stage."""

from __future__ import annotations

from ..constraints.contacts import contact_multiplier
from ..constraints.links import link_half_square, link_multiplier, link_rate
from ..constraints.riders import DECK, HEAD, rider_multiplier
from ..kernel import inner
from ..math.lanes import absolute, any_lane, load, select, splat, store
from ..math.pointers import axes
from ..model.tape import (
    CONTACT,
    H_CONTACTS,
    H_GUESS,
    H_LINKS,
    H_MASK,
    H_RIDERS,
    H_TOLERANCE,
    H_USED_MASK,
    LINK,
)


@inner
def link_error(tape, s, link, velocity, dt):
    """How far a link is from where it must be, and the error allowed (both in the units of g or its rate)."""
    length = load(s, tape[link + 8])
    allowed = load(s, tape[H_TOLERANCE]) * length * length
    if velocity:
        return link_rate(s, link, tape) - load(s, tape[link + 14]), allowed / dt
    return link_half_square(s, link, tape, length), allowed


@inner
def set_changed(tape, s):
    """Whether a cable's state differs, in any world, from that of the present factor."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            old = load(s, tape[H_USED_MASK] + tape[link + 15])
            new = load(s, tape[H_MASK] + tape[link + 15])
            if any_lane(absolute(new - old) > splat(0.5)):
                return True
    return False


@inner
def pushing(tape, s, velocity):
    """Worlds in which a taut cable pushes."""
    zero = splat(0.0)
    half = splat(0.5)
    pushing = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            taut = load(s, tape[H_MASK] + tape[link + 15]) > half
            lets_go = taut & (load(s, link_multiplier(tape, link, velocity)) < zero)
            if velocity:
                lets_go = lets_go & (load(s, tape[link + 14] + 1) < half)
            pushing = pushing | lets_go
    return pushing


@inner
def withdraw(tape, s, skip, velocity, worlds, single):
    """Undo the last pass where a cable pushes, and let those cables go, all or the lowest only."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    flipped = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        row = link_multiplier(tape, link, velocity)
        value = load(s, row)
        before = load(s, tape[link + 14] + 3)
        if tape[link + 10] != 0:
            slot = tape[H_MASK] + tape[link + 15]
            lets_go = (load(s, slot) > half) & (value < zero)
            if velocity:
                lets_go = lets_go & (load(s, tape[link + 14] + 1) < half)
            if single:
                lets_go = lets_go & (select(flipped, zero, one) > half)
                flipped = flipped | lets_go
            store(s, slot, select(lets_go, zero, load(s, slot)))
            before = select(lets_go, zero, before)
        store(s, row, select(worlds, before, value))
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        row = rider_multiplier(tape, at, velocity)
        old = tape[at + 9] + tape[at + 6] + 3
        for axis in range(axes(s)):
            store(s, row + axis, select(worlds, load(s, old + axis), load(s, row + axis)))
        at += HEAD + DECK * tape[at + 6]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            row = contact_multiplier(tape, contact, velocity)
            guess = tape[H_GUESS] + tape[contact + 19]
            for axis in range(3):
                value = select(worlds, load(s, tape[contact + 23] + axis), load(s, row + axis))
                store(s, row + axis, value)
                store(s, guess + axis, value)


@inner
def tighten(tape, s, velocity, dt, worlds, single):
    """Take up slack cables that overstretch, all or the lowest only; none that is on trial. Worlds that changed."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    changed = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            slot = tape[H_MASK] + tape[link + 15]
            error, allowed = link_error(tape, s, link, velocity, dt)
            tightens = worlds & (load(s, slot) < half) & (error > allowed)
            tightens = tightens & (load(s, tape[link + 14] + 4) < half)
            if velocity:
                held = load(s, tape[link + 14] + 1) > half
                tightens = tightens & ((load(s, tape[link + 12]) > zero) | held)
            if single:
                tightens = tightens & (select(changed, zero, one) > half)
            store(s, slot, select(tightens, one, load(s, slot)))
            changed = changed | tightens
    return changed
