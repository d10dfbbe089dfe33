"""Direct solver: links, riders and contacts of a world in one sparse factorisation.

Position stage: find multipliers such that x = x_free + M^-1 J(x_start)^T l satisfies every constraint, by
chord Newton on A = J M^-1 J^T at the step's start (Barth et al. 1995 for rods). Velocity stage: one linear
solve with A at the step's end. Cables are rows of an active set: taut rows take part, slack ones are
masked; from the tenth change on only the lowest violated row changes (Murty 1974), which ends. Contacts
are eliminated last; their Schur complement W is solved as one block assuming that loaded contacts stick,
and where that is wrong by projected sweeps on W, whose fixed point is Coulomb's law. A world that has
converged is frozen: no result depends on its neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..constraints.clusters import finish_clusters, place_clusters, start_clusters
from ..constraints.contacts import (
    contact_gap,
    contact_multiplier,
    contact_shift,
    contact_speed,
    moved_by_load,
)
from ..constraints.links import link_multiplier
from ..constraints.riders import DECK, HEAD, rider_multiplier, rider_offset, rider_slip
from ..kernel import inner
from ..math.lanes import absolute, any_lane, load, select, splat, store
from ..math.pointers import axes, spatial
from ..model.tape import (
    CONTACT,
    FRESH,
    H_BACKWARD,
    H_BLOCKS,
    H_CABLES,
    H_CONTACTS,
    H_DT,
    H_FORWARD,
    H_GIVEN_UP,
    H_GUESS,
    H_LINKS,
    H_MASK,
    H_PASSES,
    H_POSITION,
    H_RIDERS,
    H_RIGHT,
    H_TOLERANCE,
    H_UNSETTLED,
    H_VELOCITY,
    HASTY,
    LINK,
)
from ..stage import Stage, stage
from . import block_ldl
from .base import Solver
from .cables import link_error, pushing, set_changed, tighten, withdraw
from .cone import factorise_contacts, solve_contacts
from .gather import clear_velocity_multipliers, gather
from .matrix import refactor
from .stages import begin_stage, end_stage

_FREE_CHANGES = 10
# Passes after which a world whose contacts do not settle is flagged instead of tried again.
_RETRIES = 4
# Compliance of contacts, as a share of the inverse mass they act on; repeated solves take it out again.
# Contacts that rigid things join share friction in more ways than one, and what is still to be solved makes them
# contradict one another: a harder compliance answers that with larger opposing forces.
_SOFT, _HARD = 1e-3, 1e-5
# Velocities do not contradict one another. With the square of the softness one repeat less takes it out.
_FIRM = _SOFT * _SOFT
_MOST_REPEATS = 4


@dataclass(frozen=True)
class Direct(Solver):
    """Sparse direct solve of all constraints (see the module).

    Args:
        tolerance: largest violation of a link over its length when a step ends.
        passes: most Newton passes; a world that needs more is flagged in ``world.health``.
    """

    tolerance: float = 1e-12
    passes: int = 60
    exact: ClassVar[bool] = True
    sparse: ClassVar[bool] = True

    @property
    def repeats(self) -> int:
        """Solves of contacts that take their softness out, each by its factor, to a thousandth of the tolerance."""
        # A centimetre is more than a contact has to make up for in a step.
        wanted = math.log(0.1 * self.tolerance) / math.log(_SOFT)
        return max(1, min(_MOST_REPEATS, math.ceil(wanted - 1e-9)))

    @property
    def stage(self) -> Stage:
        """Puts a half step on the constraints."""
        return direct_stage


@inner
def _contact_rows(tape, s, skip, velocity):
    """Right-hand sides of the contacts: minus the relative motion still unwanted."""
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            slot = tape[H_RIGHT] + tape[contact + 19]
            if velocity:
                wanted = load(s, tape[contact + 18] + 2)
                store(s, slot, wanted - contact_speed(s, tape, contact, 0))
                store(s, slot + 1, -contact_speed(s, tape, contact, 1))
                store(s, slot + 2, -contact_speed(s, tape, contact, 2))
            else:
                store(s, slot, -contact_gap(s, tape, contact))
                store(s, slot + 1, -contact_shift(s, tape, contact, 1))
                store(s, slot + 2, -contact_shift(s, tape, contact, 2))


@inner
def _missed(tape, s, skip):
    """Worlds in which a contact went through the surface, or carries load above it, by more than the tolerance.

    Shifts along the surface are not asked: a foot that lands while another stands must give by second order.
    """
    zero = splat(0.0)
    missed = zero > zero
    allowed = load(s, tape[H_TOLERANCE])
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            gap = contact_gap(s, tape, contact)
            # Newton's method may leave on a contact that it opens a load that moves nothing.
            loaded = moved_by_load(tape, s, contact) > allowed
            possible = load(s, tape[contact + 18]) > splat(0.5)
            missed = missed | (possible & (gap < -allowed)) | (loaded & (gap > allowed))
    return missed


@inner
def _contact_start(tape, s, skip, velocity):
    """First guess: the multipliers at hand; loaded contacts and those about to close are taken to stick."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            slot = tape[contact + 19]
            multiplier = contact_multiplier(tape, contact, velocity)
            possible = load(s, tape[contact + 18]) > half
            if velocity:
                carried = load(s, tape[contact + 15]) > zero
                possible = possible & (carried | (load(s, tape[contact + 18] + 3) > half))
                store(s, tape[contact + 18], select(possible, one, zero))
                loaded = possible
            else:
                closes = contact_gap(s, tape, contact) < zero
                loaded = possible & ((load(s, multiplier) > zero) | closes)
            sticks = loaded & (load(s, tape[contact + 14]) > zero)
            store(s, tape[H_MASK] + slot, select(loaded, one, zero))
            store(s, tape[H_MASK] + slot + 1, select(sticks, one, zero))
            store(s, tape[H_MASK] + slot + 2, select(sticks, one, zero))
            for axis in range(3):
                value = load(s, multiplier + axis)
                value = select(possible, value, zero)
                store(s, multiplier + axis, value)
                store(s, tape[H_GUESS] + slot + axis, value)


