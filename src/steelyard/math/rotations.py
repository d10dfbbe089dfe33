"""Rotations by unit quaternions (w, x, y, z) of lane vectors."""

from __future__ import annotations

from ..kernel import inner
from .lanes import fma, load, splat, sqrt, store
from .vectors import cross, dot, symmetric_product

_TERMS = 12


@inner
def load_quaternion(s, row):
    """Four rows."""
    return load(s, row), load(s, row + 1), load(s, row + 2), load(s, row + 3)


@inner
def load_turn(s, row):
    """Twice the inverse of a quaternion's square, and the quaternion: what ``rotate`` takes.

    With the factor, a length that is off by rounding makes no vector longer: without, angular momentum grew by 3e-13 of
    it in 600 steps.
    """
    w, x, y, z = load_quaternion(s, row)
    return splat(2.0) / fma(w, w, dot(x, y, z, x, y, z)), w, x, y, z


@inner
def store_unit_quaternion(s, row, w, x, y, z):
    """Four rows, of length 1."""
    inverse = splat(1.0) / sqrt(fma(w, w, dot(x, y, z, x, y, z)))
    store(s, row, w * inverse)
    store(s, row + 1, x * inverse)
    store(s, row + 2, y * inverse)
    store(s, row + 3, z * inverse)


@inner
def quaternion_product(aw, ax, ay, az, bw, bx, by, bz):
    """a b: first the rotation b, then a."""
    cx, cy, cz = cross(ax, ay, az, bx, by, bz)
    return (
        fma(aw, bw, -dot(ax, ay, az, bx, by, bz)),
        fma(aw, bx, fma(bw, ax, cx)),
        fma(aw, by, fma(bw, ay, cy)),
        fma(aw, bz, fma(bw, az, cz)),
    )


@inner
def turned_by(ux, uy, uz, w, x, y, z):
    """The quaternion after a turn by a rotation vector (axis times angle) of the world's frame.

    cos and sin by their series, to rounding for angles of up to four radians.
    """
    square = splat(-0.25) * dot(ux, uy, uz, ux, uy, uz)
    one = splat(1.0)
    cosine = one
    sine = one
    for k in range(_TERMS, 0, -1):
        cosine = fma(cosine * square, splat(1.0 / ((2 * k - 1) * (2 * k))), one)
        sine = fma(sine * square, splat(1.0 / ((2 * k) * (2 * k + 1))), one)
    half = splat(0.5) * sine
    return quaternion_product(cosine, half * ux, half * uy, half * uz, w, x, y, z)


@inner
def rotate(factor, w, x, y, z, a, b, c):
    """The vector (a, b, c) from the body's frame to the world's, by what ``load_turn`` gave."""
    tx, ty, tz = cross(x, y, z, a, b, c)
    tx = factor * tx
    ty = factor * ty
    tz = factor * tz
    ux, uy, uz = cross(x, y, z, tx, ty, tz)
    return fma(w, tx, a + ux), fma(w, ty, b + uy), fma(w, tz, c + uz)


@inner
def rotate_back(factor, w, x, y, z, a, b, c):
    """The vector (a, b, c) from the world's frame to the body's."""
    return rotate(factor, w, -x, -y, -z, a, b, c)


@inner
def in_frame(s, matrix, factor, w, x, y, z, a, b, c):
    """A symmetric matrix of the body's frame, in six rows, times a vector of the world's."""
    u, v, t = rotate_back(factor, w, x, y, z, a, b, c)
    u, v, t = symmetric_product(s, matrix, u, v, t)
    return rotate(factor, w, x, y, z, u, v, t)
