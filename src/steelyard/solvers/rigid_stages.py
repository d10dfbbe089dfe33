"""The two stages of a step in which bodies touch or are joined, one world after the other, whichever solver has them.

In the position stage no gap closes beyond touching within the step; in the velocity stage what touches does not
approach, or leaves with the speed at which it rebounds. Where surfaces overlap by more than ``slop`` a last solve from
rest moves them apart; its velocities are forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import ClassVar

from ..collision.contact_list import (
    find_contacts,
    match_contacts,
    prepare_contacts,
)
from ..collision.placement import place_colliders
from ..constraints.brakes import has_brake, release_brake
from ..constraints.contact_rows import contact_at, contact_ends, relative_velocity, world_vector
from ..constraints.joints import (
    POSITIONS,
    PUSHES,
    VELOCITIES,
    begin_joints,
    soften_joints,
    store_joints,
    tautness,
)
from ..constraints.solids import (
    gather_solids,
    move_solids,
    pay_for_lifts,
    rest_solids,
    scatter_velocities,
)
from ..kernel import inner
from ..math.lanes import load, splat, store
from ..math.pointers import LANES, doubles_at
from ..model.rigid_layout import (
    C_BEFORE,
    C_BRAKE,
    C_BRAKE_BEFORE,
    C_COMPLIANCE,
    C_EARLIER,
    C_FRICTION,
    C_GAP,
    C_HELD,
    C_ID,
    C_IMPULSE,
    C_LEAST,
    C_MOVED,
    C_PLACE,
    C_REBOUND,
    C_RESTITUTION,
    CAPACITY,
    JOINTS,
    N_HERTZ,
    N_RATIO,
    N_REST_SPEED,
    N_REST_TIME,
    N_SLOP,
    N_SWEEPS,
    NUMBERS,
    S_FREE,
    S_GRADIENT,
    S_PLACE,
    S_ROTATION,
    SETTINGS,
    SOLID,
    SOLID_RECORDS,
    SOLIDS,
    START_ROW,
    STORED,
    STORED_ROW,
    T_BRAKE,
    T_HELD,
    T_ID,
    T_IMPULSE,
    T_PLACE,
    T_REBOUND,
)
from ..model.tape import COUNT, H_BLOCKS, H_DT, H_RIGID
from ..stage import Stage, stage
from .blows import pass_blows, start_velocities
from .body_settings import BodySettings
from .joint_closing import close_over_step, drift_closed, join_again
from .late_contacts import meet_late
from .rigid_islands import ALL, PUSH, SOFTLY, solve_islands
from .sleep import (
    all_asleep,
    fall_asleep,
    hold_sleepers,
    keep_sleeping_contacts,
    wake_changed,
    wake_touched,
)

# By what joints are stiffer than contacts where these are soft, and their damping ratio.
_STIFFER, _JOINT_RATIO = 2.0, 2.0
# Share of a penetration that one step takes away, and the fastest push [m/s].
_SHARE, _FASTEST = 1.0, 3.0
# Error of joints [m or rad] that a push may leave to the next step.
_OPENED = 1e-3
# A gap [m] at which a contact that carried nothing is closed all the same.
_CLOSED = 1e-10
# A gap [m] that nothing closes; and in place of what is held, that the gap was no larger when the step began.
_AT_REST = 1e-8
_TOUCHED = -1.0
# Besides, that a solve has just changed impulses: taken from the mark of what touches, or in place of none.
_CHANGED = 1.0


@dataclass(frozen=True, kw_only=True)
class RigidSolver(BodySettings):
    """Base of what holds contacts and joints of bodies, and of particles as solids; not to be used by itself."""

    staged: ClassVar[bool] = True
    rigid: ClassVar[bool] = True

    @property
    def own_settings(self) -> dict[int, float]:
        """Numbers of one's own, by their places in the layout."""
        raise NotImplementedError

    @property
    def closes_joints(self) -> bool:
        """Exact solvers do; sweeps leave joints to the next step, and drift follows."""
        return self.own_settings.get(N_SWEEPS, 0.0) == 0.0

    @property
    def settings(self) -> tuple[float, ...]:
        """Numbers in the order of the layout."""
        given = {
            N_SLOP: self.slop,
            N_REST_SPEED: self.rest_speed,
            N_REST_TIME: self.rest_time or 0.0,
            **self.own_settings,
        }
        return tuple(given.get(k, 0.0) for k in range(SETTINGS))

    @property
    def island(self) -> Stage:
        """What solves an island; part 0 for all impulses, 1 for changes, 2 for a push."""
        raise NotImplementedError

    @property
    def start(self) -> Stage:
        """Notes velocities, from which rebounds follow."""
        return keep_start_velocities

    @property
    def stage(self) -> Stage:
        """Contacts of the position stage (half 0) or of the velocity stage (half 1)."""
        return rigid_stage


