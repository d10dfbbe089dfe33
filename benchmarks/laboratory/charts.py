"""Work-precision diagrams: cost against error, a curve per method, a point per step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

import steelyard as sy
from benchmarks.laboratory.measurement import Point, curves, order
from benchmarks.laboratory.problem import Problem

# Okabe and Ito's colours, which colour-blind readers tell apart, without black and yellow.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A4B9A")
MARKS = ("o", "^", "D", "v", "P", "X")
PEER_COLOURS = ("#000000", "#555555", "#999999")
PEER_MARKS = ("s", "*", "h", "<")
#: Of a peer's line, one for each engine: what one makes with several settings is then seen to be one's.
PEER_LINES = ("--", "-.", ":")
#: Errors are drawn within these bounds: below all is rounding, above it is another motion.
SHOWN = (1e-16, 1.0)
FRAME = 1.0 / 60.0

Measured = Mapping[str, tuple[Problem, Sequence[Point]]]


def draw(measured: Measured, path: Path, *, title: str, note: str) -> None:
    """A row per variant of a problem, a column per measure."""
    names = list(
        dict.fromkeys(measure.name for p, _ in measured.values() for measure in p.measures)
    )
    styles = _styles(measured)
    rows = len(measured)
    height = 3.6 * rows + 0.9
    figure, panels = plt.subplots(
        rows, len(names), figsize=(4.3 * len(names) + 3.6, height), squeeze=False
    )
    for row, (variant, (problem, points)) in zip(panels, measured.items(), strict=True):
        units = {measure.name: measure.unit for measure in problem.measures}
        for column, (panel, name) in enumerate(zip(row, names, strict=True)):
            if name not in units:
                panel.axis("off")
                continue
            _draw_panel(panel, points, styles, lambda p, name=name: p.errors[name])
            panel.set_xlabel(f"error of the {name} [{units[name]}]")
            if column == 0:
                panel.set_ylabel("CPU time per simulated\nsecond and world [µs]")
                panel.set_title(variant, loc="left", fontsize=10)
        handles = []
        followed = [point for point in points if point.worst <= SHOWN[1]]
        for name, curve in curves(followed).items():
            slope = order(curve)
            handles.append(
                _handle(styles[name], name if slope is None else f"{name}  ({slope:.1f})")
            )
        handles += [_handle(("none", "", "", False), line) for line in _failures(points)]
        row[-1].legend(
            handles=handles,
            title="method (measured order)",
            fontsize=8,
            title_fontsize=8,
            loc="center left",
            bbox_to_anchor=(1.02, 0.5),
            frameon=False,
            handlelength=3.0,
        )
    figure.suptitle(title, x=0.01, y=1.0 - 0.15 / height, ha="left", va="top")
    figure.text(0.01, 0.08 / height, note, fontsize=8, color="#444444", va="bottom")
    figure.tight_layout(rect=(0.0, 0.25 / height, 1.0, 1.0))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def overview(measured: Measured, path: Path, *, title: str, note: str) -> None:
    """All problems on one page, each method by its worst error."""
    styles = _styles(measured)
    columns = 4
    rows = -(-len(measured) // columns)
    height = 3.1 * rows + 2.0
    figure, panels = plt.subplots(rows, columns, figsize=(4.2 * columns, height), squeeze=False)
    for panel in panels.ravel()[len(measured) :]:
        panel.axis("off")
    for panel, (variant, (_, points)) in zip(panels.ravel(), measured.items(), strict=False):
        _draw_panel(panel, points, styles, lambda p: p.worst)
        panel.set_title(variant, loc="left", fontsize=9)
    for panel in panels[:, 0]:
        panel.set_ylabel("µs per second and world", fontsize=8)
    for panel in panels[-1]:
        panel.set_xlabel("worst error [m, share]", fontsize=8)
    used = dict.fromkeys(name for _, points in measured.values() for name in curves(points))
    # What several problems share has a line of the legend; peers of one problem are in its own chart.
    handles = [_handle(styles[name], name) for name in used if styles[name][3]]
    handles.append(_handle(("#555555", "s", "--", False), "peers (see each problem's chart)"))
    figure.suptitle(title, x=0.01, y=1.0 - 0.15 / height, ha="left", va="top")
    figure.text(0.01, 0.08 / height, note, fontsize=8, color="#444444", va="bottom")
    columns = 4
    lines = -(-len(handles) // columns)
    figure.tight_layout(rect=(0.0, (0.5 + 0.2 * lines) / height, 1.0, 1.0))
    figure.legend(
        handles=handles,
        loc="lower left",
        ncols=columns,
        fontsize=9,
        frameon=False,
        bbox_to_anchor=(0.005, 0.3 / height),
    )
    figure.savefig(path, dpi=100)
    plt.close(figure)


Style = tuple[str, str, str, bool]


def _styles(measured: Measured) -> dict[str, Style]:
    """Colour, mark, line and whether it is ours, by name; a method looks the same in every chart."""
    listed = [entry.name for entry in sy.CANDIDATES]
    found: dict[str, Style] = {}
    peers = 0
    engines: list[str] = []
    forms = 0
    for _, points in measured.values():
        for point in points:
            name = point.method
            if name in found:
                continue
            if point.peer:
                colour = PEER_COLOURS[peers % len(PEER_COLOURS)]
                mark = PEER_MARKS[peers % len(PEER_MARKS)]
                engine = name.split()[0]
                if engine not in engines:
                    engines.append(engine)
                line = PEER_LINES[engines.index(engine) % len(PEER_LINES)]
                found[name] = (colour, mark, line, False)
                peers += 1
            elif name in listed:
                k = listed.index(name)
                found[name] = (
                    COLOURS[k % len(COLOURS)], MARKS[(k + k // len(COLOURS)) % len(MARKS)], "-", True
                )  # fmt: skip
            else:
                colour = COLOURS[(3 + forms) % len(COLOURS)]
                found[name] = (colour, MARKS[-1 - forms % len(MARKS)], ":", True)
                forms += 1
    return found


def _handle(style: Style, label: str) -> Line2D:
    colour, mark, line, _ = style
    return Line2D([], [], color=colour, marker=mark, linestyle=line, markersize=5, label=label)


def _failures(points: Sequence[Point]) -> list[str]:
    """What has no curve, since it never follows the motion."""
    followed = {point.method for point in points if point.worst <= SHOWN[1]}
    failed = dict.fromkeys(point.method for point in points if point.method not in followed)
    return [f"{name}: lost at every step" for name in failed]


def _draw_panel(
    panel: Axes,
    points: Sequence[Point],
    styles: Mapping[str, Style],
    error: Callable[[Point], float],
) -> None:
    # A motion that is lost is another one: its cost says nothing.
    points = [point for point in points if point.worst <= SHOWN[1]]
    for name, curve in curves(points).items():
        colour, mark, line, _ = styles[name]
        x = np.clip([error(point) for point in curve], *SHOWN)
        y = [point.per_second for point in curve]
        sizes = [60.0 if abs(point.dt / FRAME - 1.0) < 0.3 else 16.0 for point in curve]
        panel.plot(x, y, line, color=colour, linewidth=1.2, alpha=0.9)
        panel.scatter(x, y, s=sizes, color=colour, marker=mark, zorder=3, linewidths=0.0)
    for point in points:
        if point.per_second is not None and not point.peer and point.worlds == 1:
            colour, mark, _, _ = styles[point.method]
            x = np.clip(error(point), *SHOWN)
            panel.scatter(
                x,
                point.per_second,
                s=30,
                facecolors="none",
                edgecolors=colour,
                marker=mark,
                zorder=4,
            )
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.xaxis.set_major_locator(LogLocator(numticks=8))
    panel.yaxis.set_major_locator(LogLocator(numticks=8))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.yaxis.set_minor_formatter(NullFormatter())
    # At least so many decades: what hardly changes shall look so.
    for decades, limits, widen in (
        (3.0, panel.get_xlim(), panel.set_xlim),
        (2.0, panel.get_ylim(), panel.set_ylim),
    ):
        wider = max(0.5 * (decades - np.log10(limits[1] / limits[0])), 0.0)
        widen(limits[0] * 10.0**-wider, limits[1] * 10.0**wider)
    panel.tick_params(labelsize=8)
    panel.grid(True, which="major", alpha=0.25)
