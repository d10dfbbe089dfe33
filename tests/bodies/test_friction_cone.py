"""Projection on Coulomb's cone: nearest point, and its derivative against differences."""

import numpy as np
import pytest

from steelyard.kernel import kernel
from steelyard.solvers.friction_cone import project, projection_derivative


@kernel
def _project(y, mu, out):
    n, t, u, case, size = project(y[0], y[1], y[2], mu)
    out[0] = n
    out[1] = t
    out[2] = u
    a, b, c, d, e, f = projection_derivative(y[1], y[2], mu, n, case, size)
    for k, value in enumerate((a, b, c, d, e, f)):
        out[3 + k] = value


def _projected(y, mu):
    out = np.zeros(9)
    _project(np.asarray(y, dtype=np.float64), mu, out)
    a, b, c, d, e, f = out[3:]
    return out[:3], np.array([[a, b, c], [b, d, e], [c, e, f]])


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0, 4.0])
def test_is_the_nearest_point_of_the_cone(mu):
    """y - p lies in the polar cone and is orthogonal to p (Moreau)."""
    rng = np.random.default_rng(3)
    for y in rng.normal(size=(500, 3)):
        p, _ = _projected(y, mu)
        left = y - p
        assert np.hypot(p[1], p[2]) <= mu * p[0] + 1e-12
        assert left[0] <= -mu * np.hypot(left[1], left[2]) + 1e-12
        assert abs(p @ left) < 1e-12


@pytest.mark.parametrize("mu", [0.0, 0.3, 4.0])
def test_derivative_is_that_of_the_projection(mu):
    rng = np.random.default_rng(4)
    step = 1e-6
    for y in rng.normal(size=(200, 3)):
        _, derivative = _projected(y, mu)
        each = [
            (_projected(y + step * e, mu)[0] - _projected(y - step * e, mu)[0]) / (2.0 * step)
            for e in np.eye(3)
        ]
        # A kink between both ends of a difference is no error.
        apart = abs(abs(mu * y[0]) - np.hypot(y[1], y[2])) > 1e-4 and abs(y[0]) > 1e-4
        assert not apart or np.abs(np.array(each).T - derivative).max() < 1e-6
        moments = np.linalg.eigvalsh(derivative)
        assert moments[0] > -1e-12
        assert moments[2] < 1.0 + 1e-12


def test_the_tip_and_the_axis_are_finite():
    for y in ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]):
        p, derivative = _projected(y, 0.5)
        assert np.isfinite(p).all()
        assert np.isfinite(derivative).all()