@inner
def _store_brake(s, c, at):
    """Impulse of spinning and rolling, if a contact has one, behind its other numbers."""
    x = 0.0
    y = 0.0
    z = 0.0
    if has_brake(s, c):
        x, y, z = world_vector(s, c, s[c + C_BRAKE], s[c + C_BRAKE + 1], s[c + C_BRAKE + 2])
    s[at + LANES * T_BRAKE] = x
    s[at + LANES * (T_BRAKE + 1)] = y
    s[at + LANES * (T_BRAKE + 2)] = z


@inner
def _store_contacts(tape, s, n, rigid, k, count, kept):
    """Ids, impulses, places and rebounds of the contacts at hand, for the next stage, behind those that are kept."""
    for j in range(tape[rigid + CAPACITY] - kept):
        at = LANES * (tape[rigid + STORED_ROW] + tape[rigid + STORED] * (kept + j)) + k
        if j < count:
            c = contact_at(tape, rigid, j)
            s[at] = s[c + C_ID] + 1.0
            x, y, z = world_vector(
                s, c, s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2]
            )
            s[at + LANES * T_IMPULSE] = x
            s[at + LANES * (T_IMPULSE + 1)] = y
            s[at + LANES * (T_IMPULSE + 2)] = z
            for i in range(3):
                s[at + LANES * (T_PLACE + i)] = s[c + C_PLACE + i]
            s[at + LANES * T_REBOUND] = s[c + C_REBOUND]
            s[at + LANES * T_HELD] = s[c + C_HELD]
            if tape[rigid + STORED] > T_BRAKE:
                _store_brake(s, c, at)
        else:
            # What lies behind the last is not looked at.
            s[at + LANES * T_ID] = 0.0
            break


@inner
def _rebounds(tape, s, n, rigid, k, count, dt):
    """Speed at which contacts that closed within the step leave, from that at which they met.

    Under the normal acceleration a of free motion the surfaces meet at the square of their speed at the start minus
    2 a gap: so energy is what restitution says, whatever the step.
    """
    start_velocities(tape, s, rigid, k)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        s[c + C_REBOUND] = 0.0
        if s[c + C_RESTITUTION] > 0.0:
            a, b = contact_ends(tape, n, rigid, i)
            before, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
            half, _, _ = relative_velocity(s, c, a, b, S_FREE)
            gap = s[c + C_GAP]
            # What ends as near as the velocity stage takes for closed counts: else its speed would be lost.
            if half < 0.0 and gap + dt * half < _CLOSED:
                square = before * before - 4.0 * (half - before) / dt * gap
                s[c + C_REBOUND] = s[c + C_RESTITUTION] * sqrt(max(square, 0.0))


@inner
def _contacts_at_hand(tape, s, n, rigid, k, dt):
    """Solids and contacts of lane k in the work area, with what is known of them from the last stage.

    Returns:
        How many contacts there are, and how many of the stored ones are kept for what sleeps.
    """
    count = 0
    kept = 0
    while True:
        gather_solids(tape, s, rigid, k)
        kept = keep_sleeping_contacts(tape, s, rigid, k)
        place_colliders(tape, s, rigid, k, dt, S_PLACE, S_ROTATION)
        count = find_contacts(tape, s, n, rigid, k, kept)
        if not wake_touched(tape, s, rigid, k, count):
            break
    hold_sleepers(tape, s, rigid, k)
    prepare_contacts(tape, s, n, rigid, count)
    match_contacts(tape, s, n, rigid, k, count, kept)
    return count, kept


