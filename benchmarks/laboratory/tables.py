"""What the charts say in numbers: the tables of docs/accuracy.md, made from the results.

    python -m benchmarks.laboratory.tables

writes them anew between the page's markers; a full run of the laboratory does so too.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from benchmarks import record
from benchmarks.laboratory import problems

PAGE = record.ROOT / "docs" / "accuracy.md"
CHARTS = record.RESULTS / "charts"
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)


def cheapest(directory: Path = CHARTS) -> str:
    """The cheapest method for each problem and tolerance, and what the cheapest peer costs in turn."""
    lines = [
        "| problem | " + " | ".join(f"{tolerance:.0e}" for tolerance in TOLERANCES) + " |",
        "|---" * (len(TOLERANCES) + 1) + "|",
    ]
    for document in _documents(directory):
        for variant, found in document["variants"].items():
            rows = found["by_tolerance"]
            cells = [
                _cell([row for row in rows if abs(row["tolerance"] / tolerance - 1.0) < 1e-6])
                for tolerance in TOLERANCES
            ]
            lines.append(f"| {variant} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def origin(directory: Path = CHARTS) -> str:
    """Where the figures come from."""
    found = {
        json.dumps({key: value for key, value in document["provenance"].items() if key != "date"})
        for document in _documents(directory)
    }
    lines = []
    for text in sorted(found):
        made = json.loads(text)
        versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
        lines.append(
            f"`{made['command']}`, commit {(made['commit'] or 'none')[:12]}"
            f"{' with changes' if '+' in (made['commit'] or '') else ''}, one core of "
            f"{made['machine']['cpu']}, {versions}."
        )
    return "\n".join(lines)


def _documents(directory: Path) -> list[dict[str, Any]]:
    paths = [directory / f"{name}.json" for name in problems.NAMES]
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths if path.exists()]


def _cell(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return "none"
    row = rows[0]
    peer = row["peer"] and _named(row["peer"])
    if row["ours"] is None:
        return f"**only {peer}**"
    ours = _named(row["ours"])
    if peer is None:
        return f"{ours}; no peer"
    if row["ratio"] < 1.0:
        return f"{ours}; **{peer} wins: {row['ratio']:.2g}x**"
    return f"{ours}; {row['peer']['method']} {_number(row['ratio'])}x"


def _named(point: dict[str, Any]) -> str:
    return (
        f"{point['method']} at {_number(1.0 / point['dt'])} Hz: {_number(point['per_second'])} µs"
    )


def _number(value: float) -> str:
    return f"{value:.2g}" if value < 99.5 else f"{value:,.0f}"


def render(page: str, directory: Path = CHARTS) -> str:
    """The page with its tables made anew."""
    for name, make in (("origin", origin), ("cheapest", cheapest)):
        marked = re.compile(f"(<!-- {name} -->\n).*?(<!-- end of {name} -->)", re.DOTALL)
        if len(marked.findall(page)) != 1:
            raise ValueError(f"docs/accuracy.md: needs the markers of {name} once. Put them back.")
        text = make(directory)
        page = marked.sub(lambda match, text=text: f"{match[1]}{text}\n{match[2]}", page)
    return page


def write() -> None:
    """Make the tables of the page anew."""
    PAGE.write_text(render(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    write()
