"""Where a path falls through a level between two steps of any method.

Both ends of a step and their velocities fix a cubic (Hermite), which is off by at most h^4 |x''''|/384 between them: as
good as a method of order 4 and better than those below. The level is met at the cubic's root.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, II.6.
"""

from __future__ import annotations

import math

import numpy as np

from ..kernel import kernel
from ..scene import checks


@kernel
def hermite(before, speed_before, after, speed_after, dt, time):
    """Place and speed along one axis at a time within a step, from both its ends."""
    s = time / dt
    change = (after - before) / dt
    bend = 3.0 * change - 2.0 * speed_before - speed_after
    twist = speed_before + speed_after - 2.0 * change
    place = before + time * (speed_before + s * (bend + s * twist))
    return place, speed_before + s * (2.0 * bend + s * 3.0 * twist)


@kernel
def hermite_fall_time(before, speed_before, after, speed_after, dt):
    """Time within a step at which a height falls through 0; inf where it is not above before and below after."""
    if not (before >= 0.0 and after < 0.0):
        return math.inf
    low, high = 0.0, dt
    time = dt * before / (before - after)
    for _ in range(100):
        place, speed = hermite(before, speed_before, after, speed_after, dt, time)
        if place >= 0.0:
            low = time
        else:
            high = time
        closer = time - place / speed if speed < 0.0 else math.inf
        if not low <= closer <= high:
            closer = 0.5 * (low + high)
        if not abs(closer - time) > 2e-16 * dt:
            return closer
        time = closer
    return time


def step_impact(
    position: np.ndarray,
    velocity: np.ndarray,
    next_position: np.ndarray,
    next_velocity: np.ndarray,
    *,
    dt: float,
    height: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """When and where particles fall through a level within one step, by the cubic through its ends.

    Args:
        position: (..., 3) at the step's start [m].
        velocity: (..., 3) there [m/s].
        next_position: (..., 3) at its end [m].
        next_velocity: (..., 3) there [m/s].
        dt: the step [s], above 0.
        height: level [m].

    Returns:
        Times since the step's start (...) [s], inf where it is not above the level before and below it after, and
        places (..., 3) [m], NaN there.

    Raises:
        ValueError: a setting out of range, or arrays of unfit shapes.
    """
    owner = "step_impact"
    step = checks.number(owner, "dt", dt, above=0.0, remedy="Give the method's step.")
    level = checks.number(owner, "height", height, remedy="Give the level in metres.")
    given = [checks.floats(x) for x in (position, velocity, next_position, next_velocity)]
    shapes = {None if x is None else x.shape for x in given}
    shape = shapes.pop()
    if shapes or shape is None or shape[-1:] != (3,):
        raise ValueError(
            f"step_impact: position is {checks.described(position)} and next_position "
            f"{checks.described(next_position)}; all four arrays must be of one shape (..., 3). Give x, y, z of "
            "every particle before and after the step."
        )
    x0, v0, x1, v1 = (np.asarray(x).reshape(-1, 3) for x in given)
    times = np.empty(len(x0))
    places = np.full(x0.shape, np.nan)
    for k in range(len(x0)):
        times[k] = hermite_fall_time(x0[k, 1] - level, v0[k, 1], x1[k, 1] - level, v1[k, 1], step)
        if math.isfinite(times[k]):
            for c in range(3):
                places[k, c] = hermite(x0[k, c], v0[k, c], x1[k, c], v1[k, c], step, times[k])[0]
    return times.reshape(shape[:-1]), places.reshape(shape)
