"""Run the benchmarks on one core and hold what they measure against the targets.

    python -m benchmarks.run [NAME ...] [--quick] [--output FOLDER]

Results go to benchmarks/results, those of a quick run to runs/benchmarks.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from benchmarks.figures import Figure

BENCHMARKS = (
    "against_mujoco",
    "bodies",
    "scaling",
    "environments",
    "links",
    "planar",
    "undeclared",
)


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the chosen benchmarks, then print what they measured."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.run", description="Measure speed and accuracy on one core."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join(BENCHMARKS)}")
    parser.add_argument(
        "--quick", action="store_true", help="show that all runs, in seconds; measures nothing"
    )
    parser.add_argument("--output", type=Path, help="folder of the results")
    chosen = parser.parse_args(arguments)
    unknown = sorted(set(chosen.names) - set(BENCHMARKS))
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}: choose from {', '.join(BENCHMARKS)}")
    names = tuple(dict.fromkeys(chosen.names)) or BENCHMARKS
    use_one_core()
    # Imported now: numpy reads the number of its threads when it is first imported.
    record = import_module("benchmarks.record")
    modules = {name: import_module(f"benchmarks.{name}") for name in names}
    output = chosen.output
    if output is None:
        output = record.ROOT / "runs" / "benchmarks" if chosen.quick else record.RESULTS
    output.mkdir(parents=True, exist_ok=True)

    console = Console()
    figures: dict[str, list[Figure]] = {}
    with Progress(
        TextColumn("{task.description:<45}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        # Redrawn at the stages only: a thread that draws would count into the CPU time.
        auto_refresh=False,
    ) as progress:
        task = progress.add_task("", total=sum(len(module.STAGES) for module in modules.values()))
        done = 0
        for name, module in modules.items():

            def announce(stage: str, name: str = name) -> None:
                nonlocal done
                progress.update(task, description=f"{name}: {stage}", completed=done, refresh=True)
                done += 1

            figures[name] = module.run(quick=chosen.quick, output=output, announce=announce)
        progress.update(task, description="done", completed=done, refresh=True)
    console.print(table(figures, quick=chosen.quick))
    console.print(f"Results and charts: {output}")
    return 0


def use_one_core() -> None:
    """Keep this process, those it starts and the threads of libraries on one core."""
    os.environ.update(dict.fromkeys(THREADS, "1"))
    # Charts go to files and environments to memory: no window is opened.
    os.environ.update(MPLBACKEND="Agg", SDL_VIDEODRIVER="dummy")
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def table(figures: Mapping[str, Sequence[Figure]], *, quick: bool) -> Table:
    """All figures, those with a target in colour."""
    title = "Quick run: shows that all runs, measures nothing" if quick else "Measured on one core"
    made = Table(title=title)
    for column in ("benchmark", "figure"):
        made.add_column(column)
    for column in ("measured", "target", "met"):
        made.add_column(column, justify="right", no_wrap=True)
    for name, found in figures.items():
        made.add_section()
        for row, figure in enumerate(found):
            style, met = {True: ("green", "yes"), False: ("red", "no"), None: ("", "")}[figure.met]
            made.add_row(
                name if row == 0 else "",
                figure.name,
                f"{figure.measured:.3g} {figure.unit}",
                figure.target,
                met,
                style=style,
            )
    return made


if __name__ == "__main__":
    raise SystemExit(main())
