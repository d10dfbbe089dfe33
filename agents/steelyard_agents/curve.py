"""Record the learning curve of a training run, and draw it."""

import csv
import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import EngFormatter, MaxNLocator, PercentFormatter
from stable_baselines3.common.callbacks import BaseCallback

POINTS = 200

BLUE = "#0b62a4"
LEVEL_LINES: tuple[dict[str, Any], ...] = (
    {"color": "#888888", "linestyle": ":"},
    {"color": "#d1661a", "linestyle": "--"},
    {"color": "#3a8a3a", "linestyle": "-."},
)


@dataclass(frozen=True)
class CurvePoint:
    """The episodes that ended in one stretch of training.

    Attributes:
        timesteps: Environment steps at the end of the stretch, over all rows.
        wall_time: Seconds since training began, at the end of the stretch.
        episodes: Number of episodes that ended.
        return_mean: Their mean return, in the environment's own rewards.
        length_mean: Their mean length in steps.
        success_rate: The part of them that succeeded; None where that is not reported.
    """

    timesteps: int
    wall_time: float
    episodes: int
    return_mean: float
    length_mean: float
    success_rate: float | None


class LearningCurve(BaseCallback):
    """Gather the finished episodes of a training run into about `POINTS` points.

    A stretch in which no episode ended gives no point: its episodes count in the next one.

    Attributes:
        points: The points so far, in order.
    """

    def __init__(self) -> None:
        super().__init__()
        self.points: list[CurvePoint] = []

    def _on_training_start(self) -> None:
        self._interval = self.locals["total_timesteps"] / POINTS
        self._next = self._interval
        self._start = time.perf_counter()
        self._finished: list[tuple[float, int, bool | None]] = []

    def _on_step(self) -> bool:
        infos = self.locals["infos"]
        for row in np.flatnonzero(self.locals["dones"]):
            episode, success = infos[row]["episode"], infos[row].get("is_success")
            self._finished.append((episode["r"], episode["l"], success))
        if self.num_timesteps >= self._next:
            self._close_stretch()
            self._next = self.num_timesteps + self._interval
        return True

    def _on_training_end(self) -> None:
        self._close_stretch()

    def _close_stretch(self) -> None:
        if not self._finished:
            return
        returns, lengths, successes = zip(*self._finished, strict=True)
        known = [success for success in successes if success is not None]
        self.points.append(
            CurvePoint(
                timesteps=self.num_timesteps,
                wall_time=round(time.perf_counter() - self._start, 3),
                episodes=len(returns),
                return_mean=float(np.mean(returns)),
                length_mean=float(np.mean(lengths)),
                success_rate=float(np.mean(known)) if known else None,
            )
        )
        self._finished.clear()


def write_csv(path: Path, points: Sequence[CurvePoint]) -> None:
    """Write one line per point, under the names of `CurvePoint`; an unknown value is empty."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(field.name for field in dataclasses.fields(CurvePoint))
        writer.writerows(dataclasses.astuple(point) for point in points)


def draw(
    path: Path,
    points: Sequence[CurvePoint],
    *,
    title: str,
    references: Mapping[str, Mapping[str, Any]],
) -> None:
    """Draw return and success rate against steps (below) and wall time (above) as a PNG.

    Args:
        path: File to write.
        points: The learning curve; at least one point.
        title: Stands above the chart.
        references: Scores to draw as level lines, by name, as `Evaluation.summary` gives them.
    """
    steps = np.array([point.timesteps for point in points], dtype=float)
    weights = np.array([point.episodes for point in points], dtype=float)
    panels = [("mean episode return", "return_mean")]
    if all(point.success_rate is not None for point in points):
        panels.append(("success rate", "success_rate"))

    # A Figure of its own, without pyplot, needs no display and leaves no global state behind.
    layout = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.08)
    figure = Figure(figsize=(8.0, 1.6 + 2.2 * len(panels)), dpi=150, layout=layout)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, fontweight="bold")
    for axis, (label, name) in zip(axes, panels, strict=True):
        values = np.array([getattr(point, name) for point in points], dtype=float)
        axis.plot(steps, values, color=BLUE, linewidth=0.8, alpha=0.35, label="in training, raw")
        axis.plot(steps, smooth(values, weights), color=BLUE, linewidth=2.2, label="smoothed")
        for reference, look in zip(references, LEVEL_LINES, strict=False):
            level = references[reference].get(name)
            if level is not None:
                axis.axhline(level, linewidth=1.4, label=reference, zorder=1.5, **look)
        axis.set_ylabel(label)
        axis.grid(color="#e4e4e4", linewidth=0.6)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].margins(y=0.06)
    if len(panels) == 2:
        axes[1].set_ylim(-0.04, 1.04)
        axes[1].yaxis.set_major_formatter(PercentFormatter(1.0))
    axes[-1].set_xlim(0.0, steps[-1])
    axes[-1].xaxis.set_major_formatter(EngFormatter(sep=""))
    axes[-1].set_xlabel("environment steps")
    figure.align_ylabels(axes)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)

    seconds = np.array([point.wall_time for point in points])
    ticks = MaxNLocator(nbins=8).tick_values(0.0, seconds[-1])
    positions = np.interp(ticks, np.append(0.0, seconds), np.append(0.0, steps))
    # Where training was slow the ticks crowd: leave out those without room for a label.
    clear = (ticks <= seconds[-1]) & (np.diff(positions, prepend=-steps[-1]) > 0.05 * steps[-1])
    clock = axes[0].secondary_xaxis("top")
    clock.set_xticks(positions[clear], [f"{tick:g}" for tick in ticks[clear]])
    clock.set_xlabel("wall time [s]")
    figure.savefig(path)


def smooth(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the centred moving average over a tenth of the points, weighted, shape (points,)."""
    kernel = np.ones(2 * (values.size // 20) + 1)
    return np.convolve(values * weights, kernel, "same") / np.convolve(weights, kernel, "same")
