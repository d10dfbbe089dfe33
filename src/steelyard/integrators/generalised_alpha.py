"""Index-3 generalised-alpha with geometric stiffness: links and motion solved together, implicitly.

    M q" = f - J^T l at the step's end, with the length of every link there; for the filtered acceleration a
    (1 - am) a' + am a = (1 - af) q"' + af q",
    x' = x + h v + h^2 ((1/2 - b) a + b a'),   v' = v + h ((1 - g) a + g a').

am = (2 r - 1)/(r + 1), af = r/(r + 1), g = 1/2 + af - am, b = (g + 1/2)^2 / 4 with r = ``rho_inf``, the share of the
amplitude that oscillations far above 1/h keep per step. Newton's method on ``solvers.saddle``, which starts from the
multipliers at hand. A heavy end puts its tension into the matrix: vibrations across a taut chain, of 2 sqrt(T/(m l))
radians a second, need no small step. RATTLE fails where h times that is above about 2.

Order 2 in positions and velocities on smooth motion, 1 across impacts. Linear momentum is conserved to the tolerance;
angular momentum and energy to second order, and energy falls where motion is not resolved. Every spring is stable. Of
the nonlinear motion of links that is not certain: a chain of 20 links of 1 m with an end of 1000 x at 60 Hz, shaken in
space by .3 m/s, held in all of 64 worlds for r up to .4, did not always settle at .5, and blew up at .55; let go at
rest it held to .6. Links of .1 m need r up to .3. An end of 1e6 x wants r = 0. A world that does not settle is
flagged.

Damping, drag, springs and buoyancy are forces at the step's end like all others, with their derivatives in the matrix
(``integrators.implicit``); stiff springs count as plain anchored ones. Rods that others imply are left out. Cables are
an active set: one that would push goes slack. Where a slack one tightens, or links were off their length, velocities
get the least impulse (in the metric of masses) that leaves the cable's rebound by Newton's law and all else at rest
along the links, and the next step starts afresh: accelerations and multipliers from the equations of motion. So it does
wherever positions or velocities were assigned; velocities that links cannot follow first get such an impulse too.
Refuses contacts, user-written forces, and any solver beside it.

Sources: Chung & Hulbert (1993); Arnold & Bruels (2007), with links at index 3; geometric stiffness: Tournier, Nesme,
Gilles & Faure (2015); impacts as velocity jumps beside the smooth motion: Bruels, Acary & Cardona (2014).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from ..constraints.controls import move_controls
from ..constraints.links import link_gradients, link_targets
from ..constraints.riders import rider_coefficients
from ..forces.accumulate import accumulate_forces
from ..forces.drag import add_drag
from ..kernel import inner
from ..math.lanes import absolute, any_lane, fma, load, select, splat, store
from ..math.pointers import axes
from ..math.vectors import store_coordinates
from ..model.tape import (
    H_CONSTANTS,
    H_DAMPING,
    H_DRIFT,
    H_DT,
    H_FILTERED,
    H_IMPULSE,
    H_INVERSE_MASS,
    H_JOLT,
    H_MARK,
    H_MASS,
    H_PARTICLES,
    H_PASSES,
    H_POSITION,
    H_SADDLE_SOLVE,
    H_TOLERANCE,
    H_UNKNOWNS,
    H_UNSETTLED,
    H_VELOCITY,
    H_WORK,
)
from ..scene import checks
from ..solvers.base import Solver
from ..solvers.saddle import MASSES, MOTION
from ..solvers.saddle_rows import (
    acceleration_rows,
    add_position_multipliers,
    keep_multipliers,
    leaving,
    let_pushing_go,
    position_rows,
    pull,
    snapped,
    take_multipliers,
    taut_as_pulled,
    taut_at_rest,
    velocity_rows,
)
from ..stage import call_stage, stage
from .base import Acting, Integrator, Recipe
from .implicit import UNKNOWN, load_force

_SHARE = checks.Limit(least=0.0, most=1.0, remedy="Use 0 where motion is violent, 0.3 elsewhere.")
# Constants, in rows of the scratch.
_SQUARE, _RATE, _OLD, _NEW, _FORCES, _FILTERED, _OLD_SPEED, _NEW_SPEED, _INVERSE = range(9)
_FREE_CHANGES = 10
# Rounding of a coordinate as it enters an equation, a few units in the last place.
_ROUNDING = 1e-15


@dataclass(frozen=True)
class GeneralisedAlpha(Integrator):
    """Index-3 generalised-alpha with geometric stiffness (see the module).

    Args:
        rho_inf: share of the amplitude that oscillations far above 1/dt keep per step, in [0, 1].
        passes: most Newton passes; a world that needs more is flagged in ``world.health``.
        tolerance: largest violation of a link over its length, and of an equation of motion over its terms.
    """

    rho_inf: float = 0.3
    passes: int = 30
    tolerance: float = 1e-12

    sums_drag: ClassVar[bool] = True
    smooth: ClassVar[bool] = True
    evaluations: ClassVar[tuple[float | None, ...]] = ()
    holds_links: ClassVar[bool] = True
    work: ClassVar[int] = 14

    def __post_init__(self) -> None:
        checks.number("GeneralisedAlpha", "rho_inf", self.rho_inf, _SHARE)

    @property
    def reach(self) -> float:  # type: ignore[override]
        """Share of the step, squared the weight of the forces at its end."""
        return math.sqrt(self.constants(1.0)[_SQUARE])

    def constants(self, dt: float) -> tuple[float, ...]:
        """Weights of the update."""
        r = self.rho_inf
        am, af = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
        g = 0.5 + af - am
        b = 0.25 * (g + 0.5) ** 2
        new = dt * dt * b
        return (
            new * (1.0 - af) / (1.0 - am), g / (b * dt), dt * dt * (0.5 - b), new, af / (1.0 - am),
            am / (1.0 - am), dt * (1.0 - g), dt * g, 1.0 / new,
        )  # fmt: skip

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """Prediction, Newton's method, new velocities."""
        return (
            (generalised_alpha_begin, 0),
            (move_controls, 0),
            (generalised_alpha_solve, 0),
            (generalised_alpha_end, 0),
        )

    def order(self) -> int:
        """Second order."""
        return 2

    def stable_limit(self) -> float:
        """Every spring is stable."""
        return math.inf


