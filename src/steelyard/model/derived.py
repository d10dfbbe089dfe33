"""Numbers that kernels need and parameters imply: powers of damping, exponentials of oscillators.

Computed on the host when a parameter or the step changes, in extended precision where a rounding error would
be repeated at every step.
"""

from __future__ import annotations

import numpy as np

_Extended = np.longdouble

#: Where the six numbers of a symmetric matrix stand in it.
LOWER = ([0, 1, 1, 2, 2, 2], [0, 0, 1, 0, 1, 2])


def decay(damping: np.ndarray, time: float) -> np.ndarray:
    """damping^time."""
    return damping**time


def rate(damping: np.ndarray) -> np.ndarray:
    """-ln(damping), which is 0, not -0, for no damping."""
    return np.abs(np.log(damping))


def symmetric(numbers: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) from their numbers 00 10 11 20 21 22 along the first axis, (6, ...)."""
    a, b, c, d, e, f = numbers
    rows = [np.stack(row, axis=-1) for row in ((a, b, d), (b, c, e), (d, e, f))]
    return np.stack(rows, axis=-2)


def inverse_inertia(numbers: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric matrix, in and out as numbers 00 10 11 20 21 22, (6,) or (6, worlds)."""
    inverse = np.linalg.inv(symmetric(numbers))
    return np.stack([inverse[..., i, j] for i, j in zip(*LOWER, strict=True)])


def flight(damping: np.ndarray, time: float) -> np.ndarray:
    """e^(-ct), phi1, phi2 of ``integrators.closed_form`` with c = -ln(damping); shape (3, ...)."""
    rate = -np.log(damping.astype(_Extended))
    z = rate * _Extended(time)
    small = z < 1e-2
    safe = np.where(small, _Extended(1), rate)
    one = np.where(small, 0, -np.expm1(-z) / safe)
    two = np.where(small, 0, (_Extended(time) - one) / safe)
    series = np.ones_like(z)
    for k in range(9, 2, -1):
        series = 1 - z / k * series
    one = np.where(small, _Extended(time) * (1 - z / 2 * series), one)
    two = np.where(small, _Extended(time) ** 2 / 2 * series, two)
    return np.stack([np.exp(-z), one, two]).astype(np.float64)


def drag(linear: np.ndarray, inverse_mass: np.ndarray, time: float) -> np.ndarray:
    """e = exp(-k1 t/m) and phi = (1 - e)/k1 of ``forces.drag``; shape (2, ...)."""
    z = linear * inverse_mass * time
    small = z < 1e-8
    phi = np.where(
        small, inverse_mass * time * (1 - z / 2), -np.expm1(-z) / np.where(small, 1.0, linear)
    )
    return np.stack([np.exp(-z), phi])


def oscillator(
    stiffness: np.ndarray, damping: np.ndarray, inverse_mass: np.ndarray, time: float
) -> np.ndarray:
    """Coefficients (p00, p01, p10, p11) of the exact step of y'' = -(k y + c y')/m; shape (4, ...).

    With b = c/2m, w^2 = k/m - b^2: e^(-bt) times the oscillation, written with cosh and sinh where w^2 < 0
    such that neither overflows, and by series where w t is near 0.
    """
    k, c, inverse = np.broadcast_arrays(stiffness, damping, inverse_mass)
    inverse = inverse.astype(_Extended)
    h = _Extended(time)
    b = c.astype(_Extended) * inverse / 2
    square = k.astype(_Extended) * inverse
    discriminant = square - b * b
    w = np.sqrt(np.abs(discriminant))
    # Two real rates -(b - w), -(b + w); the small one without cancellation.
    slow = np.where(b + w > 0, square / np.where(b + w > 0, b + w, 1), 0)
    fast = b + w
    over = discriminant < 0
    grown = np.where(
        over, (np.exp(-slow * h) + np.exp(-fast * h)) / 2, np.exp(-b * h) * np.cos(w * h)
    )
    width = np.where(w > 0, w, 1)
    turned = np.where(
        over,
        (np.exp(-slow * h) - np.exp(-fast * h)) / (2 * width),
        np.exp(-b * h) * np.sin(w * h) / width,
    )
    near = w * h < 1e-4
    z = np.where(near, -discriminant * h * h, 0)
    turned = np.where(near, np.exp(-b * h) * h * (1 + z / 6 * (1 + z / 20 * (1 + z / 42))), turned)
    grown = np.where(near, np.exp(-b * h) * (1 + z / 2 * (1 + z / 12 * (1 + z / 30))), grown)
    p = np.stack([grown + b * turned, turned, -square * turned, grown - b * turned])
    return p.astype(np.float64)
