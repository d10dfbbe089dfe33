"""Vectors and 3 x 3 matrices of lane vectors: three numbers per world, in registers or in rows of the scratch."""

from __future__ import annotations

from ..kernel import inner
from .lanes import fma, load, load_z, select, splat, sqrt, store, store_z


@inner
def load_vector(s, row):
    """Three rows."""
    return load(s, row), load(s, row + 1), load(s, row + 2)


@inner
def store_vector(s, row, x, y, z):
    """Three rows."""
    store(s, row, x)
    store(s, row + 1, y)
    store(s, row + 2, z)


@inner
def load_coordinates(s, row):
    """Position, velocity or force: three rows, of which a planar scene has two."""
    return load(s, row), load(s, row + 1), load_z(s, row + 2)


@inner
def store_coordinates(s, row, x, y, z):
    """Position, velocity or force."""
    store(s, row, x)
    store(s, row + 1, y)
    store_z(s, row + 2, z)


@inner
def between(s, a, b):
    """From b to a: position, velocity or wind."""
    ax, ay, az = load_coordinates(s, a)
    bx, by, bz = load_coordinates(s, b)
    return ax - bx, ay - by, az - bz


@inner
def add_scaled(s, row, factor, x, y, z):
    """Position, velocity or force += factor times a vector."""
    store(s, row, fma(factor, x, load(s, row)))
    store(s, row + 1, fma(factor, y, load(s, row + 1)))
    store_z(s, row + 2, fma(factor, z, load_z(s, row + 2)))


@inner
def dot(ax, ay, az, bx, by, bz):
    """Scalar product."""
    return fma(az, bz, fma(ay, by, ax * bx))


@inner
def cross(ax, ay, az, bx, by, bz):
    """Vector product."""
    return (
        fma(ay, bz, -az * by),
        fma(az, bx, -ax * bz),
        fma(ax, by, -ay * bx),
    )


@inner
def unit(x, y, z):
    """The vector over its length."""
    inverse = splat(1.0) / sqrt(dot(x, y, z, x, y, z))
    return x * inverse, y * inverse, z * inverse


@inner
def symmetric_product(s, row, x, y, z):
    """Symmetric matrix in six rows (00 10 11 20 21 22) times a vector."""
    m10 = load(s, row + 1)
    m20 = load(s, row + 3)
    m21 = load(s, row + 4)
    return (
        fma(m20, z, fma(m10, y, load(s, row) * x)),
        fma(m21, z, fma(load(s, row + 2), y, m10 * x)),
        fma(load(s, row + 5), z, fma(m21, y, m20 * x)),
    )


@inner
def _reciprocal(value):
    """1/value, 0 for 0 and for what is not a number."""
    zero = splat(0.0)
    good = value * value > zero
    return select(good, splat(1.0) / select(good, value, splat(1.0)), zero)


@inner
def symmetric_inverse(s, row, out):
    """Inverse of a symmetric matrix in six rows, into six others."""
    a = load(s, row)
    b = load(s, row + 1)
    c = load(s, row + 2)
    d = load(s, row + 3)
    e = load(s, row + 4)
    f = load(s, row + 5)
    c00 = fma(c, f, -e * e)
    c10 = fma(d, e, -b * f)
    c20 = fma(b, e, -c * d)
    inverse = _reciprocal(dot(a, b, d, c00, c10, c20))
    store(s, out, inverse * c00)
    store(s, out + 1, inverse * c10)
    store(s, out + 2, inverse * fma(a, f, -d * d))
    store(s, out + 3, inverse * c20)
    store(s, out + 4, inverse * fma(b, d, -a * e))
    store(s, out + 5, inverse * fma(a, c, -b * b))


@inner
def inverse(ax, ay, az, bx, by, bz, cx, cy, cz):
    """Rows of the inverse of a matrix with the columns a, b, c; zeros if there is none."""
    px, py, pz = cross(bx, by, bz, cx, cy, cz)
    qx, qy, qz = cross(cx, cy, cz, ax, ay, az)
    rx, ry, rz = cross(ax, ay, az, bx, by, bz)
    share = _reciprocal(dot(ax, ay, az, px, py, pz))
    return (
        share * px, share * py, share * pz,
        share * qx, share * qy, share * qz,
        share * rx, share * ry, share * rz,
    )  # fmt: skip


@inner
def solve(ax, ay, az, bx, by, bz, cx, cy, cz, x, y, z):
    """Solution of a 3 x 3 system with the columns a, b, c by its adjugate."""
    px, py, pz = cross(bx, by, bz, cx, cy, cz)
    qx, qy, qz = cross(cx, cy, cz, ax, ay, az)
    rx, ry, rz = cross(ax, ay, az, bx, by, bz)
    inverse = _reciprocal(dot(ax, ay, az, px, py, pz))
    return (
        inverse * dot(px, py, pz, x, y, z),
        inverse * dot(qx, qy, qz, x, y, z),
        inverse * dot(rx, ry, rz, x, y, z),
    )
