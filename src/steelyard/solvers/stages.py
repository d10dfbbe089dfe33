"""The two stages of a constrained step, around whichever staged solver the method names."""

from __future__ import annotations

from ..collision.geometry import contact_geometry
from ..constraints.clusters import cluster_frames
from ..constraints.contacts import contact_targets
from ..constraints.links import link_gradients, link_targets
from ..constraints.riders import rider_coefficients
from ..integrators.motion import add_stage_velocity, keep_free_velocity
from ..kernel import inner
from ..math.lanes import load
from ..model.tape import FRESH, H_BLOCKS, H_DT
from ..stage import stage


@stage
def begin_step(tape, s, skip, half):
    """At the start of a step: gradients, contact frames, targets of the velocity stage.

    Notes in ``skip`` whether the last velocity stage's factor no longer fits.
    """
    dt = load(s, tape[H_DT])
    link_gradients(tape, s)
    link_targets(tape, s, dt)
    rider_coefficients(tape, s)
    cluster_frames(tape, s, False)
    contact_geometry(tape, s)
    if contact_targets(tape, s, dt, skip):
        skip[tape[H_BLOCKS] + FRESH] = 1


@inner
def begin_stage(tape, s, half):
    """Directions of the velocity stage are those at the new positions; it starts from the kicked velocities."""
    if half == 1:
        link_gradients(tape, s)
        rider_coefficients(tape, s)
        cluster_frames(tape, s, True)
        keep_free_velocity(tape, s)


@inner
def end_stage(tape, s, half):
    """The velocities take the impulses of the position stage along."""
    if half == 0:
        add_stage_velocity(tape, s, load(s, tape[H_DT]))