@inner
def _softness(hertz, ratio, dt):
    """How fast [1/s] a spring of so many hertz takes away an error, and its compliance over the mobility.

    Source: Catto (2011), *Soft Constraints*.
    """
    angle = 2.0 * pi * hertz * dt
    damped = 2.0 * ratio + angle
    return angle / (damped * dt), 1.0 / (angle * damped)


@inner
def _position_stage(tape, s, n, rigid, k, dt):
    """Before the drift: no gap may close beyond touching."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    slop = numbers[N_SLOP]
    count, kept = _contacts_at_hand(tape, s, n, rigid, k, dt)
    if tape[rigid + START_ROW] >= 0:
        _rebounds(tape, s, n, rigid, k, count, dt)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        gap = s[c + C_GAP]
        # What rests keeps its gap: else impulses would change with its rounding at every step.
        s[c + C_LEAST] = -gap / dt if gap > _AT_REST else 0.0
        s[c + C_COMPLIANCE] = 0.0
        # Friction on what is open follows where it is closed: across the gap it would have a lever that is not there.
        opened = gap > slop or (gap > _AT_REST and s[c + C_BEFORE] == 0.0)
        s[c + C_MOVED] = 1.0 if s[c + C_HELD] == _CHANGED else 0.0
        s[c + C_HELD] = 0.0
        s[c + C_EARLIER] = 0.0 if opened else 1.0
        if opened:
            s[c + C_FRICTION] = 0.0
            release_brake(s, c)
    begin_joints(tape, s, rigid, k, dt, POSITIONS)
    swept = numbers[N_SWEEPS] > 0.0
    soft = numbers[N_HERTZ] > 0.0
    if soft:
        rate, share = _softness(numbers[N_HERTZ], numbers[N_RATIO], dt)
        for i in range(count):
            c = contact_at(tape, rigid, i)
            if s[c + C_GAP] < 0.0:
                s[c + C_LEAST] = min(-rate * s[c + C_GAP], _FASTEST)
                s[c + C_COMPLIANCE] = share
        rate, share = _softness(_STIFFER * numbers[N_HERTZ], _JOINT_RATIO, dt)
        soften_joints(tape, s, rigid, rate, share)
    taut = 0.0 if swept else tautness(tape, s, rigid, k, dt)
    solve_islands(tape, s, n, rigid, count, k, ALL)
    # Where contacts are soft steps are short.
    if not soft:
        count = meet_late(tape, s, n, rigid, k, kept, count, dt)
    closed = True
    # Sweeps do not close joints: drift follows, as where there are none.
    if tape[rigid + JOINTS] > 0 and not swept:
        closed = close_over_step(tape, s, n, rigid, k, dt, taut)
        if not closed and count > 0:
            # Contacts that limbs wedge push ever harder, pass by pass, and turn joints out of reach.
            gather_solids(tape, s, rigid, k)
            begin_joints(tape, s, rigid, k, dt, POSITIONS)
            solve_islands(tape, s, n, rigid, count, k, SOFTLY)
            closed = close_over_step(tape, s, n, rigid, k, dt, tautness(tape, s, rigid, k, dt))
        drift_closed(tape, s, rigid, k)
    scatter_velocities(tape, s, rigid, k)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        if s[c + C_EARLIER] == 0.0:
            s[c + C_HELD] = s[c + C_IMPULSE]
        elif s[c + C_GAP] <= _AT_REST:
            s[c + C_HELD] = _TOUCHED - _CHANGED * s[c + C_MOVED]
    _store_contacts(tape, s, n, rigid, k, count, kept)
    store_joints(tape, s, rigid, k, dt, False)
    if not closed:
        join_again(tape, s, n, rigid, k, dt, 0.0)


@inner
def _velocity_stage(tape, s, n, rigid, k, dt):
    """After the last kick: surfaces that touch do not approach; then overlaps are pushed apart."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    slop = numbers[N_SLOP]
    count, kept = _contacts_at_hand(tape, s, n, rigid, k, dt)
    deep = False
    for i in range(count):
        c = contact_at(tape, rigid, i)
        closed = s[c + C_GAP] <= _CLOSED or s[c + C_BEFORE] > 0.0
        if s[c + C_HELD] <= _TOUCHED:
            # What carries nothing may drift by rounding, but must bear when it is asked to.
            closed = closed or s[c + C_GAP] <= _AT_REST
            s[c + C_MOVED] = 1.0 if s[c + C_HELD] < _TOUCHED else 0.0
            s[c + C_HELD] = 0.0
        elif s[c + C_HELD] > 0.0:
            # Closed within this step: nothing is known yet of what bears it.
            for axis in range(3):
                s[c + C_BEFORE + axis] = 0.0
                s[c + C_BRAKE_BEFORE + axis] = 0.0
        # What is open does not act: it would have to approach at more than light.
        s[c + C_LEAST] = s[c + C_REBOUND] if closed else -1e30
        s[c + C_COMPLIANCE] = 0.0
        deep = deep or s[c + C_GAP] < -slop
    pass_blows(tape, s, n, rigid, k, count)
    begin_joints(tape, s, rigid, k, dt, VELOCITIES)
    solve_islands(tape, s, n, rigid, count, k, ALL)
    scatter_velocities(tape, s, rigid, k)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        s[c + C_HELD] = _CHANGED * s[c + C_MOVED]
    _store_contacts(tape, s, n, rigid, k, count, kept)
    store_joints(tape, s, rigid, k, dt, True)
    fall_asleep(tape, s, n, rigid, k, count, dt)
    # Where contacts are soft they push by themselves.
    if deep and numbers[N_HERTZ] == 0.0:
        _push_apart(tape, s, n, rigid, k, count, dt, slop)


