"""Flight of Ballistic's shot: where it meets a moving target, passes it, or comes down.

The shot flies in closed form (``steelyard.flight``); the target's centre runs straight and may
weave across its way: place + travel t + weave sin(angle + rate t). Every answer is a root on these
closed forms, so nothing depends on where steps begin and end, and no shot is too fast for a target.

Kernels take ``flight`` (ROWS, worlds), of which column ``w`` is one world's; the rate of the shot's
drag c = -ln(damping) [1/s]; the rate of the weave [rad/s]; times [s] from the start of the step.
"""

from __future__ import annotations

import math

import steelyard as sy

MUZZLE = 1.5  # height of the pivot of the barrel, where shots start and are parked [m]
LIFE, REACH = 5.0, 200.0  # [s], [m]: where the source, too, gives up a shot

# Rows of ``flight``, the first of each.
SHOT = 0  # 6: position [m] and velocity [m/s] at the start of the step
PULL = 6  # 3: constant acceleration in the step [m/s^2]
TARGET = 9  # 3: place of the target at the start of the step but for the weave [m]
TRAVEL = 12  # 2: its velocity along x and z but for the weave [m/s]
WEAVE = 14  # 2: weave along x and z [m]
ANGLE = 16  # angle of the weave at the start of the step [rad]
FLYING = 17  # whether there is a shot
CLOSEST = 18  # square of the least gap between shot and target's centre in this flight [m^2]
NEAREST = 19  # 3: that gap along the line of sight, across it and up [m]
MISS = 22  # 3: the same of the last flight
MARK = 25  # 3: where the last flight ended [m]
EVENT = 28  # what came of the shot in this step: 0, MISSED or HIT
ROWS = 29
MISSED, HIT = 1.0, 2.0

# Functions whose root is sought: height over the ground; half the rate of the squared gap; the
# squared gap less the squared radius.
_HEIGHT, _APPROACH, _SURFACE = range(3)


@sy.kernel
def target_motion(flight, w, rate, time):
    """Place x, z [m] and velocity x, z [m/s] of the target's centre."""
    speed_x, speed_z = flight[TRAVEL, w], flight[TRAVEL + 1, w]
    x = flight[TARGET, w] + speed_x * time
    z = flight[TARGET + 2, w] + speed_z * time
    weave_x, weave_z = flight[WEAVE, w], flight[WEAVE + 1, w]
    if weave_x != 0.0 or weave_z != 0.0:
        angle = flight[ANGLE, w] + rate * time
        side, speed = math.sin(angle), rate * math.cos(angle)
        x += weave_x * side
        z += weave_z * side
        speed_x += weave_x * speed
        speed_z += weave_z * speed
    return x, z, speed_x, speed_z


@sy.kernel
def gap(flight, w, drag, rate, time):
    """Shot minus target's centre (x, y, z) [m] and its rate [m/s]."""
    x, u = sy.flight(flight[SHOT, w], flight[SHOT + 3, w], flight[PULL, w], drag, time)
    y, v = sy.flight(flight[SHOT + 1, w], flight[SHOT + 4, w], flight[PULL + 1, w], drag, time)
    z, s = sy.flight(flight[SHOT + 2, w], flight[SHOT + 5, w], flight[PULL + 2, w], drag, time)
    target_x, target_z, target_u, target_s = target_motion(flight, w, rate, time)
    return x - target_x, y - flight[TARGET + 1, w], z - target_z, u - target_u, v, s - target_s


@sy.inner
def _sought(goal, flight, w, drag, rate, radius, time):
    x, y, z, u, v, s = gap(flight, w, drag, rate, time)
    if goal == _HEIGHT:
        return y + flight[TARGET + 1, w]
    if goal == _APPROACH:
        return x * u + y * v + z * s
    return x * x + y * y + z * z - radius * radius


@sy.inner
def _root(goal, flight, w, drag, rate, radius, high):
    """Where in [0, high] ``_sought`` changes its sign, from the far side; ``high`` if it does not.

    Regula falsi in the Illinois form (Dowell & Jarratt 1971) to the last bits of the time; every
    fourth step halves the bracket, so that rounding near the root cannot stall it.
    """
    low, side = 0.0, 0
    at_low = _sought(goal, flight, w, drag, rate, radius, low)
    at_high = _sought(goal, flight, w, drag, rate, radius, high)
    if (at_low > 0.0) == (at_high > 0.0):
        return high
    for k in range(200):
        if high - low <= 1e-15:
            break
        time = high - at_high * (high - low) / (at_high - at_low)
        if k % 4 == 3 or not low < time < high:
            time = 0.5 * (low + high)
        at_time = _sought(goal, flight, w, drag, rate, radius, time)
        if (at_time > 0.0) == (at_high > 0.0):
            high, at_high = time, at_time
            at_low *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low, at_low = time, at_time
            at_high *= 0.5 if side == -1 else 1.0
            side = -1
    return high


