"""What can be set of every solver where bodies touch or are joined."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

from ..scene import checks
from .base import Solver


@dataclass(frozen=True, kw_only=True)
class BodySettings(Solver):
    """Base of solvers that hold contacts of bodies; scenes without any take no notice of these settings.

    Args:
        slop: penetration [m] that is left alone.
        broad_phase: how what is near is found: "pairs" tries all, a "tree" of boxes follows what moves and needs no
            list of them; by the number of colliders by default.
        contacts: most contacts of a world; by the number of its pairs, but sixteen a body at most, by default. What
            is beyond sets a flag in ``world.health``, and the deepest are kept.
        rest_speed: what is slower [m/s and rad/s] is at rest.
        rest_time: for how long [s] all of an island must be at rest before it sleeps; None where nothing shall. What
            sleeps is where it would be awake within ``rest_speed`` times the time asleep, and wakes by itself.
    """

    slop: float = 1e-4
    broad_phase: Literal["pairs", "tree"] | None = None
    contacts: int | None = None
    rest_speed: float = 1e-6
    rest_time: float | None = 0.5

    def __post_init__(self) -> None:
        owner = type(self).__name__
        above = checks.Limit(above=0.0, remedy="Use 1e-4 for a tenth of a millimetre.")
        checks.number(owner, "slop", self.slop, above)
        if self.broad_phase not in (None, "pairs", "tree"):
            raise ValueError(
                f'{owner}: broad_phase is {self.broad_phase!r}; it must be "pairs", "tree" or None. Leave it out.'
            )
        if self.contacts is not None:
            checks.whole(owner, "contacts", self.contacts, least=1, remedy="Leave it out.")
        above = checks.Limit(above=0.0, remedy="Use 1e-6 for a micrometre per second.")
        checks.number(owner, "rest_speed", self.rest_speed, above)
        if self.rest_time is not None:
            limit = checks.Limit(least=0.0, remedy="Use 0.5, or None where nothing shall sleep.")
            checks.number(owner, "rest_time", self.rest_time, limit)

    @property
    def body_settings(self) -> dict[str, Any]:
        """These settings alone, by name."""
        return {own.name: getattr(self, own.name) for own in fields(BodySettings)}
