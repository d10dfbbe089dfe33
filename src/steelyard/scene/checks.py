"""Refusals: every bad value is named with its limit and the remedy.

A kind of thing states what its numbers must be once, in its table ``LIMITS``; its constructor and
an assignment to it in a world both check by that table.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Vector = Sequence[float] | np.ndarray


def floats(value: Any) -> np.ndarray | None:
    """``value`` as an array of float64; None where it is not made of real numbers."""
    try:
        given = np.asarray(value)
    except ValueError:  # sequences of different lengths
        return None
    return given.astype(np.float64, copy=False) if given.dtype.kind in "biuf" else None


def described(value: Any) -> str:
    """What a function returned, in words: its shape where it is an array, else itself."""
    given = floats(value)
    return repr(value) if given is None else f"an array of shape {given.shape}"


def _refuse_first(
    owner: str, name: str, value: np.ndarray, bad: np.ndarray, limit: str, remedy: str
) -> None:
    """Raise for the first world in which ``value`` (size,) or (size, worlds) is ``bad``.

    ``bad`` is of the shape of ``value``, or has one row where a rule is for all numbers together.
    """
    if not bad.any():
        return
    columns = value.reshape(len(value), -1)
    wrong = bad.reshape(len(bad), -1)
    world = int(wrong.any(axis=0).argmax())
    where = f" in world {world}" if value.ndim == 2 else ""
    numbers = columns[:, world].tolist()
    together = len(wrong) < len(numbers)
    shown = tuple(numbers) if together else numbers[int(wrong[:, world].argmax())]
    raise ValueError(f"{owner}: {name} is {shown}{where}; it must be {limit}. {remedy}")


@dataclass(frozen=True, kw_only=True)
class Rule:
    """What the numbers under a name must be: finite, and whatever a kind of rule adds.

    Args:
        remedy: what to do where they are not.
    """

    remedy: str = "Give SI units."

    def check(self, owner: str, name: str, value: np.ndarray) -> np.ndarray:
        """``value``, of shape (size,) if shared and (size, worlds) if per world, as it is stored.

        Raises:
            ValueError: the rule does not hold.
        """
        _refuse_first(owner, name, value, ~np.isfinite(value), "finite", self.remedy)
        return value


@dataclass(frozen=True, kw_only=True)
class Limit(Rule):
    """Numbers within bounds.

    Args:
        above: bound that they must exceed.
        least: smallest that is allowed.
        most: largest that is allowed.
        invertible: whether the inverse of each but 0 must be finite too.
        infinite: whether they may be infinite.
    """

    above: float | None = None
    least: float | None = None
    most: float | None = None
    invertible: bool = False
    infinite: bool = False

    def __str__(self) -> str:
        if self.most is not None:
            low = f"({self.above:g}" if self.least is None else f"[{self.least:g}"
            bounds = f"in {low}, {self.most:g}]"
        elif self.above is not None:
            bounds = f"greater than {self.above:g}"
        else:
            bounds = f"at least {self.least:g}" if self.least is not None else ""
        inverse = "of finite inverse" if self.invertible else ""
        first = "a number" if self.infinite else "finite"
        return " and ".join(filter(None, [first, bounds, inverse]))

    def broken(self, value: np.ndarray) -> np.ndarray:
        """Where the limit does not hold, of the shape of ``value``."""
        good = ~np.isnan(value) if self.infinite else np.isfinite(value)
        if self.above is not None:
            good = good & (value > self.above)
        if self.least is not None:
            good = good & (value >= self.least)
        if self.most is not None:
            good = good & (value <= self.most)
        if self.invertible:
            good = good & ((value == 0.0) | (np.abs(value) > 1.0 / np.finfo(np.float64).max))
        return ~good

    def check(self, owner: str, name: str, value: np.ndarray) -> np.ndarray:
        """See ``Rule``."""
        _refuse_first(owner, name, value, self.broken(value), str(self), self.remedy)
        return value


@dataclass(frozen=True, kw_only=True)
class Direction(Rule):
    """Three numbers that are not all 0, stored as a unit vector."""

    def check(self, owner: str, name: str, value: np.ndarray) -> np.ndarray:
        """See ``Rule``."""
        with np.errstate(over="ignore", invalid="ignore"):
            size = np.linalg.norm(value, axis=0, keepdims=True)
        bad = ~(np.isfinite(size) & (size > 0.0))
        limit = "finite and of a length greater than 0"
        _refuse_first(owner, name, value, bad, limit, self.remedy)
        return value / size


@dataclass(frozen=True, kw_only=True)
class Total(Rule):
    """Numbers with a given sum, up to rounding.

    Args:
        total: the sum.
    """

    total: float

    def check(self, owner: str, name: str, value: np.ndarray) -> np.ndarray:
        """See ``Rule``."""
        with np.errstate(over="ignore", invalid="ignore"):
            error = np.abs(value.sum(axis=0, keepdims=True) - self.total)
            largest = np.abs(value).max(axis=0, keepdims=True)
            bad = ~(error < 1e-9 * np.maximum(1.0, largest)) | ~np.isfinite(largest)
        if bad.any():
            limit = f"finite numbers with sum {self.total:g}, one per deck particle"
            _refuse_first(owner, name, value, bad, limit, self.remedy)
        return value


FINITE = Rule()


def number(owner: str, name: str, value: Any, limit: Limit | None = None, **bounds: Any) -> float:
    """``value`` as a float within its limit, or within ``bounds`` as ``Limit`` takes them.

    Raises:
        ValueError: the value is not a number, not finite or out of its limit.
    """
    limit = Limit(**bounds) if limit is None else limit
    given = floats(value)
    if given is None or given.shape != () or limit.broken(given):
        raise ValueError(f"{owner}: {name} is {value!r}; it must be {limit}. {limit.remedy}")
    return float(given)


def numbers(thing: Any, *names: str) -> None:
    """Make attributes of a thing floats within the limits of its kind.

    Raises:
        ValueError: see ``number``.
    """
    kind = type(thing)
    for name in names:
        setattr(thing, name, number(kind.__name__, name, getattr(thing, name), kind.LIMITS[name]))


def whole(owner: str, name: str, value: Any, *, least: int, remedy: str) -> int:
    """``value`` as a whole number of at least ``least``.

    Raises:
        ValueError: it is not.
    """
    try:
        result = operator.index(value)
    except TypeError:
        result = least - 1
    if result < least:
        raise ValueError(
            f"{owner}: {name} is {value!r}; it must be a whole number of at least {least}. {remedy}"
        )
    return result


def instance(owner: str, name: str, value: Any, kind: type, *, remedy: str) -> None:
    """Make sure that ``value`` is of a kind.

    Raises:
        TypeError: it is not.
    """
    if not isinstance(value, kind):
        raise TypeError(
            f"{owner}: {name} is {value!r}; it must be of type {kind.__name__}. {remedy}"
        )


def mask(owner: str, value: Any, *, worlds: int) -> np.ndarray:
    """``value`` as an array of shape (worlds,) bool.

    Raises:
        ValueError: it has another shape or type.
    """
    given = np.asarray(value)
    if given.shape != (worlds,) or given.dtype != np.bool_:
        raise ValueError(
            f"{owner}: mask is of shape {given.shape} and type {given.dtype}; it must be of shape "
            f"{(worlds,)} and type bool. Give True or False for each world."
        )
    return given


def vector(owner: str, name: str, value: Any) -> tuple[float, float, float]:
    """``value`` as three finite floats.

    Raises:
        ValueError: not three numbers, or one of them is not finite.
    """
    result = floats(value)
    if result is None or result.shape != (3,) or not np.isfinite(result).all():
        raise ValueError(
            f"{owner}: {name} is {value!r}; it must be three finite numbers (x, y, z). "
            "Give a sequence of three floats in SI units, y up."
        )
    x, y, z = result.tolist()
    return x, y, z


def quaternion(owner: str, name: str, value: Any) -> tuple[float, float, float, float]:
    """``value`` as a unit quaternion (w, x, y, z).

    Raises:
        ValueError: not four finite numbers, or all of them 0.
    """
    given = floats(value)
    if given is None or given.shape != (4,) or not np.isfinite(given).all() or not given.any():
        raise ValueError(
            f"{owner}: {name} is {value!r}; it must be four finite numbers (w, x, y, z), not all 0. Use "
            "(1, 0, 0, 0) for no turn, or (cos a/2, sin a/2 times the axis) for one by a."
        )
    w, x, y, z = (
        given / np.linalg.norm(given / np.abs(given).max()) / np.abs(given).max()
    ).tolist()
    return w, x, y, z


#: Names under which things hold vectors.
VECTORS = (
    "position", "velocity", "acceleration", "gravity", "anchor", "normal", "start", "end", "wind",
)  # fmt: skip


def in_plane(owner: str, name: str, value: np.ndarray) -> None:
    """Refuse vectors, (3 n,) or (3 n, worlds), with a part across the plane of a planar scene."""
    across = np.asarray(value, dtype=np.float64)[2::3]
    remedy = "Move it into the plane, or use a Scene that is not planar."
    # What is not a number is flagged elsewhere, world by world.
    bad = (across != 0.0) & ~np.isnan(across)
    _refuse_first(owner, f"{name} along z", across, bad, "0 in a planar scene", remedy)


def vectors(thing: Any, *names: str) -> None:
    """Make attributes of a thing tuples of three finite floats.

    Raises:
        ValueError: see ``vector``.
    """
    for name in names:
        setattr(thing, name, vector(type(thing).__name__, name, getattr(thing, name)))


def fitted(owner: str, name: str, value: Any, *, size: int, worlds: int) -> np.ndarray:
    """A copy of an assigned value as it is stored: (size,) if shared, (size, worlds) if per world.

    Raises:
        ValueError: not numbers, or not of a shape that can be assigned.
    """
    given = floats(value)
    each = (worlds,) if size == 1 else (worlds, size)
    if given is None or given.shape not in [(), (size,), (worlds, size), each]:
        shown = repr(value) if given is None else f"of shape {given.shape}"
        shared = "one number" if size == 1 else f"numbers of shape {(size,)}"
        raise ValueError(
            f"{owner}: {name} is {shown}; it must be {shared} for all worlds, or of shape {each} "
            "for each its own. Give it one of these shapes."
        )
    if given.ndim == 2 or (given.shape == each and worlds > 1):
        return np.array(given.reshape(worlds, size).T, order="C")
    return np.array(np.broadcast_to(given, (size,)))
