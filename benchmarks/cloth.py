"""The cloth's motion integrated to high accuracy, by a program that shares nothing with the engine but the scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.sparse import csr_matrix

import steelyard as sy

Array = npt.NDArray[np.float64]


def spring_accelerations(scene: sy.Scene) -> tuple[Array, Array, csr_matrix, Array, Array]:
    """What the motion of a network of springs needs of a scene.

    Returns:
        Inverse masses (particles, 1), damping rates (particles, 1), incidence (springs, particles), stiffnesses
        and rest lengths (springs, 1).
    """
    particles = scene.particles
    place = {id(p): k for k, p in enumerate(particles)}
    springs = [thing for thing in scene.things if isinstance(thing, sy.Spring)]
    ends = np.array([(place[id(s.a)], place[id(s.b)]) for s in springs])
    rows = np.arange(len(springs))
    values = np.concatenate([np.ones(len(springs)), -np.ones(len(springs))])
    incidence = csr_matrix(
        (values, (np.concatenate([rows, rows]), ends.T.ravel())),
        shape=(len(springs), len(particles)),
    )
    return (
        np.array([[p.inverse_mass] for p in particles]),
        np.array([[-np.log(p.damping)] for p in particles]),
        incidence,
        np.array([[s.stiffness] for s in springs]),
        np.array([[s.rest_length] for s in springs]),
    )


def spring_motion(
    scene: sy.Scene, times: Array, *, tolerance: float = 1e-11
) -> tuple[Array, Array]:
    """Positions and velocities of a scene of springs, weight and damping, by DOP853.

    Args:
        scene: particles and ``Spring`` alone.
        times: where to give the state [s], rising.
        tolerance: relative, and absolute in metres and metres per second.

    Returns:
        Positions [m] and velocities [m/s], each (times, particles, 3).
    """
    inverse, rate, incidence, stiffness, rest = spring_accelerations(scene)
    count = len(scene.particles)
    weight = np.where(inverse > 0.0, scene.gravity, 0.0)
    transposed = incidence.T.tocsr()

    def rates(t: float, y: Array) -> Array:
        x, v = y.reshape(2, count, 3)
        apart = incidence @ x
        length = np.sqrt((apart**2).sum(axis=1, keepdims=True))
        force = transposed @ (stiffness * (rest / length - 1.0) * apart)
        return np.concatenate([v, weight + inverse * force - rate * v]).ravel()

    start = np.array([[p.position for p in scene.particles], [p.velocity for p in scene.particles]])
    solution = solve_ivp(
        rates,
        (0.0, float(times[-1])),
        start.ravel(),
        method="DOP853",
        t_eval=times,
        rtol=tolerance,
        atol=tolerance,
    )
    states = solution.y.T.reshape(len(times), 2, count, 3)
    return states[:, 0], states[:, 1]
