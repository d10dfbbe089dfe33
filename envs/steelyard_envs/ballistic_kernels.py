"""Kernels of Ballistic: randomisation, control, observation, reward and termination."""

from __future__ import annotations

import math

import numpy as np

import steelyard as sy
from steelyard_envs.ballistic_flight import (
    ANGLE,
    CLOSEST,
    EVENT,
    FLYING,
    HIT,
    MISS,
    MISSED,
    SHOT,
    TARGET,
    TRAVEL,
    WEAVE,
    follow_shot,
    move_target,
    target_motion,
)
from steelyard_envs.clip import clip
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED

AZIMUTH_RATE, ELEVATION_RATE = 1.0, 0.5  # [rad/s]
AZIMUTH_MOST, ELEVATION_LEAST, ELEVATION_MOST = 1.5, -0.25, 1.4  # [rad]
SHOTS, RELOAD = 6, 1.0  # [s] from one shot to the next
SECTOR = 0.6  # target and barrel start within this azimuth to either side [rad]
CROSSING = 12.0  # time in which a moving target runs from one random place to another [s]

# Rows of ``values``; those of the flight follow from FLIGHT on.
(
    AZIMUTH, ELEVATION, LEFT, FIRED_AT, FIRED, ELAPSED, WIND_X, WIND_Z, CLOSENESS, FLIGHT,
) = range(10)  # fmt: skip
# Entries of ``settings`` and ``layout``.
(
    DT, LIMIT, RADIUS, WEAVE_MOST, WEAVE_RATE, WIND_MOST, WIND_SEEN, MOVES, NEAR, FAR,
    SPEED, WEIGHT, DRAG, RELOAD_STEPS,
) = range(14)  # fmt: skip
POSITION, VELOCITY, NONFINITE = range(3)


@sy.inner
def _somewhere(streams, w, near, far):
    """A random place x, z in the sector, uniform in range and azimuth."""
    reach = sy.uniform_between(streams, w, near, far)
    azimuth = sy.uniform_between(streams, w, -SECTOR, SECTOR)
    return reach * math.sin(azimuth), reach * math.cos(azimuth)


@sy.kernel
def begin(mask, values, flight, streams, settings):
    """A fresh episode in the worlds of ``mask``: aim, wind and target."""
    near, far, radius = settings[NEAR], settings[FAR], settings[RADIUS]
    for w in range(mask.shape[0]):
        if not mask[w]:
            continue
        for row in range(values.shape[0]):
            values[row, w] = 0.0
        values[AZIMUTH, w] = sy.uniform_between(streams, w, -SECTOR, SECTOR)
        values[ELEVATION, w] = sy.uniform_between(streams, w, 0.0, 0.5)
        values[LEFT, w] = SHOTS
        values[FIRED_AT, w] = -settings[RELOAD_STEPS]
        wind = settings[WIND_MOST] * sy.uniform(streams, w)
        towards = 2.0 * math.pi * sy.uniform(streams, w)
        values[WIND_X, w] = wind * math.sin(towards)
        values[WIND_Z, w] = wind * math.cos(towards)
        x, z = _somewhere(streams, w, near, far)
        to_x, to_z = _somewhere(streams, w, near, far)
        run_x, run_z = to_x - x, to_z - z
        run = math.hypot(run_x, run_z)
        flight[TARGET, w] = x
        flight[TARGET + 1, w] = sy.uniform_between(streams, w, radius, radius + 0.1 * far)
        flight[TARGET + 2, w] = z
        flight[TRAVEL, w] = settings[MOVES] * run_x / CROSSING
        flight[TRAVEL + 1, w] = settings[MOVES] * run_z / CROSSING
        flight[WEAVE, w] = settings[WEAVE_MOST] * run_z / run
        flight[WEAVE + 1, w] = -settings[WEAVE_MOST] * run_x / run
        flight[ANGLE, w] = 2.0 * math.pi * sy.uniform(streams, w)


@sy.inner
def _turned(angle, action, change, low, high):
    """An angle of the barrel after a step at the commanded rate; it stops at its limits."""
    command = min(max(np.float64(action), -1.0), 1.0) if action == action else 0.0
    return min(max(angle + change * command, low), high)


@sy.inner
def _control(actions, values, flight, settings, layout, state, given):
    """Fire along the aim that was observed, then turn the barrel."""
    dt, speed, drag = settings[DT], settings[SPEED], settings[DRAG]
    position, velocity = layout[POSITION], layout[VELOCITY]
    for w in range(actions.shape[0]):
        azimuth, elevation = values[AZIMUTH, w], values[ELEVATION, w]
        idle = flight[FLYING, w] == 0.0 and values[LEFT, w] > 0.0
        loaded = values[ELAPSED, w] - values[FIRED_AT, w] >= settings[RELOAD_STEPS]
        fires = idle and loaded and actions[w, 2] > 0.0
        values[FIRED, w] = 1.0 if fires else 0.0
        if fires:
            values[LEFT, w] -= 1.0
            values[FIRED_AT, w] = values[ELAPSED, w]
            flight[FLYING, w] = 1.0
            flight[CLOSEST, w] = math.inf
            state[velocity, w] = speed * math.cos(elevation) * math.sin(azimuth)
            state[velocity + 1, w] = speed * math.sin(elevation)
            state[velocity + 2, w] = speed * math.cos(elevation) * math.cos(azimuth)
        for c in range(3):
            flight[SHOT + c, w] = state[position + c, w]
            flight[SHOT + 3 + c, w] = state[velocity + c, w]
        # Drag is linear in the velocity relative to the air, so wind is a constant acceleration. A
        # shot that does not fly has none and stays where it is.
        flying = flight[FLYING, w]
        given[0, w] = flying * drag * values[WIND_X, w]
        given[1, w] = flying * settings[WEIGHT]
        given[2, w] = flying * drag * values[WIND_Z, w]
        values[AZIMUTH, w] = _turned(
            azimuth, actions[w, 0], AZIMUTH_RATE * dt, -AZIMUTH_MOST, AZIMUTH_MOST
        )
        values[ELEVATION, w] = _turned(
            elevation, actions[w, 1], ELEVATION_RATE * dt, ELEVATION_LEAST, ELEVATION_MOST
        )


