"""The one stepping kernel: all substeps of a range of worlds, block after block of ``LANES``.

A block's state is copied to the scratch, stepped there by the stages of the recipe and copied back; parameters that
differ between worlds are copied in beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import types

from .kernel import inner, kernel
from .math.lanes import any_lane, fma, load, load_at, select, splat, store, store_at
from .math.pointers import (
    LANES,
    Doubles,
    Integers,
    axes,
    doubles_at,
    integers_at,
    tape_at,
)
from .model.rigid_layout import CAPACITY, STORED, STORED_ROW, T_ID
from .model.tape import (
    COUNT,
    FRESH,
    H_BLOCKS,
    H_DIVISIONS,
    H_DT,
    H_GIVEN_UP,
    H_HASTY,
    H_NONFINITE,
    H_PARTICLES,
    H_POSITION,
    H_RECIPE,
    H_RIGID,
    H_STATE_ROWS,
    H_TIME,
    H_VELOCITY,
    HASTY,
)
from .stage import Stage, call_stage, caller

if TYPE_CHECKING:
    from .model.compile import Model

# Parts of a step to run, a bit for each; the last part takes all higher bits, so its mask is negative.
WHOLE_STEP = -1
_HASTY_STEPS = 2

# Entries of a launch: addresses of the stepping kernel and of the arrays it works on, and their sizes.
(
    L_ADVANCE,
    L_TAPE,
    L_SCRATCH,
    L_SKIP,
    L_PICKED,
    L_STATE,
    L_WIDTH,
    L_GIVEN,
    L_GIVEN_ROWS,
    L_GIVEN_COUNT,
    L_WORLDS,
) = range(11)


@inner
def _moves(tape, s, row):
    """Whether a row of the state can change: in a planar scene, not where it is a third coordinate."""
    return axes(s) == 3 or row % 3 != 2 or row >= 6 * tape[H_PARTICLES]


@inner
def _unused(tape, s, row):
    """Rows from this one on that no world of the block uses: those of contacts behind the last that any has."""
    rigid = tape[H_RIGID]
    if rigid >= 0:
        size = tape[rigid + STORED]
        place = row - tape[rigid + STORED_ROW]
        left = size * tape[rigid + CAPACITY] - place
        if place > 0 and left >= 0 and place % size == 0:
            last = row - size + T_ID
            if not any_lane(load(s, last) > splat(0.0)):
                return left
    return 0


@inner
def _load_row(s, row, source, start, picked, whole):
    if whole:
        store(s, row, load_at(source, start + picked[0]))
    else:
        for k in range(LANES):
            s[row, k] = source[start + picked[k]]


@inner
def _load_block(tape, s, state, given, given_rows, given_count, width, picked, whole):
    """Copy the state of the picked worlds, and their own parameters, to the scratch.

    Returns:
        The row from which on contacts were left out.
    """
    row = 0
    loaded = tape[H_STATE_ROWS]
    while row < tape[H_STATE_ROWS]:
        if _moves(tape, s, row):
            _load_row(s, row, state, width * row, picked, whole)
        else:
            store(s, row, splat(0.0))
        row += 1
        left = _unused(tape, s, row)
        if left > 0:
            loaded = row
            row += left
    for index in range(given_count):
        _load_row(s, given_rows[index], given, width * index, picked, whole)
    return loaded


@inner
def _forget_contacts(tape, s, loaded):
    """Zero what lies behind the last contact of each world, in rows that were loaded or written to."""
    rigid = tape[H_RIGID]
    if rigid >= 0:
        zero = splat(0.0)
        live = splat(1.0)
        size = tape[rigid + STORED]
        row = tape[rigid + STORED_ROW]
        end = row + size * tape[rigid + CAPACITY]
        while row < end and (row < loaded or any_lane(live > zero)):
            live = select(load(s, row + T_ID) > zero, live, zero)
            for field in range(row, row + size):
                store(s, field, select(live > zero, load(s, field), zero))
            row += size


@inner
def _store_block(tape, s, state, width, picked, count, whole, loaded):
    """Copy the state of the picked worlds back, but of those that are given up."""
    _forget_contacts(tape, s, loaded)
    given_up = load(s, tape[H_GIVEN_UP]) > splat(0.5)
    first = picked[0]
    every = not any_lane(given_up)
    row = 0
    while row < tape[H_STATE_ROWS]:
        if _moves(tape, s, row):
            entry = width * row + first
            if whole and every:
                store_at(state, entry, load(s, row))
            elif whole:
                store_at(state, entry, select(given_up, load_at(state, entry), load(s, row)))
            else:
                for k in range(count):
                    if every or s[tape[H_GIVEN_UP], k] < 0.5:
                        state[width * row + picked[k]] = s[row, k]
        row += 1
        if row >= loaded:
            row += _unused(tape, s, row)


@inner
def _flag_nonfinite(tape, s):
    """Set the flag of worlds whose positions or velocities are not finite."""
    zero = splat(0.0)
    # Two sums, neither of which waits for the other.
    place = zero
    speed = zero
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            place = fma(load(s, tape[H_POSITION] + 3 * p + axis), zero, place)
            speed = fma(load(s, tape[H_VELOCITY] + 3 * p + axis), zero, speed)
    flag = tape[H_NONFINITE]
    store(s, flag, select(place + speed <= zero, load(s, flag), splat(1.0)))


@inner
def _step(tape, s, skip, phase):
    """One substep of a block: the recipe's stages that belong to the wanted parts; the last moves the clock."""
    at = tape[H_RECIPE]
    for index in range(tape[at]):
        part = tape[at + 2 + 2 * index]
        if (phase >> part) & 1 != 0:
            call_stage(tape[at + 1 + 2 * index], tape, s, skip, part)
    if phase < 0:
        clock = tape[H_TIME]
        store(s, clock, load(s, clock) + load(s, tape[H_DT]))


