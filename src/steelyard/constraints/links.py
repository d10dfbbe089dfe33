"""Rods and cables: gradients, residuals and impulses.

With d = x_a - x_b a link holds g = (d.d - L^2)/2 = 0 (rod) or g <= 0 (cable). No square root is needed: the
gradient of g is d at a and -d at b. The impulse is minus the multiplier times it, so tension is positive;
the multiplier is a mass.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, select, splat, sqrt, store
from ..math.pointers import axes
from ..math.vectors import between, dot, load_coordinates
from ..model.tape import H_LINKS, LINK


@inner
def link_half_square(s, link, tape, length):
    """(d.d - L^2)/2 at the current positions."""
    x, y, z = between(s, tape[link], tape[link + 1])
    square = dot(x, y, z, x, y, z)
    return splat(0.5) * fma(-length, length, square)


@inner
def link_rate(s, link, tape):
    """d . (v_a - v_b) with the stored gradient d."""
    x, y, z = load_coordinates(s, tape[link + 13])
    u, v, w = between(s, tape[link + 2], tape[link + 3])
    return dot(x, y, z, u, v, w)


@inner
def link_gradients(tape, s):
    """Store d = x_a - x_b of every link."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        xa = tape[link]
        xb = tape[link + 1]
        d = tape[link + 13]
        for component in range(axes(s)):
            store(s, d + component, load(s, xa + component) - load(s, xb + component))


@inner
def link_targets(tape, s, dt):
    """Rate of g each link must have after the step, decided at its start.

    A rod or taut cable follows its winch: L dL/dt at the step's end. A cable that is closing on its end
    rebounds: minus restitution times the closing rate beyond the winch's. A cable overstretched at the
    start is held like a rod, so that pulling it back leaves no velocity.
    """
    at = tape[H_LINKS]
    zero = splat(0.0)
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        length = load(s, tape[link + 8])
        rate = load(s, tape[link + 9])
        end_rate = fma(dt, load(s, tape[link + 16]), rate)
        follow = fma(splat(0.5) * dt, rate + end_rate, length) * end_rate
        if tape[link + 10] == 0:
            store(s, tape[link + 14], follow)
        else:
            closing = link_rate(s, link, tape) - length * rate
            # The rebound is a rate of g at full length; the closing was measured short of it.
            x, y, z = load_coordinates(s, tape[link + 13])
            square = dot(x, y, z, x, y, z)
            closing = closing * length / sqrt(select(square > zero, square, splat(1.0)))
            rebound = select(closing > zero, closing * load(s, tape[link + 11]), zero)
            store(s, tape[link + 14], follow - rebound)
            over = link_half_square(s, link, tape, length) > splat(1e-9) * length * length
            store(s, tape[link + 14] + 1, select(over, splat(1.0), zero))


@inner
def link_multiplier(tape, link, velocity):
    """Row of a link's multiplier: of the position stage, or of the velocity stage."""
    return tape[link + 14] + 2 if velocity else tape[link + 12]


@inner
def link_impulses(tape, s, velocity):
    """Add every multiplier's impulse to the particles' impulse rows."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        fa = tape[link + 4]
        fb = tape[link + 5]
        multiplier = load(s, link_multiplier(tape, link, velocity))
        d = tape[link + 13]
        for component in range(axes(s)):
            part = multiplier * load(s, d + component)
            store(s, fa + component, load(s, fa + component) - part)
            store(s, fb + component, load(s, fb + component) + part)
