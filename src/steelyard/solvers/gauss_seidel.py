"""Gauss-Seidel: one constraint after the other, a number of sweeps.

Position stage: SHAKE (Ryckaert, Ciccotti & Berendsen 1977) with cables, riders and contacts beside the rods;
velocity stage: the same sweeps on velocities (RATTLE, Andersen 1983). Impulses are summed per constraint and
clamped as sums, so unilateral rows may give back what they took. Converges by a factor of about
cos^2(pi/2n) per sweep on a chain of n: cheap per sweep, slow to settle long chains and heavy ends.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..constraints.contacts import contact_gap, contact_multiplier, contact_shift, contact_speed
from ..constraints.links import link_half_square, link_multiplier, link_rate
from ..constraints.riders import DECK, HEAD, rider_multiplier, rider_offset, rider_slip
from ..kernel import inner
from ..math.lanes import absolute, fma, load, select, splat, sqrt, store
from ..math.pointers import axes
from ..model.tape import (
    CONTACT,
    H_CONTACTS,
    H_IMPULSE,
    H_LINKS,
    H_PARTICLES,
    H_PASSES,
    H_POSITION,
    H_RIDERS,
    H_VELOCITY,
    LINK,
)
from ..stage import Stage, stage
from .base import Solver
from .body_settings import BodySettings
from .gather import clear_velocity_multipliers, gather
from .stages import begin_stage, end_stage
from .swept_bodies import SweptBodies


@dataclass(frozen=True)
class GaussSeidel(BodySettings):
    """Projected Gauss-Seidel sweeps over all constraints (see the module).

    Args:
        passes: sweeps per stage and step, always all of them, so that cost is known and no world waits
            for another. What error they leave is measured, not flagged: see ``world.residual``.
        slop, broad_phase, contacts, rest_speed, rest_time: of scenes of bodies, see ``BodySettings``.
    """

    passes: int = 20

    @property
    def for_bodies(self) -> Solver:
        """Sweeps over contacts and joints of bodies."""
        return SweptBodies(passes=self.passes, **self.body_settings)

    @property
    def stage(self) -> Stage:
        """Puts a half step on the constraints."""
        return sweep_stage


@inner
def _push(s, row, weight, d, change, sign):
    """Add an impulse ``change`` times the vector at ``d`` to a position or velocity."""
    for component in range(axes(s)):
        value = load(s, row + component)
        part = weight * load(s, d + component) * change
        store(s, row + component, value + sign * part)


@inner
def _sweep_links(tape, s, velocity):
    """One sweep over the links."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        d = tape[link + 13]
        length = load(s, tape[link + 8])
        row = link_multiplier(tape, link, velocity)
        first = 2 if velocity else 0
        a = tape[link + first]
        b = tape[link + first + 1]
        slope = zero
        for component in range(axes(s)):
            now = load(s, d + component)
            if not velocity:
                now = load(s, a + component) - load(s, b + component)
            slope = fma(now, load(s, d + component), slope)
        slope = slope * (load(s, tape[link + 6]) + load(s, tape[link + 7]))
        if velocity:
            error = link_rate(s, link, tape) - load(s, tape[link + 14])
        else:
            error = link_half_square(s, link, tape, length)
        old = load(s, row)
        usable = absolute(slope) > zero
        new = old + select(usable, error / select(usable, slope, one), zero)
        if tape[link + 10] != 0:
            may = new > zero
            if velocity:
                closed = (load(s, tape[link + 12]) > zero) | (load(s, tape[link + 14] + 1) > zero)
                may = (may & closed) | (load(s, tape[link + 14] + 1) > zero)
            new = select(may, new, zero)
        store(s, row, new)
        change = new - old
        _push(s, a, load(s, tape[link + 6]), d, change, -one)
        if tape[link + 5] < tape[H_IMPULSE] + 3 * tape[H_PARTICLES]:
            _push(s, b, load(s, tape[link + 7]), d, change, one)


