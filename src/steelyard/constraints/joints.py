"""Joints in one world: what is wanted of their rows in a stage, how far they are open, and what they bear.

Locked coordinates and limits are held where the step ends: the velocity that a row wants is that at hand, less what is
left of its error over the step (as RATTLE holds rods). Motors and springs act with a force over each half of the step;
a spring's is implicit, k (C + h u) + c u with h the half step.
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import (
    BOUND_ROW,
    EQUAL,
    FRAME_WORK,
    J_ASKED,
    J_BEFORE,
    J_COMPLIANCE,
    J_DAMPING,
    J_ERROR,
    J_FORCE,
    J_HIGH,
    J_IMPULSE,
    J_KIND,
    J_LEAST,
    J_LEFT,
    J_LOW,
    J_OFFSET,
    J_STIFFNESS,
    J_TORQUE_A,
    J_WEIGHT,
    JOINT_BROKEN,
    JOINT_TORN,
    JOINTS,
    LIMIT,
    MOTOR,
    OFF,
    REMEMBERED,
    ROW_ENTRIES,
    S_BASE,
    S_END,
    S_END_ROTATION,
    S_FREE,
    S_GEOMETRIC,
    S_INVERSE_INERTIA,
    S_JOINED,
    S_PLACE,
    S_PUSH,
    S_ROTATION,
    S_STEP,
    S_TURNS,
    S_VELOCITY,
    SOLIDS,
    SPRING,
)
from .contact_rows import accelerate
from .joint_rows import (
    ALL,
    DIRECTIONS,
    ERRORS,
    add_row_impulse,
    joint_at,
    joint_solids,
    measure_joint,
    row_at,
    row_velocity,
)
from .solids import linearise_turns, rest_solids, solid_at

POSITIONS, VELOCITIES, PUSHES = range(3)
# Compliance of a row over its mobility.
_COMPLIANCE = 1e-6
# Share of its own square that a pass must add to those after it to be mixed in.
_NEW = 1e-12
# A limit this near [m or rad] is reached.
_REACHED = 1e-10


@inner
def begin_joints(tape, s, rigid, k, dt, what):
    """Rows of all joints of lane k, with the impulses of the stage before, for positions, velocities or pushes.

    Returns:
        The largest error of what must be closed, for pushes.
    """
    half = 0.5 * dt
    worst = 0.0
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        measure_joint(tape, s, rigid, k, joint, S_PLACE, S_ROTATION, ALL)
        row = row_at(tape, rigid, tape[joint + 4])
        for i in range(tape[joint + 5]):
            kind = s[row + J_KIND]
            before = s[LANES * (tape[rigid + BOUND_ROW] + tape[joint + 4] + i) + k]
            s[row + J_COMPLIANCE] = _COMPLIANCE * s[row + J_WEIGHT]
            if what == PUSHES:
                error = s[row + J_ERROR]
                s[row + J_LEAST] = -error / dt
                if kind == LIMIT:
                    error = max(-error, 0.0) if s[row + J_LOW] == 0.0 else max(error, 0.0)
                elif kind != EQUAL:
                    s[row + J_KIND] = OFF
                    error = 0.0
                worst = abs(error) if not abs(error) <= worst else worst
            elif kind == MOTOR:
                s[row + J_LOW] *= half
                s[row + J_HIGH] *= half
                s[row + J_BEFORE] = before
            elif kind == SPRING:
                give = s[row + J_DAMPING] + half * s[row + J_STIFFNESS]
                s[row + J_COMPLIANCE] = 1.0 / (half * give)
                s[row + J_LEAST] = -s[row + J_STIFFNESS] * s[row + J_ERROR] / give
            elif kind != OFF:
                s[row + J_BEFORE] = before
                s[row + J_IMPULSE] = before
                if what == POSITIONS:
                    s[row + J_LEAST] = -s[row + J_ERROR] / dt
                elif kind == LIMIT:
                    gap = s[row + J_ERROR] if s[row + J_LOW] == 0.0 else -s[row + J_ERROR]
                    if before == 0.0 and gap > _REACHED:
                        s[row + J_KIND] = OFF
            row += ROW_ENTRIES
    return worst


@inner
def _mix(tape, s, rigid, turn):
    """Mix what rows ask for with what they asked for before, such that the errors left would be least.

    Source: Anderson (1965), *Iterative Procedures for Nonlinear Integral Equations*.
    """
    depth = min(turn, REMEMBERED - 1)
    now = turn % REMEMBERED
    sums = tape[rigid + FRAME_WORK] + 24
    for i in range(depth * (depth + 1)):
        s[sums + i] = 0.0
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] == EQUAL:
                left = s[row + J_LEFT + now]
                at = sums
                for i in range(depth):
                    one = left - s[row + J_LEFT + (turn - 1 - i) % REMEMBERED]
                    for k in range(i + 1):
                        s[at] += one * (left - s[row + J_LEFT + (turn - 1 - k) % REMEMBERED])
                        at += 1
                    s[at] += one * left
                    at += 1
            row += ROW_ENTRIES
    # Cholesky's method row by row, the right side behind each row; what adds nothing new to its rows is left out.
    at = 0
    for i in range(depth):
        own = sums + at
        full = s[own + i]
        other = sums
        for k in range(i):
            value = s[own + k]
            for c in range(k):
                value -= s[own + c] * s[other + c]
            value *= s[other + k]
            s[own + k] = value
            s[own + i] -= value * value
            s[own + i + 1] -= value * s[other + k + 1]
            other += k + 2
        s[own + i] = 1.0 / sqrt(s[own + i]) if s[own + i] > _NEW * full else 0.0
        s[own + i + 1] *= s[own + i]
        at += i + 2
    for i in range(depth - 1, -1, -1):
        own = sums + i * (i + 3) // 2
        value = s[own + i + 1]
        for c in range(i + 1, depth):
            below = sums + c * (c + 3) // 2
            value -= s[below + i] * s[below + c + 1]
        s[own + i + 1] = value * s[own + i]
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] == EQUAL:
                asked = s[row + J_ASKED + now]
                for i in range(depth):
                    share = s[sums + i * (i + 3) // 2 + i + 1]
                    s[row + J_LEAST] += share * (
                        s[row + J_ASKED + (turn - 1 - i) % REMEMBERED] - asked
                    )
            row += ROW_ENTRIES


@inner
def _pull(tape, s, rigid, joint):
    """Impulse of a joint on a, by its rows at hand."""
    x = 0.0
    y = 0.0
    z = 0.0
    row = row_at(tape, rigid, tape[joint + 4])
    for _ in range(tape[joint + 5]):
        if s[row + J_KIND] != OFF:
            value = s[row + J_OFFSET] + s[row + J_IMPULSE]
            x += value * s[row + J_FORCE]
            y += value * s[row + J_FORCE + 1]
            z += value * s[row + J_FORCE + 2]
        row += ROW_ENTRIES
    return x, y, z


@inner
def _stiffen(s, solid, x, y, z, ax, ay, az, dt):
    """Add the geometric stiffness of a pull (x, y, z) at an arm, times dt: how its torque falls off with a turn.

    With s along x/|x| + r/|r| it is (|x||r| + x . r)/2 (1 - s s^T): exact for a pull along its arm, 0 for a push along
    it, and never negative.
    """
    pull = sqrt(x * x + y * y + z * z)
    arm = sqrt(ax * ax + ay * ay + az * az)
    size = 0.5 * dt * (pull * arm + x * ax + y * ay + z * az) * s[solid + S_TURNS]
    if size > 0.0:
        sx = x / pull + ax / arm
        sy = y / pull + ay / arm
        sz = z / pull + az / arm
        share = size / (sx * sx + sy * sy + sz * sz)
        g = solid + S_GEOMETRIC
        s[g] += size - share * sx * sx
        s[g + 1] -= share * sx * sy
        s[g + 2] += size - share * sy * sy
        s[g + 3] -= share * sx * sz
        s[g + 4] -= share * sy * sz
        s[g + 5] += size - share * sz * sz


@inner
def _stiffen_ends(tape, s, rigid, joint, place, dt):
    """Geometric stiffness of a joint on both its solids, whose places are in the field ``place``."""
    frames = tape[rigid + FRAME_WORK]
    a, b = joint_solids(tape, rigid, joint)
    x, y, z = _pull(tape, s, rigid, joint)
    at = a + place
    _stiffen(
        s, a, x, y, z, s[frames] - s[at], s[frames + 1] - s[at + 1], s[frames + 2] - s[at + 2], dt
    )
    at = b + place
    _stiffen(
        s, b, -x, -y, -z, s[frames + 12] - s[at], s[frames + 13] - s[at + 1], s[frames + 14] - s[at + 2], dt
    )  # fmt: skip


@inner
def soften_joints(tape, s, rigid, rate, share):
    """Let what is locked give way: errors fall at a rate [1/s], with a compliance over the mobility."""
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] == EQUAL:
                s[row + J_LEAST] = -rate * s[row + J_ERROR]
                s[row + J_COMPLIANCE] = share * s[row + J_WEIGHT]
            row += ROW_ENTRIES


@inner
def hold_impulses(tape, s, rigid, factor):
    """Put the impulses at hand into the base, so that rows count changes from there.

    Args:
        factor: on the compliance of locked coordinates and limits, of which changes need less.
    """
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_BASE + c] = s[at + S_VELOCITY + c]
            s[at + S_JOINED + c] = 0.0
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            kind = s[row + J_KIND]
            if kind != OFF:
                add_row_impulse(s, row, a, b, S_JOINED, s[row + J_IMPULSE])
            if kind == EQUAL or kind == LIMIT:  # noqa: SIM109
                s[row + J_COMPLIANCE] *= factor
            else:
                s[row + J_ASKED] = s[row + J_LEAST]
            s[row + J_OFFSET] = s[row + J_IMPULSE]
            s[row + J_IMPULSE] = 0.0
            row += ROW_ENTRIES


@inner
def add_changes(tape, s, rigid):
    """Add what a solve changed to the base."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_BASE + c] += s[at + S_VELOCITY + c]
            s[at + S_JOINED + c] += s[at + S_VELOCITY + c]
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            s[row + J_OFFSET] += s[row + J_IMPULSE]
            s[row + J_IMPULSE] = 0.0
            row += ROW_ENTRIES


