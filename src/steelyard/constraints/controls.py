"""What control moves: winches and riders."""

from __future__ import annotations

from ..math.lanes import fma, load, splat, store
from ..model.tape import H_DT, H_WINCHES
from ..stage import stage
from .riders import rider_advance


@stage
def move_controls(tape, s, skip, half):
    """Winches and riders move to where they are at the step's end."""
    dt = load(s, tape[H_DT])
    at = tape[H_WINCHES]
    for index in range(tape[at]):
        winch = at + 1 + 3 * index
        length, speed = tape[winch], tape[winch + 1]
        rate = load(s, speed)
        end_rate = fma(dt, load(s, tape[winch + 2]), rate)
        store(s, length, fma(splat(0.5) * dt, rate + end_rate, load(s, length)))
        store(s, speed, end_rate)
    rider_advance(tape, s, dt)
