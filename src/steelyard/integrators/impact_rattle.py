"""RATTLE with the times of impacts resolved inside the step.

A step is first tried without the contacts and cables that carry nothing. Where a gap closes in it, or a slack cable
reaches its end, the cubic through both ends of the step (``step_impact``) tells when; two trials that end there mend
the time by Newton's method. The step is then taken up to the impact, which is one of ``Rattle`` that begins and ends
without touching: velocities rebound by the speed found there, and what is left of the step follows in the same way, up
to ``impacts`` times. What is left after those is taken as ``Rattle`` takes it; so balls come to rest.

Order 2 with impacts too, where ``Rattle`` has order 1 in their time; a ball on level ground is exact. Energy is kept by
restitution 1 across impacts to the error of their speed. Contacts and cables that carry load, and those that start in
penetration, are held as by ``Rattle``. A step without an impact takes one of ``Rattle``, one with an impact four.

Works with Direct alone, since sweeps leave errors larger than those of the time. Refuses what is tabulated for one
length of the step or known only between steps: drag, stiff springs, user-written forces and contacts.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, II.6 (dense output and events).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..collision.geometry import contact_geometry
from ..constraints.contacts import contact_shift, contact_speed
from ..constraints.controls import move_controls
from ..constraints.links import link_half_square, link_rate
from ..kernel import inner
from ..math.lanes import absolute, any_lane, load, select, splat, store
from ..math.pointers import LANES
from ..model.tape import (
    CONTACT,
    DIVIDED,
    EVENT,
    FRESH,
    H_BLOCKS,
    H_CABLES,
    H_CONTACTS,
    H_DAMPED,
    H_DAMPING,
    H_DAMPING_RATES,
    H_DT,
    H_EVENTS,
    H_IMPACTS,
    H_LINKS,
    H_PARTICLES,
    H_PARTS,
    H_TRIAL,
    LINK,
)
from ..scene import checks
from ..solvers.base import Solver
from ..solvers.gather import scale_multipliers
from ..solvers.stages import begin_step
from ..stage import call_stage, stage
from .base import Acting, Integrator, Recipe
from .divided import PAST, SHORTEST, fall_time, keep_state, put_back
from .rattle import rattle_halves

# Rows of an event: gap [m] or slack (L^2 - d^2)/2, and its rate, where the part of the step begins; whether it may
# close, closes in this part, and at which rate it leaves; of a contact also its frame at the impact, and what its gap
# along that frame is where the part begins.
_GAP, _RATE, _FREE, _CLOSES, _LEAVES, _BEFORE, _FRAME = range(7)
# Trials that Newton's method mends: rounding is left.
_MENDED = 2
# Impacts so close in time, over the step, are one.
_TOGETHER = 1e-8
# What is no farther off, and comes no nearer within the step [m; of a cable's length squared], is at rest.
_REST = 1e-9


@dataclass(frozen=True)
class ImpactRattle(Integrator):
    """RATTLE with resolved times of impacts (see the module).

    Args:
        impacts: most impacts of a step whose times are resolved, at least 1.
    """

    impacts: int = 4

    damping_share: ClassVar[float] = 0.5
    evaluations: ClassVar[tuple[float | None, ...]] = ()
    solver_stages: ClassVar[tuple[bool, ...]] = (True,)
    splits: ClassVar[bool] = True

    def __post_init__(self) -> None:
        checks.whole("ImpactRattle", "impacts", self.impacts, least=1, remedy="Use 4.")

    @property
    def divisions(self) -> int:
        """Most events that divide a step."""
        return self.impacts

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """One stage that runs those of ``parts``."""
        return ((impact_rattle_step, 0),)

    def parts(self, solver: Solver | None, acting: Acting) -> Recipe:
        """RATTLE, with notes of what may close."""
        first, second = rattle_halves(acting)
        if solver is None:
            return ((first, 0), (second, 1))
        return (
            (begin_step, 0), (note_gaps, 0), (move_controls, 0), (first, 0), (solver.stage, 0), (second, 1),
            (solver.stage, 1),
        )  # fmt: skip

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Stable while dt times angular frequency is below 2."""
        return 2.0


@inner
def _slack(tape, s, link):
    """How short a cable is of its end, as (L^2 - d^2)/2, and its rate."""
    length = load(s, tape[link + 8])
    rate = length * load(s, tape[link + 9]) - link_rate(s, link, tape)
    return -link_half_square(s, link, tape, length), rate


