"""Coulomb's cone |l_t| <= mu l_n: nearest point of it and the derivative of that.

A point y projects to itself inside (the contact sticks), to 0 in the polar cone (open), else to the cone's side
(it slides). The derivative is symmetric with eigenvalues from 0 to 1.
"""

from __future__ import annotations

from math import sqrt

from ..kernel import inner

OPEN, STICK, SLIDE, HELD_STICK, HELD_SLIDE = range(5)


@inner
def project(yn, y1, y2, mu):
    """Where (yn, y1, y2) projects to, whether it sticks, slides or opens, and the length of (y1, y2)."""
    size = sqrt(y1 * y1 + y2 * y2)
    if yn <= -mu * size:
        return 0.0, 0.0, 0.0, OPEN, size
    if mu > 0.0 and size <= mu * yn:
        return yn, y1, y2, STICK, size
    normal = (yn + mu * size) / (1.0 + mu * mu)
    share = mu * normal / size if size > 0.0 else 0.0
    return normal, share * y1, share * y2, SLIDE, size


@inner
def project_beyond(yn, y1, y2, mu, held):
    """The same for the part of the cone above a normal impulse that is there already, with a disc for a foot."""
    l0, l1, l2, case, size = project(yn + held, y1, y2, mu)
    if held > 0.0 and l0 < held:
        most = mu * held
        if size <= most:
            return 0.0, y1, y2, HELD_STICK, size
        share = most / size
        return 0.0, share * y1, share * y2, HELD_SLIDE, size
    return l0 - held, l1, l2, case, size


@inner
def projection_derivative(y1, y2, mu, normal, case, size):
    """Six entries (nn, n1, n2, 11, 12, 22) of the derivative where ``project`` gave the rest."""
    if case == OPEN:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if case == STICK:
        return 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    if case == HELD_STICK:
        return 0.0, 0.0, 0.0, 1.0, 0.0, 1.0
    if case == HELD_SLIDE:
        # ``normal`` is what is held.
        e1 = y1 / size
        e2 = y2 / size
        across = mu * normal / size
        return 0.0, 0.0, 0.0, across * (1.0 - e1 * e1), -across * e1 * e2, across * (1.0 - e2 * e2)
    a = 1.0 / (1.0 + mu * mu)
    if size == 0.0:
        return a, 0.0, 0.0, 0.0, 0.0, 0.0
    e1 = y1 / size
    e2 = y2 / size
    across = mu * normal / size
    along = a * mu * mu - across
    return (
        a, a * mu * e1, a * mu * e2, across + along * e1 * e1, along * e1 * e2, across + along * e2 * e2
    )  # fmt: skip