@sy.inner
def _nearest(flight, w, drag, rate, end):
    """When in [0, end] the shot is nearest to the target's centre.

    On the scale of a step the squared gap to a target within reach is convex, as speed^2 is far
    above gap times acceleration; so it falls up to one least value and rises after it.
    """
    if _sought(_APPROACH, flight, w, drag, rate, 0.0, 0.0) >= 0.0:
        return 0.0
    return _root(_APPROACH, flight, w, drag, rate, 0.0, end)


@sy.inner
def _note(flight, w, drag, rate, time):
    """Keep the gap at a time of the step if it is the flight's least."""
    x, y, z, _, _, _ = gap(flight, w, drag, rate, time)
    square = x * x + y * y + z * z
    if square < flight[CLOSEST, w]:
        target_x, target_z, _, _ = target_motion(flight, w, rate, time)
        reach = math.hypot(target_x, target_z)
        sine, cosine = target_x / reach, target_z / reach
        flight[CLOSEST, w] = square
        flight[NEAREST, w] = x * sine + z * cosine
        flight[NEAREST + 1, w] = x * cosine - z * sine
        flight[NEAREST + 2, w] = y


@sy.inner
def _end(flight, w, drag, rate, event, time):
    """Keep what came of the shot."""
    x, y, z, _, _, _ = gap(flight, w, drag, rate, time)
    target_x, target_z, _, _ = target_motion(flight, w, rate, time)
    flight[MARK, w] = x + target_x
    flight[MARK + 1, w] = y + flight[TARGET + 1, w]
    flight[MARK + 2, w] = z + target_z
    for c in range(3):
        flight[MISS + c, w] = flight[NEAREST + c, w]
    flight[EVENT, w] = event
    flight[FLYING, w] = 0.0


@sy.kernel
def follow_shot(flight, state, position, velocity, w, dt, drag, rate, radius, age):
    """Follow a shot through a step that the physics has made: to the target, the ground, or on.

    Its path is the flight that leaves the step's start with its velocity and ends where the physics
    put it: with the exact method the flight itself, with others a path without gaps between steps.
    A shot that ends is parked at the pivot, at rest.

    Args:
        flight: see the module.
        state: state of the world after the step.
        position, velocity: rows of the shot in it.
        w: world.
        dt: length of the step [s].
        drag, rate: see the module.
        radius: of the target [m].
        age: time since the shot was fired, at the step's end [s].
    """
    phi1 = sy.flight(0.0, 1.0, 0.0, drag, dt)[0]
    phi2 = sy.flight(0.0, 0.0, 1.0, drag, dt)[0]
    for c in range(3):
        moved = state[position + c, w] - flight[SHOT + c, w]
        flight[PULL + c, w] = (moved - flight[SHOT + 3 + c, w] * phi1) / phi2
    lands = state[position + 1, w] < 0.0
    end = _root(_HEIGHT, flight, w, drag, rate, 0.0, dt) if lands else dt
    time = _nearest(flight, w, drag, rate, end)
    _note(flight, w, drag, rate, time)
    far = math.hypot(state[position, w], state[position + 2, w]) > REACH
    if flight[CLOSEST, w] <= radius * radius:
        time = _root(_SURFACE, flight, w, drag, rate, radius, time)
        _end(flight, w, drag, rate, HIT, time)
    elif lands or far or age > LIFE - 0.5 * dt:
        _end(flight, w, drag, rate, MISSED, end)
    if flight[FLYING, w] == 0.0:
        for c in range(3):
            state[position + c, w] = MUZZLE if c == 1 else 0.0
            state[velocity + c, w] = 0.0


@sy.kernel
def move_target(flight, w, dt, rate):
    """Put the target where it is after the step."""
    flight[TARGET, w] += dt * flight[TRAVEL, w]
    flight[TARGET + 2, w] += dt * flight[TRAVEL + 1, w]
    flight[ANGLE, w] += dt * rate