def _advance_blocks(launch, s, first, last, substeps, phase):
    """Advance the worlds of blocks ``first`` ... ``last - 1`` by ``substeps``.

    The cost of a block is that of its hardest world. So contacts are first taken to stick; worlds where they do
    not are put aside, and done over in blocks of their own. That is worth it in few steps, in which few
    worlds of many slip.
    """
    tape = tape_at(launch[L_TAPE])
    skip = integers_at(launch[L_SKIP])
    # Worlds in the block at hand, then worlds that wait for a second try.
    picked = integers_at(launch[L_PICKED])
    state = doubles_at(launch[L_STATE])
    width = launch[L_WIDTH]
    given = doubles_at(launch[L_GIVEN])
    given_rows = integers_at(launch[L_GIVEN_ROWS])
    worlds = launch[L_WORLDS]
    words = tape[H_BLOCKS]
    worth = worlds > LANES and substeps <= _HASTY_STEPS
    worth = worth and tape[H_HASTY] != 0 and phase == WHOLE_STEP
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
            hasty = worth
            for k in range(LANES):
                picked[k] = LANES * block + min(k, count - 1)
            block += 1
        loaded = _load_block(
            tape, s, state, given, given_rows, launch[L_GIVEN_COUNT], width, picked, whole
        )
        store(s, tape[H_GIVEN_UP], splat(0.0))
        skip[words + HASTY] = 1 if hasty else 0
        skip[words + COUNT] = count
        for substep in range(substeps):
            skip[words + FRESH] = 1 if substep == 0 else 0
            _step(tape, s, skip, phase)
        _flag_nonfinite(tape, s)
        _store_block(tape, s, state, width, picked, count, whole, loaded)
        if any_lane(load(s, tape[H_GIVEN_UP]) > splat(0.5)):
            for k in range(count):
                if s[tape[H_GIVEN_UP], k] > 0.5:
                    picked[LANES + waiting] = picked[k]
                    waiting += 1


_ARGUMENTS = (Integers, Doubles, types.int64, types.int64, types.int64, types.int64)
_advance = Stage(_advance_blocks, _ARGUMENTS)
_call_advance = caller(_ARGUMENTS)


@inner
def _start(launch, first, last, substeps, phase):
    """Call the stepping kernel of a launch, an array."""
    scratch = doubles_at(launch[L_SCRATCH])
    pointer = integers_at(launch.ctypes.data)
    _call_advance(launch[L_ADVANCE], pointer, scratch, first, last, substeps, phase)


def launch(
    model: Model,
    scratch: tuple[np.ndarray, ...],
    state: np.ndarray,
    given: tuple[np.ndarray, np.ndarray],
    worlds: int,
) -> np.ndarray:
    """What kernels need to step worlds, (11,) int64; it holds addresses, so its arrays must outlive it.

    Args:
        model: the scene compiled.
        scratch: work arrays of one thread.
        state: (state rows, padded worlds) float64, which stepping changes.
        given: own parameter rows (n, padded worlds), and their rows in the scratch (n,).
        worlds: number of worlds.
    """
    s, skip, picked = scratch
    values, rows = given
    arrays = (model.tape, s, skip, picked, state)
    addresses = [array.ctypes.data for array in arrays]
    return np.array(
        [
            _advance.address(planar=model.scene.planar), *addresses, state.shape[1],
            values.ctypes.data, rows.ctypes.data, len(rows), worlds,
        ],
        dtype=np.int64,
    )  # fmt: skip


@kernel
def advance_blocks(launch, first, last, substeps, phase):
    """Advance the worlds of blocks ``first`` ... ``last - 1``; ``phase`` is WHOLE_STEP or bits of its parts."""
    _start(launch, first, last, substeps, phase)


@kernel
def start_again(mask, start, state):
    """Put the state of the worlds of a mask back to the start.

    Args:
        mask: (worlds,) bool.
        start: (state rows,) float64.
        state: (state rows, padded worlds) float64, changed in place.
    """
    for world in range(len(mask)):
        if mask[world]:
            for row in range(len(start)):
                state[row, world] = start[row]


@inner
def advance(launch, substeps):
    """Advance all worlds of ``World.launch``, within a kernel.

    Args:
        launch: (n,) int64.
        substeps: number of steps; a solver that divides the step takes its own within each.
    """
    blocks = (launch[L_WORLDS] + LANES - 1) // LANES
    _start(launch, 0, blocks, substeps * tape_at(launch[L_TAPE])[H_DIVISIONS], WHOLE_STEP)
