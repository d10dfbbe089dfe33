"""Rows of rigid contacts in one world: frames, arms, the velocity between both surfaces, and impulses on the solids."""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..model.rigid_layout import (
    C_ARM_A,
    C_ARM_B,
    C_BINORMAL,
    C_NORMAL,
    C_PLACE,
    C_TANGENT,
    C_WEIGHT,
    CONTACT_ENTRIES,
    CONTACT_WORK,
    END_A,
    END_B,
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_MOVES,
    S_TURNS,
)
from .solids import solid_at, symmetric_times


@inner
def contact_at(tape, rigid, i):
    """First entry of a contact's work."""
    return tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i


@inner
def contact_ends(tape, n, rigid, i):
    """Work of the solids of a contact; -1 for scenery."""
    b = n[tape[rigid + END_B] + i]
    a = solid_at(tape, rigid, n[tape[rigid + END_A] + i])
    return a, solid_at(tape, rigid, b) if b >= 0 else -1


@inner
def frame(s, c):
    """Two tangents of a contact, from its normal alone.

    Source: Duff et al. (2017), *Building an Orthonormal Basis, Revisited*.
    """
    x = s[c + C_NORMAL]
    y = s[c + C_NORMAL + 1]
    z = s[c + C_NORMAL + 2]
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    s[c + C_TANGENT] = 1.0 + sign * x * x * a
    s[c + C_TANGENT + 1] = sign * b
    s[c + C_TANGENT + 2] = -sign * x
    s[c + C_BINORMAL] = b
    s[c + C_BINORMAL + 1] = sign + y * y * a
    s[c + C_BINORMAL + 2] = -y


@inner
def _arm(s, c, solid, place, out):
    """From a solid's place to the contact; 0 where it does not turn."""
    for k in range(3):
        s[c + out + k] = s[solid + S_TURNS] * (s[c + C_PLACE + k] - s[solid + place + k])


@inner
def _mobility(s, c, solid, arm):
    """Trace of what a unit impulse at the contact does to the velocity there."""
    x = s[c + arm]
    y = s[c + arm + 1]
    z = s[c + arm + 2]
    m = solid + S_INVERSE_INERTIA
    xx = s[m]
    yx = s[m + 1]
    yy = s[m + 2]
    zx = s[m + 3]
    zy = s[m + 4]
    zz = s[m + 5]
    # trace of [r]^T K [r] = r.r tr K - r.K r.
    turning = (x * x + y * y + z * z) * (xx + yy + zz) - (
        x * (xx * x + yx * y + zx * z)
        + y * (yx * x + yy * y + zy * z)
        + z * (zx * x + zy * y + zz * z)
    )
    return 3.0 * s[solid + S_INVERSE] + turning


@inner
def prepare_rows(s, c, a, b, place):
    """Frame, arms and mean mobility of a contact of solids at ``a`` and ``b`` (-1: scenery), in a field of places."""
    frame(s, c)
    _arm(s, c, a, place, C_ARM_A)
    weight = _mobility(s, c, a, C_ARM_A)
    if b >= 0:
        _arm(s, c, b, place, C_ARM_B)
        weight += _mobility(s, c, b, C_ARM_B)
    s[c + C_WEIGHT] = weight / 3.0


@inner
def relative_velocity(s, c, a, b, field):
    """Velocity of a against b along normal and tangents; ``field``: which six-vector of the solids."""
    x = s[c + C_ARM_A]
    y = s[c + C_ARM_A + 1]
    z = s[c + C_ARM_A + 2]
    v = a + field
    ux = s[v] + s[v + 4] * z - s[v + 5] * y
    uy = s[v + 1] + s[v + 5] * x - s[v + 3] * z
    uz = s[v + 2] + s[v + 3] * y - s[v + 4] * x
    if b >= 0:
        x = s[c + C_ARM_B]
        y = s[c + C_ARM_B + 1]
        z = s[c + C_ARM_B + 2]
        v = b + field
        ux -= s[v] + s[v + 4] * z - s[v + 5] * y
        uy -= s[v + 1] + s[v + 5] * x - s[v + 3] * z
        uz -= s[v + 2] + s[v + 3] * y - s[v + 4] * x
    return (
        ux * s[c] + uy * s[c + 1] + uz * s[c + 2],
        ux * s[c + C_TANGENT] + uy * s[c + C_TANGENT + 1] + uz * s[c + C_TANGENT + 2],
        ux * s[c + C_BINORMAL] + uy * s[c + C_BINORMAL + 1] + uz * s[c + C_BINORMAL + 2],
    )


@inner
def world_vector(s, c, n, t, u):
    """A vector along normal and tangents in the world's axes."""
    return (
        n * s[c] + t * s[c + C_TANGENT] + u * s[c + C_BINORMAL],
        n * s[c + 1] + t * s[c + C_TANGENT + 1] + u * s[c + C_BINORMAL + 1],
        n * s[c + 2] + t * s[c + C_TANGENT + 2] + u * s[c + C_BINORMAL + 2],
    )


@inner
def contact_vector(s, c, x, y, z):
    """A vector of the world's axes along normal and tangents."""
    return (
        x * s[c] + y * s[c + 1] + z * s[c + 2],
        x * s[c + C_TANGENT] + y * s[c + C_TANGENT + 1] + z * s[c + C_TANGENT + 2],
        x * s[c + C_BINORMAL] + y * s[c + C_BINORMAL + 1] + z * s[c + C_BINORMAL + 2],
    )


@inner
def add_impulse(s, c, a, b, field, n, t, u):
    """Add an impulse on a, and against it on b, to a six-vector of both solids."""
    fx, fy, fz = world_vector(s, c, n, t, u)
    _add(s, a, c + C_ARM_A, field, fx, fy, fz)
    if b >= 0:
        _add(s, b, c + C_ARM_B, field, -fx, -fy, -fz)


@inner
def _add(s, solid, arm, field, fx, fy, fz):
    moves = s[solid + S_MOVES]
    x = s[arm]
    y = s[arm + 1]
    z = s[arm + 2]
    at = solid + field
    s[at] += moves * fx
    s[at + 1] += moves * fy
    s[at + 2] += moves * fz
    s[at + 3] += y * fz - z * fy
    s[at + 4] += z * fx - x * fz
    s[at + 5] += x * fy - y * fx


@inner
def accelerate(s, solid, source, target):
    """Target six-vector += M^-1 source."""
    for k in range(3):
        s[solid + target + k] += s[solid + S_INVERSE] * s[solid + source + k]
    a, b, c = symmetric_times(
        s,
        solid + S_INVERSE_INERTIA,
        s[solid + source + 3],
        s[solid + source + 4],
        s[solid + source + 5],
    )
    s[solid + target + 3] += a
    s[solid + target + 4] += b
    s[solid + target + 5] += c


@inner
def length(x, y, z):
    """Of a vector."""
    return sqrt(x * x + y * y + z * z)