@inner
def _turn_impulses(tape, s, rigid):
    """Let what rows hold push along their directions at hand, and free velocities be what that changes."""
    for i in range(tape[rigid + SOLIDS] + 1):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_PUSH + c] = -s[at + S_JOINED + c]
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] != OFF:
                add_row_impulse(s, row, a, b, S_PUSH, s[row + J_OFFSET])
            row += ROW_ENTRIES
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + S_BASE + c] += s[at + S_PUSH + c]
            s[at + S_JOINED + c] += s[at + S_PUSH + c]
        accelerate(s, at, S_PUSH, S_FREE)


@inner
def keep_joints(tape, s, rigid, of_solids, to_solids, of_rows, to_rows):
    """Copy impulses of all solids and rows from one field to another."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(6):
            s[at + to_solids + c] = s[at + of_solids + c]
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            s[row + to_rows] = s[row + of_rows]
            row += ROW_ENTRIES


@inner
def _forget_stiffness(tape, s, rigid):
    for i in range(tape[rigid + SOLIDS] + 1):
        at = solid_at(tape, rigid, i) + S_GEOMETRIC
        for c in range(6):
            s[at + c] = 0.0


@inner
def tautness(tape, s, rigid, k, dt):
    """Largest (step times frequency)^2 with which the pulls of joints make a solid swing.

    RATTLE, whose pulls have the directions of the step's start, is stable below 4, as velocity Verlet is below h w = 2.
    """
    _forget_stiffness(tape, s, rigid)
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        measure_joint(tape, s, rigid, k, joint, S_PLACE, S_ROTATION, ERRORS)
        # Impulses are those of half a step.
        _stiffen_ends(tape, s, rigid, joint, S_PLACE, 2.0 * dt)
    most = 0.0
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        g = at + S_GEOMETRIC
        w = at + S_INVERSE_INERTIA
        # The trace of the product: no less than the largest eigenvalue, and at most three times that.
        trace = s[g] * s[w] + s[g + 2] * s[w + 2] + s[g + 5] * s[w + 5]
        trace += 2.0 * (s[g + 1] * s[w + 1] + s[g + 3] * s[w + 3] + s[g + 4] * s[w + 4])
        most = max(most, trace)
    _forget_stiffness(tape, s, rigid)
    return most


@inner
def close_joints(tape, s, rigid, k, dt, turn, implicit):
    """Ask rows for what is left of their errors where the step ends; the largest error of those that must be closed.

    Args:
        turn: number of the pass. Passes are mixed, since the directions in which rows push are those of the start.
        implicit: take directions from where the step ends, and how pulls change with the turns at hand.
    """
    if implicit:
        _forget_stiffness(tape, s, rigid)
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        what = DIRECTIONS if implicit else ERRORS
        measure_joint(tape, s, rigid, k, joint, S_END, S_END_ROTATION, what)
        if implicit:
            _stiffen_ends(tape, s, rigid, joint, S_END, dt)
    rest_solids(tape, s, rigid)
    if implicit:
        linearise_turns(tape, s, rigid, k)
        _turn_impulses(tape, s, rigid)
    worst = 0.0
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            kind = s[row + J_KIND]
            if kind == EQUAL or kind == LIMIT:  # noqa: SIM109
                error = s[row + J_ERROR]
                asked = -error / dt
                s[row + J_LEAST] = asked
                s[row + J_ASKED + turn % REMEMBERED] = row_velocity(s, row, a, b, S_STEP) + asked
                s[row + J_LEFT + turn % REMEMBERED] = error
                s[row + J_BEFORE] = s[row + J_OFFSET]
                if kind == LIMIT:
                    below = -error if s[row + J_LOW] == 0.0 else error
                    error = max(below, 0.0) if s[row + J_OFFSET] == 0.0 else error
                # A NaN must not pass for closed.
                worst = abs(error) if not abs(error) <= worst else worst
            elif kind != OFF:
                s[row + J_LEAST] = s[row + J_ASKED] - row_velocity(s, row, a, b, S_STEP)
                s[row + J_BEFORE] = s[row + J_OFFSET] if kind == MOTOR else 0.0
            row += ROW_ENTRIES
    if turn > 0 and not implicit:
        _mix(tape, s, rigid, turn)
    return worst


@inner
def store_joints(tape, s, rigid, k, dt, ends):
    """Keep the impulses of all rows; where the step ``ends``, forces too, and break joints that bear too much."""
    for j in range(tape[rigid + JOINTS]):
        joint = joint_at(tape, rigid, j)
        row = row_at(tape, rigid, tape[joint + 4])
        fx = 0.0
        fy = 0.0
        fz = 0.0
        tx = 0.0
        ty = 0.0
        tz = 0.0
        for i in range(tape[joint + 5]):
            at = LANES * (tape[rigid + BOUND_ROW] + tape[joint + 4] + i) + k
            if s[row + J_KIND] == OFF:
                s[at] = 0.0
            else:
                value = s[row + J_OFFSET] + s[row + J_IMPULSE]
                s[at] = value
                x = s[row + J_FORCE]
                y = s[row + J_FORCE + 1]
                z = s[row + J_FORCE + 2]
                fx += value * x
                fy += value * y
                fz += value * z
                if x == 0.0 and y == 0.0 and z == 0.0:
                    tx += value * s[row + J_TORQUE_A]
                    ty += value * s[row + J_TORQUE_A + 1]
                    tz += value * s[row + J_TORQUE_A + 2]
            row += ROW_ENTRIES
        if ends:
            share = 2.0 / dt
            force = LANES * tape[joint + JOINT_BROKEN + 1] + k
            torque = LANES * tape[joint + JOINT_BROKEN + 2] + k
            s[force] = share * fx
            s[force + LANES] = share * fy
            s[force + 2 * LANES] = share * fz
            s[torque] = share * tx
            s[torque + LANES] = share * ty
            s[torque + 2 * LANES] = share * tz
            strong = (
                share * sqrt(fx * fx + fy * fy + fz * fz) <= s[LANES * tape[joint + JOINT_TORN] + k]
            )
            most = s[LANES * tape[joint + JOINT_TORN + 1] + k]
            if not (strong and share * sqrt(tx * tx + ty * ty + tz * tz) <= most):
                s[LANES * tape[joint + JOINT_BROKEN] + k] = 1.0