@sy.inner
def _follow(count, values, flight, settings, layout, state):
    """What came of the shots in this step."""
    dt, drag, rate, radius = settings[DT], settings[DRAG], settings[WEAVE_RATE], settings[RADIUS]
    position, velocity = layout[POSITION], layout[VELOCITY]
    for w in range(count):
        values[ELAPSED, w] += 1.0
        flight[EVENT, w] = 0.0
        if flight[FLYING, w] != 0.0:
            age = (values[ELAPSED, w] - values[FIRED_AT, w]) * dt
            follow_shot(flight, state, position, velocity, w, dt, drag, rate, radius, age)
        move_target(flight, w, dt, rate)


@sy.kernel
def observe(mask, values, flight, settings, layout, state, observations):
    """Observations of the worlds of ``mask``."""
    dt, seen = settings[DT], settings[WIND_SEEN]
    x, v = layout[POSITION], layout[VELOCITY]
    for w in range(mask.shape[0]):
        if not mask[w]:
            continue
        target_x, target_z, speed_x, speed_z = target_motion(flight, w, settings[WEAVE_RATE], 0.0)
        reach = math.hypot(target_x, target_z)
        sine, cosine = target_x / reach, target_z / reach
        gap_x, gap_z = state[x, w] - target_x, state[x + 2, w] - target_z
        since = values[ELAPSED, w] - values[FIRED_AT, w]
        flying = flight[FLYING, w]
        row = observations[w]
        row[0] = values[AZIMUTH, w]
        row[1] = values[ELEVATION, w]
        row[2] = min(max(settings[RELOAD_STEPS] - since, 0.0) * dt, RELOAD)
        row[3] = values[LEFT, w]
        row[4] = clip(reach, -500.0, 500.0)
        row[5] = clip(math.atan2(target_x, target_z) - values[AZIMUTH, w], -3.0, 3.0)
        row[6] = flight[TARGET + 1, w]
        row[7] = clip(speed_x * sine + speed_z * cosine, -50.0, 50.0)
        row[8] = clip(speed_x * cosine - speed_z * sine, -50.0, 50.0)
        row[9] = seen * (values[WIND_X, w] * sine + values[WIND_Z, w] * cosine)
        row[10] = seen * (values[WIND_X, w] * cosine - values[WIND_Z, w] * sine)
        row[11] = flying
        row[12] = flying * clip(gap_x * sine + gap_z * cosine, -500.0, 500.0)
        row[13] = flying * clip(gap_x * cosine - gap_z * sine, -500.0, 500.0)
        row[14] = flying * clip(state[x + 1, w] - flight[TARGET + 1, w], -500.0, 500.0)
        row[15] = clip(state[v, w] * sine + state[v + 2, w] * cosine, -150.0, 150.0)
        row[16] = clip(state[v, w] * cosine - state[v + 2, w] * sine, -150.0, 150.0)
        row[17] = clip(state[v + 1, w], -150.0, 150.0)
        row[18] = flying * since * dt
        for c in range(3):
            row[19 + c] = clip(flight[MISS + c, w], -500.0, 500.0)


@sy.inner
def _judge(values, flight, settings, layout, state, rewards, flags):
    """Rewards and flags after a step; the number of episodes that ended."""
    ended = 0
    for w in range(flags.shape[1]):
        broken = state[layout[NONFINITE], w] > 0.0
        hit = flight[EVENT, w] == HIT and not broken
        closeness = values[CLOSENESS, w]
        if hit:
            closeness = 1.0
        elif flight[EVENT, w] == MISSED and not broken:
            closeness = 1.0 / (1.0 + math.sqrt(flight[CLOSEST, w]) / (settings[FAR] / 12.0))
        rewards[1, w] = 5.0 if hit else 0.0
        # A difference of potentials, so that a near miss before the hit pays nothing in the end.
        rewards[2, w] = 5.0 * (closeness - values[CLOSENESS, w])
        values[CLOSENESS, w] = closeness
        rewards[3, w] = -0.1 if values[FIRED, w] > 0.0 else 0.0
        rewards[4, w] = -0.25 * settings[DT]
        rewards[0, w] = rewards[1, w] + rewards[2, w] + rewards[3, w] + rewards[4, w]
        spent = values[LEFT, w] == 0.0 and flight[FLYING, w] == 0.0
        over = hit or spent or broken
        late = settings[LIMIT] > 0.0 and values[ELAPSED, w] >= settings[LIMIT]
        flags[TERMINATED, w] = over
        flags[TRUNCATED, w] = late
        flags[SUCCESS, w] = hit
        flags[PHYSICS_ERROR, w] = broken
        if over or late:
            ended += 1
    return ended


@sy.kernel
def step(
    actions, everyone, values, flight, settings, layout, observations, rewards, flags,
    state, given, launch, substeps,
):  # fmt: skip
    """A control step of all worlds: fire and turn, physics, outcome, observation, reward."""
    count = actions.shape[0]
    _control(actions, values, flight, settings, layout, state, given)
    sy.advance(launch, substeps)
    _follow(count, values, flight, settings, layout, state)
    observe(everyone, values, flight, settings, layout, state, observations)
    return _judge(values, flight, settings, layout, state, rewards, flags)
