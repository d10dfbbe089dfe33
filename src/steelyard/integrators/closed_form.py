"""Closed-form flight: constant acceleration and linear damping, nothing else.

dv/dt = a - c v with c = -ln(damping) has, over any time t,

    v(t) = v0 e^(-ct) + a phi1(t),    x(t) = x0 + v0 phi1(t) + a phi2(t),
    phi1 = (1 - e^(-ct))/c,    phi2 = (t - phi1)/c,

so a step of any size is exact and steps compose without error. Invariants: all of the motion's. Refuses
forces, links, riders and contacts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..kernel import kernel
from ..math.lanes import fma, load, store
from ..math.pointers import axes
from ..model.tape import H_ACCELERATION, H_DAMPING, H_DRIFT, H_POSITION, H_VELOCITY
from ..scene import checks
from ..solvers.base import Solver
from ..stage import stage
from .base import Acting, Integrator, Recipe


@dataclass(frozen=True)
class ClosedForm(Integrator):
    """Exact flight of free particles (see the module)."""

    flies: ClassVar[bool] = True

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """One exact flow."""
        return ((closed_form_step, 0),)

    def order(self) -> int:
        """Exact: any order; 0 says that no slope can be measured."""
        return 0

    def stable_limit(self) -> float:
        """No spring is accepted."""
        return math.inf


@stage
def closed_form_step(tape, s, skip, half):
    """Rows H_DAMPING: per particle e^(-ch), phi1(h), phi2(h)."""
    at = tape[H_DRIFT]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        decay = load(s, tape[H_DAMPING] + 3 * p)
        phi1 = load(s, tape[H_DAMPING] + 3 * p + 1)
        phi2 = load(s, tape[H_DAMPING] + 3 * p + 2)
        for component in range(axes(s)):
            row = 3 * p + component
            a = load(s, tape[H_ACCELERATION] + row)
            v = load(s, tape[H_VELOCITY] + row)
            x = load(s, tape[H_POSITION] + row)
            store(s, tape[H_POSITION] + row, fma(a, phi2, fma(v, phi1, x)))
            store(s, tape[H_VELOCITY] + row, fma(a, phi1, v * decay))


@kernel
def _phi(rate, time):
    """e^(-ct), phi1 and phi2, by series where c t is small."""
    z = rate * time
    if abs(z) < 1e-2:
        one = 1.0 - z / 2 * (
            1.0 - z / 3 * (1.0 - z / 4 * (1.0 - z / 5 * (1.0 - z / 6 * (1.0 - z / 7))))
        )
        two = 0.5 * (1.0 - z / 3 * (1.0 - z / 4 * (1.0 - z / 5 * (1.0 - z / 6 * (1.0 - z / 7)))))
        return math.exp(-z), time * one, time * time * two
    one = -math.expm1(-z) / rate
    return math.exp(-z), one, (time - one) / rate


@kernel
def flight(position, velocity, acceleration, rate, time):
    """Place and speed along one axis after ``time``; ``rate`` is c = -ln(damping) [1/s]."""
    decay, phi1, phi2 = _phi(rate, time)
    return (
        position + velocity * phi1 + acceleration * phi2,
        velocity * decay + acceleration * phi1,
    )


@kernel
def _newton(height, velocity, acceleration, rate, time):
    """Root of the height by Newton's method from ``time``, on a side from which it cannot overshoot."""
    for _ in range(100):
        place, speed = flight(height, velocity, acceleration, rate, time)
        change = place / speed
        time -= change
        if not abs(change) > 2e-16 * time:
            break
    return time


@kernel
def flight_fall_time(height, velocity, acceleration, rate):
    """Time until a particle ``height`` above a level falls through it; inf if it never does.

    A particle below the level that rises through it counts when it comes down again; one that is below
    and stays there has fallen at time 0.
    """
    rises = velocity > 0.0
    # Turning point of the height, where there is one.
    turn = math.inf
    if velocity != 0.0 and acceleration != 0.0 and rises == (acceleration < 0.0):
        turn = (
            math.log1p(-velocity * rate / acceleration) / rate
            if rate > 0.0
            else -velocity / acceleration
        )
    extreme = flight(height, velocity, acceleration, rate, turn)[0] if turn < math.inf else 0.0
    below = height < 0.0 or (height == 0.0 and not rises)
    if below and not (rises and acceleration < 0.0 and extreme > 0.0):
        return 0.0
    if acceleration < 0.0:
        if rate * velocity < acceleration:
            # Faster than its terminal speed: the height is convex, and Newton's method safe from the start.
            return _newton(height, velocity, acceleration, rate, 0.0)
        # Concave: safe from any time past the root. Without drag it falls for at most this long; double.
        root = math.sqrt(max(velocity * velocity - 2.0 * acceleration * height, 0.0))
        time = max((velocity + root) / -acceleration, 1e-9)
        while flight(height, velocity, acceleration, rate, time)[0] > 0.0:
            time *= 2.0
        return _newton(height, velocity, acceleration, rate, time)
    if rises or velocity == 0.0:
        return math.inf
    if acceleration == 0.0:
        if rate == 0.0:
            return -height / velocity
        share = -height * rate / velocity
        return -math.log1p(-share) / rate if share < 1.0 else math.inf
    return math.inf if extreme > 0.0 else _newton(height, velocity, acceleration, rate, 0.0)


def flight_impact(
    position: np.ndarray,
    velocity: np.ndarray,
    *,
    acceleration: tuple[float, float, float] = (0.0, -9.81, 0.0),
    damping: float = 1.0,
    height: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """When and where particles in free flight fall through a level.

    Args:
        position: (..., 3) [m].
        velocity: (..., 3) [m/s].
        acceleration: constant acceleration [m/s^2].
        damping: fraction of velocity kept per second, in (0, 1].
        height: level [m].

    Returns:
        Times (...) [s], inf where it never falls through, and places (..., 3) [m], NaN there.

    Raises:
        ValueError: a setting out of range, or positions and velocities of unfit shapes. A particle
            that is not finite has NaN for an answer.
    """
    owner = "flight_impact"
    pull = checks.vector(owner, "acceleration", acceleration)
    share = checks.number(
        owner, "damping", damping, above=0.0, most=1.0, remedy="Use 1 for no damping."
    )
    level = checks.number(owner, "height", height, remedy="Give the level in metres.")
    x, v = checks.floats(position), checks.floats(velocity)
    try:
        shape = () if x is None or v is None else np.broadcast_shapes(x.shape, v.shape)
    except ValueError:
        shape = ()
    if x is None or v is None or not shape[-1:] == x.shape[-1:] == v.shape[-1:] == (3,):
        raise ValueError(
            f"flight_impact: position is {checks.described(position)} and velocity "
            f"{checks.described(velocity)}; both must be of shapes (..., 3) that broadcast. "
            "Give x, y, z of every particle."
        )
    points = np.broadcast_to(x, shape).reshape(-1, 3)
    speeds = np.broadcast_to(v, shape).reshape(-1, 3)
    rate = -math.log(share)
    times = np.empty(len(points))
    places = np.full((len(points), 3), np.nan)
    for k, (point, speed) in enumerate(zip(points, speeds, strict=True)):
        times[k] = flight_fall_time(point[1] - level, speed[1], pull[1], rate)
        if math.isfinite(times[k]):
            for c in range(3):
                places[k, c] = flight(point[c], speed[c], pull[c], rate, times[k])[0]
    return times.reshape(shape[:-1]), places.reshape(shape)
