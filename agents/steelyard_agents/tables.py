"""Tables of scores for the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

# What the policies are called in front of people.
LABELS = {"random": "random", "controller": "hand-written", "trained": "trained"}


def score_table(title: str, scores: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return a table with one row per policy.

    Args:
        title: Stands above the table.
        scores: A summary as `scores.Evaluation.summary` gives it, by the policy's name.
    """
    table = Table(title=title, title_style="bold", title_justify="left")
    table.add_column("policy", no_wrap=True)
    for heading in ("mean return", "IQM", "success rate", "mean length", "episodes"):
        table.add_column(heading, justify="right")
    best = max(summary["return_mean"] for summary in scores.values())
    for name, summary in scores.items():
        success = summary["success_rate"]
        table.add_row(
            LABELS.get(name, name),
            f"{summary['return_mean']:.1f} ± {summary['return_std']:.1f}",
            f"{summary['return_iqm']:.1f}",
            "-" if success is None else f"{success:.0%}",
            f"{summary['length_mean']:.0f}",
            str(summary["episodes"]),
            style="bold green" if summary["return_mean"] == best and len(scores) > 1 else None,
        )
    return table
