"""Proximal passes over an island, and a soft one where they do not settle (see ``proximal_newton``)."""

from __future__ import annotations

from math import sqrt

from ..constraints.brakes import brake_at, brake_compliance, has_brake, relative_spin
from ..constraints.contact_rows import contact_at, contact_ends, length, relative_velocity
from ..constraints.joint_rows import joint_at, joint_solids, row_at, row_impulse, row_velocity
from ..kernel import inner
from ..math.pointers import doubles_at
from ..model.rigid_layout import (
    C_BEFORE,
    C_BRAKE,
    C_BRAKE_BEFORE,
    C_BRAKE_WEIGHT,
    C_COMPLIANCE,
    C_FRICTION,
    C_HELD,
    C_IMPULSE,
    C_LIMIT,
    C_MOVED,
    C_ROLLING,
    C_SHIFT,
    C_SPEED,
    C_SPINNING,
    C_WEIGHT,
    HELD,
    ISLAND,
    J_BEFORE,
    J_COMPLIANCE,
    J_IMPULSE,
    J_KIND,
    J_OFFSET,
    LIST,
    N_COMPLIANCE,
    N_IMPULSE,
    N_ITERATIONS,
    N_PASSES,
    N_SHIFT,
    N_TOLERANCE,
    NUMBERS,
    OFF,
    ROW_ENTRIES,
    S_VELOCITY,
    SETTLED,
    SPRING,
)
from ..model.tape import H_RIGID
from ..stage import stage
from .rigid_islands import (
    ALL,
    CHANGES,
    PUSH,
    SOFTLY,
    begin_velocity,
    forget_impulses,
    island_at_hand,
)
from .rigid_newton import assemble_held, impulse_at, minimise
from .rigid_sweeps import settle_contact

# Compliance of the fallback, which is solved once, and of the push, over the mobility of a contact.
_SOFT, _PUSH = 1e-4, 1e-3
# Error [m/s] with which the last pass may end, and how many times as many passes there may be to reach it: a slip that
# was guessed wrong by metres a second takes energy from nowhere.
_NEAR, _MORE = 1e-2, 5
# Compliance, residual, passes and steps of what takes rounding out of the impulses in the end.
_POLISH, _POLISHED, _POLISHES, _POLISH_STEPS = 1e-3, 1e-12, 2, 3
# Solids of an island in which it is worth that.
_FEW = 2
# Residual of a pass for changes: what it leaves, the next one finds.
_ROUGH = 1e-5
# Error of velocities [m/s or rad/s] at which an island keeps its impulses: what is at rest costs a test.
_AT_REST = 2e-11
# Share of it at which it keeps those that the stage before has changed: these took out an error of velocities that is
# there no more. Kept, they would leave as large a one the other way, for the next stage to find, and so on for good.
_CHANGED = 1e-2


@inner
def _polish(tape, s, n, rigid, size, contacts, joints, rows):
    """Take rounding out of the impulses.

    That of velocities counts in them by one over the compliance: less with a larger one, which passes take out again.
    """
    for j in range(contacts):
        c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
        s[c + C_COMPLIANCE] = _POLISH * s[c + C_WEIGHT]
    for _ in range(_POLISHES):
        taken = minimise(tape, s, n, rigid, size, contacts, joints, rows, _POLISHED, _POLISH_STEPS)
        for j in range(contacts):
            c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
            for k in range(3):
                if taken < 0:
                    s[c + C_IMPULSE + k] = s[c + C_BEFORE + k]
                    s[c + C_BRAKE + k] = s[c + C_BRAKE_BEFORE + k]
                else:
                    s[c + C_BEFORE + k] = s[c + C_IMPULSE + k]
                    s[c + C_BRAKE_BEFORE + k] = s[c + C_BRAKE + k]
        if taken <= 0:
            break


