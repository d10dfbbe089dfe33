"""Small-step XPBD: extended position-based dynamics, one pass over the constraints in each of many substeps.

In a substep of h = dt / substeps every constraint in turn moves its particles along its present gradient. With l =
|x_a - x_b|, W = w_a + w_b and q the pull times h^2 summed so far,

    rod, cable:   dq = (l - L) / W,                           cables q >= 0,
    spring:       dq = (k h^2 (l - l0) - q) / (k h^2 W + 1),  bungees q >= 0:

springs are constraints of compliance 1/k, not forces. Velocities are those of the displacement; impulses, not
places, are summed for them, so that rounding takes no momentum. Contacts close and obey Coulomb's law by the
displacement of the substep; what rebounds, cables too, is set right in the velocities afterwards.

Order 1, in the substep. Conserves linear momentum; damps like backward Euler: a single spring keeps (1 + h^2
w^2)^(-1/2) of its amplitude at each substep, whatever its stiffness, and what turns loses angular momentum. No spring
has a stability limit; other forces have that of symplectic Euler in h. One pass does not settle constraints that
share particles: a rod of a chain is right after its turn, and the next one's pull T stretches it again by h^2 T / m, m
the mass between them, at rest too. Works with symplectic Euler alone, whose step predicts the substep.

Sources: Macklin, Mueller & Chentanez 2016, *XPBD* (eq. 18); Macklin et al. 2019, *Small steps in physics simulation*;
Mueller et al. 2020, *Detailed rigid body simulation with extended position based dynamics* (contacts).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..constraints.contacts import contact_impulses, contact_multiplier
from ..constraints.links import link_multiplier, link_rate
from ..constraints.riders import DECK, HEAD, rider_impulses, rider_multiplier
from ..kernel import inner
from ..math.lanes import fma, load, select, splat, sqrt, store
from ..math.pointers import axes
from ..math.vectors import add_scaled, between, dot, load_coordinates, store_coordinates
from ..model.tape import (
    COMPLIANCE,
    CONTACT,
    H_COMPLIANCES,
    H_CONTACTS,
    H_DT,
    H_IMPULSE,
    H_LINKS,
    H_PARTICLES,
    H_PASSES,
    H_RIDERS,
    LINK,
)
from ..stage import Stage, stage
from .base import Solver
from .gather import clear_velocity_multipliers
from .gauss_seidel import sweep_contacts, sweep_riders
from .stages import begin_stage, end_stage


@dataclass(frozen=True)
class Xpbd(Solver):
    """Small-step XPBD (see the module).

    Args:
        substeps: substeps of a step; controls and user-written forces act in each of them.
        iterations: passes over the constraints in a substep; more substeps are worth more than more passes.
    """

    substeps: int = 20
    iterations: int = 1

    compliant: ClassVar[bool] = True

    @property
    def stage(self) -> Stage:
        """Puts positions on the constraints, then mends velocities of what rebounds."""
        return xpbd_stage


@inner
def _clear(tape, s):
    """Multipliers and impulses of a substep start from none."""
    zero = splat(0.0)
    for row in range(3 * tape[H_PARTICLES] + 3):
        store(s, tape[H_IMPULSE] + row, zero)
    at = tape[H_COMPLIANCES]
    for index in range(tape[at]):
        store(s, tape[at + 1 + COMPLIANCE * index + 9], zero)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        store(s, link_multiplier(tape, at + 1 + LINK * index, False), zero)
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            store(s, rider_multiplier(tape, at, False) + axis, zero)
        at += HEAD + DECK * tape[at + 6]
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        for axis in range(3):
            store(s, contact_multiplier(tape, at + 1 + CONTACT * index, False) + axis, zero)


@inner
def _direction(s, a, b):
    """Unit vector from b to a, 0 where they coincide, and their distance."""
    zero = splat(0.0)
    one = splat(1.0)
    x, y, z = between(s, a, b)
    distance = sqrt(dot(x, y, z, x, y, z))
    some = distance > zero
    inverse = select(some, one / select(some, distance, one), zero)
    return x * inverse, y * inverse, z * inverse, distance


@inner
def _pull(s, x, impulse, weight, nx, ny, nz, change):
    """Add ``change`` times n to an impulse, and what it does to the place."""
    px = change * nx
    py = change * ny
    pz = change * nz
    ix, iy, iz = load_coordinates(s, impulse)
    store_coordinates(s, impulse, ix + px, iy + py, iz + pz)
    add_scaled(s, x, weight, px, py, pz)


@inner
def _draw_together(tape, s, a, b, fa, fb, wa, wb, nx, ny, nz, change):
    """Pull both ends together; an anchor stays."""
    _pull(s, a, fa, wa, nx, ny, nz, -change)
    if fb < tape[H_IMPULSE] + 3 * tape[H_PARTICLES]:
        _pull(s, b, fb, wb, nx, ny, nz, change)


@inner
def _project_springs(tape, s, square_dt):
    """One pass over springs and bungees."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_COMPLIANCES]
    for index in range(tape[at]):
        k = at + 1 + COMPLIANCE * index
        a, b = tape[k], tape[k + 1]
        wa, wb = load(s, tape[k + 4]), load(s, tape[k + 5])
        nx, ny, nz, distance = _direction(s, a, b)
        stiffness = load(s, tape[k + 6]) * square_dt
        row = tape[k + 9]
        old = load(s, row)
        error = fma(stiffness, distance - load(s, tape[k + 7]), -old)
        new = old + error / fma(stiffness, wa + wb, one)
        if tape[k + 8] != 0:
            new = select(new > zero, new, zero)
        store(s, row, new)
        _draw_together(tape, s, a, b, tape[k + 2], tape[k + 3], wa, wb, nx, ny, nz, new - old)


