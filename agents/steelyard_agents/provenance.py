"""Where a result comes from: the command, the commit, the machine and the versions behind it."""

import datetime
import importlib.metadata
import json
import os
import platform
import shlex
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

PACKAGES = (
    "steelyard",
    "numpy",
    "numba",
    "gymnasium",
    "stable-baselines3",
    "torch",
)


def provenance(module: str, arguments: Sequence[str]) -> dict[str, Any]:
    """Return what is needed to reproduce a result of `python -m module arguments`."""
    return {
        "command": shlex.join(["python", "-m", module, *arguments]),
        "commit": commit(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "versions": versions(),
    }


def commit() -> str | None:
    """Return the commit of this source tree, with `-dirty` if its sources differ from it.

    None where the package does not run from a git checkout. Results are left out of the
    comparison: writing one must not make the next one dirty.
    """
    source = Path(__file__).resolve()
    # An installed copy may lie inside somebody else's repository, whose commit says nothing.
    if _git(source.parent, "ls-files", "--error-unmatch", source.name) is None:
        return None
    head = _git(source.parent, "rev-parse", "HEAD")
    if head is None:
        return None
    sources = (":(top)src", ":(top)envs", ":(top)agents/steelyard_agents")
    return f"{head}-dirty" if _git(source.parent, "status", "--porcelain", "--", *sources) else head


def _git(folder: Path, *arguments: str) -> str | None:
    """Return what git prints, or None if there is no git or it fails."""
    try:
        finished = subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return finished.stdout.strip()


def machine() -> dict[str, Any]:
    """Return the processor, the cores this process may use, and the operating system."""
    affinity = getattr(os, "sched_getaffinity", None)
    return {
        "processor": _processor(),
        "cores": len(affinity(0)) if affinity else os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results depend on."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def write_json(path: Path, record: dict[str, Any]) -> None:
    """Write `record` to `path` for people to read, making the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n")
