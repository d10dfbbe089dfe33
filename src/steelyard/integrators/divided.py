"""What methods share that divide a step where something happens in it."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, select, splat, store
from ..model.tape import H_KEPT, H_STATE_ROWS

# Shortest part of a step, and how far past the event it goes, so that the event is behind it, over the step.
SHORTEST, PAST = 1e-6, 1e-10
# To a millionth of the step, which the cubic seldom deserves and Newton's method then mends.
_BISECTIONS = 20


@inner
def fall_time(gap, rate, later, later_rate, length):
    """When the cubic through both ends falls through 0, by bisection: it is above at first and below at last."""
    half = splat(0.5)
    one = splat(1.0)
    inverse = one / length
    change = (later - gap) * inverse
    bend = splat(3.0) * change - splat(2.0) * rate - later_rate
    twist = rate + later_rate - splat(2.0) * change
    low = splat(0.0)
    high = length
    for _ in range(_BISECTIONS):
        time = half * (low + high)
        share = time * inverse
        value = fma(time, fma(share, fma(share, twist, bend), rate), gap)
        above = value > splat(0.0)
        low = select(above, time, low)
        high = select(above, high, time)
    return half * (low + high)


@inner
def keep_state(tape, s):
    """Keep the state that a part begins from."""
    for row in range(tape[H_STATE_ROWS]):
        store(s, tape[H_KEPT] + row, load(s, row))


@inner
def put_back(tape, s, worlds):
    """State of some worlds as it was kept."""
    for row in range(tape[H_STATE_ROWS]):
        store(s, row, select(worlds, load(s, tape[H_KEPT] + row), load(s, row)))
