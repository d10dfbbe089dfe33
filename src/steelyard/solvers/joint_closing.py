"""Closing joints where the step ends: by their impulses over the step, or by moving what they join."""

from __future__ import annotations

from ..constraints.joints import (
    PUSHES,
    add_changes,
    begin_joints,
    close_joints,
    hold_impulses,
    keep_joints,
    tautness,
)
from ..constraints.solids import (
    drift_solids,
    end_drift,
    gather_solids,
    kinetic_energy,
    move_solids,
    rest_solids,
    solid_at,
)
from ..kernel import inner
from ..math.pointers import LANES
from ..model.rigid_layout import J_KEPT, J_OFFSET, S_BASE, S_KEPT, S_VELOCITY, SOLIDS
from ..model.tape import H_UNSETTLED
from .block_cholesky import SIX
from .rigid_islands import CHANGES, PUSH, solve_islands

# Passes that close joints, solves that move them together, the error [m or rad] at which they are closed, and that
# which is flagged.
_CLOSINGS, _PROJECTIONS, _CLOSE, _OPEN = 16, 10, 5e-10, 1e-8
# (Step times frequency)^2 of taut joints from which on rows push as where the step ends; energy that closing may come
# to, over that of the first solve, and there over that and what there was without impulses.
_TAUT, _GAIN, _TAUT_GAIN = 4.0, 1.1, 2.0
# Compliance of rows for changes, over that for all.
_CHANGES = 1e-3


@inner
def close_over_step(tape, s, n, rigid, k, dt, taut):
    """Solve until joints are closed where the step ends, by Newton's method; whether that was reached.

    Rows push as where the step begins (RATTLE), or as where it ends if pulls are too taut for that. If joints do not
    close, or only at more energy than there was, the first solve holds.
    """
    now = tautness(tape, s, rigid, k, dt)
    implicit = min(taut, now) > _TAUT
    hold_impulses(tape, s, rigid, _CHANGES)
    keep_joints(tape, s, rigid, S_BASE, S_KEPT, J_OFFSET, J_KEPT)
    bound = 0.0
    free = 0.0
    closed = False
    last = 1e300
    for turn in range(_CLOSINGS):
        drift_solids(tape, s, rigid, k, dt)
        implicit = implicit or (turn == _CLOSINGS // 2 and now > _TAUT)
        if turn == 0:
            bound = kinetic_energy(tape, s, rigid, k, 1.0)
            free = kinetic_energy(tape, s, rigid, k, 0.0)
        worst = close_joints(tape, s, rigid, k, dt, turn, implicit)
        if worst <= _CLOSE or (worst <= _OPEN and worst > 0.5 * last):
            most = _TAUT_GAIN * (bound + free) if implicit else _GAIN * bound
            closed = kinetic_energy(tape, s, rigid, k, 1.0) <= most
            break
        last = worst
        solve_islands(tape, s, n, rigid, 0, k, CHANGES)
        add_changes(tape, s, rigid)
    if not closed:
        keep_joints(tape, s, rigid, S_KEPT, S_BASE, J_KEPT, J_OFFSET)
        drift_solids(tape, s, rigid, k, dt)
    return closed


@inner
def drift_closed(tape, s, rigid, k):
    """Drift by the impulses with which joints are closed."""
    end_drift(tape, s, rigid, k)
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(SIX):
            s[at + S_VELOCITY + c] = s[at + S_BASE + c]


@inner
def join_again(tape, s, n, rigid, k, dt, allowed):
    """Move solids the least that closes their joints, in the metric of their masses; velocities stay as they are.

    Args:
        allowed: error [m or rad] that is left as it is.
    """
    worst = 0.0
    for turn in range(_PROJECTIONS):
        gather_solids(tape, s, rigid, k)
        worst = begin_joints(tape, s, rigid, k, dt, PUSHES)
        if worst <= _CLOSE or (turn == 0 and worst <= allowed):
            return
        rest_solids(tape, s, rigid)
        solve_islands(tape, s, n, rigid, 0, k, PUSH)
        move_solids(tape, s, rigid, k, dt)
    if not worst <= _OPEN:
        s[LANES * tape[H_UNSETTLED] + k] = 1.0
