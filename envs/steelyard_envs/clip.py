"""Observations stay within their bounds, whatever the physics does."""

from __future__ import annotations

import steelyard as sy


@sy.inner
def clip(value, low, high):
    """``value`` within bounds, 0 if it is not a number."""
    return min(max(value if value == value else 0.0, low), high)


@sy.inner
def clip_lanes(value, low, high):
    """The same of a lane vector, with bounds that are the same for all."""
    zero = sy.extension.splat(0.0)
    least = sy.extension.splat(low)
    most = sy.extension.splat(high)
    # What is not a number compares as false.
    number = (value <= zero) | (value > zero)
    value = sy.extension.select(number, value, zero)
    value = sy.extension.select(value < least, least, value)
    return sy.extension.select(value > most, most, value)
