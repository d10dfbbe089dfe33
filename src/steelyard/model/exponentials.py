"""Exponential and phi functions of a damped oscillator's 2 x 2 matrix, in extended precision.

Matrices are arrays of shape (4, ...): entries 00, 01, 10, 11.
"""

from __future__ import annotations

import numpy as np

from .derived import oscillator

_Extended = np.longdouble
#: Terms of a series at arguments up to 1/4: 4^-18/18! is 2e-27.
_TERMS = 18


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            a[0] * b[0] + a[1] * b[2],
            a[0] * b[1] + a[1] * b[3],
            a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3],
        ]
    )


def phi(square: np.ndarray, rate: np.ndarray, time: float) -> np.ndarray:
    """phi_0 ... phi_3 of t L, phi_k(z) = sum of z^n/(n + k)!, for L = ((0, 1), (-square, -rate)).

    Series at t L/2^s, then doubled s times by phi_k(2 z) = 2^-k (e^z phi_k(z) + sum over j of phi_j(z)/(k - j)!),
    after Skaflestad & Wright (2009). Speeds are scaled by the larger of w and the rate, so that L's entries are
    alike; s is each world's own.

    Args:
        square: w^2 [1/s^2], any shape.
        rate: c [1/s], the same shape.
        time: t [s], above 0.

    Returns:
        Extended precision, shape (4, 4, ...): the function, then the entry.
    """
    h = _Extended(time)
    square, rate = np.broadcast_arrays(square.astype(_Extended), rate.astype(_Extended))
    scale = np.maximum(np.maximum(np.sqrt(square), rate), 1 / h)
    times = np.ceil(np.log2(scale * h)) + 2
    share = h / 2**times
    zero, one = np.zeros_like(share), np.ones_like(share)
    identity = np.stack([one, zero, zero, one])
    z = np.stack([zero, share * scale, -share * square / scale, -share * rate])
    series = []
    for k in range(4):
        # 1/k! (1 + z/(k + 1) (1 + z/(k + 2) (...))), from the inside.
        total = identity
        for n in range(_TERMS, 0, -1):
            total = identity + _product(z, total) / _Extended(n + k)
        series.append(total / (1, 1, 2, 6)[k])
    e, one_, two, three = series
    for k in range(int(times.max(initial=0))):
        further = k < times
        three = np.where(further, (_product(e, three) + one_ / 2 + two + three) / 8, three)
        two = np.where(further, (_product(e, two) + one_ + two) / 4, two)
        one_ = np.where(further, (_product(e, one_) + one_) / 2, one_)
        e = np.where(further, _product(e, e), e)
    return np.stack([e, one_, two, three]) * np.stack([one, 1 / scale, scale, one])


def exponential_weights(square: np.ndarray, rate: np.ndarray, time: float) -> np.ndarray:
    """Coefficients of ``integrators.exponential``; shape (24, ...).

    exp(h L/2) and exp(h L), four each; then the effect on place and speed of N in a (once), b (twice), c (twice)
    and the result (three times).
    """
    square, rate = np.broadcast_arrays(square, rate)
    unit = np.ones_like(square)
    half = oscillator(square, rate, unit, time / 2)
    whole = oscillator(square, rate, unit, time)
    h = _Extended(time)
    _, h1, h2, _ = h * phi(square, rate, time / 2)
    _, f1, f2, f3 = h * phi(square, rate, time)
    weights = [
        h1 / 2, h1 / 2 - h2, h2,
        f1 - 2 * f2, 2 * f2,
        f1 - 3 * f2 + 4 * f3, 2 * f2 - 4 * f3, 4 * f3 - f2,
    ]  # fmt: skip
    pairs = np.stack([entry for weight in weights for entry in (weight[1], weight[3])])
    return np.concatenate([half, whole, pairs.astype(np.float64)])
