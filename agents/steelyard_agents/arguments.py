"""Command-line arguments that several commands share."""

import argparse
import ast
from collections.abc import Sequence
from typing import Any


def add_env_kwargs(parser: argparse.ArgumentParser) -> None:
    """Add `--env-kwargs KEY=VALUE ...` to `parser`."""
    parser.add_argument(
        "--env-kwargs",
        nargs="+",
        default=[],
        metavar="KEY=VALUE",
        help="arguments of the environment, as in difficulty=2",
    )


def parse_env_kwargs(pairs: Sequence[str]) -> dict[str, Any]:
    """Read `KEY=VALUE` pairs: a Python literal where VALUE is one, else text.

    Raises:
        ValueError: A pair has no `=` or no key.
    """
    parsed: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not (equals and key.isidentifier()):
            raise ValueError(f"--env-kwargs got {pair!r}; write KEY=VALUE, as in difficulty=2")
        try:
            parsed[key] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            parsed[key] = value
    return parsed
