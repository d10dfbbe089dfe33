"""Every island of one world, each solved by the stage that the solver gives (``Solver.island``)."""

from __future__ import annotations

from ..constraints.brakes import add_torque, has_brake
from ..constraints.contact_rows import accelerate, add_impulse, contact_at, contact_ends
from ..constraints.joint_rows import (
    add_row_impulse,
    joint_at,
    joint_solids,
    row_at,
)
from ..constraints.solids import is_free, solid_at, symmetric_times
from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import (
    C_BEFORE,
    C_BRAKE,
    C_BRAKE_BEFORE,
    C_COMPLIANCE,
    C_IMPULSE,
    C_LATE,
    C_SHIFT,
    C_WEIGHT,
    HELD,
    ISLAND,
    J_BEFORE,
    J_IMPULSE,
    J_KIND,
    J_OFFSET,
    LIST,
    LOCAL,
    OFF,
    ORDER,
    ROW_ENTRIES,
    S_BASE,
    S_FREE,
    S_GEOMETRIC,
    S_PUSH,
    S_VELOCITY,
    SETTLED,
    SOLIDS,
    SOLVE,
)
from ..model.tape import H_UNSETTLED
from ..stage import call_stage
from .block_cholesky import SIX
from .islands import UNSEEN, gather_island, join_all

# What is solved for: ALL impulses; CHANGES of those of joints, one pass of which more follow; a PUSH from rest; or,
# where contacts came LATE, all again of their islands, of which others keep the base; or SOFTLY, all with contacts that
# give way.
ALL, CHANGES, PUSH, LATE, SOFTLY = range(5)


@inner
def island_at_hand(tape, n, rigid):
    """Numbers of its solids, contacts and joints, and the factor's rows."""
    island = tape[rigid + ISLAND]
    return n[island], n[island + 1], n[island + 2], n[island + 3]


@inner
def begin_velocity(tape, s, n, rigid, size, contacts, joints, warm):
    """Velocities that the impulses of the last pass make, or without any."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_PUSH + k] = 0.0
            s[at + S_VELOCITY + k] = s[at + S_FREE + k]
    if warm:
        for j in range(contacts):
            i = n[tape[rigid + LIST] + j]
            c = contact_at(tape, rigid, i)
            a, b = contact_ends(tape, n, rigid, i)
            add_impulse(
                s, c, a, b, S_PUSH, s[c + C_BEFORE], s[c + C_BEFORE + 1], s[c + C_BEFORE + 2]
            )
            if has_brake(s, c):
                t = c + C_BRAKE_BEFORE
                add_torque(s, c, a, b, S_PUSH, s[t], s[t + 1], s[t + 2])
        for j in range(joints):
            joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
            a, b = joint_solids(tape, rigid, joint)
            row = row_at(tape, rigid, tape[joint + 4])
            for _ in range(tape[joint + 5]):
                if s[row + J_KIND] != OFF:
                    add_row_impulse(s, row, a, b, S_PUSH, s[row + J_BEFORE] - s[row + J_OFFSET])
                row += ROW_ENTRIES
        for i in range(size):
            accelerate(s, solid_at(tape, rigid, n[tape[rigid + ORDER] + i]), S_PUSH, S_VELOCITY)


@inner
def forget_impulses(tape, s, n, rigid, contacts, joints, compliance):
    """Begin from nothing, with a compliance of contacts over their mobility."""
    for j in range(contacts):
        c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
        s[c + C_COMPLIANCE] = compliance * s[c + C_WEIGHT]
        s[c + C_SHIFT] = 0.0
        for k in range(3):
            s[c + C_BEFORE + k] = 0.0
            s[c + C_BRAKE_BEFORE + k] = 0.0
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            s[row + J_BEFORE] = s[row + J_OFFSET]
            row += ROW_ENTRIES


@inner
def _keep_impulses(tape, s, n, rigid, size, contacts):
    """S_VELOCITY = sum of the impulses on every solid of an island: equal and opposite to the bit."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        # Where geometric stiffness was counted: what it did to the torques.
        x, y, z = symmetric_times(
            s,
            at + S_GEOMETRIC,
            s[at + S_VELOCITY + 3],
            s[at + S_VELOCITY + 4],
            s[at + S_VELOCITY + 5],
        )
        for k in range(3):
            s[at + S_VELOCITY + k] = 0.0
        s[at + S_VELOCITY + 3] = -x
        s[at + S_VELOCITY + 4] = -y
        s[at + S_VELOCITY + 5] = -z
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        add_impulse(
            s, c, a, b, S_VELOCITY, s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2]
        )
        if has_brake(s, c):
            t = c + C_BRAKE
            add_torque(s, c, a, b, S_VELOCITY, s[t], s[t + 1], s[t + 2])


@inner
def _keep_joint_impulses(tape, s, n, rigid, joints):
    """Add those of an island's joints."""
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] != OFF:
                add_row_impulse(s, row, a, b, S_VELOCITY, s[row + J_IMPULSE])
            row += ROW_ENTRIES


@inner
def _is_late(tape, s, n, rigid, contacts):
    """Whether an island has a contact that is not solved yet."""
    late = False
    for j in range(contacts):
        late = late or s[contact_at(tape, rigid, n[tape[rigid + LIST] + j]) + C_LATE] < 0.0
    return late


@inner
def solve_islands(tape, s, n, rigid, count, k, what):
    """Solve all islands of lane k; solids end with the impulses on them in S_VELOCITY, after a push with velocities.

    Args:
        count: number of contacts that count.
        what: ALL, CHANGES, PUSH, LATE or SOFTLY.
    """
    join_all(tape, s, n, rigid, count)
    for seed in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, seed)
        if not is_free(s, at):
            for c in range(SIX):
                s[at + S_VELOCITY + c] = 0.0
        elif n[tape[rigid + LOCAL] + seed] == UNSEEN:
            gather_island(tape, n, rigid, seed, count)
            size, contacts, joints, _ = island_at_hand(tape, n, rigid)
            if what == LATE and not _is_late(tape, s, n, rigid, contacts):
                for i in range(size):
                    solid = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
                    for c in range(SIX):
                        s[solid + S_VELOCITY + c] = s[solid + S_BASE + c]
                continue
            if contacts + joints > 0 or what == PUSH:
                call_stage(tape[rigid + SOLVE], tape, s, n, ALL if what == LATE else what)
                if n[tape[rigid + ISLAND] + SETTLED] == 0:
                    s[LANES * tape[H_UNSETTLED] + k] = 1.0
            if what != PUSH:
                _keep_impulses(tape, s, n, rigid, size, contacts)
                _keep_joint_impulses(tape, s, n, rigid, joints)
