"""Scene and method compiled to constant arrays: rows of state and scratch, parameters and the index tape."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..methods import Method
from ..scene.contacts import (
    ContactGenerator,
    Ground,
    LinePlatform,
    check_span,
    check_thickness,
)
from ..scene.forces import (
    AnchoredBungee,
    AnchoredSpring,
    Bungee,
    Buoyancy,
    Drag,
    Gravity,
    Spring,
    StiffSpring,
    UserForce,
)
from ..scene.links import Cable, CableConstraint, RodConstraint
from ..scene.particle import Particle
from ..scene.rider import Rider
from ..scene.scene import CONTACTS, LINKS, Scene
from . import derived, tape
from .network import Network
from .parameters import Key, Parameters, Slot
from .tape import CONTACT, GROUND, HEADER, LINE, LINK, USER

PARTICLES = "particles"

#: Header fields that are -1, not an empty section, where a scene has no such rows.
_ABSENT = ("user_forces", "force", "start", "free", "impulse", "dense")


@dataclass
class Model:
    """What is constant while worlds step.

    Attributes:
        scene: the scene it was compiled from.
        method: the method it was compiled for.
        tape: (n,) int64, see ``model.tape``.
        rows: number of scratch rows.
        state_rows: number of state rows; they come first in the scratch.
        start: (state rows,) state at time 0.
        parameters: assignable values and the rows that follow from them.
        places: first state row and size of what varies, by (thing, name).
        stages: names of what runs in a step, for people.
        contacts_most: most contacts that a world can have at once.
        blocks: number of matrix blocks.
    """

    scene: Scene
    method: Method
    tape: np.ndarray = field(default_factory=lambda: np.zeros(HEADER, dtype=np.int64))
    rows: int = 0
    state_rows: int = 0
    start: np.ndarray = field(default_factory=lambda: np.zeros(0))
    parameters: Parameters = field(default_factory=Parameters)
    places: dict[Key, tuple[int, int]] = field(default_factory=dict)
    stages: list[str] = field(default_factory=list)
    contacts_most: int = 0
    blocks: int = 0
    dropped: list[Any] = field(default_factory=list)


class Compiler:
    """Allocates rows and writes the tape; one method per kind of thing."""

    def __init__(self, scene: Scene, method: Method) -> None:
        self.scene = scene
        self.method = method
        self.model = Model(scene, method)
        self.parameters = self.model.parameters
        self.particles = scene.particles
        self.index = {id(particle): p for p, particle in enumerate(self.particles)}
        self.links = scene.of(*LINKS)
        self.riders = scene.of(Rider)
        self.contacts = self._contact_pairs()
        self.header: dict[str, int] = {}
        self.sections: dict[str, list[int]] = {}
        self.counts: dict[str, int] = {}
        self.widths = {
            "springs": 7, "gravities": 3, "buoyancies": 5, "drags": 7, "stiff_springs": 8, "drift": 1,
            "winches": 3, "movers": 5, "links": LINK, "contacts": CONTACT, "generators": 2,
        }  # fmt: skip
        self.next_row = 0
        self.start: list[float] = []
        direct = method.solver is not None and method.solver.code == tape.DIRECT
        self.network = Network(self) if direct else None
        if self.network is not None:
            self.links = self.network.choose()
        chosen = set(map(id, self.links))
        self.implied = [link for link in scene.of(*LINKS) if id(link) not in chosen]

    # Rows

    def take(self, size: int) -> int:
        """First of ``size`` new scratch rows."""
        row = self.next_row
        self.next_row += size
        return row

    def state(self, key: Key, values: Any) -> int:
        """Rows of the state under a name, with their start values."""
        values = np.asarray(values, dtype=np.float64).ravel()
        row = self.take(len(values))
        self.model.places[key] = (row, len(values))
        self.start.extend(values.tolist())
        return row

    def slot(self, size: int, keys: tuple[Key, ...], compute: Any) -> int:
        """Rows computed from parameters."""
        row = self.take(size)
        self.parameters.slots.append(Slot(row, size, keys, compute))
        return row

    def parameter(self, thing: Any, name: str, value: Any, *, check: Any = None) -> int:
        """Rows that hold an assignable value as it is."""
        self.parameters.declare((thing, name), value, check)
        size = len(self.parameters.values[thing, name])
        return self.slot(size, ((thing, name),), lambda given: given)

    def constant(self, value: float, size: int = 1) -> int:
        """Rows that hold a number in every world."""
        return self.slot(size, (), lambda: np.full(size, value))

    def is_cable(self, link: Any) -> bool:
        """Whether a link may go slack."""
        return isinstance(link, Cable | CableConstraint)

    def of(self, particle: Particle) -> int:
        """Index of a particle."""
        return self.index[id(particle)]

    def at(self, name: str, particle: Particle) -> int:
        """First row of a vector of a particle."""
        return self.header[name] + 3 * self.of(particle)

    # Parts

    def _contact_pairs(self) -> list[tuple[Any, Particle, Particle | None, int]]:
        """(generator, a, b or None, index of the pair within its generator) in order."""
        pairs: list[tuple[Any, Particle, Particle | None, int]] = []
        for generator in self.scene.of(*CONTACTS):
            if isinstance(generator, ContactGenerator):
                pairs.extend((generator, a, b, k) for k, (a, b) in enumerate(generator.pairs))
            else:
                chosen = generator.particles
                some = [p for p in self.particles if p.movable] if chosen is None else chosen
                pairs.extend((generator, a, None, k) for k, a in enumerate(some))
        return pairs

    def compile(self) -> Model:
        """Everything, state rows first."""
        count = len(self.particles)
        particles = self.particles
        header = self.header
        header["particles"] = count
        header["position"] = self.state((PARTICLES, "position"), [p.position for p in particles])
        header["velocity"] = self.state((PARTICLES, "velocity"), [p.velocity for p in particles])
        self._controls()
        self._multipliers()
        user = self.scene.of(UserForce)
        header["user_forces"] = self.state((PARTICLES, "user"), [0.0] * 3 * count) if user else -1
        self._user_contacts()
        if self.method.solver is not None and self.method.solver.code == tape.WORST_FIRST:
            most = len(self.links) + len(self.contacts)
            header["moves"] = self.state((PARTICLES, "moves"), np.zeros(6 * most))
        header["time"] = self.state((PARTICLES, "time"), [0.0])
        header["unsettled"] = self.state((PARTICLES, "unsettled"), [0.0])
        header["nonfinite"] = self.state((PARTICLES, "nonfinite"), [0.0])
        self.model.state_rows = header["state_rows"] = self.next_row
        self.zero = self.constant(0.0, 3)
        self.one = self.constant(1.0)
        self.minus_one = self.constant(-1.0)
        self._particles()
        self._forces()
        self._links()
        self._riders()
        self._contacts()
        self._method()
        self._network()
        self._write()
        return self.model

    def _controls(self) -> None:
        """State that control moves: winches and riders."""
        for link in self.links:
            if getattr(link, "winch", False):
                self.state((link, "length"), [link.max_length])
                self.state((link, "rate"), [0.0])
                self.state((link, "acceleration"), [0.0])
        for rider in self.scene.of(Rider):
            self.state((rider, "weights"), rider.weights)
            self.state((rider, "rates"), np.zeros(len(rider.deck)))
            self.state((rider, "accelerations"), np.zeros(len(rider.deck)))

    def _multipliers(self) -> None:
        """Impulses of the last step, from which the next one starts."""
        if self.method.solver is None or not self.method.solver.staged:
            return
        for link in self.links:
            self.state((link, "multiplier"), [0.0])
        for rider in self.riders:
            self.state((rider, "multiplier"), np.zeros(3))
        for generator, _, _, k in self.contacts:
            self.state((generator, f"multiplier {k}"), np.zeros(3))

    def _user_contacts(self) -> None:
        """Normal and penetration of user-written contacts."""
        for generator in self.scene.of(ContactGenerator):
            for k in range(len(generator.pairs)):
                self.state((generator, f"pair {k}"), (0.0, 1.0, 0.0, 0.0))

    def place(self, thing: Any, name: str) -> int:
        """First row of a part of the state, or a work row where the method keeps none."""
        if (thing, name) in self.model.places:
            return self.model.places[thing, name][0]
        return self.take(3)

    def _particles(self) -> None:
        """Mass, acceleration and damping."""
        method = self.method
        count = len(self.particles)
        declare = self.parameters.declare
        inverse = np.array([p.inverse_mass for p in self.particles])
        fixed = inverse == 0.0

        def check_mass(value: np.ndarray) -> None:
            if ((value == 0.0) != (fixed if value.ndim == 1 else fixed[:, None])).any():
                raise ValueError(
                    "World: an immovable particle cannot be given a finite mass, nor a movable one made "
                    "immovable, while worlds exist; the solver is built for it. Change the scene instead."
                )

        declare((PARTICLES, "inverse_mass"), inverse, check_mass)
        declare((PARTICLES, "damping"), [p.damping for p in self.particles])
        own = [
            self.scene.gravity if p.acceleration is None else p.acceleration for p in self.particles
        ]
        declare((PARTICLES, "acceleration"), np.array(own, dtype=np.float64).ravel())
        declare((PARTICLES, "radius"), [p.radius for p in self.particles])
        declare((PARTICLES, "gravity"), self.scene.gravity)
        mass_key = (PARTICLES, "inverse_mass")
        self.header["inverse_mass"] = self.slot(count, (mass_key,), lambda value: value)

        movable = np.repeat(~fixed, 3).astype(np.float64)
        self.header["acceleration"] = self.slot(
            3 * count,
            ((PARTICLES, "acceleration"),),
            lambda value: value * (movable if value.ndim == 1 else movable[:, None]),
        )
        share = method.integrator.damping_share * method.dt
        damping_key = (PARTICLES, "damping")
        if method.integrator.code == tape.CLOSED_FORM:

            def phis(value: np.ndarray) -> np.ndarray:
                return np.moveaxis(derived.flight(value, method.dt), 0, 1).reshape(
                    3 * count, *value.shape[1:]
                )

            self.header["damping"] = self.slot(3 * count, (damping_key,), phis)
        else:
            self.header["damping"] = self.slot(
                count, (damping_key,), lambda value: derived.decay(value, share)
            )
        self.header["damped"] = int(any(p.damping != 1.0 for p in self.particles))
        stiff = {id(spring.particle) for spring in self.scene.of(StiffSpring)}
        self.sections["drift"] = [p for p, x in enumerate(self.particles) if id(x) not in stiff]
        self.header["dt"] = self.constant(method.dt)

    def _forces(self) -> None:
        """Force rows and a record per force."""
        scene = self.scene
        drags = scene.of(Drag)
        explicit = self.method.integrator.code == tape.EXPLICIT_EULER
        summed = scene.of(
            Spring, Bungee, AnchoredSpring, AnchoredBungee, Gravity, Buoyancy, UserForce
        ) or (drags and explicit)
        self.header["forced"] = int(bool(summed))
        force = self.take(3 * len(self.particles) + 3) if summed else -1
        self.header["force"] = force
        spare = force + 3 * len(self.particles)
        springs: list[int] = []
        for spring in scene.of(Spring, Bungee, AnchoredSpring, AnchoredBungee):
            stiffness = self.parameter(spring, "stiffness", spring.stiffness)
            rest = self.parameter(spring, "rest_length", spring.rest_length)
            if isinstance(spring, AnchoredSpring):
                a, b = spring.particle, self.parameter(spring, "anchor", spring.anchor)
                end = spare
            else:
                a, b, end = spring.a, self.at("position", spring.b), self.at("force", spring.b)
            single = int(isinstance(spring, Bungee | AnchoredBungee))
            springs += [
                self.at("position", a),
                b,
                self.at("force", a),
                end,
                stiffness,
                rest,
                single,
            ]
        self.sections["springs"] = springs
        self.sections["gravities"] = []
        gravities = scene.of(Gravity)
        if gravities:

            def mass(inverse: np.ndarray) -> np.ndarray:
                return np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), 0.0)

            masses = self.slot(len(self.particles), ((PARTICLES, "inverse_mass"),), mass)
            for gravity in gravities:
                g = self.parameter(gravity, "acceleration", gravity.acceleration)
                for p in self.some(gravity.particles):
                    self.sections["gravities"] += [self.at("force", p), masses + self.of(p), g]
        self.sections["buoyancies"] = []
        for float_ in scene.of(Buoyancy):
            names = ("volume", "density", "gravity")
            for name in names:
                self.parameters.declare((float_, name), getattr(float_, name))
            surface = self.parameter(float_, "surface", float_.surface)
            half = self.parameter(float_, "half_depth", float_.half_depth)
            lift = self.slot(1, tuple((float_, name) for name in names), lambda v, r, g: v * r * g)
            p = float_.particle
            y, f = self.at("position", p) + 1, self.at("force", p) + 1
            self.sections["buoyancies"] += [y, f, surface, half, lift]
        share = self.method.integrator.damping_share * self.method.dt
        self.sections["drags"] = []
        for drag in drags:
            linear = self.parameter(drag, "linear", drag.linear)
            quadratic = self.parameter(drag, "quadratic", drag.quadratic)
            wind = self.parameter(drag, "wind", drag.wind)
            for p in self.some(drag.particles):
                if p.movable:
                    index = self.of(p)
                    flow = self.slot(
                        2,
                        ((drag, "linear"), (PARTICLES, "inverse_mass")),
                        lambda k1, inverse, i=index: derived.drag(k1, inverse[i : i + 1], share)[
                            :, 0
                        ],
                    )
                    f = self.at("force", p) if force >= 0 else -1
                    self.sections["drags"] += [
                        self.at("velocity", p), f, linear, quadratic, wind, flow, flow + 1,
                    ]  # fmt: skip
        self.sections["stiff_springs"] = []
        for stiff in scene.of(StiffSpring):
            if stiff.particle.movable:
                self._stiff_spring(stiff)
            else:
                for name in ("anchor", "stiffness", "damping"):
                    self.parameters.declare((stiff, name), getattr(stiff, name))

    def some(self, chosen: Any) -> list[Particle]:
        """The chosen particles, or all."""
        return self.particles if chosen is None else list(chosen)

    def _stiff_spring(self, spring: StiffSpring) -> None:
        i = self.of(spring.particle)
        dt = self.method.dt
        anchor = self.parameter(spring, "anchor", spring.anchor)
        self.parameters.declare((spring, "stiffness"), spring.stiffness)
        self.parameters.declare((spring, "damping"), spring.damping)
        mass = (PARTICLES, "inverse_mass")
        p = self.slot(
            4,
            ((spring, "stiffness"), (spring, "damping"), mass),
            lambda k, c, inverse: derived.oscillator(k, c, inverse[i : i + 1], dt)[:, 0],
        )
        give = self.slot(
            1, ((spring, "stiffness"), mass), lambda k, inverse: 1 / (k * inverse[i : i + 1])
        )
        f = self.at("force", spring.particle) if self.header["force"] >= 0 else -1
        self.sections["stiff_springs"] += [
            self.at("position", spring.particle),
            self.at("velocity", spring.particle),
            self.at("acceleration", spring.particle),
            f,
            self.header["inverse_mass"] + i,
            p,
            anchor,
            give,
        ]

    def _links(self) -> None:
        """Work rows of constrained particles and a record per link."""
        count = len(self.particles)
        constrained = bool(self.links or self.implied or self.scene.of(Rider) or self.contacts)
        self.header["constrained"] = int(constrained)
        staged = constrained and self.method.solver is not None and self.method.solver.staged
        for name in ("start", "free"):
            self.header[name] = self.take(3 * count) if constrained else -1
        self.header["impulse"] = self.take(3 * count + 3) if staged else -1
        spare = self.header["impulse"] + 3 * count
        records: list[int] = []
        winches: list[int] = []
        for link in self.links:
            cable = self.is_cable(link)
            length = link.max_length if cable else link.length
            winch = getattr(link, "winch", False)
            if winch:
                length_row = self.place(link, "length")
                rate_row = self.place(link, "rate")
                gain_row = self.place(link, "acceleration")
                winches += [length_row, rate_row, gain_row]
            else:
                length_row = self.parameter(link, "length", length)
                rate_row = gain_row = self.zero
            restitution = (
                self.parameter(link, "restitution", link.restitution) if cable else self.zero
            )
            if isinstance(link, RodConstraint | CableConstraint):
                a = link.particle
                anchor = self.parameter(link, "anchor", link.anchor)
                b = (anchor, self.zero, spare, self.zero)
            else:
                a = link.a
                other = link.b
                b = (
                    self.at("position", other),
                    self.at("velocity", other),
                    self.at("impulse", other),
                    self.header["inverse_mass"] + self.of(other),
                )
            work = self.take(7) if staged else -1
            records += [
                self.at("position", a), b[0], self.at("velocity", a), b[1], self.at("impulse", a), b[2],
                self.header["inverse_mass"] + self.of(a), b[3], length_row, rate_row, int(cable), restitution,
                self.place(link, "multiplier") if staged else -1, work, work + 3, -1, gain_row,
            ]  # fmt: skip
        for rod in self.implied:
            self.parameters.declare((rod, "length"), rod.length)
            if isinstance(rod, RodConstraint):
                self.parameters.declare((rod, "anchor"), rod.anchor)
        self.sections["links"] = records
        self.sections["winches"] = winches
        self.header["cables"] = sum(map(self.is_cable, self.links))

    def _riders(self) -> None:
        """How weights move, of every rider; and a record per rider with rows of its own."""
        self.held = {id(rider): self.take(len(rider.deck) + 6) for rider in self.scene.of(Rider)}
        movers: list[int] = []
        for rider in self.scene.of(Rider):
            movers += [
                len(rider.deck), self.place(rider, "weights"), self.place(rider, "rates"),
                self.place(rider, "accelerations"), self.held[id(rider)],
            ]  # fmt: skip
        self.sections["movers"] = movers
        records: list[int] = []
        for rider in self.riders:
            load = rider.particle
            records += [
                self.at("position", load), self.at("velocity", load), self.at("impulse", load),
                self.place(rider, "multiplier"), -1, self.header["inverse_mass"] + self.of(load),
                len(rider.deck), self.place(rider, "weights"), self.place(rider, "rates"), self.held[id(rider)],
            ]  # fmt: skip
            for p in rider.deck:
                records += [
                    self.at("position", p),
                    self.at("velocity", p),
                    self.at("impulse", p),
                    self.header["inverse_mass"] + self.of(p),
                ]
        self.sections["riders"] = records
        self.counts["riders"] = len(self.riders)

    def _contacts(self) -> None:
        """A record per pair that can touch."""
        records: list[int] = []
        surfaces: dict[int, tuple[int, int, int]] = {}
        staged = self.method.solver is not None and self.method.solver.staged
        radii: dict[int, int] = {}
        for generator, a, b, k in self.contacts:
            if id(generator) not in surfaces:
                restitution = self.parameter(generator, "restitution", generator.restitution)
                friction = self.parameter(generator, "friction", generator.friction)
                surfaces[id(generator)] = (self._surface(generator), restitution, friction)
            place, restitution, friction = surfaces[id(generator)]
            kind = GROUND if isinstance(generator, Ground) else LINE
            if isinstance(generator, ContactGenerator):
                kind, place = USER, self.place(generator, f"pair {k}")
            if id(a) not in radii:
                index = self.of(a)
                radii[id(a)] = self.slot(
                    1, ((PARTICLES, "radius"),), lambda value, i=index: value[i : i + 1]
                )
            spare = self.header["impulse"] + 3 * len(self.particles)
            z = self.zero
            other = (
                (z, z, spare, z, z, z)
                if b is None
                else (
                    self.at("position", b),
                    self.at("velocity", b),
                    self.at("impulse", b),
                    self.header["inverse_mass"] + self.of(b),
                    self.at("acceleration", b),
                    self.at("start", b),
                )
            )
            records += [
                kind, self.at("position", a), other[0], self.at("velocity", a), other[1],
                self.at("impulse", a), other[2], self.header["inverse_mass"] + self.of(a), other[3],
                self.at("acceleration", a), other[4], place, radii[id(a)], restitution, friction,
                self.place(generator, f"multiplier {k}") if staged else -1, self.take(9), self.take(1),
                self.take(7) if staged else -1, -1, len(records) // CONTACT, self.at("start", a), other[5],
                self.take(6) if staged else -1,
            ]  # fmt: skip
        self.sections["contacts"] = records
        self.model.contacts_most = len(self.links) + len(self.contacts)
        self.model.blocks = len(self.contacts)

    def _surface(self, generator: Any) -> int:
        """Geometry rows of scenery."""
        if isinstance(generator, Ground):
            normal = self.parameter(generator, "normal", generator.normal)
            height = self.parameter(generator, "height", generator.height)
            assert height == normal + 3
            return normal
        if isinstance(generator, LinePlatform):
            declared = self.parameters
            particles = [a for other, a, _, _ in self.contacts if other is generator]

            def check_start(given: np.ndarray) -> None:
                check_span(given, declared.values[generator, "end"])

            def check_end(given: np.ndarray) -> None:
                check_span(declared.values[generator, "start"], given)

            def check_radius(given: np.ndarray) -> None:
                check_thickness(float(given.min()), particles)

            start = self.parameter(generator, "start", generator.start, check=check_start)
            self.parameter(generator, "end", generator.end, check=check_end)
            self.parameter(generator, "radius", generator.radius, check=check_radius)
            return start
        return -1

    def _method(self) -> None:
        """Codes and settings of the method, and the generators in the order they were added."""
        solver = self.method.solver
        self.header["integrator"] = self.method.integrator.code
        self.header["solver"] = tape.NO_SOLVER if solver is None else solver.code
        limit = getattr(solver, "passes", None)
        self.header["passes"] = getattr(solver, "iterations", 0) if limit is None else limit
        self.header["tolerance"] = self.constant(getattr(solver, "tolerance", 0.0))
        generators: list[int] = []
        link = contact = 0
        for thing in self.scene.things:
            if isinstance(thing, LINKS):
                generators += [0, link]
                link += 1
            elif isinstance(thing, CONTACTS):
                for generator, _, _, _ in self.contacts:
                    if generator is thing:
                        generators += [1, contact]
                        contact += 1
        self.sections["generators"] = generators

    def _network(self) -> None:
        """Sparse matrix of the direct solver."""
        if self.network is not None and self.header["constrained"]:
            self.network.build()
        self.header["given_up"] = self.take(1)

    def _write(self) -> None:
        """The tape: header, then every section with its count in front."""
        names = {
            name[2:].lower(): value for name, value in vars(tape).items() if name.startswith("H_")
        }
        body: list[int] = []
        for name in names:
            if name in self.sections:
                self.header[name] = HEADER + len(body)
                records = self.sections[name]
                count = self.counts.get(name, len(records) // self.widths.get(name, 1))
                body += [count, *records]
            elif name not in self.header:
                # A section that this scene and method do not have: a count of zero, shared by all.
                self.header[name] = -1
        empty = HEADER + len(body)
        body.append(0)
        for name in names:
            if self.header[name] == -1 and name not in _ABSENT:
                self.header[name] = empty
        model = self.model
        model.tape = np.array([self.header[name] for name in names] + body, dtype=np.int64)
        model.rows = self.next_row
        model.start = np.array(self.start)


def compile_model(scene: Scene, method: Method) -> Model:
    """Compile a scene for a method.

    Raises:
        ValueError: the method cannot do what the scene holds.
    """
    method.refuse(scene)
    return Compiler(scene.copy(), method).compile()
