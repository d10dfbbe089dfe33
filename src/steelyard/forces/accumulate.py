"""The sum of all forces on every particle (d'Alembert)."""

from __future__ import annotations

from functools import cache

from ..kernel import inner
from ..math.lanes import any_lane, fma, load, splat, store
from ..math.pointers import axes
from ..model.tape import (
    H_ACTIVE,
    H_DT,
    H_FORCE,
    H_FORCED,
    H_NOW,
    H_PARTICLES,
    H_TIME,
    H_USER_FORCES,
)
from ..stage import stage
from .aero import add_surfaces
from .applied import add_applied, add_thrusts
from .body_points import clear_wrenches, gather_points, place_points
from .buoyancy import add_buoyancy
from .drag import add_drag
from .explosion import add_explosions
from .gravity import add_gravity
from .springs import add_springs


@inner
def clear_forces(tape, s):
    """Force rows = 0."""
    zero = splat(0.0)
    for p in range(tape[H_PARTICLES] + 1):
        for axis in range(axes(s)):
            store(s, tape[H_FORCE] + 3 * p + axis, zero)


@inner
def add_written_forces(tape, s):
    """Add what user-written forces sum to."""
    given = tape[H_USER_FORCES]
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            f = tape[H_FORCE] + 3 * p + axis
            store(s, f, load(s, f) + load(s, given + 3 * p + axis))


@inner
def accumulate_forces(tape, s):
    """Clear the force rows and add all forces but drag, which integrators treat in their own way."""
    if tape[H_FORCED] == 0:
        return
    clear_forces(tape, s)
    add_springs(tape, s)
    add_gravity(tape, s)
    add_buoyancy(tape, s)
    add_explosions(tape, s)
    if tape[H_USER_FORCES] >= 0:
        add_written_forces(tape, s)


@stage
def load_bodies(tape, s, skip, part):
    """Clear the wrenches on bodies and place their points; ``sum_forces`` follows."""
    clear_wrenches(tape, s)
    place_points(tape, s)
    add_thrusts(tape, s)
    add_surfaces(tape, s)
    add_applied(tape, s)


@stage
def gather_bodies(tape, s, skip, part):
    """What all forces come to on bodies, after ``sum_forces``."""
    gather_points(tape, s)


@stage
def sum_forces(tape, s, skip, part):
    """All forces at the state at hand, drag too; nothing where no world is active."""
    if any_lane(load(s, tape[H_ACTIVE]) > splat(0.5)):
        accumulate_forces(tape, s)
        add_drag(tape, s)


@inner
def tell_time(tape, s, share):
    """The time at which forces are evaluated next: that of the step's start and ``share`` of the step."""
    now = fma(share, load(s, tape[H_DT]), load(s, tape[H_TIME]))
    store(s, tape[H_NOW], now)


@stage
def tell_rk4_time(tape, s, skip, part):
    """The time of each evaluation of the classical Runge-Kutta method."""
    tell_time(tape, s, splat(0.0 if part == 0 else 1.0 if part == 3 else 0.5))


@cache
def acting_forces(acting):
    """``accumulate_forces`` for the declared kinds alone (``integrators.base.Acting``), which costs what they cost."""
    springs, gravities, buoyancies, written = acting[:4]
    particles_forced = acting.particles_forced
    points, wrenches, applied = acting.points, acting.wrenches, acting.applied
    thrusts, surfaces, explosions = acting.thrusts, acting.surfaces, acting.explosions

    @inner
    def accumulate(tape, s):
        if wrenches:
            clear_wrenches(tape, s)
        if points:
            place_points(tape, s)
        if particles_forced:
            clear_forces(tape, s)
        if springs:
            add_springs(tape, s)
        if gravities:
            add_gravity(tape, s)
        if buoyancies:
            add_buoyancy(tape, s)
        if written:
            add_written_forces(tape, s)
        if explosions:
            add_explosions(tape, s)
        if thrusts:
            add_thrusts(tape, s)
        if surfaces:
            add_surfaces(tape, s)
        if applied:
            add_applied(tape, s)
        if points:
            gather_points(tape, s)

    return accumulate
