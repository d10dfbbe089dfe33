"""Rows of joints in registers, against matrices."""

from __future__ import annotations

import numpy as np

import steelyard as sy
from steelyard.constraints.wide_rows import (
    finish_wide_row,
    load_velocity,
    moved,
    response_along,
    store_velocity,
    velocity_along,
)
from steelyard.math.pointers import doubles_at
from steelyard.model.rigid_layout import (
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_VELOCITY,
    SOLID_ENTRIES,
    WIDE_ROW,
)

A, B, FIRST, SECOND = 0, SOLID_ENTRIES, 2 * SOLID_ENTRIES, 2 * SOLID_ENTRIES + WIDE_ROW


@sy.kernel
def _through(numbers, torques, impulse, out):
    s = doubles_at(numbers.ctypes.data)
    out[0] = finish_wide_row(s, FIRST, A, B, torques[0, 0], torques[0, 1], torques[0, 2])
    finish_wide_row(s, SECOND, A, B, torques[1, 0], torques[1, 1], torques[1, 2])
    out[1] = response_along(s, FIRST, SECOND)
    va = load_velocity(s, A)
    vb = load_velocity(s, B)
    out[2] = velocity_along(s, FIRST, va, vb)
    va, vb = moved(s, FIRST, va, vb, impulse)
    store_velocity(s, A, va)
    store_velocity(s, B, vb)


def test_wide_rows_do_what_matrices_do() -> None:
    rng = np.random.default_rng(0)
    numbers = np.zeros(SECOND + WIDE_ROW)
    inverse = np.zeros((12, 12))
    velocity = rng.normal(size=12)
    for solid, at in ((A, 0), (B, 6)):
        mass, root = rng.uniform(0.5, 2.0), rng.normal(size=(3, 3))
        inertia = root @ root.T
        inverse[at : at + 3, at : at + 3] = mass * np.eye(3)
        inverse[at + 3 : at + 6, at + 3 : at + 6] = inertia
        numbers[solid + S_INVERSE] = mass
        # Kept as xx, yx, yy, zx, zy, zz.
        numbers[solid + S_INVERSE_INERTIA : solid + S_INVERSE_INERTIA + 6] = inertia[
            np.tril_indices(3)
        ]
        numbers[solid + S_VELOCITY : solid + S_VELOCITY + 6] = velocity[at : at + 6]
    force, on_a, on_b = rng.normal(size=(3, 2, 3))
    rows = np.hstack([force, on_a, -force, -on_b])
    for w, row in ((FIRST, rows[0]), (SECOND, rows[1])):
        numbers[w : w + 6] = row[:6]
    out = np.zeros(3)
    _through(numbers, on_b, 0.7, out)
    wanted = [rows[0] @ inverse @ rows[0], rows[0] @ inverse @ rows[1], rows[0] @ velocity]
    np.testing.assert_allclose(out, wanted, rtol=1e-13)
    after = velocity + 0.7 * inverse @ rows[0]
    found = [numbers[solid + S_VELOCITY : solid + S_VELOCITY + 8] for solid in (A, B)]
    np.testing.assert_allclose(np.hstack([found[0][:6], found[1][:6]]), after, rtol=1e-13)
    assert not found[0][6:].any() and not found[1][6:].any()
