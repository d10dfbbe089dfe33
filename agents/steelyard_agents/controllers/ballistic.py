"""Ballistics by hand: solve for the aim at which the shot meets the target, turn there, fire."""

import math
from typing import Any

import numpy as np

import steelyard as sy
from steelyard_envs.ballistic import DAMPING
from steelyard_envs.ballistic_flight import LIFE, MUZZLE
from steelyard_envs.ballistic_kernels import AZIMUTH_RATE, ELEVATION_RATE

# Angle off the solution at which it fires [rad]: .8 m at 80 m, where targets have 1.6 m and more.
TOLERANCE = 0.006


class BallisticController:
    """Fires along the low solution of the flight with drag, wind and lead.

    With linear drag c, wind w and own acceleration a the shot's displacement in a time T is
    V phi1(T) + (a + c w) phi2(T), with phi1 = (1 - e^(-cT))/c and phi2 = (T - phi1)/c. The muzzle
    velocity V has a given length, so T solves |target(T) - muzzle - (a + c w) phi2(T)| = |V| phi1(T):
    Newton's method, from the time of a straight shot. Where the wind is hidden, it is what bends the
    shot in flight.

    Args:
        shot: Kind of shot, as in the environment.
        damping: Share of velocity that shots keep per second, as in the environment.
        control_rate: Observations per second, as in the environment.
    """

    def __init__(
        self, shot: str = "artillery", *, damping: float = DAMPING, control_rate: float = 50.0
    ) -> None:
        kind = sy.scenes.SHOTS[shot]
        self.speed = math.hypot(*kind.velocity)
        self.fall = np.array([0.0, 0.0, kind.acceleration])
        # Without drag the formulas below divide by 0; so little moves no shot by a millimetre.
        self.drag = max(-math.log(damping), 1e-6)
        self.dt = 1.0 / control_rate

    def reset(self, num_envs: int) -> None:
        """Forget what bent the shots before."""
        self._wind = np.zeros((num_envs, 2))
        self._before = np.zeros((num_envs, 2))
        self._flew = np.zeros(num_envs, dtype=bool)

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Turn towards the solution; fire when there."""
        obs = obs.astype(np.float64)
        lead, elevation = self.aim(obs, self.wind(obs))
        turn, rise = obs[:, 5] + lead, elevation - obs[:, 1]
        there = np.maximum(np.abs(turn), np.abs(rise)) < TOLERANCE
        rates = np.stack([turn / AZIMUTH_RATE, rise / ELEVATION_RATE], axis=1) / self.dt
        trigger = np.where(there, 1.0, -1.0)[:, None]
        return np.concatenate([np.clip(rates, -1.0, 1.0), trigger], axis=1).astype(np.float32)

    def wind(self, obs: np.ndarray) -> np.ndarray:
        """Wind along and across the line of sight [m/s], shape (n, 2)."""
        # Observed vectors turn with the line of sight: turn them back to axes that stand still.
        sight = obs[:, 0] + obs[:, 5]
        velocity = _turn(obs[:, 15:17], sight)
        keep, phi1, _ = _phis(self.drag, self.dt)
        bent = (velocity - keep * self._before) / (self.drag * phi1)
        flies = obs[:, 11] > 0.0
        self._wind = np.where((flies & self._flew)[:, None], bent, self._wind)
        self._before, self._flew = velocity, flies
        seen = obs[:, 9:11]
        return np.where(seen.any(axis=1, keepdims=True), seen, _turn(self._wind, -sight))

    def aim(self, obs: np.ndarray, wind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Azimuth from the target and elevation of the barrel [rad], each of shape (n,)."""
        still = np.zeros(len(obs))
        place = np.stack([obs[:, 4], still, obs[:, 6] - MUZZLE], axis=1)
        travel = np.stack([obs[:, 7], obs[:, 8], still], axis=1)
        pull = self.fall + self.drag * np.concatenate([wind, still[:, None]], axis=1)
        time = np.linalg.norm(place, axis=1) / self.speed
        for _ in range(20):
            keep, phi1, phi2 = _phis(self.drag, time)
            path = place + travel * time[:, None] - pull * phi2[:, None]
            length = np.linalg.norm(path, axis=1)
            change = travel - pull * phi1[:, None]
            slope = self.speed * keep - np.einsum("nk,nk->n", path, change) / length
            time = np.clip(time - (self.speed * phi1 - length) / slope, self.dt, LIFE)
        along, across, up = path.T
        return np.arctan2(across, along), np.arctan2(up, np.hypot(along, across))


def _phis(drag: float, time: Any) -> tuple[Any, Any, Any]:
    """e^(-ct), phi1 and phi2 of the flight."""
    keep = np.exp(-drag * time)
    phi1 = (1.0 - keep) / drag
    return keep, phi1, (time - phi1) / drag


def _turn(vectors: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Vectors (along, across) on a line at an azimuth, as (towards 0, towards a quarter turn)."""
    sine, cosine = np.sin(angle), np.cos(angle)
    along, across = vectors.T
    return np.stack([along * cosine - across * sine, along * sine + across * cosine], axis=1)
