"""Observations stay within their bounds, whatever the physics does."""

from __future__ import annotations

import steelyard as sy


@sy.inner
def clip(value, low, high):
    """``value`` within bounds, 0 if it is not a number."""
    return min(max(value if value == value else 0.0, low), high)
