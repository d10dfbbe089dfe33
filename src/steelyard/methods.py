"""Method: the integrator, the solver and the step that a world uses."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .integrators.base import Integrator
from .integrators.closed_form import ClosedForm
from .integrators.explicit_euler import ExplicitEuler
from .integrators.rattle import Rattle
from .integrators.rk4 import RungeKutta4
from .integrators.symplectic_euler import SymplecticEuler
from .scene import checks
from .scene.body_forces import SURFACES
from .scene.contacts import Collisions, ContactGenerator, Ground, LinePlatform
from .scene.forces import Drag, Explosion, StiffSpring, UserForce
from .scene.joints import JOINTS
from .scene.links import Cable, CableConstraint
from .scene.rider import Rider
from .scene.scene import CONTACTS, FORCES, LINKS, SPRINGS, Scene
from .solvers.base import Solver
from .solvers.direct import Direct
from .solvers.gauss_seidel import GaussSeidel
from .solvers.proximal_newton import ProximalNewton
from .solvers.soft_step import SoftStep
from .solvers.worst_first import WorstFirst
from .solvers.xpbd import Xpbd

_STEP = checks.Limit(above=0.0, remedy="Use 1/60 for sixty steps a second.")
_TOLERANCE = checks.Limit(above=0.0, remedy="Use 1e-12 for what rounding allows.")


@dataclass(frozen=True)
class Method:
    """How a scene is stepped.

    Args:
        integrator: one of the classes of ``steelyard.integrators``.
        solver: one of the classes of ``steelyard.solvers``; not needed without links, riders and
            contacts.
        dt: step [s], above 0.

    Raises:
        TypeError: no integrator or no solver.
        ValueError: a step or a setting of the solver out of its limits.
    """

    integrator: Integrator
    solver: Solver | None = None
    dt: float = 1.0 / 60.0

    def __post_init__(self) -> None:
        checks.number("Method", "dt", self.dt, _STEP)
        checks.instance("Method", "integrator", self.integrator, Integrator, remedy="Use Rattle().")
        if self.solver is not None:
            checks.instance("Method", "solver", self.solver, Solver, remedy="Use Direct().")
        for part in (self.integrator, self.solver):
            owner = type(part).__name__
            least_iterations = 1 if isinstance(part, Xpbd) else 0
            for name, least in (("passes", 1), ("iterations", least_iterations), ("substeps", 1)):
                count = getattr(part, name, least)
                checks.whole(owner, name, count, least=least, remedy="Give a count.")
            checks.number(owner, "tolerance", getattr(part, "tolerance", 1.0), _TOLERANCE)

    @property
    def substeps(self) -> int:
        """Parts into which the solver divides a step."""
        count: int = getattr(self.solver, "substeps", 1)
        return count

    @property
    def substep(self) -> float:
        """What the stages take for a step [s]: dt over ``substeps``."""
        return self.dt / self.substeps

    def for_scene(self, scene: Scene) -> Method:
        """The method as a scene needs it: where bodies touch or are joined, with the solver's form for these."""
        if self.solver is None or not joined_or_touching(scene):
            return self
        return replace(self, solver=self.solver.for_bodies)

    def refuse(self, scene: Scene) -> None:
        """Raise if this method cannot do what a scene holds.

        Raises:
            ValueError: names the method, the thing and the remedy.
        """
        fitting = self.for_scene(scene)
        if fitting is not self and fitting != self:
            fitting.refuse(scene)
            return
        name = type(self.integrator).__name__
        held = scene.of(*LINKS, *CONTACTS, Rider)
        if scene.bodies and not self.integrator.moves_bodies:
            raise ValueError(
                f"{name} cannot step a Body; it steps particles. Use Rattle(), ComposedRattle() or RungeKutta4()."
            )
        if (
            self.solver is not None
            and self.solver.compliant
            and scene.bodies
            and scene.of(*SPRINGS)
        ):
            raise ValueError(
                f"{type(self.solver).__name__} cannot hold a {type(scene.of(*SPRINGS)[0]).__name__} in a scene with "
                "bodies, whose points it does not know. Use Rattle()."
            )
        self._refuse_bodies(name, scene)
        if isinstance(self.integrator, ClosedForm):
            other = held or scene.of(*FORCES)
            if other:
                raise ValueError(
                    f"ClosedForm cannot step a {type(other[0]).__name__}; the limit is free flight "
                    "with constant acceleration and damping. Use Rattle()."
                )
        elif self.integrator.holds_links:
            self._refuse_beside_links(name, scene)
        elif held and not self.integrator.solver_stages:
            raise ValueError(
                f"{name} cannot hold a {type(held[0]).__name__}; it steps particles under forces alone. "
                "Use Rattle() with Direct()."
            )
        elif scene.of(UserForce) and not self.integrator.evaluations:
            raise ValueError(
                f"{name} cannot take a UserForce: it needs the force at states that only its own iteration "
                "knows. Use LinearlyImplicit() or RungeKutta4()."
            )
        elif held and self.solver is None:
            raise ValueError(
                f"{name} alone cannot hold a {type(held[0]).__name__}; it needs a solver. "
                f"Use {self._fitting(self.integrator)}."
            )
        elif (
            held
            and self.solver is not None
            and self.solver.staged not in self.integrator.solver_stages
        ):
            raise ValueError(
                f"{name} does not work with {type(self.solver).__name__}. "
                f"Use {self._fitting(self.integrator)} with it."
            )
        if scene.of(Explosion) and not self.integrator.tells_time:
            raise ValueError(
                f"{name} cannot take an Explosion: its force depends on the time, which this method does not tell. Use "
                "Rattle() or RungeKutta4()."
            )
        if isinstance(self.solver, Xpbd) and not isinstance(self.integrator, SymplecticEuler):
            raise ValueError(
                f"{name} does not work with Xpbd, which takes velocities from the displacement of a whole "
                "substep. Use SymplecticEuler() with it."
            )
        if isinstance(self.solver, WorstFirst) and scene.of(Rider):
            raise ValueError(
                "WorstFirst cannot hold a Rider: it has no impulse for it. Use Direct(), or spread "
                "the load's mass over the deck (steelyard.scenes.lumped_masses)."
            )
        if self.integrator.splits and not self.integrator.smooth:
            self._refuse_divided(name, scene)
        if self.integrator.reverses:
            self._refuse_backwards(name, scene)
        sprung = {id(spring.particle) for spring in scene.of(StiffSpring)}
        for thing in held:
            if any(id(p) in sprung for p in scene.touched(thing)):
                raise ValueError(
                    f"{name}: a particle on a StiffSpring also takes part in a "
                    f"{type(thing).__name__}; the spring's solution is exact only alone. Use "
                    "AnchoredSpring, or name the other particles."
                )
        if isinstance(self.integrator, ExplicitEuler) and any(
            isinstance(x, Cable | CableConstraint) and x.winch for x in scene.of(*LINKS)
        ):
            raise ValueError(
                "ExplicitEuler cannot drive a winch. Use SymplecticEuler() or Rattle()."
            )

    def _refuse_bodies(self, name: str, scene: Scene) -> None:
        """Raise if contacts of bodies have no solver, or a solver of these something else to hold."""
        rigid = self.solver is not None and self.solver.rigid
        for joint in scene.of(*JOINTS):
            if not rigid:
                raise ValueError(
                    f"{name} with {type(self.solver).__name__} cannot hold a {type(joint).__name__}; it needs a solver "
                    "of joints. Use Method(Rattle(), ProximalNewton())."
                )
            for thing in scene.of(StiffSpring):
                raise ValueError(
                    f"{type(self.solver).__name__} cannot step a {type(thing).__name__} beside a "
                    f"{type(joint).__name__}. Use AnchoredSpring."
                )
        solver = type(self.solver).__name__
        if not rigid:
            for contact in scene.of(Ground, Collisions):
                if scene.bodies_at(contact):
                    raise ValueError(
                        f"{name} with {solver} cannot hold a {type(contact).__name__} that meets a Body; it knows "
                        "contacts of particles. Use Method(Rattle(), ProximalNewton()), or name the particles "
                        f"({type(contact).__name__}(particles=[...]))."
                    )
            return
        if not isinstance(self.integrator, Rattle):
            raise ValueError(f"{name} does not work with {solver}. Use Rattle() with it.")
        for thing in scene.of(*LINKS, Rider, LinePlatform, ContactGenerator):
            raise ValueError(
                f"{solver} cannot hold a {type(thing).__name__}; it knows contacts with grounds and of bodies and "
                "particles among themselves. Use Direct() where no body touches anything."
            )

    def _refuse_beside_links(self, name: str, scene: Scene) -> None:
        """Raise if an integrator that holds links by itself cannot do the rest of a scene."""
        if self.solver is not None:
            raise ValueError(
                f"{name} does not work with {type(self.solver).__name__}; it holds links itself. "
                f"Use Method({name}()) without a solver."
            )
        for contact in scene.of(*CONTACTS):
            raise ValueError(
                f"{name} cannot hold a {type(contact).__name__}; it knows links and riders, no contacts. "
                "Use Rattle() with Direct()."
            )
        if scene.of(UserForce) and not self.integrator.evaluations:
            raise ValueError(
                f"{name} cannot take a UserForce: it needs the force at states that only its own iteration "
                "knows. Use Rattle() with Direct(), or LinearlyImplicit() where nothing is linked."
            )

    def _refuse_divided(self, name: str, scene: Scene) -> None:
        """Raise if a step cannot be divided at impacts."""
        if self.solver is not None and not self.solver.sparse:
            raise ValueError(
                f"{name} does not work with {type(self.solver).__name__}, whose errors are larger than those of "
                "an impact's time. Use Direct() with it."
            )
        for thing in scene.of(Drag, StiffSpring, ContactGenerator):
            raise ValueError(
                f"{name} cannot step a {type(thing).__name__}: it is known for whole steps alone, which impacts "
                "divide. Use Rattle()."
            )

    @staticmethod
    def _refuse_backwards(name: str, scene: Scene) -> None:
        """Raise if a scene holds what cannot run backwards in time."""
        for thing in scene.of(Cable, CableConstraint, *CONTACTS, Drag, StiffSpring, *SURFACES):
            raise ValueError(
                f"{name} cannot step a {type(thing).__name__}: parts of its step run backwards in time, where "
                "impacts and drag have no meaning. Use Rattle(), or rods and AnchoredSpring."
            )

    @staticmethod
    def _fitting(integrator: Integrator) -> str:
        return (
            "WorstFirst()" if True not in integrator.solver_stages else "Direct() or GaussSeidel()"
        )


DEFAULT = Method(Rattle(), Direct())
#: Where bodies touch something.
DEFAULT_RIGID = Method(Rattle(), ProximalNewton())


def joined_or_touching(scene: Scene) -> bool:
    """Whether there are joints, or bodies that touch something."""
    touching = any(scene.bodies_at(contact) for contact in scene.of(Ground, Collisions))
    return touching or bool(scene.of(*JOINTS))


def default_for(scene: Scene) -> Method:
    """The method of a world that is given none."""
    return DEFAULT_RIGID if joined_or_touching(scene) else DEFAULT


__all__ = [
    "DEFAULT",
    "ClosedForm",
    "Direct",
    "ExplicitEuler",
    "GaussSeidel",
    "Method",
    "ProximalNewton",
    "Rattle",
    "RungeKutta4",
    "SoftStep",
    "SymplecticEuler",
    "WorstFirst",
    "Xpbd",
]
