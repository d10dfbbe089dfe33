"""Contacts of particles: relative motion in the contact frame, impact targets and impulses.

A contact carries three multipliers along its frame (normal, tangent 1, tangent 2). Position stage: the gap at
the end of the step is not negative and the tangential displacement obeys Coulomb's law. Velocity stage: a
contact that carried load keeps or gains the separation speed its restitution asks for.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import any_lane, fma, load, select, splat, sqrt, store
from ..math.pointers import axes
from ..model.tape import CONTACT, GROUND, H_CONTACTS, H_TOLERANCE

# Share of a penetration found at the start that one step takes back.
_RECOVERY = 0.2
# Share of the tolerance below which what an impulse moves is nothing.
_IDLE = 1e-2


@inner
def contact_motion(s, frame, axis, xa, xb, base_a, base_b):
    """Component along a frame axis of (x_a - base_a) - (x_b - base_b); base rows below 0 are absent."""
    value = splat(0.0)
    for component in range(axes(s)):
        relative = load(s, xa + component) - load(s, xb + component)
        if base_a >= 0:
            relative = relative - load(s, base_a + component)
        if base_b >= 0:
            relative = relative + load(s, base_b + component)
        value = fma(load(s, frame + 3 * axis + component), relative, value)
    return value


@inner
def contact_targets(tape, s, dt, skip):
    """Decide, at the start of a step, which contacts may close and how each may rebound.

    Writes near (1 where the gap can close within the step), the floor under the gap, the separation
    speed after an impact, and held (1 where the contact started in penetration: then its normal is held
    like a link, so that pushing out leaves no velocity; one that parts fast enough by itself is left
    alone). ``skip`` is set for blocks near in no world.
    Returns whether a factor made before no longer fits: another choice of blocks, or frames that turn.

    The speed of an impact is that at the surface, v^2 = v_n^2 + 2 a_n gap; speed that one step's
    acceleration alone explains is not bounced since a resting contact starts the step with none.
    """
    zero = splat(0.0)
    one = splat(1.0)
    changed = False
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        frame = tape[contact + 16]
        gap = load(s, tape[contact + 17])
        speed = contact_motion(s, frame, 0, tape[contact + 3], tape[contact + 4], -1, -1)
        pull = contact_motion(s, frame, 0, tape[contact + 9], tape[contact + 10], -1, -1)
        square = zero
        weight = zero
        for component in range(axes(s)):
            relative = load(s, tape[contact + 3] + component) - load(
                s, tape[contact + 4] + component
            )
            square = fma(relative, relative, square)
            relative = load(s, tape[contact + 9] + component) - load(
                s, tape[contact + 10] + component
            )
            weight = fma(relative, relative, weight)
        # Four times as far as speed and acceleration reach, and up to the root of two more.
        reach = splat(32.0) * dt * dt * fma(dt * dt, weight, square)
        near = (gap < zero) | (gap * gap < reach)
        tolerance = load(s, tape[H_TOLERANCE])
        # A load that moves nothing is rounding, but would push for ever.
        carried = moved_by_load(tape, s, contact) > splat(_IDLE) * tolerance
        low = gap < splat(-10.0) * tolerance - splat(1e-9)
        leaves = low & (speed * dt > splat(-_RECOVERY) * gap)
        near = (near | carried) & (select(leaves, one, zero) < splat(0.5))
        # An impact this step: closing, and the surface lies within what speed and acceleration cover.
        fall = -speed
        energy = fma(splat(-2.0) * pull, select(gap > zero, gap, zero), fall * fall)
        impact = select(energy > zero, sqrt(energy), zero)
        bounce = select(speed < zero, load(s, tape[contact + 13]) * impact, zero)
        store(s, tape[contact + 18], select(near, one, zero))
        store(s, tape[contact + 18] + 1, select(low, splat(1.0 - _RECOVERY) * gap, zero))
        store(s, tape[contact + 18] + 2, bounce)
        store(s, tape[contact + 18] + 3, select(low, one, zero))
        for axis in range(3):
            row = tape[contact + 15] + axis
            store(s, row, select(near & carried, load(s, row), zero))
        left_out = 0 if any_lane(near) else 1
        changed = changed or skip[tape[contact + 20]] != left_out or tape[contact] != GROUND
        skip[tape[contact + 20]] = left_out
    return changed


@inner
def moved_by_load(tape, s, contact):
    """How far [m] the normal impulse of the position stage moves both particles of a contact, were they free."""
    mobility = load(s, tape[contact + 7]) + load(s, tape[contact + 8])
    return load(s, contact_multiplier(tape, contact, False)) * mobility


@inner
def contact_gap(s, tape, contact):
    """Gap at the current positions above its floor, the normal kept from the step's start."""
    moved = contact_motion(
        s,
        tape[contact + 16],
        0,
        tape[contact + 1],
        tape[contact + 2],
        tape[contact + 21],
        tape[contact + 22],
    )
    return load(s, tape[contact + 17]) + moved - load(s, tape[contact + 18] + 1)


@inner
def contact_shift(s, tape, contact, axis):
    """Tangential displacement since the step's start."""
    return contact_motion(
        s,
        tape[contact + 16],
        axis,
        tape[contact + 1],
        tape[contact + 2],
        tape[contact + 21],
        tape[contact + 22],
    )


@inner
def contact_speed(s, tape, contact, axis):
    """Relative velocity along a frame axis."""
    return contact_motion(s, tape[contact + 16], axis, tape[contact + 3], tape[contact + 4], -1, -1)


@inner
def contact_multiplier(tape, contact, velocity):
    """First row of a contact's multipliers: of the position stage, or of the velocity stage."""
    return tape[contact + 18] + 4 if velocity else tape[contact + 15]


@inner
def contact_impulses(tape, s, skip, velocity):
    """Add every contact's impulse to its particles' impulse rows."""
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            frame = tape[contact + 16]
            multiplier = contact_multiplier(tape, contact, velocity)
            n = load(s, multiplier)
            t = load(s, multiplier + 1)
            u = load(s, multiplier + 2)
            for component in range(axes(s)):
                part = n * load(s, frame + component)
                part = fma(t, load(s, frame + 3 + component), part)
                part = fma(u, load(s, frame + 6 + component), part)
                fa = tape[contact + 5] + component
                fb = tape[contact + 6] + component
                store(s, fa, load(s, fa) + part)
                store(s, fb, load(s, fb) - part)