@inner
def sweep_riders(tape, s, velocity):
    """One sweep over the riders."""
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        count = tape[at + 6]
        inverse = load(s, tape[at + 5])
        total = inverse
        for k in range(count):
            weight = load(s, tape[at + 9] + k)
            total = fma(weight * weight, load(s, tape[at + HEAD + DECK * k + 3]), total)
        place = 1 if velocity else 0
        for axis in range(axes(s)):
            error = rider_slip(s, tape, at, axis) if velocity else rider_offset(s, tape, at, axis)
            change = -error / total
            row = rider_multiplier(tape, at, velocity) + axis
            store(s, row, load(s, row) + change)
            x = tape[at + place] + axis
            store(s, x, fma(inverse, change, load(s, x)))
            for k in range(count):
                deck = at + HEAD + DECK * k
                weight = load(s, tape[at + 9] + k) * load(s, tape[deck + 3])
                x = tape[deck + place] + axis
                store(s, x, fma(weight, change, load(s, x)))
        at += HEAD + DECK * count


@inner
def sweep_contacts(tape, s, skip, velocity):
    """One sweep over the contacts: normal, then tangents within the friction cone."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] != 0:
            continue
        row = contact_multiplier(tape, contact, velocity)
        frame = tape[contact + 16]
        first = 3 if velocity else 1
        a = tape[contact + first]
        b = tape[contact + first + 1]
        ma = load(s, tape[contact + 7])
        mb = load(s, tape[contact + 8])
        total = ma + mb
        possible = load(s, tape[contact + 18]) > half
        if velocity:
            held = load(s, tape[contact + 18] + 3) > half
            possible = possible & ((load(s, tape[contact + 15]) > zero) | held)
            error = contact_speed(s, tape, contact, 0) - load(s, tape[contact + 18] + 2)
        else:
            held = zero > zero
            error = contact_gap(s, tape, contact)
        old = load(s, row)
        new = old - error / total
        new = select(possible & (held | (new > zero)), new, zero)
        store(s, row, new)
        _push(s, a, ma, frame, new - old, one)
        two = tape[contact + 6] < tape[H_IMPULSE] + 3 * tape[H_PARTICLES]
        if two:
            _push(s, b, mb, frame, new - old, -one)
        if velocity:
            t = contact_speed(s, tape, contact, 1)
            u = contact_speed(s, tape, contact, 2)
        else:
            t = contact_shift(s, tape, contact, 1)
            u = contact_shift(s, tape, contact, 2)
        t0 = load(s, row + 1)
        u0 = load(s, row + 2)
        t = t0 - t / total
        u = u0 - u / total
        bound = load(s, tape[contact + 14]) * select(new > zero, new, zero)
        length = sqrt(fma(u, u, t * t))
        outside = length > bound
        factor = select(outside, bound / select(outside, length, one), one)
        t = t * factor
        u = u * factor
        store(s, row + 1, t)
        store(s, row + 2, u)
        _push(s, a, ma, frame + 3, t - t0, one)
        if two:
            _push(s, b, mb, frame + 3, t - t0, -one)
        _push(s, a, ma, frame + 6, u - u0, one)
        if two:
            _push(s, b, mb, frame + 6, u - u0, -one)


@stage
def sweep_stage(tape, s, skip, half):
    """One stage by sweeps."""
    velocity = half == 1
    target = tape[H_VELOCITY] if velocity else tape[H_POSITION]
    begin_stage(tape, s, half)
    if velocity:
        clear_velocity_multipliers(tape, s)
    gather(tape, s, skip, velocity, target)
    for _ in range(tape[H_PASSES]):
        _sweep_links(tape, s, velocity)
        sweep_riders(tape, s, velocity)
        sweep_contacts(tape, s, skip, velocity)
    gather(tape, s, skip, velocity, target)
    end_stage(tape, s, half)
