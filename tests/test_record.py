"""Provenance and timing of benchmark results."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import record


def test_write_keeps_payload_and_provenance(tmp_path: Path) -> None:
    payload = {"error": np.float64(1.5e-3), "worlds": np.arange(3), "nested": {"n": np.int64(7)}}
    path = record.write("platform", payload, directory=tmp_path / "new")
    document = json.loads(path.read_text(encoding="utf-8"))
    assert path.name == "platform.json"
    assert (document["error"], document["worlds"], document["nested"]) == (
        1.5e-3,
        [0, 1, 2],
        {"n": 7},
    )
    source = document["provenance"]
    assert set(source) == {"command", "commit", "machine", "versions", "date"}
    assert source["versions"]["numpy"] == np.__version__
    assert source["command"].startswith("python")
    # Results are published: they must not tell where on the machine the repository lies.
    assert str(record.ROOT) not in path.read_text(encoding="utf-8")


def test_write_refuses_what_json_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON"):
        record.write("bad", {"error": float("nan")}, directory=tmp_path)
    with pytest.raises(ValueError, match="provenance"):
        record.write("bad", {"provenance": 1}, directory=tmp_path)
    with pytest.raises(TypeError, match="object has no JSON form"):
        record.write("bad", {"thing": object()}, directory=tmp_path)
    assert not list(tmp_path.iterdir())


def test_interleave_takes_turns_after_a_warm_up_and_returns_medians() -> None:
    now = 0.0
    calls: list[str] = []
    cost = {"a": iter([100.0, 1.0, 5.0, 2.0]), "b": iter([100.0, 3.0, 3.0, 9.0])}

    def run(name: str) -> None:
        nonlocal now
        calls.append(name)
        now += next(cost[name])

    medians = record.interleave(
        {"a": lambda: run("a"), "b": lambda: run("b")}, repeats=3, clock=lambda: now
    )
    assert calls == ["a", "b"] * 4
    assert medians == {"a": 2.0, "b": 3.0}


def test_interleave_refuses_no_repeats() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        record.interleave({}, repeats=0)