@inner
def _push_apart(tape, s, n, rigid, k, count, dt, slop):
    """Move overlapping solids apart by a solve from rest, of which no velocity stays."""
    rest_solids(tape, s, rigid)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        gap = s[c + C_GAP]
        s[c + C_LEAST] = min(-_SHARE * gap / dt, _FASTEST) if gap < -slop else -max(gap, 0.0) / dt
        release_brake(s, c)
    begin_joints(tape, s, rigid, k, dt, PUSHES)
    solve_islands(tape, s, n, rigid, count, k, PUSH)
    move_solids(tape, s, rigid, k, dt)
    pay_for_lifts(tape, s, rigid, k, dt)
    # Sweeps leave joints open by more.
    if tape[rigid + JOINTS] > 0 and doubles_at(tape[rigid + NUMBERS])[N_SWEEPS] == 0.0:
        join_again(tape, s, n, rigid, k, dt, _OPENED)


@stage
def keep_start_velocities(tape, s, skip, half):
    """Velocities and momenta before the first kick, from which rebounds follow."""
    rigid = tape[H_RIGID]
    start = tape[rigid + START_ROW]
    if start >= 0:
        record = tape[rigid + SOLID_RECORDS]
        for _ in range(tape[rigid + SOLIDS]):
            for c in range(3):
                store(s, start + c, load(s, tape[record + 2] + c))
                momentum = tape[record + 3]
                store(s, start + 3 + c, load(s, momentum + c) if momentum >= 0 else splat(0.0))
            start += 6
            record += SOLID


@stage
def rigid_stage(tape, s, skip, half):
    """Position stage, before the drift, or velocity stage, after the last kick, of every lane that is a world."""
    rigid = tape[H_RIGID]
    dt = s[LANES * tape[H_DT]]
    for k in range(skip[tape[H_BLOCKS] + COUNT]):
        if half == 0:
            if wake_changed(tape, s, rigid, k):
                _position_stage(tape, s, skip, rigid, k, dt)
            else:
                hold_sleepers(tape, s, rigid, k)
        elif all_asleep(tape, s, rigid, k):
            hold_sleepers(tape, s, rigid, k)
        else:
            _velocity_stage(tape, s, skip, rigid, k, dt)
