"""Kernels of Bridge: randomisation, load, wind, winches, observation, reward and termination."""

from __future__ import annotations

import math

import numpy as np

import steelyard as sy
from steelyard_envs.clip import clip
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED

PAIRS, SPACING = 6, 1.9  # node pairs; planks between them [m]
LEVEL, LEVEL_SPREAD = 2.5, 0.1  # the level to hold lies so far around [m]
# The load: half its footprint and its way [planks], acceleration [planks/s^2], friction.
FOOT, START, END, ACCELERATION, FRICTION = 0.25, 0.5, 4.5, 0.4, 0.6
# It makes haste when it needs this speed [planks/s] to arrive by this time [s].
HASTE, DEADLINE = 0.4, 16.0
SPEED, WINCH_ACCELERATION, SHORT, LONG = 0.4, 2.0, 2.6, 4.4  # of the winches [m/s, m/s^2, m, m]
STALL, SLOPE = 90.0, 100.0  # tension of a pair at the winches' stall [N], and per speed [N s/m]
NEAR = 0.15  # distance of a pair from the level at which its reward is halved [m]
ALLOWED = 0.1  # rms distance of the deck from the level for a success [m]

# Rows of ``values``.
(
    PLACE, ACROSS, LOAD_SPEED, LOAD_SLIDE, WANTED, WANTED_ACROSS, LEG_END, ELAPSED,
    GUST, GUST_END, GUST_PLACE, GUST_X, GUST_Z, HEIGHT, SQUARES, CROSSING,
) = range(16)  # fmt: skip
WINCH, TENSION, CONTACT, ROWS = 16, 22, 28, 31
# Entries of ``settings`` and ``layout``; each of the last four begins twelve support cables.
DT, LIMIT, FORCE, SENSOR_SHARE, WIND, DRIFT, PAUSE, TURN = range(8)
POSITION, VELOCITY, WEIGHTS, RATES, ACCELERATIONS, PUSH, NONFINITE = range(7)
LENGTH, WINCH_RATE, WINCH_GAIN, PULL = 7, 19, 31, 43


@sy.inner
def _next_leg(values, streams, settings, w):
    """Draw how the load goes on: it pauses, turns back or walks on, and wanders across."""
    kind = sy.uniform(streams, w)
    speed = sy.uniform(streams, w)
    lasts = sy.uniform_between(streams, w, 0.5, 1.5)
    if kind < settings[PAUSE]:
        values[WANTED, w] = 0.0
    elif kind < settings[PAUSE] + settings[TURN]:
        values[WANTED, w] = -0.2 - 0.2 * speed
    else:
        values[WANTED, w] = 0.25 + 0.35 * speed
        lasts *= 2.0
    values[LEG_END, w] += lasts
    values[WANTED_ACROSS, w] = 0.5 + settings[DRIFT] * sy.uniform_between(streams, w, -1.0, 1.0)


@sy.inner
def _next_gust(values, streams, settings, w):
    """Draw when, how long, where and how the wind blows next."""
    values[GUST, w] = values[GUST_END, w] + sy.uniform_between(streams, w, 0.2, 1.5)
    values[GUST_END, w] = values[GUST, w] + sy.uniform_between(streams, w, 0.6, 2.0)
    values[GUST_PLACE, w] = sy.uniform_between(streams, w, 0.0, PAIRS - 1.0)
    values[GUST_X, w] = 0.5 * settings[WIND] * sy.uniform_between(streams, w, -1.0, 1.0)
    values[GUST_Z, w] = settings[WIND] * sy.uniform_between(streams, w, -1.0, 1.0)


@sy.kernel
def begin(mask, values, streams, settings, layout, starts, state):
    """One of the settled bridges, a level to hold, the first leg and the first gust."""
    for w in range(mask.shape[0]):
        if not mask[w]:
            continue
        chosen = int(starts.shape[1] * sy.uniform(streams, w))
        for row in range(starts.shape[0]):
            state[row, w] = starts[row, chosen]
        for row in range(values.shape[0]):
            values[row, w] = 0.0
        values[HEIGHT, w] = LEVEL + LEVEL_SPREAD * sy.uniform_between(streams, w, -1.0, 1.0)
        values[PLACE, w] = START
        values[ACROSS, w] = 0.5
        values[WANTED_ACROSS, w] = 0.5
        values[LEG_END, w] = sy.uniform_between(streams, w, 2.0, 4.0)
        _next_gust(values, streams, settings, w)
        _sense(values, settings, layout, state, w, 1.0)