@inner
def _apart(gap, rate, rest, dt):
    """Whether a gap is open or closing: not at rest at 0, where there is no impact to resolve."""
    return (gap > rest) | (rate * dt > rest) | (rate * dt < -rest)


@stage
def note_gaps(tape, s, skip, part):
    """At the start of a part of the step: gaps and what may close; leave out what is on trial, set how it rebounds."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    dt = load(s, tape[H_DT])
    trial = load(s, tape[H_TRIAL]) > half
    event = tape[H_EVENTS]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        decided = tape[contact + 18]
        gap = load(s, tape[contact + 17])
        rate = contact_speed(s, tape, contact, 0)
        free = (load(s, tape[contact + 15]) <= zero) & (load(s, decided + 3) < half)
        free = free & _apart(gap, rate, splat(_REST), dt)
        store(s, event + _GAP, gap)
        store(s, event + _RATE, rate)
        store(s, event + _FREE, select(free, one, zero))
        near = load(s, decided)
        store(s, decided, select(trial & free, zero, near))
        closes = load(s, event + _CLOSES) > half
        store(s, decided, select(closes, one, load(s, decided)))
        bounce = select(closes, load(s, event + _LEAVES), load(s, decided + 2))
        store(s, decided + 2, bounce)
        if any_lane(closes):
            skip[tape[contact + 20]] = 0
            row = tape[contact + 17]
            store(s, row, select(closes, load(s, event + _BEFORE), gap))
            for k in range(9):
                row = tape[contact + 16] + k
                store(s, row, select(closes, load(s, event + _FRAME + k), load(s, row)))
        event += EVENT
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            gap, rate = _slack(tape, s, link)
            length = load(s, tape[link + 8])
            free = (load(s, tape[link + 12]) <= zero) & (load(s, tape[link + 14] + 1) < half)
            free = free & _apart(gap, rate, splat(_REST) * length * length, dt)
            store(s, tape[link + 14] + 4, select(trial & free, one, zero))
            store(s, event + _GAP, gap)
            store(s, event + _RATE, rate)
            store(s, event + _FREE, select(free, one, zero))
            closes = load(s, event + _CLOSES) > half
            target = load(s, tape[link + 14])
            follow = length * load(s, tape[link + 9])
            leaves = follow - load(s, event + _LEAVES)
            store(s, tape[link + 14], select(closes, leaves, target))
            event += EVENT


@inner
def _earliest(s, event, gap, rate, first, length, active, time):
    """The earlier of ``time`` and when this one closes; on later trials by Newton's method from the present end."""
    zero = splat(0.0)
    half = splat(0.5)
    free = active & (load(s, event + _FREE) > half)
    if first:
        start = load(s, event + _GAP)
        start_rate = load(s, event + _RATE)
        closes = free & (gap < zero) & ((start > zero) | (start_rate > zero))
        touches = free & (gap < zero) & (start <= zero) & (start_rate <= zero)
        found = select(touches, zero, time)
        if any_lane(closes):
            fallen = fall_time(start, start_rate, gap, rate, length)
            found = select(closes, fallen, found)
    else:
        closing = free & (rate < zero)
        found = length + gap / select(closing, -rate, splat(1.0))
        found = select(closing, found, time)
    return select(found < time, found, time)


@inner
def _when(tape, s, first, length, left, active):
    """When in this part of the step the first impact happens; ``left`` where none does."""
    time = left
    event = tape[H_EVENTS]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        rate = contact_speed(s, tape, contact, 0)
        gap = load(s, tape[contact + 17])
        time = _earliest(s, event, gap, rate, first, length, active, time)
        event += EVENT
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            gap, rate = _slack(tape, s, link)
            time = _earliest(s, event, gap, rate, first, length, active, time)
            event += EVENT
    return time


@inner
def _note(s, event, gap, rate, restitution, meets, near):
    """What closes at the end of this part, and how it rebounds."""
    zero = splat(0.0)
    closing = meets & (load(s, event + _FREE) > splat(0.5)) & (rate < zero)
    closes = closing & (gap < -rate * near)
    store(s, event + _CLOSES, select(closes, splat(1.0), zero))
    store(s, event + _LEAVES, select(closes, -restitution * rate, zero))


