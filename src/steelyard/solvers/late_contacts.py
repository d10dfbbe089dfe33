"""Contacts that a step only makes on its way: what turns fast meets others with features that faced away at the start.

After the solve of the position stage all solids drift as that says. Where they then overlap, the overlapping points
become contacts too, linearised where the step ends: they are to approach by as much less as they are deep. The solve is
done again, a few times over, since the new impulses turn solids in their turn.
"""

from __future__ import annotations

from ..collision.contact_list import any_turns_far, find_late_contacts
from ..collision.placement import place_colliders
from ..constraints.contact_rows import contact_at, contact_ends, relative_velocity
from ..constraints.solids import drift_by_impulses
from ..integrators.rotor import ROUGH_ORDER
from ..kernel import inner
from ..math.pointers import doubles_at
from ..model.rigid_layout import (
    C_BEFORE,
    C_BRAKE,
    C_BRAKE_BEFORE,
    C_IMPULSE,
    C_LATE,
    C_REBOUND,
    C_RESTITUTION,
    N_SLOP,
    NUMBERS,
    S_END,
    S_END_ROTATION,
    S_GRADIENT,
)
from .blows import start_velocities
from .rigid_islands import LATE, solve_islands

_TURNS = 4


@inner
def meet_late(tape, s, n, rigid, k, kept, count, dt):
    """Solve again for what overlaps where the step ends; how many contacts there are then."""
    if not any_turns_far(tape, s, rigid, dt):
        return count
    slop = doubles_at(tape[rigid + NUMBERS])[N_SLOP]
    for i in range(count):
        s[contact_at(tape, rigid, i) + C_LATE] = 0.0
    for _ in range(_TURNS):
        drift_by_impulses(tape, s, rigid, k, dt, ROUGH_ORDER)
        place_colliders(tape, s, rigid, k, dt, S_END, S_END_ROTATION)
        count, found = find_late_contacts(tape, s, n, rigid, k, kept, count, dt, slop)
        if not found:
            break
        for i in range(count):
            c = contact_at(tape, rigid, i)
            for axis in range(3):
                s[c + C_BEFORE + axis] = s[c + C_IMPULSE + axis]
                s[c + C_BRAKE_BEFORE + axis] = s[c + C_BRAKE + axis]
        solve_islands(tape, s, n, rigid, count, k, LATE)
        for i in range(count):
            c = contact_at(tape, rigid, i)
            s[c + C_LATE] = abs(s[c + C_LATE])
    start_velocities(tape, s, rigid, k)
    for i in range(count):
        c = contact_at(tape, rigid, i)
        if s[c + C_LATE] != 0.0 and s[c + C_IMPULSE] > 0.0:
            a, b = contact_ends(tape, n, rigid, i)
            before, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
            s[c + C_REBOUND] = s[c + C_RESTITUTION] * max(-before, 0.0)
    return count