@sy.inner
def _towards(speed, wanted, change):
    """``speed`` moved to ``wanted`` by at most ``change``."""
    return speed + min(max(wanted - speed, -change), change)


@sy.inner
def _fastest(rest, speed, dt):
    """Speed after a step from which the load can still stop within the ``rest`` of its way."""
    half = 0.5 * ACCELERATION * dt
    square = half * half + 2.0 * ACCELERATION * (rest - 0.5 * speed * dt)
    return max(math.sqrt(max(square, 0.0)) - half, 0.0)


@sy.inner
def _walk(values, streams, settings, w):
    """Place and speed of the load after the control step; it stops at the ends of its way."""
    dt = settings[DT]
    time = values[ELAPSED, w] * dt
    if time >= values[LEG_END, w]:
        _next_leg(values, streams, settings, w)
    place = values[PLACE, w]
    wanted = values[WANTED, w]
    needed = (END - place) / max(DEADLINE - time, 1.0)
    if needed > HASTE or time > DEADLINE:
        wanted = max(wanted, 1.3 * max(needed, HASTE))
    old = values[LOAD_SPEED, w]
    wanted = min(wanted, _fastest(END - place, old, dt))
    wanted = max(wanted, -_fastest(place - START, -old, dt)) if place < END else 0.0
    speed = _towards(old, wanted, ACCELERATION * dt)
    place += 0.5 * (old + speed) * dt
    if place < START or place > END:
        place = min(max(place, START), END)
        speed = 0.0
    values[LOAD_SPEED, w] = speed
    values[PLACE, w] = place
    across = values[ACROSS, w]
    slide = min(max(2.0 * (values[WANTED_ACROSS, w] - across), -0.2), 0.2)
    slide = _towards(values[LOAD_SLIDE, w], slide, ACCELERATION * dt)
    values[ACROSS, w] = across + 0.5 * (values[LOAD_SLIDE, w] + slide) * dt
    values[LOAD_SLIDE, w] = slide


@sy.inner
def _share(offset):
    """Share of a pair in a load that stands ``offset`` planks beyond it, and the share's slope.

    The mean of the tent 1 - |x| over the footprint: it has no kink, so to pass a pair is no blow.
    """
    apart = abs(offset)
    if apart < FOOT:
        share, slope = 1.0 - (FOOT * FOOT + apart * apart) / (2.0 * FOOT), -apart / FOOT
    elif apart < 1.0 - FOOT:
        share, slope = 1.0 - apart, -1.0
    elif apart < 1.0 + FOOT:
        rest = 1.0 + FOOT - apart
        share, slope = rest * rest / (4.0 * FOOT), -rest / (2.0 * FOOT)
    else:
        share, slope = 0.0, 0.0
    return share, (slope if offset > 0.0 else -slope)


@sy.inner
def _move_load(values, streams, settings, layout, state, w):
    """Move the rider's weights at constant acceleration to what the load's next place asks for."""
    dt = settings[DT]
    place, across = values[PLACE, w], values[ACROSS, w]
    speed, slide = values[LOAD_SPEED, w], values[LOAD_SLIDE, w]
    _walk(values, streams, settings, w)
    for k in range(PAIRS):
        old, slope = _share(place - k)
        new, _ = _share(values[PLACE, w] - k)
        for side in range(2):
            node = 2 * k + side
            old_side = across if side else 1.0 - across
            new_side = values[ACROSS, w] if side else 1.0 - values[ACROSS, w]
            rate = slope * speed * old_side + old * (slide if side else -slide)
            gain = new * new_side - state[layout[WEIGHTS] + node, w] - rate * dt
            state[layout[RATES] + node, w] = rate
            state[layout[ACCELERATIONS] + node, w] = 2.0 * gain / (dt * dt)


