"""Proximal Newton: rigid contacts with Coulomb's cone, exact and without sweeps.

With velocities v of the solids and v* what they would be without contacts, the impulses l of a pass are the nearest
points of their cones to

    y_n = l0_n + (b - mu |u_t| - u_n)/R,    y_t = l0_t - u_t/R,    u = J v,

and v minimises |v - v*|_M^2/2 + R |l|^2/2, a convex function whose gradient M (v - v*) - J^T l Newton's method brings
to 0 with an exact line search. Its matrix M + J^T D J/R, D the derivative of the projection, has the size of the solids
and not of the contacts, and is positive definite however redundant these are. Between passes l0 becomes l, which takes
the compliance R out (the proximal point method), and |u_t| in the shift mu |u_t| becomes that at hand (de Saxce & Feng
1998), which makes friction Coulomb's own. Islands are solved apart; one at rest begins with the impulses that hold it,
and costs a test.

In the position stage b = -gap/dt keeps surfaces from passing within the step; in the velocity stage contacts that
closed get b = 0, or the speed at which they rebound (``rigid_stages``).

Source: Castro, Permenter & Han (2022), *An Unconstrained Convex Formulation of Compliant Contact*; Carpentier,
Le Lidec & Montaut (2024), *From Compliant to Rigid Contact Simulation*; Acary, Cadoux, Lemarechal & Malick (2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..model.rigid_layout import (
    N_COMPLIANCE,
    N_IMPULSE,
    N_ITERATIONS,
    N_PASSES,
    N_SHIFT,
    N_TOLERANCE,
)
from ..stage import Stage
from .proximal_passes import pass_island
from .rigid_stages import RigidSolver


@dataclass(frozen=True)
class ProximalNewton(RigidSolver):
    """Rigid contacts by the proximal Newton method (see the module).

    Args:
        tolerance: largest residual of a pass over the momentum at hand, both by kinetic energy.
        passes: most proximal passes.
        iterations: most Newton iterations of a pass; a world that needs more falls back to softer contacts.
        slop, broad_phase, contacts, rest_speed, rest_time: see ``BodySettings``.
    """

    tolerance: float = 1e-9
    passes: int = 6
    iterations: int = 60
    exact: ClassVar[bool] = True

    @property
    def island(self) -> Stage:
        """Proximal passes."""
        return pass_island

    @property
    def own_settings(self) -> dict[int, float]:
        """Those of Newton's method."""
        return {
            N_COMPLIANCE: 1e-5,
            N_TOLERANCE: self.tolerance,
            N_IMPULSE: 1e-9,
            N_SHIFT: 1e-4,
            N_PASSES: self.passes,
            N_ITERATIONS: self.iterations,
        }
