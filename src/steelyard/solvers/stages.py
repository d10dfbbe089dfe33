"""The two stages of a constrained step, around whichever staged solver the method names."""

from __future__ import annotations

from ..collision.geometry import contact_geometry
from ..constraints.contacts import contact_targets
from ..constraints.links import link_gradients, link_targets
from ..constraints.riders import rider_coefficients
from ..integrators.motion import add_stage_velocity, keep_free_velocity
from ..kernel import inner
from ..model.tape import DIRECT, H_POSITION, H_SOLVER, H_VELOCITY
from .direct import refactor, solve_stage
from .gauss_seidel import sweep_stage


@inner
def begin_step(tape, s, skip, dt):
    """At the start of a step: gradients, contact frames, targets of the velocity stage.

    Returns whether the last velocity stage's factor no longer fits.
    """
    link_gradients(tape, s)
    link_targets(tape, s, dt)
    rider_coefficients(tape, s)
    contact_geometry(tape, s)
    return contact_targets(tape, s, dt, skip)


@inner
def position_stage(tape, s, skip, dt, fresh):
    """Put the drifted positions on the constraints; the velocities take the impulses along.

    ``fresh`` says that the factor at hand is not of the present gradients.
    """
    if tape[H_SOLVER] == DIRECT:
        if fresh:
            refactor(tape, s, skip)
        solve_stage(tape, s, skip, False, dt, tape[H_POSITION])
    else:
        sweep_stage(tape, s, skip, False, tape[H_POSITION])
    add_stage_velocity(tape, s, dt)


@inner
def velocity_stage(tape, s, skip, dt):
    """Make the velocities follow the constraints at the new positions, impacts included."""
    link_gradients(tape, s)
    rider_coefficients(tape, s)
    keep_free_velocity(tape, s)
    if tape[H_SOLVER] == DIRECT:
        refactor(tape, s, skip)
        solve_stage(tape, s, skip, True, dt, tape[H_VELOCITY])
    else:
        sweep_stage(tape, s, skip, True, tape[H_VELOCITY])