@inner
def _unsettled(s, c, u0, u1, u2):
    """Compliance times the change of a contact's impulse by a pass: how far a velocity is from what it must be."""
    l0, l1, l2, _, _, _, _ = impulse_at(s, c, u0, u1, u2)
    return s[c + C_COMPLIANCE] * length(
        l0 - s[c + C_BEFORE], l1 - s[c + C_BEFORE + 1], l2 - s[c + C_BEFORE + 2]
    )


@inner
def _unsettled_brake(s, c, l0, l1, l2):
    """The same of spinning and rolling, given what the pass would have."""
    t = c + C_BRAKE_BEFORE
    return brake_compliance(s, c) * length(l0 - s[t], l1 - s[t + 1], l2 - s[t + 2])


@inner
def _unsettled_joint(tape, s, rigid, j):
    """The same of a joint's rows."""
    joint = joint_at(tape, rigid, j)
    a, b = joint_solids(tape, rigid, joint)
    row = row_at(tape, rigid, tape[joint + 4])
    change = 0.0
    for _ in range(tape[joint + 5]):
        if s[row + J_KIND] != OFF:
            value, _ = row_impulse(s, row, row_velocity(s, row, a, b, S_VELOCITY))
            left = value + s[row + J_OFFSET] - s[row + J_BEFORE]
            change = max(change, s[row + J_COMPLIANCE] * abs(left))
        row += ROW_ENTRIES
    return change


@inner
def _keep_last(tape, s, n, rigid, contacts, joints):
    """Let the impulses of the last stage be those of this."""
    for j in range(contacts):
        c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
        for k in range(3):
            s[c + C_IMPULSE + k] = s[c + C_BEFORE + k]
            s[c + C_BRAKE + k] = s[c + C_BRAKE_BEFORE + k]
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            s[row + J_IMPULSE] = s[row + J_BEFORE] - s[row + J_OFFSET]
            row += ROW_ENTRIES


