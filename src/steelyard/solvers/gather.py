"""All impulses of a stage, gathered and applied."""

from __future__ import annotations

from ..constraints.clusters import clear_touched
from ..constraints.contacts import contact_impulses, contact_multiplier
from ..constraints.links import link_impulses, link_multiplier
from ..constraints.riders import DECK, HEAD, rider_impulses, rider_multiplier
from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import axes
from ..math.vectors import store_vector
from ..model.tape import (
    CONTACT,
    H_CONTACTS,
    H_FREE,
    H_IMPULSE,
    H_INVERSE_MASS,
    H_LINKS,
    H_PARTICLES,
    H_RIDERS,
    H_SINGLES,
    LINK,
)


@inner
def clear_velocity_multipliers(tape, s):
    """The velocity stage starts from no impulse."""
    zero = splat(0.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        store(s, link_multiplier(tape, at + 1 + LINK * index, True), zero)
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            store(s, rider_multiplier(tape, at, True) + axis, zero)
        at += HEAD + DECK * tape[at + 6]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        for axis in range(3):
            store(s, contact_multiplier(tape, at + 1 + CONTACT * index, True) + axis, zero)


@inner
def scale_multipliers(tape, s, factor):
    """Multipliers of links, riders and contacts times a factor."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        row = tape[at + 1 + LINK * index + 12]
        store(s, row, factor * load(s, row))
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            row = tape[at + 3] + axis
            store(s, row, factor * load(s, row))
        at += HEAD + DECK * tape[at + 6]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        for axis in range(3):
            row = tape[at + 1 + CONTACT * index + 15] + axis
            store(s, row, factor * load(s, row))


@inner
def gather(tape, s, skip, velocity, target):
    """Sum all impulses and apply them: rows ``target`` = free rows + M^-1 impulse.

    Particles of rigid clusters are moved by these, see ``constraints.clusters``.
    """
    zero = splat(0.0)
    singles = tape[H_SINGLES]
    for index in range(tape[singles]):
        p = tape[singles + 1 + index]
        store_vector(s, tape[H_IMPULSE] + 3 * p, zero, zero, zero)
    clear_touched(tape, s)
    # What is fixed takes impulses too, behind the last particle.
    store_vector(s, tape[H_IMPULSE] + 3 * tape[H_PARTICLES], zero, zero, zero)
    link_impulses(tape, s, velocity)
    rider_impulses(tape, s, velocity)
    contact_impulses(tape, s, skip, velocity)
    at = tape[H_SINGLES]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        inverse = load(s, tape[H_INVERSE_MASS] + p)
        for component in range(axes(s)):
            row = 3 * p + component
            part = load(s, tape[H_IMPULSE] + row)
            store(s, target + row, fma(inverse, part, load(s, tape[H_FREE] + row)))
