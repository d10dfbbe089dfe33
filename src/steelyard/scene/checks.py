"""Refusals: every bad value is named with its limit and the remedy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Vector = Sequence[float] | np.ndarray


def number(
    owner: str,
    name: str,
    value: Any,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    remedy: str,
) -> float:
    """``value`` as a finite float within its limits.

    Raises:
        ValueError: the value is not a number, not finite or out of its limits.
    """
    limits = [
        f"greater than {above:g}" if above is not None else "",
        f"at least {least:g}" if least is not None else "",
        f"at most {most:g}" if most is not None else "",
    ]
    limit = " and ".join(["finite", *filter(None, limits)])
    try:
        result = float(value)
    except (TypeError, ValueError):
        result = math.nan
    good = (
        math.isfinite(result)
        and (above is None or result > above)
        and (least is None or result >= least)
        and (most is None or result <= most)
    )
    if not good:
        raise ValueError(f"{owner}: {name} is {value!r}; it must be {limit}. {remedy}")
    return result


def vector(owner: str, name: str, value: Any) -> tuple[float, float, float]:
    """``value`` as three finite floats.

    Raises:
        ValueError: not three numbers, or one of them is not finite.
    """
    try:
        result = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        result = np.empty(0)
    if result.shape != (3,) or not np.isfinite(result).all():
        raise ValueError(
            f"{owner}: {name} is {value!r}; it must be three finite numbers (x, y, z). "
            "Give a sequence of three floats in SI units, y up."
        )
    x, y, z = result.tolist()
    return x, y, z
