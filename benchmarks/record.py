"""Timing that cancels the machine's load, and results that keep where they came from."""

from __future__ import annotations

import json
import os
import platform
import shlex
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "gymnasium",
    "mujoco",
    "drake",
    "pymunk",
    "stable-baselines3",
    "torch",
)


def provenance() -> dict[str, Any]:
    """What a result depends on: command, commit, machine, versions, date.

    Packages that are not installed are left out. `commit` ends in "+changes" when the working tree
    differs from it, and is null outside a repository.
    """
    return {
        "command": _command(),
        "commit": _commit(),
        "machine": {
            "cpu": _cpu_model(),
            "cpu_count": os.cpu_count(),
            "system": f"{platform.system()} {platform.machine()}",
        },
        "versions": {"python": platform.python_version(), **_versions()},
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def write(name: str, payload: Mapping[str, Any], *, directory: Path = RESULTS) -> Path:
    """Write `payload` with its provenance to `directory`/NAME.json and return the path.

    Arrays and numpy scalars may stand anywhere in the payload.

    Raises:
        ValueError: The payload holds NaN, infinity or the key "provenance".
        TypeError: The payload holds an object that JSON has no form for.
    """
    if "provenance" in payload:
        raise ValueError('The payload has the key "provenance", which `write` fills: rename it.')
    document = {"provenance": provenance(), **payload}
    text = json.dumps(document, indent=2, default=_plain, allow_nan=False)
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}.json"
    path.write_text(text + "\n", encoding="utf-8")
    return path


def interleave(
    functions: Mapping[str, Callable[[], object]],
    *,
    repeats: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, float]:
    """Median CPU time [s] of one call of each function.

    After one warm-up call of each (compilation, caches), the functions take turns (A B A B ...), so
    that whatever else the machine does falls on all of them alike and their ratios hold.

    Args:
        functions: What to time, by name. A call should last for milliseconds at least.
        repeats: Timed calls of each function.
        clock: CPU clock [s]; `time.thread_time` leaves out the process's other threads.
    """
    if repeats < 1:
        raise ValueError(f"repeats is {repeats}: at least 1 timed call is needed.")
    for function in functions.values():
        function()
    samples: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            start = clock()
            function()
            samples[name].append(clock() - start)
    return {name: statistics.median(times) for name, times in samples.items()}


def _command() -> str:
    """The command line as a reader would type it in the repository root."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    if spec is not None:
        program = f"python -m {spec.name.removesuffix('.__main__')}"
    else:
        script = Path(sys.argv[0])
        absolute = script.resolve()
        known = absolute.relative_to(ROOT) if absolute.is_relative_to(ROOT) else script.name
        program = f"python {known}" if sys.argv[0] not in ("", "-", "-c") else "python"
    return shlex.join([*program.split(), *sys.argv[1:]])


@cache
def _commit() -> str | None:
    """The commit when it is first asked for: results that are written later do not count as changes."""
    head = _git("rev-parse", "HEAD")
    if head is None:
        return None
    return f"{head}+changes" if _git("status", "--porcelain") else head


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _cpu_model() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _versions() -> dict[str, str]:
    found = {}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form: convert it to numbers first.")
