"""Lane vectors of whole arrays, where a batch ends within a block and where it does not."""

from __future__ import annotations

import numpy as np
import pytest

import steelyard as sy

lanes = sy.extension


@sy.kernel
def _through_rows(rows, out, above, limit):
    for first in range(0, rows.shape[1], lanes.LANES):
        value = lanes.load_row(rows, 1, first)
        lanes.store_row(out, 2, first, value + value)
        lanes.store_row(above, 1, first, value > lanes.splat(limit))


@sy.kernel
def _through_columns(table, out):
    for first in range(0, table.shape[0], lanes.LANES):
        x = lanes.load_column(table, first, 0)
        y = lanes.load_column(table, first, 2)
        lanes.store_columns(out, first, (-y, x, y))


@sy.kernel
def _thirteen_columns(table, out):
    for first in range(0, table.shape[0], lanes.LANES):
        x = lanes.load_column(table, first, 0)
        one = lanes.splat(1.0)
        two = one + one
        y = x * two
        z = y * two
        v = z * two
        lanes.store_columns(
            out, first, (x, y, z, v, -x, -y, -z, -v, x + one, y + one, z + one, v + one, two)
        )


@sy.kernel
def _sums_of_blocks(table, out):
    for first in range(0, table.shape[0], lanes.LANES):
        lanes.store_row(out, 0, first, lanes.load_column(table, first, 0))


@pytest.mark.parametrize("worlds", [1, 5, 8, 13, 24])
def test_rows_are_loaded_and_stored_to_their_end(worlds: int) -> None:
    rows = np.random.default_rng(0).standard_normal((3, worlds))
    out = np.zeros((4, worlds))
    above = np.zeros((2, worlds), dtype=np.bool_)
    _through_rows(rows, out, above, 0.1)
    np.testing.assert_array_equal(out[2], 2.0 * rows[1])
    np.testing.assert_array_equal(above[1], rows[1] > 0.1)
    assert not out[[0, 1, 3]].any() and not above[0].any()


@pytest.mark.parametrize("worlds", [1, 5, 8, 13, 24])
def test_columns_are_loaded_and_stored_to_their_end(worlds: int) -> None:
    table = np.random.default_rng(0).standard_normal((worlds, 3)).astype(np.float32)
    out = np.zeros((worlds + 1, 5), dtype=np.float32)
    _through_columns(table, out[:worlds])
    expected = np.stack((-table[:, 2], table[:, 0], table[:, 2]), axis=1)
    np.testing.assert_array_equal(out[:worlds, :3], expected)
    assert not out[:, 3:].any() and not out[worlds].any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("worlds", [3, 16, 21])
def test_many_columns_are_stored_world_by_world(worlds: int, dtype: type) -> None:
    table = np.arange(1.0, worlds + 1.0).astype(dtype)[:, None].copy()
    out = np.zeros((worlds + 1, 13), dtype=dtype)
    _thirteen_columns(table, out[:worlds])
    x = table[:, :1] * np.array([[1.0, 2.0, 4.0, 8.0]])
    expected = np.concatenate((x, -x, x + 1.0, np.full((worlds, 1), 2.0)), axis=1)
    np.testing.assert_array_equal(out[:worlds], expected)
    assert not out[worlds].any()


def test_single_precision_rows_and_their_end() -> None:
    rows = np.arange(11.0, dtype=np.float32)[None, :].repeat(2, axis=0).copy()
    out = np.zeros((3, 11), dtype=np.float32)
    _through_rows(rows, out, np.zeros((2, 11), dtype=np.bool_), 0.0)
    np.testing.assert_array_equal(out[2], 2.0 * rows[1])
    assert not out[:2].any()


def test_what_is_behind_the_last_world_is_zero() -> None:
    table = np.arange(1.0, 11.0).astype(np.float32)[:, None].copy()
    out = np.zeros((1, 16))
    _sums_of_blocks(table, out)
    assert out[0].tolist() == [*range(1, 11), *([0] * 6)]