@sy.kernel
def gust_strength(values, w, time):
    """Share of its greatest force that the gust has at a time [s]: it swells and fades smoothly."""
    begin, end = values[GUST, w], values[GUST_END, w]
    if time <= begin or time >= end:
        return 0.0
    return math.sin(math.pi * (time - begin) / (end - begin)) ** 2


@sy.kernel
def blow(values, streams, settings, layout, state, w):
    """The impulse of a gust on the nodes, for one control step."""
    dt = settings[DT]
    time = values[ELAPSED, w] * dt
    if time >= values[GUST_END, w]:
        _next_gust(values, streams, settings, w)
    strength = gust_strength(values, w, time)
    if strength > 0.0:
        for node in range(2 * PAIRS):
            apart = node // 2 - values[GUST_PLACE, w]
            kick = dt * strength * math.exp(-0.5 * apart * apart)
            state[layout[VELOCITY] + 3 * node, w] += kick * values[GUST_X, w]
            state[layout[VELOCITY] + 3 * node + 2, w] += kick * values[GUST_Z, w]


@sy.inner
def _wind_winches(actions, values, settings, layout, state, w):
    """Speed the winches up to what is asked, within their limits, over the control step."""
    dt = settings[DT]
    for k in range(PAIRS):
        asked = actions[w, k]
        asked = -SPEED * min(max(asked, -1.0), 1.0) if asked == asked else 0.0
        old = values[WINCH + k, w]
        rate = _towards(old, asked, WINCH_ACCELERATION * dt)
        # The motor's line: the more it pulls the slower it hauls; beyond stall it is driven back.
        rate = max(rate, min((values[TENSION + k, w] - STALL) / SLOPE, SPEED))
        # Near its end a cable covers a tenth of the rest in a control step, and so stops softly.
        length = state[layout[LENGTH + 2 * k], w]
        rate = min(max(rate, (SHORT - length) / (10.0 * dt)), (LONG - length) / (10.0 * dt))
        for cable in (2 * k, 2 * k + 1):
            state[layout[WINCH_RATE + cable], w] = old
            state[layout[WINCH_GAIN + cable], w] = (rate - old) / dt
        values[WINCH + k, w] = rate


@sy.inner
def _sense(values, settings, layout, state, w, share):
    """Tension of every pair and force of the deck on the load, smoothed as sensors do."""
    for k in range(PAIRS):
        pull = 0.0
        for cable in (2 * k, 2 * k + 1):
            pull += state[layout[PULL + cable], w] * state[layout[LENGTH + cable], w]
        pull *= settings[FORCE]
        values[TENSION + k, w] += share * (pull - values[TENSION + k, w])
    for c in range(3):
        push = settings[FORCE] * state[layout[PUSH] + c, w]
        values[CONTACT + c, w] += share * (push - values[CONTACT + c, w])


@sy.kernel
def deck(values, layout, state, w, c):
    """Component ``c`` of a plank's length and of the deck's width under the load [m]."""
    along = across = 0.0
    for k in range(PAIRS):
        share, slope = _share(values[PLACE, w] - k)
        near = state[layout[POSITION] + 6 * k + c, w]
        far = state[layout[POSITION] + 6 * k + 3 + c, w]
        along += slope * (near + values[ACROSS, w] * (far - near))
        across += share * (far - near)
    return along, across


@sy.kernel
def slides(values, layout, state, w):
    """Whether the deck does not push the load up, or holds it back by more than friction can."""
    ax, bx = deck(values, layout, state, w, 0)
    ay, by = deck(values, layout, state, w, 1)
    az, bz = deck(values, layout, state, w, 2)
    nx, ny, nz = by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax
    fx, fy, fz = values[CONTACT, w], values[CONTACT + 1, w], values[CONTACT + 2, w]
    push = (fx * nx + fy * ny + fz * nz) / math.sqrt(nx * nx + ny * ny + nz * nz)
    square = fx * fx + fy * fy + fz * fz - push * push
    return not (push > 0.0 and square <= FRICTION * FRICTION * push * push)