@inner
def _fingerprint(tape, s):
    """A number that changes when any position or velocity does."""
    value = splat(0.0)
    for p in range(tape[H_PARTICLES]):
        for axis in range(axes(s)):
            row = 3 * p + axis
            weight = splat(1.0 + 0.37 * row)
            value = fma(weight, load(s, tape[H_POSITION] + row), value)
            value = fma(weight + splat(0.1), load(s, tape[H_VELOCITY] + row), value)
    return value


@inner
def _project(tape, s, skip, worlds):
    """Least change of velocities, in the metric of masses, that gives links and riders of some worlds their rates."""
    zero = splat(0.0)
    at = tape[H_UNKNOWNS]
    for _ in range(tape[H_PASSES]):
        for index in range(tape[at]):
            row = tape[at + 1 + UNKNOWN * index + 2]
            for axis in range(axes(s)):
                store(s, row + axis, zero)
        velocity_rows(tape, s)
        call_stage(tape[H_SADDLE_SOLVE], tape, s, skip, MASSES)
        if not any_lane(let_pushing_go(tape, s) & worlds):
            break
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        for axis in range(axes(s)):
            row = tape[H_VELOCITY] + tape[k] + axis
            change = select(worlds, load(s, tape[k + 2] + axis), zero)
            store(s, row, load(s, row) + change)


@inner
def _start_accelerations(tape, s, skip, fresh, dt):
    """Multipliers of the equations of motion at the present state, in the worlds that start afresh.

    Velocities that links cannot follow are theirs no longer.
    """
    taut_at_rest(tape, s, dt)
    worlds = fresh & leaving(tape, s, dt)
    if any_lane(worlds):
        _project(tape, s, skip, worlds)
        link_targets(tape, s, dt)
        accumulate_forces(tape, s)
        add_drag(tape, s)
        taut_at_rest(tape, s, dt)
    at = tape[H_UNKNOWNS]
    for _ in range(tape[H_PASSES]):
        for index in range(tape[at]):
            k = at + 1 + UNKNOWN * index
            x, y, z = load_force(tape, s, k)
            store_coordinates(s, tape[k + 2], x, y, z)
        acceleration_rows(tape, s)
        call_stage(tape[H_SADDLE_SOLVE], tape, s, skip, MASSES)
        if not any_lane(take_multipliers(tape, s, fresh)):
            break