@inner
def _link_start(tape, s, velocity):
    """First active set: rods, and cables that carried tension (or, for velocities, are held)."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        slot = tape[link + 15]
        if slot >= 0:
            taut = one
            if tape[link + 10] != 0:
                closed = load(s, tape[link + 12]) > zero
                if velocity:
                    closed = closed | (load(s, tape[link + 14] + 1) > splat(0.5))
                taut = select(closed, one, zero)
            store(s, tape[H_MASK] + slot, taut)


@inner
def _right_rows(tape, s, velocity, dt):
    """Right-hand sides of links and riders; worlds that still miss the tolerance."""
    zero = splat(0.0)
    bad = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        slot = tape[link + 15]
        if slot >= 0:
            error, allowed = link_error(tape, s, link, velocity, dt)
            error = error * load(s, tape[H_MASK] + slot)
            store(s, tape[H_RIGHT] + slot, error)
            bad = bad | (absolute(error) > allowed)
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        allowed = load(s, tape[H_TOLERANCE])
        if velocity:
            allowed = allowed / dt
        for axis in range(axes(s)):
            error = rider_slip(s, tape, at, axis) if velocity else rider_offset(s, tape, at, axis)
            store(s, tape[H_RIGHT] + tape[at + 4] + axis, -error)
            bad = bad | (absolute(error) > allowed)
        at += HEAD + DECK * tape[at + 6]
    return bad


@inner
def _accept(tape, s, skip, velocity, worlds):
    """Add the solved changes to the multipliers of the worlds that take part."""
    zero = splat(0.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        slot = tape[link + 15]
        if slot >= 0:
            row = link_multiplier(tape, link, velocity)
            store(s, tape[link + 14] + 3, load(s, row))
            change = load(s, tape[H_RIGHT] + slot) * load(s, tape[H_MASK] + slot)
            store(s, row, load(s, row) + select(worlds, change, zero))
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        row = rider_multiplier(tape, at, velocity)
        for axis in range(axes(s)):
            store(s, tape[at + 9] + tape[at + 6] + 3 + axis, load(s, row + axis))
            change = load(s, tape[H_RIGHT] + tape[at + 4] + axis)
            store(s, row + axis, load(s, row + axis) + select(worlds, change, zero))
        at += HEAD + DECK * tape[at + 6]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            row = contact_multiplier(tape, contact, velocity)
            guess = tape[H_GUESS] + tape[contact + 19]
            for axis in range(3):
                value = select(worlds, load(s, guess + axis), load(s, row + axis))
                store(s, row + axis, value)
                store(s, guess + axis, value)


@inner
def _apply(tape, s, skip, velocity, target, worlds):
    """Rows ``target`` as the multipliers at hand, changed in ``worlds``, and the rigid clusters make them."""
    gather(tape, s, skip, velocity, target)
    place_clusters(tape, s, target, velocity, worlds)


@inner
def solve_stage(tape, s, skip, velocity, dt, target, hasty):
    """One stage: multipliers and the rows ``target`` (positions or velocities) that meet all constraints.

    ``target`` starts from the free rows; the stored gradients, frames and weights direct the impulses.
    ``hasty``: give up worlds in which a contact slips or opens, and set their flag.
    """
    zero = splat(0.0)
    # Rows that no constraint uses must stay 0: what a broken world left there would reach the next block.
    for row in range(tape[H_RIGHT], tape[H_GUESS]):
        store(s, row, zero)
    if velocity:
        clear_velocity_multipliers(tape, s)
    _link_start(tape, s, velocity)
    start_clusters(tape, s, velocity)
    _apply(tape, s, skip, velocity, target, zero >= zero)
    _contact_start(tape, s, skip, velocity)
    contacts = tape[tape[H_CONTACTS]]
    half = splat(0.5)
    bad = load(s, tape[H_GIVEN_UP]) < half
    stuck = zero > zero
    lost = zero > zero
    allowed = load(s, tape[H_TOLERANCE])
    if velocity:
        allowed = allowed / dt
    softness = _FIRM if velocity else _SOFT
    if contacts > 0:
        factorise_contacts(tape, s, skip, softness)
    for turn in range(tape[H_PASSES]):
        changed = zero > zero
        if tape[H_CABLES] > 0:
            single = turn >= _FREE_CHANGES
            if turn > 0:
                changed = pushing(tape, s, velocity) & bad
                if any_lane(changed):
                    withdraw(tape, s, skip, velocity, changed, single)
                    _apply(tape, s, skip, velocity, target, changed)
            others = select(changed, zero, splat(1.0)) > splat(0.5)
            changed = changed | tighten(tape, s, velocity, dt, others, single)
        # Letting a cable go may stretch another: a world whose set changed has not settled.
        late = changed | _right_rows(tape, s, velocity, dt)
        if contacts > 0 and turn > 0 and not velocity:
            late = late | _missed(tape, s, skip)
        if turn < _RETRIES:
            late = late | stuck
        else:
            lost = lost | stuck
        if turn > 0 or contacts == 0:
            bad = late & (load(s, tape[H_GIVEN_UP]) < half)
        if not any_lane(bad):
            break
        if tape[H_CABLES] > 0 and set_changed(tape, s):
            refactor(tape, s, skip)
            if contacts > 0:
                factorise_contacts(tape, s, skip, softness)
        if contacts > 0 and turn == _RETRIES and not velocity:
            softness = _HARD
            factorise_contacts(tape, s, skip, softness)
        if contacts > 0:
            _contact_rows(tape, s, skip, velocity)
        block_ldl.forward(tape, tape[H_FORWARD], spatial(s), skip)
        if contacts > 0:
            first = turn == 0
            stuck = bad & solve_contacts(tape, s, skip, velocity, allowed, softness, first, hasty)
            if hasty:
                store(s, tape[H_GIVEN_UP], select(stuck, splat(1.0), load(s, tape[H_GIVEN_UP])))
                bad = bad & (load(s, tape[H_GIVEN_UP]) < half)
                stuck = zero > zero
        block_ldl.backward(tape, tape[H_BACKWARD], spatial(s), skip)
        _accept(tape, s, skip, velocity, bad)
        _apply(tape, s, skip, velocity, target, bad)
        if velocity and tape[H_CABLES] == 0 and not any_lane(stuck):
            # Velocities are linear and nothing can go slack: one solve is exact.
            bad = stuck
            break
    finish_clusters(tape, s, target, velocity)
    bad = bad | lost
    store(s, tape[H_UNSETTLED], select(bad, splat(1.0), load(s, tape[H_UNSETTLED])))


@stage
def direct_stage(tape, s, skip, half):
    """Put the drifted positions, or the kicked velocities, on the constraints, impacts included."""
    velocity = half == 1
    begin_stage(tape, s, half)
    words = tape[H_BLOCKS]
    if velocity or skip[words + FRESH] != 0:
        refactor(tape, s, skip)
    target = tape[H_VELOCITY] if velocity else tape[H_POSITION]
    solve_stage(tape, s, skip, velocity, load(s, tape[H_DT]), target, skip[words + HASTY] != 0)
    end_stage(tape, s, half)
