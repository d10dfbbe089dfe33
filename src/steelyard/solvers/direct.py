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

from dataclasses import dataclass
from typing import ClassVar

from ..constraints.contacts import (
    contact_gap,
    contact_multiplier,
    contact_shift,
    contact_speed,
)
from ..constraints.links import (
    link_half_square,
    link_multiplier,
    link_rate,
)
from ..constraints.riders import DECK, HEAD, rider_multiplier, rider_offset, rider_slip
from ..kernel import inner
from ..math.lanes import absolute, any_lane, fma, load, select, splat, store
from ..model.tape import (
    CONTACT,
    DIRECT,
    H_BACKWARD,
    H_CABLES,
    H_CONTACTS,
    H_FACTOR,
    H_FORWARD,
    H_GUESS,
    H_LINK_COUPLINGS,
    H_LINK_DIAGONALS,
    H_LINK_MASKS,
    H_LINKS,
    H_MASK,
    H_MATRIX,
    H_MATRIX_ROWS,
    H_PADDING,
    H_PASSES,
    H_POINT_DIAGONALS,
    H_POINT_LINKS,
    H_POINT_POINTS,
    H_REFERENCES,
    H_RIDERS,
    H_RIGHT,
    H_TOLERANCE,
    H_UNSETTLED,
    H_USED_MASK,
    LINK,
)
from . import block_ldl
from .base import Solver
from .cone import factorise_contacts, solve_contacts
from .gather import clear_velocity_multipliers, gather

_FREE_CHANGES = 10
# Passes after which a world whose contacts do not settle is flagged instead of tried again.
_RETRIES = 4


@dataclass(frozen=True)
class Direct(Solver):
    """Sparse direct solve of all constraints (see the module).

    Args:
        tolerance: largest violation of a link over its length when a step ends.
        passes: most Newton passes; a world that needs more is flagged in ``world.health``.
    """

    tolerance: float = 1e-12
    passes: int = 60
    code: ClassVar[int] = DIRECT


@inner
def assemble(tape, s):
    """Matrix A = J M^-1 J^T of all blocks from the stored gradients, frames and weights."""
    zero = splat(0.0)
    for row in range(tape[H_MATRIX_ROWS]):
        store(s, tape[H_MATRIX] + row, zero)
    at = tape[H_LINK_DIAGONALS]
    for index in range(tape[at]):
        k = at + 1 + 4 * index
        d = tape[k + 1]
        square = load(s, d) * load(s, d)
        square = fma(load(s, d + 1), load(s, d + 1), square)
        square = fma(load(s, d + 2), load(s, d + 2), square)
        store(s, tape[k], square * (load(s, tape[k + 2]) + load(s, tape[k + 3])))
    at = tape[H_LINK_COUPLINGS]
    for index in range(tape[at]):
        k = at + 1 + 5 * index
        d = tape[k + 1]
        e = tape[k + 2]
        product = load(s, d) * load(s, e)
        product = fma(load(s, d + 1), load(s, e + 1), product)
        product = fma(load(s, d + 2), load(s, e + 2), product)
        weight = load(s, tape[k + 3]) * load(s, tape[k + 4])
        store(s, tape[k], fma(weight, product, load(s, tape[k])))
    at = tape[H_POINT_DIAGONALS]
    for index in range(tape[at]):
        k = at + 1 + 3 * index
        weight = load(s, tape[k + 1])
        weight = weight * weight * load(s, tape[k + 2])
        for row in (0, 2, 5):
            store(s, tape[k] + row, load(s, tape[k] + row) + weight)
    at = tape[H_POINT_LINKS]
    for index in range(tape[at]):
        k = at + 1 + 6 * index
        weight = load(s, tape[k + 2]) * load(s, tape[k + 3]) * load(s, tape[k + 4])
        d = tape[k + 5]
        x = weight * load(s, d)
        y = weight * load(s, d + 1)
        z = weight * load(s, d + 2)
        frame = tape[k + 1]
        for row in range(3):
            value = load(s, tape[k] + 3 * row)
            value = fma(load(s, frame + 3 * row), x, value)
            value = fma(load(s, frame + 3 * row + 1), y, value)
            value = fma(load(s, frame + 3 * row + 2), z, value)
            store(s, tape[k] + 3 * row, value)
    at = tape[H_POINT_POINTS]
    for index in range(tape[at]):
        k = at + 1 + 6 * index
        weight = load(s, tape[k + 3]) * load(s, tape[k + 4]) * load(s, tape[k + 5])
        for row in range(3):
            f = tape[k + 1] + 3 * row
            x = weight * load(s, f)
            y = weight * load(s, f + 1)
            z = weight * load(s, f + 2)
            for column in range(3):
                g = tape[k + 2] + 3 * column
                value = fma(x, load(s, g), load(s, tape[k] + 3 * row + column))
                value = fma(y, load(s, g + 1), value)
                store(s, tape[k] + 3 * row + column, fma(z, load(s, g + 2), value))


