"""Contacts of the direct solver on their Schur complement W: who opens, sticks or slides.

Find multipliers l with u = W l - b, per contact: l_n >= 0, u_n >= 0, l_n u_n = 0, |l_t| <= mu l_n, and l_t opposite to
u_t where it slides (Signorini and Coulomb). First try: loaded contacts stick, one solve. Worlds where that
breaks a condition take Newton's method (``cone_newton``), and where that fails are swept: projected
Gauss-Seidel on W, whose fixed point is the law itself.
"""

from __future__ import annotations

from ..constraints.contacts import contact_multiplier
from ..kernel import inner
from ..math.lanes import absolute, any_lane, fma, load, select, splat, sqrt, store
from ..math.pointers import spatial
from ..model.tape import (
    CONTACT,
    H_CONTACT_BACKWARD,
    H_CONTACT_COPIES,
    H_CONTACT_FACTOR,
    H_CONTACT_FORWARD,
    H_CONTACT_PRODUCTS,
    H_CONTACTS,
    H_DENSE,
    H_DT,
    H_GUESS,
    H_MASK,
    H_REPEATS,
    H_RIGHT,
    H_TOTAL,
)
from . import block_ldl
from .cone_newton import anchor, newton, softened_motion
from .cone_rows import relative_motion

_SWEEPS = 200
_ANCHORS = 3
# Share of the allowed error that softness may leave.
_PULL = 1e-2


@inner
def factorise_contacts(tape, s, skip, softness):
    """Factor of W over the masked rows, a little softened.

    Contacts joined by links share their load in more ways than one. A little softness on the diagonal makes
    the solution the one of least norm, which spreads friction and so stays inside the cones where it can.
    """
    at = tape[H_CONTACT_COPIES]
    for index in range(tape[at]):
        k = at + 1 + 5 * index
        taken = load(s, tape[k + 2]) * load(s, tape[k + 3])
        value = load(s, tape[k + 1]) * taken
        if tape[k + 4] >= 0:
            value = fma(load(s, tape[k + 4]), splat(1.0 + softness) - taken, value)
        store(s, tape[k], value)
    block_ldl.factor(tape, tape[H_CONTACT_FACTOR], spatial(s), skip)


@inner
def _stick(tape, s, skip, velocity, first):
    """Solve W l = b over the masked rows into the guess rows.

    Repeating the solve on what is left of b takes the factor's softness out (the proximal point method), as often as
    the tolerance asks; once less for velocities, whose softness is the square. The ``first`` of a stage's passes
    starts from nothing, which spreads friction evenly, others from the guess.
    """
    zero = splat(0.0)
    at = tape[H_CONTACTS]
    guess = tape[H_GUESS]
    total = tape[H_TOTAL]
    for index in range(tape[at]):
        slot = tape[at + 1 + CONTACT * index + 19]
        for row in range(slot, slot + 3):
            value = zero if first else load(s, guess + row) * load(s, tape[H_MASK] + row)
            store(s, total + row, value)
    repeats = tape[H_REPEATS]
    if velocity:
        repeats = max(repeats - 1, 1)
    for repeat in range(repeats):
        k = tape[H_CONTACT_PRODUCTS] + 1
        for index in range(tape[at]):
            contact = at + 1 + CONTACT * index
            if skip[tape[contact + 20]] == 0:
                slot = tape[contact + 19]
                right = tape[H_RIGHT] + slot
                mask = tape[H_MASK] + slot
                a = load(s, right)
                b = load(s, right + 1)
                c = load(s, right + 2)
                if repeat > 0 or not first:
                    x, y, z = relative_motion(tape, s, skip, k, total)
                    a = a - x
                    b = b - y
                    c = c - z
                store(s, guess + slot, a * load(s, mask))
                store(s, guess + slot + 1, b * load(s, mask + 1))
                store(s, guess + slot + 2, c * load(s, mask + 2))
            k += 5 + 4 * tape[k + 4]
        block_ldl.forward(tape, tape[H_CONTACT_FORWARD], spatial(s), skip)
        block_ldl.backward(tape, tape[H_CONTACT_BACKWARD], spatial(s), skip)
        for index in range(tape[at]):
            slot = tape[at + 1 + CONTACT * index + 19]
            for row in range(slot, slot + 3):
                value = load(s, guess + row) * load(s, tape[H_MASK] + row)
                store(s, total + row, load(s, total + row) + value)
    for index in range(tape[at]):
        slot = tape[at + 1 + CONTACT * index + 19]
        for row in range(slot, slot + 3):
            store(s, guess + row, load(s, total + row))


