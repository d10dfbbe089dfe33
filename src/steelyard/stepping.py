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
from .kernel import inner, kernel, part
from .math.lanes import LANES, any_lane, fma, load, load_at, select, splat, store, store_at
from .model.tape import (
    CLOSED_FORM,
    DIRECT,
    EXPLICIT_EULER,
    H_CONSTRAINED,
    H_CONTACTS,
    H_DT,
    H_GIVEN_UP,
    H_INTEGRATOR,
    H_NONFINITE,
    H_PARTICLES,
    H_POSITION,
    H_SOLVER,
    H_STATE_ROWS,
    H_TIME,
    H_VELOCITY,
    H_WINCHES,
    RATTLE,
    WORST_FIRST,
)
from .solvers.stages import begin_step, constraint_stage
from .solvers.worst_first import resolve_worst_first

FIRST_HALF, SECOND_HALF = 1, 2
BOTH_HALVES = FIRST_HALF | SECOND_HALF
#: Entries of ``skip`` after its blocks: worlds of the block at hand and worlds that wait.
PICKED = 3 * LANES
_HASTY_STEPS = 2


@inner
def _load_rows(s, source, targets, first_target, picked, whole):
    """Copy the rows of ``source`` to the scratch: to ``targets``, or from ``first_target`` on."""
    first = picked[0]
    for index in range(source.shape[0]):
        row = targets[index] if first_target < 0 else first_target + index
        if whole:
            store(s, row, load_at(source, index, first))
        else:
            for k in range(LANES):
                s[row, k] = source[index, picked[k]]


@inner
def _store_world(tape, s, state, k, world):
    """Copy one lane's state back."""
    for row in range(tape[H_STATE_ROWS]):
        state[row, world] = s[row, k]


@inner
def _store_block(tape, s, state, picked, count, whole):
    """Copy the state of the picked worlds back."""
    if whole:
        first = picked[0]
        for row in range(tape[H_STATE_ROWS]):
            store_at(state, row, first, load(s, row))
    else:
        for k in range(count):
            _store_world(tape, s, state, k, picked[k])


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


@part
def _staged_step(tape, s, skip, dt, phase, fresh, hasty):
    """RATTLE or symplectic Euler: each half moves freely, then a stage puts it on the constraints.

    One place in the code for both stages: it is compiled once.
    """
    rattle = tape[H_INTEGRATOR] == RATTLE
    constrained = tape[H_CONSTRAINED] != 0
    for half in range(2):
        velocity = half == 1
        if velocity:
            if phase & SECOND_HALF and rattle:
                rattle_second_half(tape, s, dt)
        elif phase & FIRST_HALF:
            if constrained:
                fresh = begin_step(tape, s, skip, dt) or fresh
            _advance_controls(tape, s, dt)
            if rattle:
                rattle_first_half(tape, s, dt)
            else:
                symplectic_euler_step(tape, s, dt)
        wanted = phase & (SECOND_HALF if velocity else FIRST_HALF)
        if constrained and wanted:
            constraint_stage(tape, s, skip, velocity, dt, fresh, hasty)


@part
def _step(tape, s, skip, ends, values, dt, phase, fresh, hasty):
    """One substep of a block by the method on the tape."""
    integrator = tape[H_INTEGRATOR]
    worst_first = tape[H_CONSTRAINED] != 0 and tape[H_SOLVER] == WORST_FIRST
    if integrator == CLOSED_FORM:
        closed_form_step(tape, s)
    elif integrator == EXPLICIT_EULER or worst_first:
        _advance_controls(tape, s, dt)
        if integrator == EXPLICIT_EULER:
            explicit_euler_step(tape, s, dt)
        else:
            symplectic_euler_step(tape, s, dt)
        if worst_first:
            _worst_first(tape, s, ends, values)
    else:
        _staged_step(tape, s, skip, dt, phase, fresh, hasty)


@inner
def _may_be_hasty(tape, worlds, substeps, phase):
    """Whether worlds with slipping contacts are worth doing over: in few steps, in which few worlds will, of many."""
    contacts = tape[tape[H_CONTACTS]]
    direct = tape[H_SOLVER] == DIRECT
    worth = worlds > LANES and substeps <= _HASTY_STEPS
    return direct and contacts > 0 and phase == BOTH_HALVES and worth


@kernel
def advance(
    tape, s, skip, ends, values, state, given, given_rows, first, last, worlds, substeps, phase
):
    """Advance the worlds of blocks ``first`` ... ``last - 1`` by ``substeps``.

    The cost of a block is that of its hardest world. So contacts are first taken to stick; worlds where they do
    not are put aside, and done over in blocks of their own.

    Args:
        tape: (n,) int64, see ``model.tape``.
        s: scratch (rows, LANES) float64, parameters shared by all worlds in place.
        skip: (blocks + PICKED,) int64 work array.
        ends: (contacts,) int64 work array of the worst-first resolver.
        values: (contacts, 12) float64 work array of the same.
        state: (state rows, padded worlds) float64, changed in place.
        given: (own parameter rows, padded worlds) float64.
        given_rows: (own parameter rows,) int64, their rows in the scratch.
        phase: FIRST_HALF | SECOND_HALF; single halves let user-written forces in between.
    """
    # Worlds in the block at hand, then worlds that wait for a second try.
    picked = skip[skip.shape[0] - PICKED :]
    waiting = 0
    block = first
    while block < last or waiting > 0:
        hasty = False
        whole = False
        if waiting >= LANES or block == last:
            count = min(waiting, LANES)
            waiting -= count
            for k in range(LANES):
                picked[k] = picked[LANES + waiting + min(k, count - 1)]
        else:
            count = min(worlds - LANES * block, LANES)
            whole = count == LANES
            hasty = _may_be_hasty(tape, worlds, substeps, phase)
            for k in range(LANES):
                picked[k] = LANES * block + min(k, count - 1)
            block += 1
        _load_rows(s, state, given_rows, 0, picked, whole)
        _load_rows(s, given, given_rows, -1, picked, whole)
        store(s, tape[H_GIVEN_UP], splat(0.0))
        dt = load(s, tape[H_DT])
        for substep in range(substeps):
            _step(tape, s, skip, ends, values, dt, phase, substep == 0, hasty)
            if phase & SECOND_HALF:
                clock = tape[H_TIME]
                store(s, clock, load(s, clock) + dt)
        _flag_nonfinite(tape, s)
        if hasty and any_lane(load(s, tape[H_GIVEN_UP]) > splat(0.5)):
            for k in range(count):
                world = picked[k]
                if s[tape[H_GIVEN_UP], k] > 0.5:
                    picked[LANES + waiting] = world
                    waiting += 1
                else:
                    _store_world(tape, s, state, k, world)
        else:
            _store_block(tape, s, state, picked, count, whole)
