"""Numbers that kernels need and parameters imply: powers of damping, exponentials of oscillators.

Computed on the host when a parameter or the step changes, in extended precision where a rounding error would
be repeated at every step.
"""

from __future__ import annotations

import numpy as np

_Extended = np.longdouble


def decay(damping: np.ndarray, time: float) -> np.ndarray:
    """damping^time."""
    return damping**time


def rate(damping: np.ndarray) -> np.ndarray:
    """-ln(damping), which is 0, not -0, for no damping."""
    return np.abs(np.log(damping))


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


Block = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _product(a: Block, b: Block) -> Block:
    """Product of 2 x 2 matrices, each (00, 01, 10, 11)."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


def _combine(*terms: tuple[float, Block]) -> Block:
    """Weighted sum of 2 x 2 matrices."""
    a, b, c, d = (sum(weight * block[k] for weight, block in terms) for k in range(4))
    return a, b, c, d


def phi(square: np.ndarray, rate: np.ndarray, time: float) -> tuple[Block, Block, Block, Block]:
    """exp(t L) and phi_1 ... phi_3(t L), phi_k(z) = sum of z^n/(n + k)!, for L = ((0, 1), (-square, -rate)).

    Series at t L/2^s, then doubled s times by phi_k(2 z) = 2^-k (e^z phi_k(z) + sum over j of phi_j(z)/(k - j)!), after
    Skaflestad & Wright (2009). Speeds are scaled by the larger of w and the rate, so that L's entries are alike; s is each
    world's own.
    """
    h = _Extended(time)
    square, rate = np.broadcast_arrays(square.astype(_Extended), rate.astype(_Extended))
    scale = np.maximum(np.maximum(np.sqrt(square), rate), 1 / h)
    times = np.maximum(np.ceil(np.log2(scale * h)) + 2, 0)
    share = h / 2**times
    zero, one = np.zeros_like(share), np.ones_like(share)
    identity = one, zero, zero, one
    z = zero, share * scale, -share * square / scale, -share * rate
    phis: list[Block] = []
    for k in range(4):
        # Horner: phi_k = 1/k! (1 + z/(k+1) (1 + z/(k+2) (...))).
        series = identity
        for n in range(18, 0, -1):
            step = _product(z, series)
            series = _combine((_Extended(1), identity), (1 / _Extended(n + k), step))
        factorial = (1, 1, 2, 6)[k]
        phis.append(_combine((1 / _Extended(factorial), series)))
    e, one_, two, three = phis
    for k in range(int(times.max(initial=0))):
        half = _Extended(1) / 2
        doubled = (
            _product(e, e),
            _combine((half, _product(e, one_)), (half, one_)),
            _combine((half / 2, _product(e, two)), (half / 2, one_), (half / 2, two)),
            _combine(
                (half / 4, _product(e, three)), (half / 8, one_), (half / 4, two), (half / 4, three)
            ),
        )
        further = k < times
        e, one_, two, three = (
            (
                np.where(further, new[0], old[0]),
                np.where(further, new[1], old[1]),
                np.where(further, new[2], old[2]),
                np.where(further, new[3], old[3]),
            )
            for new, old in zip(doubled, (e, one_, two, three), strict=True)
        )
    back = [(b[0], b[1] / scale, b[2] * scale, b[3]) for b in (e, one_, two, three)]
    return back[0], back[1], back[2], back[3]


def exponential_weights(square: np.ndarray, rate: np.ndarray, time: float) -> np.ndarray:
    """Coefficients of ``integrators.exponential``; shape (24, ...).

    exp(h L/2) and exp(h L), four each; then the effect on place and speed of N in a (once), b (twice), c (twice) and the result
    (three times).
    """
    unit = np.ones_like(square * rate)
    half, whole = (oscillator(square * unit, rate * unit, unit, t) for t in (time / 2, time))
    _, h1, h2, _ = phi(square, rate, time / 2)
    _, f1, f2, f3 = phi(square, rate, time)
    h = _Extended(time)
    weights = [
        _combine((h / 2, h1)),
        _combine((h / 2, h1), (-h, h2)),
        _combine((h, h2)),
        _combine((h, f1), (-2 * h, f2)),
        _combine((2 * h, f2)),
        _combine((h, f1), (-3 * h, f2), (4 * h, f3)),
        _combine((2 * h, f2), (-4 * h, f3)),
        _combine((-h, f2), (4 * h, f3)),
    ]
    pairs = [column for weight in weights for column in (weight[1], weight[3])]
    return np.concatenate([half, whole, np.stack(pairs).astype(np.float64)])
