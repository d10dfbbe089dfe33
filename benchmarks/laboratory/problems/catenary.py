"""A hanging cable of 21 links between level supports: tan theta_k = (V0 + k w) / H link by link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from benchmarks.laboratory.problem import Problem
from benchmarks.laboratory.problems.rest import longer, rest_problem
from benchmarks.scenes import Array, ParticleScene

COUNT, LINK, SPAN, MASS, GRAVITY = 20, 0.1, 1.5, 0.05, 9.81


def discrete_catenary() -> Array:
    """Places of the particles [m], shape (particles, 3), from the left support at the origin.

    The pull along the span is the same in all links; the upward part changes by a weight at each particle and is
    odd about the middle. Their slopes follow, and the pull from the span.
    """
    steps = np.arange(COUNT + 1) - 0.5 * COUNT
    rise = steps * MASS * GRAVITY

    def excess(pull: float) -> float:
        return float((LINK * pull / np.hypot(pull, rise)).sum() - SPAN)

    pull = brentq(excess, 1e-3, 1e3, xtol=1e-15, rtol=8.9e-16)
    tension = np.hypot(pull, rise)
    x, y = np.cumsum(LINK * pull / tension), np.cumsum(LINK * rise / tension)
    return np.stack([x, y, np.zeros_like(x)], axis=1)[:-1]


def cable(place: Array, *, mass: float = MASS) -> ParticleScene:
    """The particles on their cables."""
    return ParticleScene(
        position=place,
        velocity=np.zeros_like(place),
        mass=np.full(COUNT, mass),
        cables=tuple((k, k + 1, LINK) for k in range(COUNT - 1)),
        supports=((0, (0.0, 0.0, 0.0), LINK), (COUNT - 1, (SPAN, 0.0, 0.0), LINK)),
        gravity=(0.0, -GRAVITY, 0.0),
    )


def problems() -> tuple[Problem, ...]:
    """The catenary."""
    place = discrete_catenary()
    scene = cable(place)
    uneven = scene.mass.copy()
    uneven[0] *= 1.1
    return (
        rest_problem(
            "catenary",
            scene,
            place,
            {
                "a heavier particle": replace(scene, mass=uneven),
                "a link 1 mm long": longer(scene, 0, 1e-3),
                "gravity askew": replace(scene, gravity=(0.1, -GRAVITY, 0.0)),
            },
        ),
    )