@inner
def factorise(tape, s, skip):
    """Mask slack cables, keep the diagonal as pivots' reference, and factorise all but W."""
    one = splat(1.0)
    at = tape[H_LINK_MASKS]
    for index in range(tape[at]):
        k = at + 1 + 3 * index
        store(s, tape[k], load(s, tape[k]) * load(s, tape[k + 1]) * load(s, tape[k + 2]))
    at = tape[H_PADDING]
    for index in range(tape[at]):
        k = at + 1 + 2 * index
        taken = load(s, tape[k + 1])
        store(s, tape[k], fma(load(s, tape[k]), taken, one - taken))
    at = tape[H_REFERENCES]
    for index in range(tape[at]):
        k = at + 1 + 2 * index
        store(s, tape[k], load(s, tape[k + 1]))
    block_ldl.factor(tape, tape[H_FACTOR], s, skip)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        slot = tape[at + 1 + LINK * index + 15]
        if slot >= 0:
            store(s, tape[H_USED_MASK] + slot, load(s, tape[H_MASK] + slot))


@inner
def _set_changed(tape, s):
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
def refactor(tape, s, skip):
    """Gradients are those stored; assemble and factorise anew."""
    assemble(tape, s)
    factorise(tape, s, skip)


@inner
def _contact_rows(tape, s, skip, velocity):
    """Right-hand sides of the contacts: minus the relative motion still unwanted."""
    zero = splat(0.0)
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            slot = tape[H_RIGHT] + tape[contact + 19]
            if velocity:
                wanted = load(s, tape[contact + 18] + 2)
                store(s, slot, wanted - contact_speed(s, tape, contact, 0))
                store(s, slot + 1, zero - contact_speed(s, tape, contact, 1))
                store(s, slot + 2, zero - contact_speed(s, tape, contact, 2))
            else:
                store(s, slot, zero - contact_gap(s, tape, contact))
                store(s, slot + 1, zero - contact_shift(s, tape, contact, 1))
                store(s, slot + 2, zero - contact_shift(s, tape, contact, 2))


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
def _link_error(tape, s, link, velocity, dt):
    """How far a link is from where it must be, and the error allowed (both in the units of g or its rate)."""
    length = load(s, tape[link + 8])
    allowed = load(s, tape[H_TOLERANCE]) * length * length
    if velocity:
        return link_rate(s, link, tape) - load(s, tape[link + 14]), allowed / dt
    return link_half_square(s, link, tape, length), allowed


