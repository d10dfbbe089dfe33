"""Measure the reference problems and draw their charts.

    python -m benchmarks.laboratory [NAME ...] [--quick | --redraw] [--output FOLDER]

Results go to benchmarks/results/charts, a JSON file and a picture per problem; without names all problems
are measured and an overview is drawn too.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from rich.console import Console

from benchmarks.run import use_one_core


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    use_one_core()
    # Imported now: numpy reads the number of its threads when it is first imported.
    record = import_module("benchmarks.record")
    problems = import_module("benchmarks.laboratory.problems")
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.laboratory", description="Chart cost against error."
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"any of {', '.join(problems.NAMES)}"
    )
    parser.add_argument(
        "--quick", action="store_true", help="show that all runs, in seconds; measures nothing"
    )
    parser.add_argument(
        "--redraw", action="store_true", help="draw again what was measured; measures nothing"
    )
    parser.add_argument("--output", type=Path, help="folder of the results")
    chosen = parser.parse_args(arguments)
    unknown = sorted(set(chosen.names) - set(problems.NAMES))
    if unknown:
        parser.error(f"no problem {', '.join(unknown)}: choose from {', '.join(problems.NAMES)}")
    output = chosen.output
    if output is None:
        home = record.ROOT / "runs" / "benchmarks" if chosen.quick else record.RESULTS
        output = home / "charts"
    run = import_module("benchmarks.laboratory.report").run
    console = Console()
    start = time.perf_counter()

    def announce(name: str) -> None:
        console.print(f"{time.perf_counter() - start:6.0f} s  {name}", highlight=False)

    names = tuple(dict.fromkeys(chosen.names)) or problems.NAMES
    run(
        names,
        quick=chosen.quick,
        output=output,
        announce=announce,
        overview=not chosen.names,
        redraw=chosen.redraw,
    )
    announce(f"done: {output}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
