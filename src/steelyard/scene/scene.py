"""Scene: what a person writes, before any method or number of worlds is chosen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np

from . import checks
from .body import Body, BodyPoint
from .body_forces import BODY_FORCES
from .contacts import (
    Collisions,
    ContactGenerator,
    Ground,
    LinePlatform,
    check_parts,
    check_thickness,
)
from .forces import (
    AnchoredBungee,
    AnchoredSpring,
    Bungee,
    Buoyancy,
    Drag,
    Explosion,
    Gravity,
    Spring,
    StiffSpring,
    UserForce,
)
from .joints import JOINTS
from .links import Cable, CableConstraint, Rod, RodConstraint
from .particle import Particle
from .rider import Rider
from .triggers import Trigger

LINKS = (Rod, RodConstraint, Cable, CableConstraint)
CONTACTS = (Ground, LinePlatform, Collisions, ContactGenerator)
SPRINGS = (Spring, Bungee, AnchoredSpring, AnchoredBungee, StiffSpring)
FORCES = (
    Gravity,
    Drag,
    Spring,
    Bungee,
    AnchoredSpring,
    AnchoredBungee,
    StiffSpring,
    Buoyancy,
    Explosion,
    UserForce,
)
KINDS = (Particle, Body, Rider, *LINKS, *JOINTS, *CONTACTS, *FORCES, *BODY_FORCES, Trigger)

Thing = TypeVar("Thing")


def members(thing: Any) -> Iterator[Particle | Body]:
    """The particles and bodies that a link, joint, rider, contact generator, force or trigger refers to."""
    if isinstance(thing, JOINTS):
        yield from thing.members()
        return
    for name in ("a", "b", "particle", "point", "body"):
        if hasattr(thing, name):
            end = getattr(thing, name)
            if end is not None:
                yield end.body if isinstance(end, BodyPoint) else end
    yield from getattr(thing, "particles", None) or ()
    yield from getattr(thing, "deck", ())
    for pair in getattr(thing, "pairs", ()):
        yield from (particle for particle in pair if particle is not None)


class Scene:
    """Particles, bodies and everything that acts on them, in the order in which they were added.

    Args:
        gravity: acceleration [m/s^2] of every particle and body that does not bring its own.
        planar: all that it holds lies and moves in the plane z = 0, and kernels step two coordinates instead of three;
            arrays keep the third, which stepping neither reads nor changes: leave it 0, as the energy counts it.

    Raises:
        TypeError: ``planar`` is no bool.
        ValueError: gravity is not finite, or a planar scene has some along z.
    """

    def __init__(self, *, gravity: checks.Vector = (0.0, -9.81, 0.0), planar: bool = False) -> None:
        self.gravity = checks.vector("Scene", "gravity", gravity)
        checks.instance("Scene", "planar", planar, bool, remedy="Use True or False.")
        self.planar = planar
        if self.planar:
            checks.in_plane("Scene", "gravity", np.array(self.gravity))
        self.things: list[Any] = []

    @property
    def axes(self) -> int:
        """Number of coordinates that particles move in."""
        return 2 if self.planar else 3

    def add(self, thing: Thing) -> Thing:
        """Add a particle, body, link, rider, contact generator or force, and return it.

        Raises:
            TypeError: not something that a scene holds.
            ValueError: already in this scene, it refers to a particle that is not, or it leaves the plane of a planar
                scene.
        """
        name = type(thing).__name__
        if not isinstance(thing, KINDS):
            raise TypeError(
                f"Scene.add: {thing!r} is a {name}; a scene holds "
                f"{', '.join(kind.__name__ for kind in KINDS)}. Build one of these."
            )
        if thing in self:
            raise ValueError(f"Scene.add: this {name} is already in the scene; add another one.")
        for member in members(thing):
            if member not in self:
                kind = type(member).__name__.lower()
                raise ValueError(
                    f"Scene.add: this {name} refers to a {kind} at {member.position} that is "
                    f"not in this scene; both must belong to the same scene. Add the {kind} first."
                )
        if isinstance(thing, StiffSpring) and any(
            force.particle is thing.particle for force in self.of(StiffSpring)
        ):
            raise ValueError(
                f"Scene.add: the particle at {thing.particle.position} has a StiffSpring already; "
                "the limit is 1 per particle, since its solution is exact only alone. Use "
                "AnchoredSpring."
            )
        if self.planar and isinstance(thing, Body):
            raise ValueError(
                "Scene.add: a Body cannot be in a planar scene, which steps two coordinates; a body turns in three. "
                "Use a Scene that is not planar."
            )
        if self.planar:
            for vector in checks.VECTORS:
                value = np.array(getattr(thing, vector, None), dtype=np.float64)
                if value.ndim == 1:  # a float's gravity is a number
                    checks.in_plane(name, vector, value)
        self.things.append(thing)
        return thing

    def remove(self, thing: Any) -> None:
        """Take a thing out.

        Raises:
            ValueError: it is not in the scene, or something left in the scene refers to it.
        """
        if thing not in self:
            raise ValueError(
                f"Scene.remove: this {type(thing).__name__} is not in the scene; only what was "
                "added can be removed. Give the very thing that Scene.add returned."
            )
        for other in self.things:
            if other is not thing and any(particle is thing for particle in members(other)):
                raise ValueError(
                    f"Scene.remove: a {type(other).__name__} still refers to this {type(thing).__name__.lower()}; "
                    "remove that first."
                )
        self.things = [other for other in self.things if other is not thing]

    def touched(self, thing: Any) -> list[Particle]:
        """The particles that a link, rider or contact generator may push."""
        if isinstance(thing, Ground | LinePlatform | Collisions) and thing.particles is None:
            return [particle for particle in self.particles if particle.movable]
        return [member for member in members(thing) if isinstance(member, Particle)]

    def bodies_at(self, contact: Any) -> list[Body]:
        """The bodies that a ground or collisions can meet: all movable ones, or those that it names."""
        if not isinstance(contact, Ground | Collisions):
            return []
        chosen = self.bodies if contact.particles is None else contact.particles
        return [thing for thing in chosen if isinstance(thing, Body) and thing.movable]

    def check(self) -> None:
        """Make sure that worlds of this scene mean something.

        Raises:
            ValueError: neither particle nor body, a line platform that one of its particles can never touch, collisions
                of none, drag on a body with a pivot, a line platform for everything in a scene with bodies, or contacts
                of a body without a part.
        """
        if not self.particles and not self.bodies:
            raise ValueError(
                "Scene: the scene has 0 particles; it must have at least 1, or a body. Add a Particle."
            )
        for drag in self.of(Drag):
            chosen = self.bodies if drag.particles is None else drag.particles
            if any(isinstance(thing, Body) and thing.pivot is not None for thing in chosen):
                raise ValueError(
                    "Scene: a Drag on a body with a pivot, which does not move; it takes none. Name the others "
                    "(Drag(particles=[...])), and give the body angular_damping."
                )
        for contact in self.of(Ground):
            for body in self.bodies_at(contact):
                check_parts("Ground", body)
        if any(body.movable for body in self.bodies):
            for line in self.of(LinePlatform):
                if line.particles is None:
                    raise ValueError(
                        "Scene: a LinePlatform for all of a scene with bodies; it meets particles alone, and bodies "
                        "would pass through it unseen. Name the particles (LinePlatform(particles=[...])), and give "
                        "bodies an immovable Body with a Capsule."
                    )
        for line in self.of(LinePlatform):
            check_thickness(line.radius, self.touched(line))
        for collisions in self.of(Collisions):
            collisions.check([*self.particles, *self.bodies])

    def of(self, *kinds: type) -> list[Any]:
        """The things of exactly these kinds, in the order they were added."""
        return [thing for thing in self.things if type(thing) in kinds]

    def copy(self) -> Scene:
        """A scene with the same things; adding to one leaves the other."""
        other = Scene(gravity=self.gravity, planar=self.planar)
        other.things = list(self.things)
        return other

    @property
    def particles(self) -> list[Particle]:
        """All particles, in the order they were added: the order of every particle axis."""
        return self.of(Particle)

    @property
    def bodies(self) -> list[Body]:
        """All bodies, in the order they were added: the order of every body axis."""
        return self.of(Body)

    def __contains__(self, thing: object) -> bool:
        return any(other is thing for other in self.things)

    def __repr__(self) -> str:
        counts = {kind.__name__: len(self.of(kind)) for kind in KINDS}
        parts = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        planar = ", planar" if self.planar else ""
        return f"Scene({parts or 'empty'}, gravity={self.gravity}{planar})"
