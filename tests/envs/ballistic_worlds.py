"""Worlds of Ballistic with a given aim, wind and target, and the shot's flight written down anew."""

import math

import numpy as np

from steelyard_envs import ballistic_flight as flight
from steelyard_envs import ballistic_kernels as kernels
from steelyard_envs.ballistic import DAMPING, BallisticTask

DT = 0.02
FIRE, HOLD = np.array([[0, 0, 1]], np.float32), np.array([[0, 0, -1]], np.float32)
GRAVITY = -20.0  # of the artillery's shot
SPEED = 50.0


def begun(worlds=1, *, seed=0, **kwargs):
    task = BallisticTask(worlds, **kwargs)
    task.seed(np.ones(worlds, bool), np.arange(worlds) + seed)
    task.start(np.ones(worlds, bool))
    return task


def lay(task, *, azimuth=0.0, elevation=0.0, wind=(0.0, 0.0)):
    task.values[kernels.AZIMUTH], task.values[kernels.ELEVATION] = azimuth, elevation
    task.values[kernels.WIND_X], task.values[kernels.WIND_Z] = wind


def put_target(task, place, *, radius=None, travel=(0.0, 0.0), weave=(0.0, 0.0), angle=0.0):
    rows = (flight.TARGET, place), (flight.TRAVEL, travel), (flight.WEAVE, weave)
    for row, value in rows:
        for c, component in enumerate(value):
            task.flight[row + c] = component
    task.flight[flight.ANGLE] = angle
    if radius is not None:
        task.settings[kernels.RADIUS] = radius


def fire_and_wait(task, steps=260):
    """Events of a shot, (steps, worlds); a flight ends within 250 steps."""
    worlds = task.num_envs
    events = np.zeros((steps, worlds))
    for k in range(steps):
        task.step(np.repeat(FIRE if k == 0 else HOLD, worlds, axis=0))
        events[k] = task.flight[flight.EVENT, :worlds]
    return events


def flown(time, *, azimuth, elevation, wind, damping=DAMPING, speed=SPEED, gravity=GRAVITY):
    """Place (..., 3) of a shot after a time (...), written down anew."""
    c = -math.log(damping)
    time = np.asarray(time)[..., None]
    phi1 = -np.expm1(-c * time) / c
    velocity = speed * np.array(
        [math.cos(elevation) * math.sin(azimuth), math.sin(elevation),
         math.cos(elevation) * math.cos(azimuth)]
    )  # fmt: skip
    pull = np.array([c * wind[0], gravity, c * wind[1]])
    return np.array([0.0, 1.5, 0.0]) + velocity * phi1 + pull * (time - phi1) / c


AIM = {"azimuth": 0.3, "elevation": 0.6, "wind": (-7.0, 9.0)}