@stage
def generalised_alpha_begin(tape, s, skip, part):
    """Accelerations at the start, and what of the step's end does not depend on the forces there.

    Work rows: positions, velocities and filtered accelerations of that kind, then what the forces move, which is kept
    apart since a difference of positions would lose it to rounding, then sizes of forces (``pull``).
    """
    dt = load(s, tape[H_DT])
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    constants = tape[H_CONSTANTS]
    mark = _fingerprint(tape, s)
    old_mark = load(s, tape[H_MARK])
    untouched = (mark <= old_mark) & (mark >= old_mark)
    fresh = select(untouched, splat(0.0), splat(1.0)) > splat(0.5)
    link_gradients(tape, s)
    link_targets(tape, s, dt)
    rider_coefficients(tape, s)
    accumulate_forces(tape, s)
    add_drag(tape, s)
    if any_lane(fresh):
        _start_accelerations(tape, s, skip, fresh, dt)
    jolt = keep_multipliers(tape, s)
    store(s, tape[H_JOLT], select(jolt, splat(1.0), splat(0.0)))
    pull(tape, s, work + 4 * count)
    square = load(s, constants + _SQUARE)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        inverse = load(s, tape[H_INVERSE_MASS] + tape[k + 1])
        fx, fy, fz = load_force(tape, s, k)
        store_coordinates(s, tape[k + 2], fx, fy, fz)
        for axis in range(axes(s)):
            row = tape[k] + axis
            q = load(s, tape[k + 2] + axis)
            if tape[H_IMPULSE] >= 0:
                q = q + load(s, tape[H_IMPULSE] + row)
            q = q * inverse
            a = select(fresh, q, load(s, tape[H_FILTERED] + row))
            x = load(s, tape[H_POSITION] + row)
            v = load(s, tape[H_VELOCITY] + row)
            b = load(s, constants + _FORCES) * q - load(s, constants + _FILTERED) * a
            x = fma(dt, v, x)
            x = fma(load(s, constants + _OLD), a, fma(load(s, constants + _NEW), b, x))
            v = fma(load(s, constants + _OLD_SPEED), a, v)
            v = fma(load(s, constants + _NEW_SPEED), b, v)
            store(s, work + row, x)
            store(s, work + count + row, v)
            store(s, work + 2 * count + row, b)
            moved = square * q
            store(s, work + 3 * count + row, moved)
            store(s, tape[H_POSITION] + row, x + moved)
            store(s, tape[H_VELOCITY] + row, fma(load(s, constants + _RATE), moved, v))
    at = tape[H_DRIFT]
    for index in range(tape[at]):
        p = tape[at + 1 + index]
        still = load(s, tape[H_INVERSE_MASS] + p) > splat(0.0)
        for axis in range(axes(s)):
            row = 3 * p + axis
            x = load(s, tape[H_POSITION] + row)
            moved = fma(dt, load(s, tape[H_VELOCITY] + row), x)
            store(s, tape[H_POSITION] + row, select(still, x, moved))


@inner
def _motion_rows(tape, s):
    """Right sides of the motion; worlds that miss the tolerance.

    In tension's share of an equation, what is left must be below the tolerance times all its terms, or rounding.
    """
    zero = splat(0.0)
    bad = zero > zero
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    square = load(s, tape[H_CONSTANTS] + _SQUARE)
    tolerance = load(s, tape[H_TOLERANCE])
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        mass = load(s, tape[H_MASS] + tape[k + 1])
        fx, fy, fz = load_force(tape, s, k)
        store_coordinates(s, tape[k + 2], fx, fy, fz)
        size = zero
        rounding = zero
        left = zero
        for axis in range(axes(s)):
            row = tape[k] + axis
            pulled = load(s, tape[k + 2] + axis)
            x = load(s, tape[H_POSITION] + row)
            free = load(s, work + row)
            moved = mass * load(s, work + 3 * count + row)
            size = size + absolute(moved) + square * absolute(pulled)
            rounding = rounding + mass * (absolute(x) + absolute(free))
            if tape[H_IMPULSE] >= 0:
                pulled = pulled + load(s, tape[H_IMPULSE] + row)
            rest = fma(square, pulled, -moved)
            store(s, tape[k + 2] + axis, rest)
            left = left + absolute(rest)
        if tape[H_IMPULSE] >= 0:
            size = fma(square, load(s, work + 4 * count + tape[k + 1]), size)
        bad = bad | (left > fma(tolerance, size, splat(_ROUNDING) * rounding))
    return bad