@inner
def _violated(tape, s, skip, velocity):
    """Worlds in which the guess breaks a condition."""
    zero = splat(0.0)
    half = splat(0.5)
    bad = zero > zero
    at = tape[H_CONTACTS]
    k = tape[H_CONTACT_PRODUCTS] + 1
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            slot = tape[contact + 19]
            loaded = load(s, tape[H_MASK] + slot) > half
            guess = tape[H_GUESS] + slot
            n = load(s, guess)
            idle = (load(s, tape[contact + 18]) > half) & (load(s, tape[H_MASK] + slot) < half)
            if any_lane(idle):
                a, _, _ = relative_motion(tape, s, skip, k, tape[H_GUESS])
                opening = a - load(s, tape[H_RIGHT] + slot)
                bad = bad | (idle & (opening < splat(-1e-13)))
            t = load(s, guess + 1)
            u = load(s, guess + 2)
            bound = load(s, tape[contact + 14]) * select(n > zero, n, zero)
            slips = fma(u, u, t * t) > bound * bound
            pulls = n < zero
            if velocity:
                pulls = pulls & (load(s, tape[contact + 18] + 3) < half)
            bad = bad | (loaded & (pulls | slips))
        k += 5 + 4 * tape[k + 4]
    return bad


@inner
def _sweep(tape, s, skip, velocity, worlds, allowed, softness):
    """Projected Gauss-Seidel on W in the worlds of the mask, from the guess rows; worlds that did not settle."""
    zero = splat(0.0)
    half = splat(0.5)
    moving = worlds
    for _ in range(_SWEEPS):
        change = zero
        at = tape[H_CONTACTS]
        k = tape[H_CONTACT_PRODUCTS] + 1
        for index in range(tape[at]):
            contact = at + 1 + CONTACT * index
            if skip[tape[contact + 20]] == 0:
                slot = tape[contact + 19]
                w = tape[k + 1]
                possible = load(s, tape[contact + 18]) > half
                a, b, c = softened_motion(tape, s, skip, contact, k, softness)
                guess = tape[H_GUESS] + slot
                n0 = load(s, guess)
                t0 = load(s, guess + 1)
                u0 = load(s, guess + 2)
                soft = splat(softness) * load(s, tape[k + 3])
                w00 = load(s, w) + soft
                stiff = w00 > zero
                step = select(stiff, a / select(stiff, w00, splat(1.0)), zero)
                n = n0 - step
                pushing = n > zero
                if velocity:
                    pushing = pushing | (load(s, tape[contact + 18] + 3) > half)
                n = select(pushing & possible, n, zero)
                jump = n - n0
                b = fma(load(s, w + 1), jump, b)
                c = fma(load(s, w + 3), jump, c)
                w11 = load(s, w + 2) + soft
                w22 = load(s, w + 5) + soft
                size = select(w11 > w22, w11, w22) + absolute(load(s, w + 4))
                inverse = select(size > zero, splat(1.0) / size, zero)
                t = fma(-inverse, b, t0)
                u = fma(-inverse, c, u0)
                bound = load(s, tape[contact + 14]) * select(n > zero, n, zero)
                length = sqrt(fma(u, u, t * t))
                outside = length > bound
                factor = select(outside, bound / select(outside, length, splat(1.0)), splat(1.0))
                t = t * factor
                u = u * factor
                n = select(moving, n, n0)
                t = select(moving, t, t0)
                u = select(moving, u, u0)
                store(s, guess, n)
                store(s, guess + 1, t)
                store(s, guess + 2, u)
                # What a change of impulse moves is what counts, not the impulse, which may be shared freely.
                for scale, value, old in ((w00, n, n0), (size, t, t0), (size, u, u0)):
                    moved = scale * absolute(value - old)
                    change = select(moved > change, moved, change)
            k += 5 + 4 * tape[k + 4]
        moving = moving & (change > allowed)
        if not any_lane(moving):
            break
    return moving


