"""Any world as a drawing: particles, links, springs, riders, scenery, contacts and forces, shown plainly."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..diagnostics.spans import place_of
from ..model.parameters import RIGID
from ..scene.body import Body
from ..scene.contacts import Collisions, ContactGenerator, Ground, LinePlatform
from ..scene.forces import (
    AnchoredBungee,
    Bungee,
    Buoyancy,
    StiffSpring,
    UserForce,
)
from ..scene.joints import JOINTS, DistanceJoint
from ..scene.links import Cable, CableConstraint, Rod, RodConstraint
from ..scene.rider import Rider
from ..scene.scene import SPRINGS
from ..scene.shapes import rotation_matrix
from ..scene.triggers import Trigger
from ..triggers import pose_of
from . import palette
from .bodies import draw_body, draw_shape
from .primitives import Color, Drawing

if TYPE_CHECKING:
    from ..world import World

Vector = np.ndarray

# Shares of the scene's extent.
_NODE, _ROD, _ROPE, _GROUND, _ARROW = 0.012, 0.008, 0.004, 1.0, 0.15
_TURNS = 7
# A contact is drawn from this share of the extent on, a cable as taut from this share of its length on.
_NEAR, _TAUT = 1e-3, 1e-3
_SLACK = 110
#: Opacity of a trigger's volume.
_VOLUME = 60


def draw_world(world: World, index: int = 0, *, forces: bool = False) -> Drawing:
    """What one world looks like now.

    Particles are balls of their radius (a small one if they have none), loads of riders orange, immovable ones dark.
    Bodies are their parts, blue-green, immovable ones grey; those without parts are three axes. Rods are struts; cables
    ropes, pale while slack; springs coils, red in tension and blue in compression, pale while a bungee is slack.
    Touching contacts are rings with their normals, joints orange marks with their axes, triggers pale volumes.

    Args:
        world: the worlds.
        index: which of them.
        forces: add arrows: constant and user-written forces on particles, from each of them, in proportion; the
            largest is 15 % of the scene's extent.

    Raises:
        IndexError: there is no such world.
    """
    if not -world.worlds <= index < world.worlds:
        raise IndexError(
            f"draw_world: index is {index}; it must be below {world.worlds}, the number of worlds."
        )
    return _WorldDrawing(world, index % world.worlds).draw(forces)


class _WorldDrawing:
    """The drawing under way: one method per kind of thing."""

    def __init__(self, world: World, index: int) -> None:
        self.world = world
        self.index = index
        self.drawing = Drawing()
        self.position = np.array(world.particles.position[index])
        everything = np.concatenate([self.position, world.bodies.position[index]])
        places = everything[np.isfinite(everything).all(axis=1)]
        span = np.ptp(places, axis=0).max() if len(places) else 0.0
        self.extent = max(float(span), 1.0)
        self.middle = places.mean(axis=0) if len(places) else np.zeros(3)

    def draw(self, forces: bool) -> Drawing:
        """Everything, back to front where order counts."""
        scene = self.world.scene
        for thing in scene.of(Ground):
            self._ground(thing)
        for thing in scene.of(LinePlatform):
            start, end = self._value(thing, "start"), self._value(thing, "end")
            width = 2.0 * float(self._value(thing, "radius"))
            self.drawing.line(start, end, color=palette.EARTH, width=width, pixels=2.0)
        for thing in scene.of(Buoyancy):
            self._surface(thing)
        for thing in scene.of(Rod, RodConstraint, Cable, CableConstraint):
            self._link(thing)
        for thing in scene.of(*SPRINGS):
            self._spring(thing)
        self._particles()
        for k, body in enumerate(scene.bodies):
            place = self.world.bodies.position[self.index, k]
            turn = self.world.bodies.orientation[self.index, k]
            draw_body(self.drawing, body, place, turn, axes=0.3 * self.extent)
        for joint in scene.of(*JOINTS):
            self._joint(joint)
        if (RIGID, "contacts") in self.world.model.places:
            self._body_contacts()
        else:
            for generator in scene.of(Ground, LinePlatform, Collisions, ContactGenerator):
                self._contacts(generator)
        for trigger in scene.of(Trigger):
            place, turn = (
                value.reshape(-1, value.shape[-1]) for value in pose_of(self.world, trigger)
            )
            which = self.index if len(place) > 1 else 0
            draw_shape(
                self.drawing,
                trigger.shape,
                place[which],
                rotation_matrix(turn[which]),
                (*palette.WIND, _VOLUME),
            )
        if forces:
            self._forces()
        return self.drawing

    # Values

    def _value(self, thing: Any, name: str) -> Any:
        """A parameter or state of a thing in this world; parameters may be shared by all."""
        value = np.asarray(getattr(self.world[thing], name))
        key = (thing, name)
        varies = key in self.world.model.places
        size = 1 if varies else self.world.model.parameters.values[key].ndim
        return value[self.index] if varies or size == 2 else value

    def _radii(self) -> Vector:
        radii = self.world.model.parameters.values["particles", "radius"]
        return radii[:, self.index] if radii.ndim == 2 else radii

    def _of(self, end: Any) -> Vector:
        return np.array(place_of(self.world, end)[self.index])

    def _ends(self, thing: Any) -> tuple[Vector, Vector]:
        """The two ends of a link or spring; a fixed end gets a mark."""
        if hasattr(thing, "a"):
            return self._of(thing.a), self._of(thing.b)
        anchor = np.asarray(self._value(thing, "anchor"))
        self.drawing.circle(anchor, _NODE * self.extent, color=palette.INK)
        return self._of(thing.particle), anchor

    # Things

    def _particles(self) -> None:
        loads = {id(rider.particle) for rider in self.world.scene.of(Rider)}
        radii = self._radii()
        for p, particle in enumerate(self.world.scene.particles):
            color = palette.LOAD if id(particle) in loads else palette.STEEL
            if not particle.movable:
                color = palette.INK
            least = _NODE * self.extent * (1.8 if id(particle) in loads else 1.0)
            self.drawing.circle(self.position[p], max(float(radii[p]), least), color=color)

    def _link(self, link: Any) -> None:
        start, end = self._ends(link)
        if isinstance(link, Rod | RodConstraint):
            self.drawing.line(start, end, color=palette.STEEL, width=_ROD * self.extent)
            return
        length = float(self._value(link, "length"))
        taut = np.linalg.norm(end - start) > length * (1.0 - _TAUT)
        color: Color = palette.ROPE if taut else (*palette.ROPE, _SLACK)
        self.drawing.line(start, end, color=color, width=_ROPE * self.extent)

    def _spring(self, spring: Any) -> None:
        start, end = self._ends(spring)
        along = end - start
        length = float(np.linalg.norm(along))
        if not length > 0.0:
            return
        rest = 0.0 if isinstance(spring, StiffSpring) else float(self._value(spring, "rest_length"))
        color: Color = palette.TARGET if length >= rest else palette.WIND
        if isinstance(spring, Bungee | AnchoredBungee) and length <= rest:
            color = (*palette.ROPE, _SLACK)
        # A zigzag across the upright plane through the spring, straight at both ends.
        across = np.cross(
            along, (0.0, 0.0, 1.0) if abs(along[2]) < 0.9 * length else (1.0, 0.0, 0.0)
        )
        across *= 0.02 * self.extent / np.linalg.norm(across)
        shares = np.concatenate(
            [[0.0, 0.15], 0.15 + 0.7 * (np.arange(2 * _TURNS) + 0.5) / (2 * _TURNS), [0.85, 1.0]]
        )
        sides = np.concatenate([[0.0, 0.0], np.resize([1.0, -1.0], 2 * _TURNS), [0.0, 0.0]])
        points = start + shares[:, None] * along + sides[:, None] * across
        for a, b in pairwise(points):
            self.drawing.line(a, b, color=color, width=0.5 * _ROPE * self.extent)

    def _ground(self, ground: Any) -> None:
        """A square of the plane under the scene, a half larger than it on every side."""
        normal, height = (
            np.asarray(self._value(ground, "normal")),
            float(self._value(ground, "height")),
        )
        middle = self.middle - (self.middle @ normal - height) * normal
        across, along = _tangents(normal)
        size = _GROUND * self.extent
        corners = [
            middle + size * (a * across + b * along)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        self.drawing.face(corners, color=(*palette.EARTH, 90), layer=-1)

    def _surface(self, float_: Any) -> None:
        """The liquid's surface about the particle."""
        x, _, z = self._of(float_.particle)
        y, size = float(self._value(float_, "surface")), 0.5 * self.extent
        corners = [(x + a * size, y, z + b * size) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        self.drawing.face(corners, color=(*palette.WIND, 70))

    def _joint(self, joint: Any) -> None:
        """A mark where both sides meet, with the axis about or along which they move; none where it is broken."""
        if float(self._value(joint, "broken")) > 0.0:
            return
        bodies = self.world.bodies
        ends = []
        for thing, place, axes in joint.ends:
            if isinstance(thing, Body):
                k = self.world._index(thing)
                turn = rotation_matrix(bodies.orientation[self.index, k])
                ends.append((bodies.position[self.index, k] + turn @ place, turn @ axes))
            else:
                ends.append((place if thing is None else self._of(thing) + place, axes))
        (a, axes), (b, _) = ends
        self.drawing.circle(a, _NODE * self.extent, color=palette.LOAD, layer=1)
        if isinstance(joint, DistanceJoint):
            self.drawing.line(a, b, color=palette.STEEL, width=_ROD * self.extent)
        elif joint.drives:
            half = 4.0 * _NODE * self.extent * axes[:, 0]
            self.drawing.line(a - half, a + half, color=palette.LOAD, pixels=2.0, layer=1)

    def _body_contacts(self) -> None:
        """A ring and the force's direction wherever bodies bear on each other."""
        contacts = self.world.contacts
        for place, force in zip(
            contacts.place[self.index], contacts.force[self.index], strict=True
        ):
            size = float(np.linalg.norm(force))
            if size > 0.0:
                self._touch(place, force / size)

    def _contacts(self, generator: Any) -> None:
        """A ring and the normal wherever a particle touches."""
        radii = self._radii()
        if isinstance(generator, ContactGenerator):
            for k, (particle, _) in enumerate(generator.pairs):
                row = self.world.row(generator, f"pair {k}")
                given = self.world.state[row : row + 4, self.index]
                if given[3] > 0.0:
                    self._touch(self._of(particle), given[:3])
            return
        if isinstance(generator, Collisions):
            for a, b in generator.pairs_of(self.world.scene.particles):
                apart = self._of(a) - self._of(b)
                distance = float(np.linalg.norm(apart))
                radius, other = (float(radii[self.world._index(p)]) for p in (a, b))
                if 0.0 < distance < radius + other + _NEAR * self.extent:
                    self._touch(self._of(a) - radius / distance * apart, apart / distance)
            return
        chosen = generator.particles
        movable = [p for p in self.world.scene.particles if p.movable]
        for particle in movable if chosen is None else chosen:
            place = self._of(particle)
            if isinstance(generator, Ground):
                normal = np.asarray(self._value(generator, "normal"))
                gap = place @ normal - float(self._value(generator, "height"))
            else:
                start, end = self._value(generator, "start"), self._value(generator, "end")
                share = np.clip(
                    (place - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1
                )
                away = place - start - share * (end - start)
                distance = float(np.linalg.norm(away))
                normal = away / distance if distance > 0.0 else np.array([0.0, 1.0, 0.0])
                gap = distance - float(self._value(generator, "radius"))
            radius = float(radii[self.world._index(particle)])
            if gap - radius < _NEAR * self.extent:
                self._touch(place - radius * normal, normal)

    def _touch(self, place: Vector, normal: Vector) -> None:
        size = 2.0 * _NODE * self.extent
        self.drawing.circle(
            place, size, color=palette.CONTACT, fill=False, normal=normal, pixels=2.0
        )
        self.drawing.line(place, place + 2.0 * size * normal, color=palette.CONTACT, pixels=2.0)

    def _forces(self) -> None:
        world = self.world
        force = (
            world.particles.mass_or_zero[self.index][:, None]
            * world.particles.acceleration[self.index]
        )
        if world.scene.of(UserForce):
            row = world.row("particles", "user")
            force = force + world.state[row : row + force.size, self.index].reshape(force.shape)
        largest = float(np.linalg.norm(force, axis=1).max(initial=0.0))
        if largest > 0.0:
            for place, arrow in zip(
                self.position, _ARROW * self.extent / largest * force, strict=True
            ):
                self._arrow(place, arrow)

    def _arrow(self, place: Vector, arrow: Vector) -> None:
        tip = place + arrow
        self.drawing.line(place, tip, color=palette.TARGET, pixels=2.0, layer=1)
        size = float(np.linalg.norm(arrow))
        if size > 0.0:
            across, _ = _tangents(arrow / size)
            for side in (-1.0, 1.0):
                barb = tip - 0.25 * arrow + side * 0.12 * size * across
                self.drawing.line(tip, barb, color=palette.TARGET, pixels=2.0, layer=1)


def _tangents(normal: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors across a unit vector."""
    start = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    across = start - (start @ normal) * normal
    across /= np.linalg.norm(across)
    return across, np.cross(normal, across)