@inner
def _project_links(tape, s):
    """One pass over rods and cables."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        a, b = tape[link], tape[link + 1]
        wa, wb = load(s, tape[link + 6]), load(s, tape[link + 7])
        nx, ny, nz, distance = _direction(s, a, b)
        total = wa + wb
        movable = total > zero
        row = link_multiplier(tape, link, False)
        old = load(s, row)
        change = (distance - load(s, tape[link + 8])) / select(movable, total, one)
        new = old + select(movable, change, zero)
        if tape[link + 10] != 0:
            new = select(new > zero, new, zero)
        store(s, row, new)
        _draw_together(tape, s, a, b, tape[link + 4], tape[link + 5], wa, wb, nx, ny, nz, new - old)


@inner
def _multipliers(tape, s):
    """Pulls of links over their distance, as other solvers keep them: along x_a - x_b."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        _, _, _, distance = _direction(s, tape[link], tape[link + 1])
        row = link_multiplier(tape, link, False)
        some = distance > zero
        store(s, row, select(some, load(s, row) / select(some, distance, one), zero))


@inner
def _rebound_cables(tape, s):
    """Cables that have met their end leave it at the rate that their restitution asks for."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            d = tape[link + 13]
            dx, dy, dz = load_coordinates(s, d)
            square = dot(dx, dy, dz, dx, dy, dz)
            wa, wb = load(s, tape[link + 6]), load(s, tape[link + 7])
            slope = square * (wa + wb)
            target = load(s, tape[link + 14])
            # Without a rebound the target is to follow the winch, which the displacement has done.
            follow = load(s, tape[link + 8]) * load(s, tape[link + 9])
            met = (load(s, link_multiplier(tape, link, False)) > zero) & (target < follow)
            error = link_rate(s, link, tape) - target
            met = met & (error > zero) & (slope > zero)
            change = select(met, error / select(slope > zero, slope, one), zero)
            two = tape[link + 5] < tape[H_IMPULSE] + 3 * tape[H_PARTICLES]
            for component in range(axes(s)):
                push = change * load(s, d + component)
                v = tape[link + 2] + component
                store(s, v, load(s, v) - wa * push)
                if two:
                    v = tape[link + 3] + component
                    store(s, v, load(s, v) + wb * push)


@stage
def xpbd_stage(tape, s, skip, half):
    """Half 0: positions, and the velocities that follow from them; half 1: what rebounds."""
    begin_stage(tape, s, half)
    if half == 0:
        dt = load(s, tape[H_DT])
        _clear(tape, s)
        for _ in range(tape[H_PASSES]):
            _project_springs(tape, s, dt * dt)
            _project_links(tape, s)
            sweep_riders(tape, s, False)
            sweep_contacts(tape, s, skip, False)
        _multipliers(tape, s)
        rider_impulses(tape, s, False)
        contact_impulses(tape, s, skip, False)
    else:
        clear_velocity_multipliers(tape, s)
        _rebound_cables(tape, s)
        sweep_contacts(tape, s, skip, True)
    end_stage(tape, s, half)
