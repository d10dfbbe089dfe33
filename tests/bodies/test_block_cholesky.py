"""The factor of 6 x 6 blocks in an envelope against numpy."""

import numpy as np

from steelyard.kernel import kernel
from steelyard.math.pointers import LANES, doubles_at, integers_at
from steelyard.solvers.block_cholesky import SIX, factorise, solve_factored
from steelyard.state import aligned


@kernel
def _solve(rows, integers, blocks, x):
    h = doubles_at(rows.ctypes.data)
    n = integers_at(integers.ctypes.data)
    good = factorise(h, n, 0, blocks, blocks)
    solve_factored(h, n, 0, blocks, blocks, x)
    return good


def _envelope(matrix, first):
    """Rows of the blocks, first block columns and first rows, as the solver lays them out."""
    blocks = len(first)
    starts, rows = [], []
    for i in range(blocks):
        starts.append(len(rows))
        for j in range(first[i], i + 1):
            block = matrix[SIX * i : SIX * i + SIX, SIX * j : SIX * j + SIX]
            rows += [np.pad(block[:, c], (0, LANES - SIX)) for c in range(SIX)]
    return np.array(rows), np.array([*first, *starts], dtype=np.int64)


def _random_matrix(first, rng):
    """A positive definite matrix with blocks from ``first`` on, some of them 0."""
    size = SIX * len(first)
    matrix = np.zeros((size, size))
    for i, start in enumerate(first):
        for j in {start, i}:
            arms = rng.normal(size=(3, size))
            keep = np.zeros(size, dtype=bool)
            keep[SIX * i : SIX * i + SIX] = keep[SIX * j : SIX * j + SIX] = True
            arms[:, ~keep] = 0.0
            matrix += 1e5 * arms.T @ arms
    return matrix + np.diag(rng.uniform(0.5, 2.0, size))


def test_solves_what_numpy_solves():
    rng = np.random.default_rng(5)
    for first in ([0], [0, 0], [0, 0, 1, 2, 3], [0, 1, 0, 2, 2, 1], [0, 1, 2]):
        matrix = _random_matrix(first, rng)
        rows, integers = _envelope(matrix, first)
        blocks = len(first)
        right = rng.normal(size=(blocks, SIX))
        memory = aligned((len(rows) + blocks + 1, LANES))
        memory[: len(rows)] = rows
        memory[len(rows) : len(rows) + blocks, :SIX] = right
        assert _solve(memory, integers, blocks, len(rows))
        found = memory[len(rows) : len(rows) + blocks, :SIX].ravel()
        wanted = np.linalg.solve(matrix, right.ravel())
        residual = matrix @ found - right.ravel()
        assert np.abs(residual).max() < 1e-9 * np.abs(matrix).max() * np.abs(wanted).max()
        np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-10)


def test_tells_a_matrix_that_is_not_positive():
    matrix = np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    rows, integers = _envelope(matrix, [0])
    memory = aligned((len(rows) + 2, LANES))
    memory[: len(rows)] = rows
    assert not _solve(memory, integers, 1, len(rows))