@inner
def _pushing(tape, s, velocity):
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
def _withdraw(tape, s, skip, velocity, worlds, single):
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
        for axis in range(3):
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
def _tighten(tape, s, velocity, dt, worlds, single):
    """Take up slack cables that overstretch, all or the lowest only. Worlds that changed."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    changed = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            slot = tape[H_MASK] + tape[link + 15]
            error, allowed = _link_error(tape, s, link, velocity, dt)
            tightens = worlds & (load(s, slot) < half) & (error > allowed)
            if velocity:
                held = load(s, tape[link + 14] + 1) > half
                tightens = tightens & ((load(s, tape[link + 12]) > zero) | held)
            if single:
                tightens = tightens & (select(changed, zero, one) > half)
            store(s, slot, select(tightens, one, load(s, slot)))
            changed = changed | tightens
    return changed


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
            error, allowed = _link_error(tape, s, link, velocity, dt)
            error = error * load(s, tape[H_MASK] + slot)
            store(s, tape[H_RIGHT] + slot, error)
            bad = bad | (absolute(error) > allowed)
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        allowed = load(s, tape[H_TOLERANCE])
        if velocity:
            allowed = allowed / dt
        for axis in range(3):
            error = rider_slip(s, tape, at, axis) if velocity else rider_offset(s, tape, at, axis)
            store(s, tape[H_RIGHT] + tape[at + 4] + axis, zero - error)
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
        for axis in range(3):
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
def solve_stage(tape, s, skip, velocity, dt, target):
    """One stage: multipliers and the rows ``target`` (positions or velocities) that meet all constraints.

    ``target`` starts from the free rows; the stored gradients, frames and weights direct the impulses.
    """
    zero = splat(0.0)
    # Rows that no constraint uses must stay 0: what a broken world left there would reach the next block.
    for row in range(tape[H_RIGHT], tape[H_GUESS]):
        store(s, row, zero)
    if velocity:
        clear_velocity_multipliers(tape, s)
    _link_start(tape, s, velocity)
    gather(tape, s, skip, velocity, target)
    _contact_start(tape, s, skip, velocity)
    contacts = tape[tape[H_CONTACTS]]
    bad = zero >= zero
    stuck = zero > zero
    lost = zero > zero
    allowed = load(s, tape[H_TOLERANCE])
    if velocity:
        allowed = allowed / dt
    if contacts > 0:
        factorise_contacts(tape, s, skip)
    for turn in range(tape[H_PASSES]):
        changed = zero > zero
        if tape[H_CABLES] > 0:
            single = turn >= _FREE_CHANGES
            if turn > 0:
                changed = _pushing(tape, s, velocity) & bad
                if any_lane(changed):
                    _withdraw(tape, s, skip, velocity, changed, single)
                    gather(tape, s, skip, velocity, target)
            others = select(changed, zero, splat(1.0)) > splat(0.5)
            changed = changed | _tighten(tape, s, velocity, dt, others, single)
        # Letting a cable go may stretch another: a world whose set changed has not settled.
        late = changed | _right_rows(tape, s, velocity, dt)
        if turn < _RETRIES:
            late = late | stuck
        else:
            lost = lost | stuck
        bad = (bad & (zero >= zero)) if turn == 0 and contacts > 0 else late
        if not any_lane(bad):
            break
        if tape[H_CABLES] > 0 and _set_changed(tape, s):
            refactor(tape, s, skip)
            if contacts > 0:
                factorise_contacts(tape, s, skip)
        if contacts > 0:
            _contact_rows(tape, s, skip, velocity)
        block_ldl.forward(tape, tape[H_FORWARD], s, skip)
        if contacts > 0:
            stuck = solve_contacts(tape, s, skip, velocity, allowed) & bad
        block_ldl.backward(tape, tape[H_BACKWARD], s, skip)
        _accept(tape, s, skip, velocity, bad)
        gather(tape, s, skip, velocity, target)
        if velocity and tape[H_CABLES] == 0 and not any_lane(stuck):
            # Velocities are linear and nothing can go slack: one solve is exact.
            bad = stuck
            break
    bad = bad | lost
    store(s, tape[H_UNSETTLED], select(bad, splat(1.0), load(s, tape[H_UNSETTLED])))
