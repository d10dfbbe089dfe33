"""Triggers: volumes that tell what is in them and stand in nothing's way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Any, ClassVar

from . import checks
from .body import Body
from .particle import Particle
from .shapes import Box, Capsule, Hollow, Sphere

if TYPE_CHECKING:
    from .scene import Scene


#: What the state holds of everything that a trigger watches, in this order, and how it starts.
SEEN = {
    "inside": 0.0, "entered": 0.0, "left": 0.0, "entries": 0.0, "exits": 0.0, "entry_time": nan,
}  # fmt: skip


@dataclass(eq=False)
class Trigger:
    """A volume that reports what enters it, stays in it and leaves it; it resolves no contact.

    Looked at after every step; what passes through within one step is seen on the straight way between the
    step's start and its end. See ``World.events``.

    Args:
        shape: a Sphere, Box or Capsule.
        place: its centre [m], in the world, or in the frame of ``body``.
        orientation: quaternion (w, x, y, z) of any length but 0; given a body, in its frame.
        body: what carries it along, and is not seen by it; None for a volume that stands still.
        only: particles and bodies that it looks for; by default all that can move and have a shape.
    """

    shape: Sphere | Box | Capsule
    place: checks.Vector = (0.0, 0.0, 0.0)
    orientation: checks.Vector = (1.0, 0.0, 0.0, 0.0)
    body: Body | None = None
    only: Sequence[Particle | Body] | None = None

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "inside": checks.Limit(least=0.0, most=1.0, remedy="Use 0 or 1.")
    }

    def __post_init__(self) -> None:
        if isinstance(self.shape, Hollow) or not isinstance(self.shape, Sphere | Box | Capsule):
            raise TypeError(
                f"Trigger: shape is {self.shape!r}; it must be a Sphere, Box or Capsule. Use Sphere(0.5)."
            )
        checks.vectors(self, "place")
        self.orientation = checks.quaternion("Trigger", "orientation", self.orientation)
        if self.body is not None:
            checks.instance(
                "Trigger", "body", self.body, Body, remedy="Use None for one that stands still."
            )
        for thing in self.only or ():
            if not isinstance(thing, Particle | Body):
                raise TypeError(
                    f"Trigger: only has {thing!r}; it must hold a Particle or a Body each. Name what is to be seen."
                )
            if not _has_shape(thing):
                raise ValueError(
                    "Trigger: only has a Body without parts, of which nothing can be seen. Give it a shape."
                )

    @property
    def particles(self) -> tuple[Any, ...]:
        """The things that it names."""
        return tuple(self.only or ())

    def watched(self, scene: Scene) -> list[Particle | Body]:
        """What it looks for in a scene: particles, then bodies, each in the scene's order."""
        everything: list[Particle | Body] = [*scene.particles, *scene.bodies]
        if self.only is not None:
            wanted = {id(thing) for thing in self.only}
            return [thing for thing in everything if id(thing) in wanted]
        return [
            thing
            for thing in everything
            if thing.movable and thing is not self.body and _has_shape(thing)
        ]


def _has_shape(thing: Particle | Body) -> bool:
    """Whether there is something to see: a particle without a radius is a point."""
    return isinstance(thing, Particle) or bool(thing.parts)
