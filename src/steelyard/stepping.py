"""The one stepping kernel: all substeps of a range of worlds, block after block of ``LANES``.

A block's state is copied to the scratch, stepped there and copied back; parameters that differ between worlds
are copied in beside it. This file reads as the recipe of every method.
"""

from __future__ import annotations

from .collision.geometry import contact_geometry
from .constraints.riders import rider_advance
from .integrators.closed_form import closed_form_step
from .integrators.explicit_euler import explicit_euler_step
from .integrators.rattle import rattle_first_half, rattle_second_half
from .integrators.symplectic_euler import symplectic_euler_step
from .kernel import inner, kernel
from .math.lanes import LANES, fma, load, select, splat, store
from .model.tape import (
    CLOSED_FORM,
    EXPLICIT_EULER,
    H_CONSTRAINED,
    H_DT,
    H_INTEGRATOR,
    H_NONFINITE,
    H_PARTICLES,
    H_POSITION,
    H_RIDERS,
    H_SOLVER,
    H_STATE_ROWS,
    H_TIME,
    H_VELOCITY,
    H_WINCHES,
    RATTLE,
    SYMPLECTIC_EULER,
    WORST_FIRST,
)
from .solvers.stages import begin_step, position_stage, velocity_stage
from .solvers.worst_first import resolve_worst_first

FIRST_HALF, SECOND_HALF = 1, 2


@inner
def _load_row(s, row, source, index, first, count):
    """Copy one row of a block to the scratch; missing worlds repeat the last."""
    if count == LANES:
        for k in range(LANES):
            s[row, k] = source[index, first + k]
    else:
        for k in range(LANES):
            s[row, k] = source[index, first + min(k, count - 1)]


@inner
def _load_block(tape, s, state, given, given_rows, block, worlds):
    """Copy a block's state and own parameters to the scratch."""
    first = LANES * block
    count = min(worlds - first, LANES)
    for row in range(tape[H_STATE_ROWS]):
        _load_row(s, row, state, row, first, count)
    for index in range(given_rows.shape[0]):
        _load_row(s, given_rows[index], given, index, first, count)


@inner
def _store_block(tape, s, state, block, worlds):
    """Copy a block's state back."""
    first = LANES * block
    count = min(worlds - first, LANES)
    for row in range(tape[H_STATE_ROWS]):
        if count == LANES:
            for k in range(LANES):
                state[row, first + k] = s[row, k]
        else:
            for k in range(count):
                state[row, first + k] = s[row, k]


@inner
def _advance_controls(tape, s, dt):
    """Winches and riders move to where they are at the step's end."""
    at = tape[H_WINCHES]
    for index in range(tape[at]):
        winch = at + 1 + 3 * index
        length, speed = tape[winch], tape[winch + 1]
        rate = load(s, speed)
        end_rate = fma(dt, load(s, tape[winch + 2]), rate)
        store(s, length, fma(splat(0.5) * dt, rate + end_rate, load(s, length)))
        store(s, speed, end_rate)
    if tape[tape[H_RIDERS]] > 0:
        rider_advance(tape, s, dt)


@inner
def _worst_first(tape, s, ends, values):
    """Contacts of the source's method, world after world."""
    contact_geometry(tape, s)
    past = tape[H_POSITION] + 3 * tape[H_PARTICLES]
    for k in range(LANES):
        resolve_worst_first(tape, s, k, ends, values, tape[H_POSITION], past, s[tape[H_DT], k])


@inner
def _flag_nonfinite(tape, s):
    """Set the flag of worlds whose positions or velocities are not finite."""
    zero = splat(0.0)
    sum_ = zero
    for row in range(3 * tape[H_PARTICLES]):
        sum_ = fma(load(s, tape[H_POSITION] + row), zero, sum_)
        sum_ = fma(load(s, tape[H_VELOCITY] + row), zero, sum_)
    flag = tape[H_NONFINITE]
    store(s, flag, select(sum_ <= zero, load(s, flag), splat(1.0)))


@inner
def _step(tape, s, skip, ends, values, dt, phase, fresh):
    """One substep of a block by the method on the tape."""
    integrator = tape[H_INTEGRATOR]
    constrained = tape[H_CONSTRAINED] != 0
    if integrator == RATTLE:
        if phase & FIRST_HALF:
            if constrained:
                fresh = begin_step(tape, s, skip, dt) or fresh
            _advance_controls(tape, s, dt)
            rattle_first_half(tape, s, dt)
            if constrained:
                position_stage(tape, s, skip, dt, fresh)
        if phase & SECOND_HALF:
            rattle_second_half(tape, s, dt)
            if constrained:
                velocity_stage(tape, s, skip, dt)
    elif integrator == SYMPLECTIC_EULER:
        if constrained and tape[H_SOLVER] != WORST_FIRST:
            fresh = begin_step(tape, s, skip, dt) or fresh
        _advance_controls(tape, s, dt)
        symplectic_euler_step(tape, s, dt)
        if constrained:
            if tape[H_SOLVER] == WORST_FIRST:
                _worst_first(tape, s, ends, values)
            else:
                position_stage(tape, s, skip, dt, fresh)
                velocity_stage(tape, s, skip, dt)
    elif integrator == EXPLICIT_EULER:
        _advance_controls(tape, s, dt)
        explicit_euler_step(tape, s, dt)
        if constrained:
            _worst_first(tape, s, ends, values)
    elif integrator == CLOSED_FORM:
        closed_form_step(tape, s)


@kernel
def advance(
    tape, s, skip, ends, values, state, given, given_rows, first, last, worlds, substeps, phase
):
    """Advance the worlds of blocks ``first`` ... ``last - 1`` by ``substeps``.

    Args:
        tape: (n,) int64, see ``model.tape``.
        s: scratch (rows, LANES) float64, parameters shared by all worlds in place.
        skip: (blocks,) int64 work array.
        ends: (contacts,) int64 work array of the worst-first resolver.
        values: (contacts, 12) float64 work array of the same.
        state: (state rows, padded worlds) float64, changed in place.
        given: (own parameter rows, padded worlds) float64.
        given_rows: (own parameter rows,) int64, their rows in the scratch.
        phase: FIRST_HALF | SECOND_HALF; single halves let user-written forces in between.
    """
    for block in range(first, last):
        _load_block(tape, s, state, given, given_rows, block, worlds)
        dt = load(s, tape[H_DT])
        for substep in range(substeps):
            _step(tape, s, skip, ends, values, dt, phase, substep == 0)
            if phase & SECOND_HALF:
                clock = tape[H_TIME]
                store(s, clock, load(s, clock) + dt)
        _flag_nonfinite(tape, s)
        _store_block(tape, s, state, block, worlds)