@inner
def _put_back(tape, s, skip, velocity, worlds):
    """Guess rows of ``worlds`` back to the multipliers at hand, or for velocities to what the positions took.

    A steady force F acts in the position stage by F dt^2/2 and in the velocity stage by F dt/2.
    """
    share = splat(1.0)
    if velocity:
        share = share / load(s, tape[H_DT])
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            for axis in range(3):
                guess = tape[H_GUESS] + tape[contact + 19] + axis
                old = share * load(s, contact_multiplier(tape, contact, False) + axis)
                store(s, guess, select(worlds, old, load(s, guess)))


@inner
def _pull(tape, s, skip, softness):
    """Largest motion that softness leaves: compliance times the change of an impulse since the anchor."""
    pull = splat(0.0)
    at = tape[H_CONTACTS]
    k = tape[H_CONTACT_PRODUCTS] + 1
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            soft = splat(softness) * load(s, tape[k + 3])
            for axis in range(3):
                held = load(s, tape[contact + 23] + 3 + axis)
                change = load(s, tape[H_GUESS] + tape[contact + 19] + axis) - held
                change = soft * absolute(change)
                pull = select(change > pull, change, pull)
        k += 5 + 4 * tape[k + 4]
    return pull


@inner
def solve_contacts(tape, s, skip, velocity, allowed, softness, first, hasty):
    """Solve the contact problem left by elimination.

    In: right rows hold b minus W times the present multipliers; guess rows the present multipliers. Out: right
    rows hold the change of the multipliers, guess rows the new ones. Sweeps settle when they move contacts by
    no more than ``allowed`` [m or m/s]. Returns the worlds that did not settle; if ``hasty``, those in which
    loaded contacts do not stick.
    """
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_CONTACTS]
    k = tape[H_CONTACT_PRODUCTS] + 1
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            right = tape[H_RIGHT] + tape[contact + 19]
            if not (velocity and first):
                # Velocities start from no impulse.
                a, b, c = relative_motion(tape, s, skip, k, tape[H_GUESS])
                store(s, right, load(s, right) + a)
                store(s, right + 1, load(s, right + 1) + b)
                store(s, right + 2, load(s, right + 2) + c)
            for axis in range(3):
                held = tape[H_GUESS] + tape[contact + 19] + axis
                store(s, tape[contact + 23] + axis, load(s, held))
        k += 5 + 4 * tape[k + 4]
    _stick(tape, s, skip, velocity, first)
    bad = _violated(tape, s, skip, velocity)
    stuck = zero > zero
    if hasty:
        stuck = bad
    elif any_lane(bad):
        _put_back(tape, s, skip, velocity, bad)
        for _ in range(_ANCHORS):
            anchor(tape, s, skip, bad)
            failed = bad
            if tape[H_DENSE] >= 0:
                failed = newton(tape, s, skip, velocity, bad, allowed, softness)
            if any_lane(failed):
                failed = _sweep(tape, s, skip, velocity, failed, allowed, softness)
            stuck = failed | (stuck & (select(bad, zero, one) > zero))
            bad = bad & (_pull(tape, s, skip, softness) > splat(_PULL) * allowed)
            if not any_lane(bad):
                break
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            for axis in range(3):
                slot = tape[contact + 19] + axis
                old = load(s, tape[contact + 23] + axis)
                store(s, tape[H_RIGHT] + slot, load(s, tape[H_GUESS] + slot) - old)
    return stuck
