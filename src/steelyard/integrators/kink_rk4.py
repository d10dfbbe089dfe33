"""Runge-Kutta of order 4 with the times of kinks resolved inside the step.

A bungee pulls from its length on, and a float is lifted as far as it is under: there the force is continuous but its
slope is not, and a step across is off by h^3. Where a step crosses such a kink, the cubic through both its ends tells
when, and a trial that ends there mends the time by Newton's method; as the force is continuous, what is left of it
counts by its square. The step is then taken up to the kink, which is one of ``RungeKutta4`` on a smooth force, and the
rest of it follows in the same way, up to ``kinks`` times.

Order 4 across kinks, but those that are crossed and crossed back within a step are not seen. Everything else is as
``RungeKutta4`` has it. A step that crosses nothing takes one of it, one that crosses four. Refuses links, riders and
contacts, and user-written forces, which are known only between steps.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, II.6 (dense output and events).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..kernel import inner
from ..math.lanes import absolute, any_lane, load, select, splat, sqrt, store
from ..math.vectors import between, dot, load_coordinates
from ..model.tape import (
    FLOAT_BOTTOM,
    FLOAT_TOP,
    H_DT,
    H_EVENTS,
    H_IMPACTS,
    H_KINKS,
    H_PARTS,
    H_VELOCITY,
    KINK,
)
from ..scene import checks
from ..solvers.base import Solver
from ..stage import call_stage, stage
from .base import Acting, Recipe
from .divided import PAST, SHORTEST, fall_time, keep_state, put_back
from .rk4 import RungeKutta4

# Rows of a kink: how far from it [m] and how fast where the part of the step begins, and on which side.
_PLACE, _RATE, _SIDE = range(3)
# What is no farther from a kink [m] is on the side to which it moves.
_NEAR = 1e-9


@dataclass(frozen=True)
class KinkRungeKutta4(RungeKutta4):
    """Classical Runge-Kutta method with resolved kinks (see the module).

    Args:
        kinks: most kinks of a step whose times are resolved, at least 1.
    """

    kinks: int = 4

    evaluations: ClassVar[tuple[float | None, ...]] = ()
    splits: ClassVar[bool] = True
    moves_bodies: ClassVar[bool] = False
    tells_time: ClassVar[bool] = False

    def __post_init__(self) -> None:
        checks.whole("KinkRungeKutta4", "kinks", self.kinks, least=1, remedy="Use 4.")

    @property
    def divisions(self) -> int:
        """Most events that divide a step."""
        return self.kinks

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """One stage that runs those of ``parts``."""
        return ((kink_rk4_step, 0),)

    def parts(self, solver: Solver | None, acting: Acting) -> Recipe:
        """A step of ``RungeKutta4``."""
        return super().recipe(solver, acting)


@inner
def _kink(tape, s, record):
    """How far from a kink [m], positive on one side, and the rate."""
    to_velocity = tape[H_VELOCITY]
    a = tape[record + 1]
    if tape[record] == FLOAT_TOP or tape[record] == FLOAT_BOTTOM:
        half = load(s, tape[record + 3])
        if tape[record] == FLOAT_TOP:
            half = -half
        return load(s, a) - load(s, tape[record + 2]) + half, load(s, a + to_velocity)
    b = tape[record + 2]
    x, y, z = between(s, a, b)
    square = dot(x, y, z, x, y, z)
    apart = square > splat(0.0)
    length = sqrt(square)
    # Positions come first in the state, then velocities; an anchor, behind both, rests.
    rate = dot(x, y, z, *load_coordinates(s, a + to_velocity))
    if b < to_velocity:
        rate = rate - dot(x, y, z, *load_coordinates(s, b + to_velocity))
    rate = select(apart, rate / select(apart, length, splat(1.0)), splat(0.0))
    return length - load(s, tape[record + 3]), rate


@inner
def _note_kinks(tape, s):
    """Where the part begins: place, rate and side."""
    one = splat(1.0)
    at = tape[H_KINKS]
    event = tape[H_EVENTS]
    for index in range(tape[at]):
        place, rate = _kink(tape, s, at + 1 + KINK * index)
        leaning = select(absolute(place) > splat(_NEAR), place, rate)
        store(s, event + _PLACE, place)
        store(s, event + _RATE, rate)
        store(s, event + _SIDE, select(leaning > splat(0.0), one, -one))
        event += 3


@inner
def _first_crossing(tape, s, first, length, left):
    """When in this part the first kink is crossed; ``left`` where none is.

    After the first trial from the cubic, then by Newton's method from the present end.
    """
    zero = splat(0.0)
    time = left
    at = tape[H_KINKS]
    event = tape[H_EVENTS]
    for index in range(tape[at]):
        place, rate = _kink(tape, s, at + 1 + KINK * index)
        side = load(s, event + _SIDE)
        later = side * place
        later_rate = side * rate
        if first:
            if any_lane(later < zero):
                start = side * load(s, event + _PLACE)
                start = select(start > zero, start, zero)
                rate = side * load(s, event + _RATE)
                found = fall_time(start, rate, later, later_rate, length)
                found = select(later < zero, found, time)
                time = select(found < time, found, time)
        else:
            closing = later_rate < zero
            found = length + later / select(closing, -later_rate, splat(1.0))
            found = select(closing, found, time)
            time = select(found < time, found, time)
        event += 3
    return time


@inner
def _run(tape, s, skip, length):
    """One step of RungeKutta4 over ``length``."""
    store(s, tape[H_DT], length)
    at = tape[H_PARTS]
    for index in range(tape[at]):
        call_stage(tape[at + 1 + 2 * index], tape, s, skip, tape[at + 2 + 2 * index])


@stage
def kink_rk4_step(tape, s, skip, part):
    """Parts of the step, each up to the next kink."""
    zero = splat(0.0)
    dt = load(s, tape[H_DT])
    left = dt
    active = dt > zero
    shortest = splat(SHORTEST) * dt
    for turn in range(tape[H_IMPACTS] + 1):
        keep_state(tape, s)
        _note_kinks(tape, s)
        length = left
        _run(tape, s, skip, length)
        if turn < tape[H_IMPACTS]:
            time = _first_crossing(tape, s, True, length, left)
            meets = active & (time < left)
            if any_lane(meets):
                length = select(meets, select(time > shortest, time, shortest), left)
                put_back(tape, s, zero <= zero)
                _run(tape, s, skip, length)
                time = _first_crossing(tape, s, False, length, left)
                change = select(meets, time - length, zero)
                change = select(absolute(change) < splat(0.1) * length, change, zero)
                length = length + change
                length = select(length > shortest, length, shortest)
                length = select(meets, length + splat(PAST) * dt, left)
                put_back(tape, s, zero <= zero)
                _run(tape, s, skip, length)
        put_back(tape, s, select(active, splat(1.0), zero) < splat(0.5))
        left = select(active, left - length, dt)
        active = active & (left > shortest)
        left = select(active, left, dt)
        if not any_lane(active):
            break
    store(s, tape[H_DT], dt)
