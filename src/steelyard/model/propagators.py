"""Linear parts of the forces on single particles, and the exponentials that move them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from . import derived
from .exponentials import exponential_weights
from .parameters import PARTICLES, Key

if TYPE_CHECKING:
    from .compile import Compiler

# Coefficients of a particle.
_ROWS = 24


def add_propagators(c: Compiler) -> None:
    """Per particle the rows of its coefficients and of the centre of its anchored springs."""
    records: list[int] = []
    free = [p for p in range(len(c.particles)) if not c.linear.get(p)]

    def damped(damping: np.ndarray) -> np.ndarray:
        rate = derived.rate(damping[free])
        weights = exponential_weights(np.zeros_like(rate), rate, c.method.substep)
        return np.swapaxes(weights, 0, 1).reshape(-1, *rate.shape[1:])

    first = c.slot(_ROWS * len(free), ((PARTICLES, "damping"),), damped)
    alone = {p: first + _ROWS * k for k, p in enumerate(free)}
    for p in range(len(c.particles)):
        if p in alone:
            records += [alone[p], c.zero]
            continue
        linear = c.linear[p]
        springs = [thing for thing, _, anchored in linear if anchored]
        stiffness: list[Key] = [(thing, "stiffness") for thing in springs]
        drags: list[Key] = [(thing, name) for thing, name, _ in linear if name is not None]
        keys = ((PARTICLES, "inverse_mass"), (PARTICLES, "damping"), *stiffness, *drags)
        count = len(springs)

        def coefficients(
            inverse: np.ndarray,
            damping: np.ndarray,
            *given: np.ndarray,
            p: int = p,
            count: int = count,
        ) -> np.ndarray:
            own = inverse[p : p + 1]
            square = _sum(given[:count]) * own
            rate = derived.rate(damping[p : p + 1]) + _sum(given[count:]) * own
            return exponential_weights(square, rate, c.method.substep)[:, 0]

        centre = c.zero
        if springs:
            anchors: list[Key] = [(thing, "anchor") for thing in springs]
            centre = c.slot(3, (*stiffness, *anchors), _mean_anchor)
        records += [c.slot(_ROWS, keys, coefficients), centre]
    c.sections["propagators"] = records


def _sum(values: tuple[np.ndarray, ...]) -> Any:
    # A rounded stiffness over mass would turn the phase at every step.
    total: Any = np.zeros(1, dtype=np.longdouble)
    for value in values:
        total = total + value
    return total


def _mean_anchor(*given: np.ndarray) -> np.ndarray:
    """Mean of the anchors, weighted by the stiffnesses; one anchor as it is."""
    half = len(given) // 2
    stiffness, anchors = given[:half], given[half:]
    if half == 1:
        return anchors[0]
    total = _sum(stiffness)
    return sum((k / total) * x for k, x in zip(stiffness, anchors, strict=True))