@stage
def generalised_alpha_solve(tape, s, skip, part):
    """Newton's method for the positions at the step's end."""
    zero = splat(0.0)
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    constants = tape[H_CONSTANTS]
    square = load(s, constants + _SQUARE)
    rate = load(s, constants + _RATE)
    rider_coefficients(tape, s)
    taut_as_pulled(tape, s)
    active = zero <= zero
    at = tape[H_UNKNOWNS]
    for turn in range(tape[H_PASSES] + 1):
        link_gradients(tape, s)
        accumulate_forces(tape, s)
        add_drag(tape, s)
        bad = position_rows(tape, s, active, turn >= _FREE_CHANGES)
        pull(tape, s, work + 4 * count)
        active = active & (_motion_rows(tape, s) | bad)
        if turn == tape[H_PASSES] or not any_lane(active):
            break
        call_stage(tape[H_SADDLE_SOLVE], tape, s, skip, MOTION)
        add_position_multipliers(tape, s, splat(1.0) / square, active)
        for index in range(tape[at]):
            k = at + 1 + UNKNOWN * index
            for axis in range(axes(s)):
                row = tape[k] + axis
                change = select(active, load(s, tape[k + 2] + axis), zero)
                moved = load(s, work + 3 * count + row) + change
                store(s, work + 3 * count + row, moved)
                store(s, tape[H_POSITION] + row, load(s, work + row) + moved)
                v = load(s, work + count + row)
                store(s, tape[H_VELOCITY] + row, fma(rate, moved, v))
    flag = tape[H_UNSETTLED]
    store(s, flag, select(active, splat(1.0), load(s, flag)))


@inner
def _impact(tape, s, skip, worlds):
    """Velocities of some worlds after an impact.

    The impulses of the position's multipliers are taken out first, or a cable that was pulled back by much would
    seem to push.
    """
    zero = splat(0.0)
    constants = tape[H_CONSTANTS]
    share = load(s, constants + _RATE) * load(s, constants + _SQUARE)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        inverse = load(s, tape[H_INVERSE_MASS] + tape[k + 1])
        # What damping at the step's end left of the impulse.
        damping = load(s, tape[H_DAMPING] + tape[k + 1])
        inverse = inverse / fma(damping, share, splat(1.0))
        for axis in range(axes(s)):
            row = tape[H_VELOCITY] + tape[k] + axis
            part = inverse * share * load(s, tape[H_IMPULSE] + tape[k] + axis)
            store(s, row, load(s, row) - select(worlds, part, zero))
    _project(tape, s, skip, worlds)


@stage
def generalised_alpha_end(tape, s, skip, part):
    """Velocities and filtered accelerations at the step's end, impacts included."""
    work = tape[H_WORK]
    count = 3 * tape[H_PARTICLES]
    constants = tape[H_CONSTANTS]
    rate = load(s, constants + _RATE)
    inverse = load(s, constants + _INVERSE)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        for axis in range(axes(s)):
            row = tape[k] + axis
            moved = load(s, work + 3 * count + row)
            v = fma(rate, moved, load(s, work + count + row))
            store(s, tape[H_VELOCITY] + row, v)
            a = fma(inverse, moved, load(s, work + 2 * count + row))
            store(s, tape[H_FILTERED] + row, a)
    afresh = splat(0.0)
    if tape[H_IMPULSE] >= 0:
        worlds = snapped(tape, s) | (load(s, tape[H_JOLT]) > splat(0.5))
        if any_lane(worlds):
            _impact(tape, s, skip, worlds)
            afresh = select(worlds, splat(1.0), afresh)
    mark = _fingerprint(tape, s)
    none = splat(0.0) / splat(0.0)
    store(s, tape[H_MARK], select(afresh > splat(0.5), none, mark))