@inner
def _pass(tape, s, n, rigid, size, contacts, joints, rows, what):
    """All passes of an island; whether they settled."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    tolerance = numbers[N_TOLERANCE] if what == ALL else _ROUGH
    iterations = int(numbers[N_ITERATIONS])
    begin_velocity(tape, s, n, rigid, size, contacts, joints, True)
    change = 0.0
    changed = False
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        s[c + C_COMPLIANCE] = numbers[N_COMPLIANCE] * s[c + C_WEIGHT]
        u0, u1, u2 = relative_velocity(s, c, a, b, S_VELOCITY)
        s[c + C_SHIFT] = sqrt(u1 * u1 + u2 * u2)
        change = max(change, _unsettled(s, c, u0, u1, u2))
        changed = changed or s[c + C_MOVED] != 0.0
        if has_brake(s, c):
            s[c + C_LIMIT] = s[c + C_BEFORE] + s[c + C_HELD]
            w0, w1, w2 = relative_spin(s, c, a, b, S_VELOCITY)
            l0, l1, l2 = brake_at(s, c, w0, w1, w2)
            change = max(change, _unsettled_brake(s, c, l0, l1, l2))
    for j in range(joints):
        change = max(change, _unsettled_joint(tape, s, rigid, n[tape[rigid + HELD] + j]))
    rests = change <= (_CHANGED * _AT_REST if changed else _AT_REST)
    for j in range(contacts):
        s[contact_at(tape, rigid, n[tape[rigid + LIST] + j]) + C_MOVED] = 0.0 if rests else 1.0
    if rests:
        _keep_last(tape, s, n, rigid, contacts, joints)
        return True
    if contacts == 1 and joints == 0:
        if settle_contact(tape, s, n, rigid):
            return True
        c = contact_at(tape, rigid, n[tape[rigid + LIST]])
        s[c + C_COMPLIANCE] = numbers[N_COMPLIANCE] * s[c + C_WEIGHT]
        begin_velocity(tape, s, n, rigid, size, contacts, joints, True)
    assemble_held(tape, s, n, rigid, size, joints, rows)
    moved = False
    settled = False
    near = True
    slips = True
    passes = int(numbers[N_PASSES])
    for turn in range(_MORE * passes):
        taken = minimise(tape, s, n, rigid, size, contacts, joints, rows, tolerance, iterations)
        if taken < 0:
            return False
        moved = moved or taken > 0
        change = 0.0
        shift = 0.0
        for j in range(contacts):
            c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
            left = s[c + C_COMPLIANCE] * length(
                s[c + C_IMPULSE] - s[c + C_BEFORE],
                s[c + C_IMPULSE + 1] - s[c + C_BEFORE + 1],
                s[c + C_IMPULSE + 2] - s[c + C_BEFORE + 2],
            )
            change = max(change, left)
            u1 = s[c + C_SPEED + 1]
            u2 = s[c + C_SPEED + 2]
            slip = sqrt(u1 * u1 + u2 * u2)
            if s[c + C_IMPULSE] > 0.0:
                shift = max(shift, s[c + C_FRICTION] * abs(slip - s[c + C_SHIFT]))
            s[c + C_SHIFT] = slip
            if has_brake(s, c):
                t = c + C_BRAKE
                change = max(change, _unsettled_brake(s, c, s[t], s[t + 1], s[t + 2]))
                limit = s[c + C_IMPULSE] + s[c + C_HELD]
                reach = s[c + C_SPINNING] + s[c + C_ROLLING]
                shift = max(shift, s[c + C_BRAKE_WEIGHT] * reach * abs(limit - s[c + C_LIMIT]))
                s[c + C_LIMIT] = limit
            for k in range(3):
                s[c + C_BEFORE + k] = s[c + C_IMPULSE + k]
                s[c + C_BRAKE_BEFORE + k] = s[c + C_BRAKE + k]
        for j in range(joints):
            joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
            row = row_at(tape, rigid, tape[joint + 4])
            for _ in range(tape[joint + 5]):
                if s[row + J_KIND] != OFF and s[row + J_KIND] != SPRING:
                    value = s[row + J_OFFSET] + s[row + J_IMPULSE]
                    change = max(change, s[row + J_COMPLIANCE] * abs(value - s[row + J_BEFORE]))
                    s[row + J_BEFORE] = value
                row += ROW_ENTRIES
        settled = what == CHANGES or (change <= numbers[N_IMPULSE] and shift <= numbers[N_SHIFT])
        slips = shift <= _NEAR
        near = change <= _NEAR and slips
        if settled or (near and turn + 1 >= passes):
            break
    if moved and settled and size <= _FEW and joints == 0:
        _polish(tape, s, n, rigid, size, contacts, joints, rows)
    # The next step goes on from what else is left, as under a top of a million times the mass. Not so with joints: what
    # their passes left gave a ragdoll fifty times its energy.
    return settled or near or (slips and joints == 0)


@inner
def _pass_softly(tape, s, n, rigid, size, contacts, joints, rows, compliance):
    """One pass with softer contacts from nothing; whether it settled."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    forget_impulses(tape, s, n, rigid, contacts, joints, compliance)
    begin_velocity(tape, s, n, rigid, size, contacts, joints, False)
    assemble_held(tape, s, n, rigid, size, joints, rows)
    few = int(numbers[N_ITERATIONS])
    loose = 10.0 * numbers[N_TOLERANCE]
    taken = minimise(tape, s, n, rigid, size, contacts, joints, rows, loose, 2 * few)
    return taken >= 0


@stage
def pass_island(tape, s, n, what):
    """The island at hand, by proximal passes."""
    rigid = tape[H_RIGID]
    size, contacts, joints, rows = island_at_hand(tape, n, rigid)
    hard = what != PUSH and what != SOFTLY
    good = hard and _pass(tape, s, n, rigid, size, contacts, joints, rows, what)
    if not good:
        compliance = _PUSH if what == PUSH else _SOFT
        good = _pass_softly(tape, s, n, rigid, size, contacts, joints, rows, compliance)
    n[tape[rigid + ISLAND] + SETTLED] = 1 if good else 0
