"""The failure maps run, and what their searches find is what is there."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.failure_map import __main__ as failure_map
from benchmarks.failure_map import springs
from benchmarks.failure_map.bisection import first_loss


def test_search_finds_the_first_loss_and_the_next_gain() -> None:
    edges = np.array([[0.37, 5.2], [2.1, np.inf], [0.0, 3.0], [np.inf, np.inf], [0.0, np.inf]])

    def holds(x: np.ndarray) -> np.ndarray:
        return (x <= edges[:, :1]) | (x > edges[:, 1:])

    grid = np.geomspace(0.1, 10.0, 12)
    lost, regained = first_loss(holds, 5, grid, rounds=5, points=10)
    # Each round divides the bracket, a factor 1.52, by 11.
    np.testing.assert_allclose(lost, edges[:, 0], rtol=1.52 / 11**5)
    np.testing.assert_allclose(regained, edges[:, 1], rtol=1.52 / 11**5)


def test_a_wrong_theory_is_caught() -> None:
    # Half a percent off, or a boundary where there is none.
    (verlet,) = (case for case in springs.CASES if case.name == "velocity Verlet")
    found = springs.measure(verlet, ratios=np.array([0.0, 0.5]), quick=True)
    assert springs.deviation(found) < 1e-3
    wrong = springs.deviation({**found, "theory": 1.005 * found["theory"]})
    assert wrong == pytest.approx(0.005, rel=0.1)
    with pytest.raises(ArithmeticError, match="only measured or only predicted"):
        springs.deviation({**found, "theory": np.array([2.0, np.inf])})


@pytest.mark.parametrize("name", failure_map.MAPS)
def test_quick_map(name: str, tmp_path: Path) -> None:
    assert failure_map.main([name, "--quick", "--output", str(tmp_path)]) == 0
    document = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert document["quick"] is True
    assert all(figure["met"] is not False for figure in document["figures"])
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
