"""Counter-based random numbers: no state but a key and a counter, so every world has a stream of its own.

Number ``counter`` of the stream ``key`` is SplitMix64's output function (Steele, Lea & Flood 2014) of their sum;
keys are mixed first, so that neighbouring seeds give unrelated streams.
"""

from __future__ import annotations

import math

import numpy as np

from ..kernel import inner, kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_ONE = np.uint64(1)


@inner
def _mix(value):
    value = (value ^ (value >> _S30)) * _FIRST
    value = (value ^ (value >> _S27)) * _SECOND
    return value ^ (value >> _S31)


@kernel
def uniform(stream, w):
    """Next number in [0, 1) of world ``w``; ``stream`` (2, worlds) uint64 holds keys and counters."""
    counter = stream[1, w] + _ONE
    stream[1, w] = counter
    key = _mix(stream[0, w] * _GOLDEN + _GOLDEN)
    return np.float64(_mix(key + counter * _GOLDEN) >> _S11) * (1.0 / 9007199254740992.0)


@kernel
def uniform_between(stream, w, low, high):
    """Next number in [low, high) of world ``w``."""
    return low + (high - low) * uniform(stream, w)


@kernel
def normal(stream, w):
    """Next standard normal number of world ``w`` (Box & Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(stream, w)))
    return radius * math.cos(2.0 * math.pi * uniform(stream, w))
