"""Explosions: first a pull inwards, then a wave that runs outwards, and hot air that rises above the place.

With t from the detonation, d from its place, r = |d|, n = d/r and T the duration of the implosion:

    implosion    -F n                              for 0 <= t < T, least < r < most
    wave         F (1 - u/D) max(0, 1 - |r - c u|/w) n    with u = t - T, for 0 <= u < D
    convection   F (1 - u/D) (1 - rho/R) up              for 0 <= u < D, rho < R beside it, height in [0, H]

Record: position, force, first row of the place and of the numbers in the order of ``SETTINGS``, row of the time of
detonation. Where there is no direction, at the very place, there is no force.

Source: Millington, *Game Physics Engine Development*, ch. 11 (the three phases).
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import absolute, load, select, splat, sqrt, store
from ..math.vectors import add_scaled, between, dot
from ..model.tape import H_EXPLOSIONS, H_NOW

RECORD = 4
#: Names of the numbers behind the place, as they stand in the rows.
SETTINGS = (
    "implosion_force", "implosion_duration", "implosion_least", "implosion_most",
    "wave_force", "wave_duration", "wave_speed", "wave_thickness",
    "convection_force", "convection_duration", "chimney_radius", "chimney_height",
)  # fmt: skip


@inner
def _fading(time, duration):
    """1 - time/duration while that lasts, 0 before and after."""
    zero = splat(0.0)
    on = (time >= zero) & (time < duration)
    return select(on, splat(1.0) - time / select(on, duration, splat(1.0)), zero)


@inner
def add_explosions(tape, s):
    """Add every explosion's force to the force rows, at the time in the row ``H_NOW``."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_EXPLOSIONS]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        row = tape[k + 2] + 3
        time = load(s, tape[H_NOW]) - load(s, tape[k + 3])
        x, y, z = between(s, tape[k], tape[k + 2])
        distance = sqrt(dot(x, y, z, x, y, z))
        apart = distance > zero
        duration = load(s, row + 1)
        near = (distance > load(s, row + 2)) & (distance < load(s, row + 3))
        pulls = (time >= zero) & (time < duration) & near
        force = select(pulls, -load(s, row), zero)
        since = time - duration
        lag = absolute(distance - load(s, row + 6) * since)
        share = one - lag / load(s, row + 7)
        share = select(share > zero, share, zero) * _fading(since, load(s, row + 5))
        force = force + load(s, row + 4) * share
        force = select(apart, force / select(apart, distance, one), zero)
        add_scaled(s, tape[k + 1], force, x, y, z)
        beside = sqrt(dot(x, zero, z, x, zero, z)) / load(s, row + 10)
        over = (y >= zero) & (y < load(s, row + 11)) & (beside < one)
        lift = load(s, row + 8) * _fading(since, load(s, row + 9))
        lift = select(over, lift * (one - beside), zero)
        up = tape[k + 1] + 1
        store(s, up, load(s, up) + lift)
