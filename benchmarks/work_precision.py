"""Work-precision diagrams: cost against error, a curve per method, a point per step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from benchmarks.cases import Score

OWN_COLOURS = ("#1b7837", "#d95f02", "#5e3c99")
PEER_COLOURS = ("#9ecae1", "#2171b5", "#08306b", "#fcae91", "#ef3b2c", "#99000d")


@dataclass(frozen=True, kw_only=True)
class Point:
    """One method at one step.

    Attributes:
        method: Its name.
        dt: Step [s].
        mode: "batch": all worlds, a call per stretch; else what differs.
        score: Errors of world 0.
        per_second: CPU time per simulated second and world [us].
        own_limit: Distances [m], by rms and at most, from the method's own motion at small steps.
        peer: Whether it is another engine.
    """

    method: str
    dt: float
    mode: str
    score: Score
    per_second: float
    own_limit: tuple[float, float]
    peer: bool

    @property
    def per_step(self) -> float:
        """CPU time per step and world [us]."""
        return self.per_second * self.dt

    def record(self) -> dict[str, Any]:
        """Plain values for a results file."""
        return {**asdict(self), "per_step": self.per_step}


def draw(points: Mapping[str, Sequence[Point]], path: Path, *, title: str, dt: float) -> None:
    """One panel per scene; points at `dt` [s] are marked large."""
    figure, panels = plt.subplots(1, len(points), figsize=(5.0 * len(points), 6.2), squeeze=False)
    for panel, (name, found) in zip(panels[0], points.items(), strict=True):
        _draw_panel(panel, found, dt)
        panel.set_title(name)
    panels[0][0].set_ylabel("CPU time per simulated second and world [µs]")
    figure.suptitle(title)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_panel(panel: Axes, points: Sequence[Point], dt: float) -> None:
    colours = {True: iter(PEER_COLOURS), False: iter(OWN_COLOURS)}
    for method in dict.fromkeys(point.method for point in points):
        curve = sorted((p for p in points if p.method == method), key=lambda point: point.dt)
        peer = curve[0].peer
        colour = next(colours[peer])
        sizes = [70.0 if abs(point.dt - dt) < 1e-9 else 18.0 for point in curve]
        # An exact method may have no error at all, which has no place on a logarithmic axis.
        x = [max(point.score.rms, 1e-16) for point in curve]
        y = [point.per_second for point in curve]
        style, mark = ("--", "s") if peer else ("-", "o")
        panel.plot(x, y, style, color=colour, linewidth=1.3, label=method)
        panel.scatter(x, y, s=sizes, color=colour, marker=mark, zorder=3)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("error, rms over the particles [m]")
    panel.grid(True, which="major", alpha=0.3)
    # Below the panel: inside, it would cover curves.
    panel.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, frameon=False
    )
