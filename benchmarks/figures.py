"""What a benchmark reports: figures, and the targets that some of them are held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

#: Called with a stage's name when a benchmark begins it.
Announce = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One measured number, with its target if it has one.

    Attributes:
        name: What was measured.
        measured: The number.
        unit: Its unit; "x" for a ratio.
        at_least: Smallest value that meets the target.
        at_most: Largest value that meets the target.
    """

    name: str
    measured: float
    unit: str = "x"
    at_least: float | None = None
    at_most: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None where there is none."""
        if self.at_least is None and self.at_most is None:
            return None
        above = self.at_least is None or self.measured >= self.at_least
        below = self.at_most is None or self.measured <= self.at_most
        return above and below

    @property
    def target(self) -> str:
        """The target in words; empty where there is none."""
        if self.at_least is not None:
            return f">= {self.at_least:g} {self.unit}"
        return f"<= {self.at_most:g} {self.unit}" if self.at_most is not None else ""

    def record(self) -> dict[str, Any]:
        """Plain values for a results file."""
        return {**asdict(self), "met": self.met}
