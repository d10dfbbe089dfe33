"""The two stages of a constrained step, around whichever staged solver the method names."""

from __future__ import annotations

from ..collision.geometry import contact_geometry
from ..constraints.clusters import cluster_frames
from ..constraints.contacts import contact_targets
from ..constraints.links import link_gradients, link_targets
from ..constraints.riders import rider_coefficients
from ..integrators.motion import add_stage_velocity, keep_free_velocity
from ..kernel import part
from ..model.tape import DIRECT, H_POSITION, H_SOLVER, H_VELOCITY
from .direct import solve_stage
from .gauss_seidel import sweep_stage
from .matrix import refactor


@part
def begin_step(tape, s, skip, dt):
    """At the start of a step: gradients, contact frames, targets of the velocity stage.

    Returns whether the last velocity stage's factor no longer fits.
    """
    link_gradients(tape, s)
    link_targets(tape, s, dt)
    rider_coefficients(tape, s)
    cluster_frames(tape, s)
    contact_geometry(tape, s)
    return contact_targets(tape, s, dt, skip)


@part
def constraint_stage(tape, s, skip, velocity, dt, fresh, hasty):
    """Put the drifted positions, or the kicked velocities, on the constraints.

    The velocities take the impulses of the position stage along. The velocity stage is at the new positions,
    impacts included. ``fresh`` says that the factor at hand is not of the start's gradients; for ``hasty`` see
    ``solve_stage``.
    """
    target = tape[H_POSITION]
    if velocity:
        target = tape[H_VELOCITY]
        link_gradients(tape, s)
        rider_coefficients(tape, s)
        cluster_frames(tape, s)
        keep_free_velocity(tape, s)
    if tape[H_SOLVER] == DIRECT:
        if velocity or fresh:
            refactor(tape, s, skip)
        solve_stage(tape, s, skip, velocity, dt, target, hasty)
    else:
        sweep_stage(tape, s, skip, velocity, target)
    if not velocity:
        add_stage_velocity(tape, s, dt)