@sy.kernel
def observe(mask, values, layout, state, observations):
    """Observations of the worlds of ``mask``."""
    position = layout[POSITION]
    velocity = layout[VELOCITY]
    for w in range(mask.shape[0]):
        if not mask[w]:
            continue
        level = values[HEIGHT, w]
        for k in range(PAIRS):
            near, far = 6 * k + 1, 6 * k + 4
            height = 0.5 * (state[position + near, w] + state[position + far, w]) - level
            climb = 0.5 * (state[velocity + near, w] + state[velocity + far, w])
            roll = 0.5 * (state[position + far, w] - state[position + near, w])
            observations[w, k] = clip(height, -2.0, 2.0)
            observations[w, 6 + k] = clip(climb, -5.0, 5.0)
            observations[w, 12 + k] = clip(roll, -1.0, 1.0)
            observations[w, 18 + k] = clip(state[layout[LENGTH + 2 * k], w], SHORT, LONG)
            observations[w, 24 + k] = clip(values[TENSION + k, w] / STALL, 0.0, 5.0)
        along, across = deck(values, layout, state, w, 1)
        place = SPACING * (values[PLACE, w] - 0.5 * (PAIRS - 1))
        observations[w, 30] = clip(place, -3.8, 3.8)
        observations[w, 31] = clip(2.0 * values[ACROSS, w] - 1.0, -1.0, 1.0)
        observations[w, 32] = clip(SPACING * values[LOAD_SPEED, w], -2.0, 2.0)
        observations[w, 33] = clip(2.0 * values[LOAD_SLIDE, w], -0.5, 0.5)
        height = state[position + 6 * PAIRS + 1, w] - level
        observations[w, 34] = clip(height, -2.0, 2.0)
        observations[w, 35] = clip(along / SPACING, -1.0, 1.0)
        observations[w, 36] = clip(0.5 * across, -1.0, 1.0)


@sy.inner
def _judge(values, settings, layout, state, observations, rewards, flags):
    """Rewards and flags after a step; the number of episodes that ended."""
    ended = 0
    for w in range(flags.shape[1]):
        values[ELAPSED, w] += 1.0
        broken = state[layout[NONFINITE], w] > 0.0
        level = off = motion = work = 0.0
        for k in range(PAIRS):
            square = np.float64(observations[w, k]) ** 2
            level += 1.0 / (PAIRS * (1.0 + square / (NEAR * NEAR)))
            off += square / PAIRS
            motion += np.float64(observations[w, 6 + k]) ** 2 / PAIRS
            work += values[WINCH + k, w] ** 2 / PAIRS
        if START < values[PLACE, w] < END:
            values[SQUARES, w] += off
            values[CROSSING, w] += 1.0
        error = values[SQUARES, w] / max(values[CROSSING, w], 1.0)
        fallen = broken or slides(values, layout, state, w)
        level = 0.0 if broken else level
        quiet = 0.0 if broken else -0.1 * min(motion / 0.01, 1.0)
        effort = 0.0 if broken else -0.05 * work / (SPEED * SPEED)
        fall = -50.0 if fallen else 0.0
        rewards[0, w] = level + quiet + effort + fall
        rewards[1, w] = level
        rewards[2, w] = quiet
        rewards[3, w] = effort
        rewards[4, w] = fall
        late = settings[LIMIT] > 0.0 and values[ELAPSED, w] >= settings[LIMIT]
        arrived = values[PLACE, w] >= END
        flags[TERMINATED, w] = fallen
        flags[TRUNCATED, w] = late
        flags[SUCCESS, w] = arrived and not fallen and error <= ALLOWED * ALLOWED
        flags[PHYSICS_ERROR, w] = broken
        if fallen or late:
            ended += 1
    return ended


@sy.kernel
def step(
    actions, everyone, values, streams, settings, layout, observations, rewards, flags,
    state, launch, substeps,
):  # fmt: skip
    """A control step of all worlds: control, physics, observation, reward."""
    count = actions.shape[0]
    for w in range(count):
        _move_load(values, streams, settings, layout, state, w)
        blow(values, streams, settings, layout, state, w)
        _wind_winches(actions, values, settings, layout, state, w)
    for _ in range(substeps):
        sy.advance(launch, 1)
        for w in range(count):
            _sense(values, settings, layout, state, w, settings[SENSOR_SHARE])
    observe(everyone, values, layout, state, observations)
    return _judge(values, settings, layout, state, observations, rewards, flags)
