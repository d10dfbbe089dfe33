"""Links, riders and contacts compiled to rows and records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.contacts import (
    Collisions,
    ContactGenerator,
    Ground,
    LinePlatform,
    check_span,
    check_thickness,
)
from ..scene.links import CableConstraint, RodConstraint
from ..scene.particle import Particle
from ..scene.rider import Rider
from .compliances import springs_of
from .parameters import PARTICLES
from .tape import BALLS, CONTACT, GROUND, LINE, USER

if TYPE_CHECKING:
    from .compile import Compiler


def add_links(c: Compiler) -> None:
    """Work rows of constrained particles and a record per link."""
    count = len(c.particles)
    held = c.compliant and springs_of(c.scene)
    constrained = bool(c.links or c.implied or c.scene.of(Rider) or c.contacts or held)
    c.header["constrained"] = int(constrained)
    staged = constrained and c.staged
    for name in ("start", "free"):
        c.header[name] = c.take(3 * count) if constrained else -1
    c.header["impulse"] = c.take(3 * count + 3) if staged else -1
    spare = c.header["impulse"] + 3 * count
    records: list[int] = []
    winches: list[int] = []
    for link in c.links:
        cable = c.is_cable(link)
        length = link.max_length if cable else link.length
        winch = getattr(link, "winch", False)
        if winch:
            length_row = c.place(link, "length")
            rate_row = c.place(link, "rate")
            gain_row = c.place(link, "acceleration")
            winches += [length_row, rate_row, gain_row]
        else:
            length_row = c.parameter(link, "length", length)
            rate_row = gain_row = c.zero
        restitution = c.parameter(link, "restitution", link.restitution) if cable else c.zero
        if isinstance(link, RodConstraint | CableConstraint):
            a = link.particle
            anchor = c.parameter(link, "anchor", link.anchor)
            b = (anchor, c.zero, spare, c.zero)
        else:
            a = link.a
            other = link.b
            b = (
                c.at("position", other),
                c.at("velocity", other),
                c.at("impulse", other),
                c.header["inverse_mass"] + c.of(other),
            )
        work = c.take(8) if staged else -1
        records += [
            c.at("position", a), b[0], c.at("velocity", a), b[1], c.at("impulse", a), b[2],
            c.header["inverse_mass"] + c.of(a), b[3], length_row, rate_row, int(cable), restitution,
            c.place(link, "multiplier") if staged else -1, work, work + 3, -1, gain_row,
        ]  # fmt: skip
    for rod in c.implied:
        c.parameters.declare((rod, "length"), rod.length)
        if isinstance(rod, RodConstraint):
            c.parameters.declare((rod, "anchor"), rod.anchor)
    c.sections["links"] = records
    c.sections["winches"] = winches
    c.header["cables"] = sum(map(c.is_cable, c.links))


def add_riders(c: Compiler) -> None:
    """How weights move, of every rider; and a record per rider with rows of its own."""
    c.held = {id(rider): c.take(len(rider.deck) + 6) for rider in c.scene.of(Rider)}
    movers: list[int] = []
    for rider in c.scene.of(Rider):
        movers += [
            len(rider.deck), c.place(rider, "weights"), c.place(rider, "rates"),
            c.place(rider, "accelerations"), c.held[id(rider)],
        ]  # fmt: skip
    c.sections["movers"] = movers
    records: list[int] = []
    for rider in c.riders:
        load = rider.particle
        records += [
            c.at("position", load), c.at("velocity", load), c.at("impulse", load),
            c.place(rider, "multiplier"), -1, c.header["inverse_mass"] + c.of(load),
            len(rider.deck), c.place(rider, "weights"), c.place(rider, "rates"), c.held[id(rider)],
        ]  # fmt: skip
        for p in rider.deck:
            records += [
                c.at("position", p),
                c.at("velocity", p),
                c.at("impulse", p),
                c.header["inverse_mass"] + c.of(p),
            ]
    c.sections["riders"] = records
    c.counts["riders"] = len(c.riders)


def add_contacts(c: Compiler) -> None:
    """A record per pair that can touch."""
    records: list[int] = []
    surfaces: dict[int, tuple[int, int, int]] = {}
    staged = c.staged
    radii: dict[int, int] = {}

    def radius(particle: Particle) -> int:
        if id(particle) not in radii:
            index = c.of(particle)
            radii[id(particle)] = c.slot(
                1, ((PARTICLES, "radius"),), lambda value: value[index : index + 1]
            )
        return radii[id(particle)]

    for generator, a, b, k in c.contacts:
        if id(generator) not in surfaces:
            restitution = c.parameter(generator, "restitution", generator.restitution)
            friction = c.parameter(generator, "friction", generator.friction)
            surfaces[id(generator)] = (_surface(c, generator), restitution, friction)
        place, restitution, friction = surfaces[id(generator)]
        kind = GROUND if isinstance(generator, Ground) else LINE
        if isinstance(generator, ContactGenerator):
            kind, place = USER, c.place(generator, f"pair {k}")
        elif isinstance(generator, Collisions) and b is not None:
            kind, place = BALLS, radius(b)
        spare = c.header["impulse"] + 3 * len(c.particles)
        z = c.zero
        other = (
            (z, z, spare, z, z, z)
            if b is None
            else (
                c.at("position", b),
                c.at("velocity", b),
                c.at("impulse", b),
                c.header["inverse_mass"] + c.of(b),
                c.at("acceleration", b),
                c.at("start", b),
            )
        )
        records += [
            kind, c.at("position", a), other[0], c.at("velocity", a), other[1],
            c.at("impulse", a), other[2], c.header["inverse_mass"] + c.of(a), other[3],
            c.at("acceleration", a), other[4], place, radius(a), restitution, friction,
            c.place(generator, f"multiplier {k}") if staged else -1, c.take(9), c.take(1),
            c.take(7) if staged else -1, -1, len(records) // CONTACT, c.at("start", a), other[5],
            c.take(10) if staged else -1,
        ]  # fmt: skip
    c.sections["contacts"] = records
    c.model.blocks = len(c.contacts)


def _surface(c: Compiler, generator: Any) -> int:
    """Geometry rows of scenery."""
    if isinstance(generator, Ground):
        normal = c.parameter(generator, "normal", generator.normal)
        height = c.parameter(generator, "height", generator.height)
        assert height == normal + 3
        return normal
    if isinstance(generator, LinePlatform):
        declared = c.parameters
        particles = [a for other, a, _, _ in c.contacts if other is generator]

        def check_start(given: np.ndarray) -> None:
            check_span(given, declared.values[generator, "end"])

        def check_end(given: np.ndarray) -> None:
            check_span(declared.values[generator, "start"], given)

        def check_radius(given: np.ndarray) -> None:
            check_thickness(float(given.min()), particles)

        start = c.parameter(generator, "start", generator.start, check=check_start)
        c.parameter(generator, "end", generator.end, check=check_end)
        c.parameter(generator, "radius", generator.radius, check=check_radius)
        return start
    return -1