@inner
def _note_impacts(tape, s, meets, near):
    """Note what closes within ``near`` [s] of the end of the last trial."""
    event = tape[H_EVENTS]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        rate = contact_speed(s, tape, contact, 0)
        gap = load(s, tape[contact + 17])
        _note(s, event, gap, rate, load(s, tape[contact + 13]), meets, near)
        moved = contact_shift(s, tape, contact, 0)
        store(s, event + _BEFORE, gap - moved)
        for k in range(9):
            store(s, event + _FRAME + k, load(s, tape[contact + 16] + k))
        event += EVENT
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            gap, rate = _slack(tape, s, link)
            _note(s, event, gap, rate, load(s, tape[link + 11]), meets, near)
            event += EVENT


@inner
def _forget_impacts(tape, s):
    """Clear the notes."""
    zero = splat(0.0)
    event = tape[H_EVENTS]
    for _ in range(tape[tape[H_CONTACTS]] + tape[H_CABLES]):
        store(s, event + _CLOSES, zero)
        store(s, event + _LEAVES, zero)
        event += EVENT


@inner
def _set_length(tape, s, length):
    """Length of the part that follows, and what damping keeps over half of it."""
    store(s, tape[H_DT], length)
    if tape[H_DAMPED] != 0:
        for p in range(tape[H_PARTICLES]):
            for k in range(LANES):
                time = 0.5 * s[tape[H_DT], k]
                s[tape[H_DAMPING] + p, k] = math.exp(-s[tape[H_DAMPING_RATES] + p, k] * time)


@inner
def _run(tape, s, skip, length, share, fresh):
    """One step of RATTLE over ``length``, ``share`` of the whole; contact gaps at its end.

    Multipliers are those of a whole step between parts; they grow with the square of its length. ``fresh``: whether the
    factor at hand is not of the state it begins from.
    """
    _set_length(tape, s, length)
    scale_multipliers(tape, s, share * share)
    skip[tape[H_BLOCKS] + FRESH] = fresh
    at = tape[H_PARTS]
    for index in range(tape[at]):
        call_stage(tape[at + 1 + 2 * index], tape, s, skip, tape[at + 2 + 2 * index])
    contact_geometry(tape, s)


@stage
def impact_rattle_step(tape, s, skip, part):
    """Parts of the step, each up to the next impact."""
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    dt = load(s, tape[H_DT])
    left = dt
    active = dt > zero
    shortest = splat(SHORTEST) * dt
    _forget_impacts(tape, s)
    words = tape[H_BLOCKS]
    # What was put back after the last step was solved has no factor at hand.
    fresh = 1 if skip[words + FRESH] != 0 or skip[words + DIVIDED] != 0 else 0
    skip[words + DIVIDED] = 0
    for turn in range(tape[H_IMPACTS] + 1):
        keep_state(tape, s)
        trial = one if turn < tape[H_IMPACTS] else zero
        store(s, tape[H_TRIAL], trial)
        length = left
        share = length / dt
        _run(tape, s, skip, length, share, fresh)
        fresh = 1
        back = one / (share * share)
        if turn < tape[H_IMPACTS]:
            time = _when(tape, s, True, length, left, active)
            meets = active & (time < left)
            if any_lane(meets):
                skip[words + DIVIDED] = 1
                length = select(time > shortest, time, shortest)
                for _ in range(_MENDED):
                    put_back(tape, s, zero <= zero)
                    _run(tape, s, skip, length, length / dt, 1)
                    time = _when(tape, s, False, length, left, active)
                    # A part that is as short as may be stays so.
                    change = select(meets, time - length, zero)
                    most = splat(0.1) * length
                    change = select(absolute(change) < most, change, zero)
                    length = length + change
                    length = select(length > shortest, length, shortest)
                _note_impacts(tape, s, meets, splat(_TOGETHER) * dt + shortest)
                length = select(meets, length + splat(PAST) * dt, length)
                store(s, tape[H_TRIAL], select(meets, zero, one))
                put_back(tape, s, zero <= zero)
                _run(tape, s, skip, length, length / dt, 1)
                _forget_impacts(tape, s)
                # An impact lasts no time: what it does to places says nothing of loads, and those before it are gone.
                back = select(meets, zero, back)
        scale_multipliers(tape, s, back)
        done = select(active, zero, one) > half
        put_back(tape, s, done)
        left = select(active, left - length, dt)
        active = active & (left > shortest)
        left = select(active, left, dt)
        if not any_lane(active):
            break
    store(s, tape[H_TRIAL], zero)
    _set_length(tape, s, dt)
