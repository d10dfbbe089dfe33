"""Draw the failure maps and hold them against the theory.

    python -m benchmarks.failure_map [NAME ...] [--quick] [--output FOLDER]

Results go to benchmarks/results/failure_map, those of a quick run to runs/failure_map.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from benchmarks.run import table, use_one_core

MAPS = ("springs", "chains", "iterations", "bodies")


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the chosen maps, then print what they measured."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.failure_map", description="Draw where methods fail."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"any of {', '.join(MAPS)}")
    parser.add_argument("--quick", action="store_true", help="show that all runs, in seconds")
    parser.add_argument("--output", type=Path, help="folder of the results")
    chosen = parser.parse_args(arguments)
    unknown = sorted(set(chosen.names) - set(MAPS))
    if unknown:
        parser.error(f"no map {', '.join(unknown)}: choose from {', '.join(MAPS)}")
    names = tuple(dict.fromkeys(chosen.names)) or MAPS
    use_one_core()
    # Imported now: numpy reads the number of its threads when it is first imported.
    record = import_module("benchmarks.record")
    output = chosen.output
    if output is None:
        base = record.ROOT / "runs" if chosen.quick else record.RESULTS
        output = base / "failure_map"
    output.mkdir(parents=True, exist_ok=True)
    found = {}
    for name in names:
        start = time.perf_counter()
        found[name] = import_module(f"benchmarks.failure_map.{name}").run(
            quick=chosen.quick, output=output
        )
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
    from rich.console import Console

    Console().print(table(found, quick=chosen.quick))
    print(f"Maps: {output}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
