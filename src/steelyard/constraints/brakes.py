"""Friction of spinning and rolling: torques that two bodies have on each other where they touch.

About the normal it is at most a length, ``spinning_friction``, times the normal impulse, and about directions across it
at most ``rolling_friction`` times that; what does not turn against the other is held. The normal impulse is that of the
pass before, or in sweeps the one at hand.
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner
from ..model.rigid_layout import (
    C_BRAKE_BEFORE,
    C_BRAKE_WEIGHT,
    C_COMPLIANCE,
    C_LIMIT,
    C_ROLLING,
    C_SPINNING,
    C_WEIGHT,
    S_INVERSE_INERTIA,
    S_TURNS,
)
from .contact_rows import contact_vector, world_vector
from .solids import symmetric_times


@inner
def has_brake(s, c):
    """Whether a contact has friction of spinning or rolling."""
    return s[c + C_SPINNING] + s[c + C_ROLLING] > 0.0


@inner
def release_brake(s, c):
    """Let a contact have none in this solve."""
    s[c + C_SPINNING] = 0.0
    s[c + C_ROLLING] = 0.0


@inner
def prepare_brake(s, c, a, b):
    """Mean mobility [1/(kg m2)]."""
    weight = _trace(s, a)
    if b >= 0:
        weight += _trace(s, b)
    s[c + C_BRAKE_WEIGHT] = weight / 3.0


@inner
def _trace(s, solid):
    """Of the inverse inertia."""
    m = solid + S_INVERSE_INERTIA
    return s[m] + s[m + 2] + s[m + 5]


@inner
def relative_spin(s, c, a, b, field):
    """Angular velocity of a against b about normal and tangents; ``field``: which six-vector of the solids."""
    v = a + field + 3
    x = s[v]
    y = s[v + 1]
    z = s[v + 2]
    if b >= 0:
        v = b + field + 3
        x -= s[v]
        y -= s[v + 1]
        z -= s[v + 2]
    return contact_vector(s, c, x, y, z)


@inner
def add_torque(s, c, a, b, field, n, t, u):
    """Add a torque's impulse on a, and against it on b, to a six-vector of both solids."""
    x, y, z = world_vector(s, c, n, t, u)
    turns = s[a + S_TURNS]
    at = a + field + 3
    s[at] += turns * x
    s[at + 1] += turns * y
    s[at + 2] += turns * z
    if b >= 0:
        turns = s[b + S_TURNS]
        at = b + field + 3
        s[at] -= turns * x
        s[at + 1] -= turns * y
        s[at + 2] -= turns * z


@inner
def brake_compliance(s, c):
    """As soft, over its mobility, as the contact."""
    return s[c + C_COMPLIANCE] / s[c + C_WEIGHT] * s[c + C_BRAKE_WEIGHT]


@inner
def limit_brake(s, c, n, t, u):
    """The nearest impulse that may be, from one about normal and tangents."""
    most = s[c + C_SPINNING] * s[c + C_LIMIT]
    n = min(max(n, -most), most)
    most = s[c + C_ROLLING] * s[c + C_LIMIT]
    size = sqrt(t * t + u * u)
    if size > most:
        t *= most / size
        u *= most / size
    return n, t, u


@inner
def _wanted(s, c, w0, w1, w2):
    """Impulse before its limit at a relative angular velocity."""
    stiffness = 1.0 / brake_compliance(s, c)
    at = c + C_BRAKE_BEFORE
    return s[at] - w0 * stiffness, s[at + 1] - w1 * stiffness, s[at + 2] - w2 * stiffness


@inner
def brake_at(s, c, w0, w1, w2):
    """Impulse at a relative angular velocity."""
    n, t, u = _wanted(s, c, w0, w1, w2)
    return limit_brake(s, c, n, t, u)


@inner
def brake_derivative(s, c, w0, w1, w2):
    """Minus the derivative of the impulse by the velocity: (nn, 11, 12, 22), all else 0."""
    stiffness = 1.0 / brake_compliance(s, c)
    n, t, u = _wanted(s, c, w0, w1, w2)
    nn = stiffness if abs(n) < s[c + C_SPINNING] * s[c + C_LIMIT] else 0.0
    most = s[c + C_ROLLING] * s[c + C_LIMIT]
    size = sqrt(t * t + u * u)
    if size <= most:
        return nn, stiffness, 0.0, stiffness
    e1 = t / size
    e2 = u / size
    across = stiffness * most / size
    return nn, across * (1.0 - e1 * e1), -across * e1 * e2, across * (1.0 - e2 * e2)


@inner
def _turning(s, solid, x, y, z):
    """What a torque's unit impulse about a direction does to the angular velocity about it."""
    a, b, c = symmetric_times(s, solid + S_INVERSE_INERTIA, x, y, z)
    return a * x + b * y + c * z


@inner
def brake_mobility(s, c, a, b, direction):
    """The same of both solids about one of a contact's directions."""
    x = s[c + direction]
    y = s[c + direction + 1]
    z = s[c + direction + 2]
    mobility = _turning(s, a, x, y, z)
    if b >= 0:
        mobility += _turning(s, b, x, y, z)
    return mobility
