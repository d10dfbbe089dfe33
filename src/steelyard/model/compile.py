"""Scene and method compiled to constant arrays: rows of state and scratch, parameters and the index tape."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..forces.springs import ONE_SIDED
from ..integrators.base import Acting, Recipe
from ..math.pointers import LANES
from ..methods import Method
from ..scene.body import Body, BodyPoint
from ..scene.contacts import Collisions, ContactGenerator
from ..scene.forces import StiffSpring, UserForce
from ..scene.links import Cable, CableConstraint
from ..scene.particle import Particle
from ..scene.rider import Rider
from ..scene.scene import CONTACTS, LINKS, Scene
from ..scene.triggers import SEEN, Trigger
from . import derived, tape
from .bodies import Bodies
from .compliances import add_compliances
from .constraints import add_contacts, add_links, add_riders
from .forces import add_forces
from .network import Network
from .parameters import PARTICLES, Key, Parameters, Slot
from .propagators import add_propagators
from .rigid import Rigid
from .rigid_layout import COLLIDER, JOINT, MEETING, PAIR, SOLID
from .saddle import Saddle
from .stiffness import Stiffness
from .tape import (
    BODY,
    BODY_POINT,
    COMPLIANCE,
    CONTACT,
    EVENT,
    HEADER,
    KINK,
    KINK_ROWS,
    LINK,
    WRENCHED,
)

#: Header fields that are -1, not an empty section, where a scene has no such rows.
_ABSENT = ("user_forces", "force", "start", "free", "impulse", "dense", "now", "rigid")


@dataclass(eq=False)
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
        recipe: stages of a step in order, each with its part.
        touching: whether two colliders can meet, of which one can move.
        numbers: settings and local geometry of rigid contacts.
        blocks: number of matrix blocks.
        skip: entries of the flags of blocks and what stands behind them.
    """

    scene: Scene
    method: Method
    tape: np.ndarray = field(default_factory=lambda: np.zeros(HEADER, dtype=np.int64))
    rows: int = 0
    state_rows: int = 0
    start: np.ndarray = field(default_factory=lambda: np.zeros(0))
    parameters: Parameters = field(default_factory=Parameters)
    places: dict[Key, tuple[int, int]] = field(default_factory=dict)
    recipe: Recipe = ()
    touching: bool = False
    numbers: np.ndarray = field(default_factory=lambda: np.zeros(0))
    skip: int = 0
    blocks: int = 0
    dropped: list[Any] = field(default_factory=list)

    @property
    def words(self) -> int:
        """Words on the tape behind its header: what the kernels of a step work through."""
        return len(self.tape) - HEADER


class Compiler:
    """Allocates rows and writes the tape; one method per kind of thing."""

    def __init__(self, scene: Scene, method: Method, *, special: bool) -> None:
        self.scene = scene
        self.method = method
        self.special = special
        self.model = Model(scene, method)
        self.parameters = self.model.parameters
        self.particles = scene.particles
        self.index = {id(particle): p for p, particle in enumerate(self.particles)}
        self.bodies = Bodies(self)
        self.links = scene.of(*LINKS)
        self.riders = scene.of(Rider)
        self.contacts = self._contact_pairs()
        self.rigid = Rigid(self) if method.solver is not None and method.solver.rigid else None
        self.header: dict[str, int] = {}
        self.sections: dict[str, list[int]] = {}
        self.counts: dict[str, int] = {}
        #: Movable ends of every record of the springs' section.
        self.spring_ends: list[tuple[int | None, int | None]] = []
        #: Forces that are linear in one particle: the thing, its parameter that brakes, whether it is a spring.
        self.linear: dict[int, list[tuple[Any, str | None, bool]]] = {}
        self.widths = {
            "springs": 7, "gravities": 3, "buoyancies": 5, "drags": 7, "stiff_springs": 8, "drift": 1,
            "winches": 3, "movers": 5, "links": LINK, "contacts": CONTACT, "generators": 2,
            "recipe": 2, "unknowns": 4, "spring_blocks": 4, "drag_blocks": 1, "float_blocks": 1,
            "bodies": BODY, "points": BODY_POINT, "wrenched": WRENCHED, "applied": 3, "thrusts": 5, "surfaces": 8,
            "explosions": 4, "solids": SOLID, "colliders": COLLIDER, "pairs": PAIR,
            "meetings": MEETING, "joints": JOINT,
            "propagators": 2, "parts": 2, "compliances": COMPLIANCE, "kinks": KINK,
        }  # fmt: skip
        self.next_row = 0
        self.start: list[float] = []
        #: First row of minus the weights at the step's start, by rider.
        self.held: dict[int, int] = {}
        integrator, solver = method.integrator, method.solver
        #: Whether links and riders keep multipliers from step to step.
        self.staged = integrator.holds_links or (solver is not None and solver.staged)
        self.network = Network(self) if solver is not None and solver.sparse else None
        self.saddle = Saddle(self) if integrator.holds_links else None
        #: Whether springs are constraints of the solver.
        self.compliant = solver is not None and solver.compliant
        if self.network is not None:
            self.links = self.network.choose()
        if self.saddle is not None:
            self.links = self.saddle.choose()
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

    def at(self, name: str, end: Particle | BodyPoint | Body) -> int:
        """First row of a vector of a particle or of a body's point, or of the force through a body's centre."""
        if isinstance(end, BodyPoint):
            return self.bodies.point(name, end)
        if isinstance(end, Body):
            return self.bodies.centre(end)
        return self.header[name] + 3 * self.of(end)

    # Parts

    def _contact_pairs(self) -> list[tuple[Any, Particle, Particle | None, int]]:
        """(generator, a, b or None, index of the pair within its generator) in order."""
        pairs: list[tuple[Any, Particle, Particle | None, int]] = []
        if self.method.solver is not None and self.method.solver.rigid:
            return pairs
        for generator in self.scene.of(*CONTACTS):
            if isinstance(generator, ContactGenerator):
                pairs.extend((generator, a, b, k) for k, (a, b) in enumerate(generator.pairs))
            elif isinstance(generator, Collisions):
                met = generator.pairs_of(self.particles)
                pairs.extend((generator, a, b, k) for k, (a, b) in enumerate(met))
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
        self.bodies.state()
        self._controls()
        self._multipliers()
        user = self.scene.of(UserForce)
        header["user_forces"] = self.state((PARTICLES, "user"), [0.0] * 3 * count) if user else -1
        self._user_contacts()
        if self.rigid is not None:
            self.rigid.state()
        for trigger in self.scene.of(Trigger):
            things = len(trigger.watched(self.scene))
            for name, value in SEEN.items():
                self.state((trigger, name), [value] * things)
        if self.method.solver is not None and not self.method.solver.staged:
            most = len(self.links) + len(self.contacts)
            header["moves"] = self.state((PARTICLES, "moves"), np.zeros(6 * most))
        if self.saddle is not None:
            header["filtered"] = self.state((PARTICLES, "filtered"), [0.0] * 3 * count)
            header["mark"] = self.state((PARTICLES, "mark"), [np.nan])
        header["time"] = self.state((PARTICLES, "time"), [0.0])
        header["unsettled"] = self.state((PARTICLES, "unsettled"), [0.0])
        header["nonfinite"] = self.state((PARTICLES, "nonfinite"), [0.0])
        self.model.state_rows = header["state_rows"] = self.next_row
        self.zero = self.constant(0.0, 3)
        self.one = self.constant(1.0)
        self.minus_one = self.constant(-1.0)
        self._particles()
        add_forces(self)
        self.bodies.forces()
        self._events()
        add_links(self)
        add_compliances(self)
        add_riders(self)
        add_contacts(self)
        if self.rigid is not None:
            self.rigid.build()
        self.bodies.finish()
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
        if not self.staged:
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
        share = method.integrator.damping_share * method.substep
        damping_key = (PARTICLES, "damping")
        if method.integrator.flies:

            def phis(value: np.ndarray) -> np.ndarray:
                return np.moveaxis(derived.flight(value, method.substep), 0, 1).reshape(
                    3 * count, *value.shape[1:]
                )

            self.header["damping"] = self.slot(3 * count, (damping_key,), phis)
        elif method.integrator.smooth:
            self.header["damping"] = self.slot(count, (damping_key,), derived.rate)
        elif len(method.integrator.fractions) > 1 or method.integrator.splits:
            self.header["damping"] = self.take(count)
        else:
            self.header["damping"] = self.slot(
                count, (damping_key,), lambda value: derived.decay(value, share)
            )
        self.header["damped"] = int(any(p.damping != 1.0 for p in self.particles))
        flows = [] if method.integrator.smooth else self.scene.of(StiffSpring)
        stiff = {id(spring.particle) for spring in flows}
        self.sections["drift"] = [p for p, x in enumerate(self.particles) if id(x) not in stiff]
        self.header["dt"] = self.constant(method.substep)
        self.header["divisions"] = method.substeps
        self._substeps()

    def _events(self) -> None:
        """Where impacts or kinks divide the step: copies of the state and notes of what may happen."""
        header, integrator = self.header, self.method.integrator
        header["impacts"] = integrator.divisions
        header["events"] = header["kept"] = header["trial"] = header["damping_rates"] = -1
        if integrator.splits:
            header["kept"] = self.take(self.model.state_rows)
        if integrator.splits and integrator.smooth:
            kinks = [
                word
                for a, b, _, _, _, rest, kind in self._records("springs")
                if kind == ONE_SIDED
                for word in (tape.BUNGEE, a, b, rest)
            ]
            for y, _, surface, half, _ in self._records("buoyancies"):
                for kind in (tape.FLOAT_TOP, tape.FLOAT_BOTTOM):
                    kinks += [kind, y, surface, half]
            self.sections["kinks"] = kinks
            header["events"] = self.take(KINK_ROWS * (len(kinks) // KINK))
        elif integrator.splits:
            closing = len(self.contacts) + sum(map(self.is_cable, self.links))
            header["events"] = self.take(EVENT * closing)
            header["trial"] = self.take(1)
            rates = ((PARTICLES, "damping"),)
            header["damping_rates"] = self.slot(len(self.particles), rates, derived.rate)

    def _records(self, name: str) -> list[list[int]]:
        """Records of a section."""
        words, width = self.sections[name], self.widths[name]
        return [words[k : k + width] for k in range(0, len(words), width)]

    def _substeps(self) -> None:
        """Lengths, what damping keeps and how impulses grow, of each part of a step that is made of several."""
        fractions = self.method.integrator.fractions
        if len(fractions) == 1:
            return
        share = self.method.integrator.damping_share * self.method.dt
        kept = {
            part: self.slot(
                len(self.particles),
                ((PARTICLES, "damping"),),
                lambda value, part=part: derived.decay(value, part * share),
            )
            for part in set(fractions)
        }
        turned = {part: self.bodies.powers(part * share) for part in set(fractions)}
        records: list[int] = []
        for part, before in zip(fractions, (fractions[-1], *fractions), strict=False):
            records += [
                self.constant(part * self.method.dt),
                kept[part],
                self.constant((part / before) ** 2),
                turned[part],
            ]
        self.sections["substeps"] = [*records, self.constant(self.method.dt)]
        self.counts["substeps"] = len(fractions)

    def _constants(self) -> int:
        """Numbers that the integrator's stages need."""
        numbers = np.array(self.method.integrator.constants(self.method.dt))
        return self.slot(len(numbers), (), lambda: numbers)

    def _acting(self) -> Acting:
        """Kinds of forces that are on the tape."""
        sections = self.sections
        return Acting(
            springs=bool(sections["springs"]),
            gravities=bool(sections["gravities"]),
            buoyancies=bool(sections["buoyancies"]),
            written=self.header["user_forces"] >= 0,
            drags=bool(sections["drags"]),
            stiff_springs=bool(sections["stiff_springs"]),
            bodies=bool(sections.get("bodies")),
            points=bool(sections.get("points")),
            wrenches=bool(sections.get("wrenched")),
            applied=bool(sections["applied"]),
            thrusts=bool(sections["thrusts"]),
            surfaces=bool(sections["surfaces"]),
            explosions=bool(sections["explosions"]),
            joints=bool(sections.get("joints")),
        )

    def some(self, chosen: Any) -> list[Particle]:
        """The chosen particles, or all."""
        return self.particles if chosen is None else list(chosen)

    def _words(self, recipe: Recipe) -> list[int]:
        """Stages as they stand on the tape; special ones get their addresses when the tape stands (``specialise``)."""
        planar = self.scene.planar
        if self.special:
            return [word for _, part in recipe for word in (0, part)]
        return [word for stage, part in recipe for word in (stage.address(planar=planar), part)]

    def _method(self) -> None:
        """Codes and settings of the method, and the generators in the order they were added."""
        solver = self.method.solver
        held = solver if self.header["constrained"] or (self.rigid and self.rigid.active) else None
        recipe = self.method.integrator.recipe(held, self._acting())
        self.sections["recipe"] = self._words(recipe)
        self.model.recipe = recipe
        splits = self.method.integrator.splits
        if splits:
            self.sections["parts"] = self._words(self.method.integrator.parts(held, self._acting()))
        self.header["hasty"] = int(bool(held and held.sparse and self.contacts and not splits))
        self.header["contacts_most"] = most = len(self.links) + len(self.contacts)
        self.header["values"] = -1
        if held is not None and not held.staged:
            self.header["values"] = self.take(-(-12 * most // LANES))
        settings = solver if held is not None else self.method.integrator
        limit = getattr(settings, "passes", None)
        self.header["passes"] = getattr(settings, "iterations", 0) if limit is None else limit
        self.header["repeats"] = getattr(solver, "repeats", 0)
        self.header["tolerance"] = self.constant(getattr(settings, "tolerance", 0.0))
        self.header["active"] = self.take(1) if self.method.integrator.reach > 0.0 else self.one
        integrator = self.method.integrator
        rows = integrator.work * len(self.particles) + integrator.spare_work
        self.header["work"] = self.take(rows)
        self.header["constants"] = self._constants()
        if self.saddle is not None:
            self.header["jolt"] = self.take(1)
            self.saddle.build()
        elif self.method.integrator.reach > 0.0:
            Stiffness(self).build()
        if self.method.integrator.linear:
            add_propagators(self)
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
        clustered: dict[int, int] = {}
        if self.network is not None and self.header["constrained"]:
            self.network.build()
            clustered = self.network.clusters.of
        self.sections["singles"] = [p for p in range(len(self.particles)) if p not in clustered]
        self.header["given_up"] = self.take(1)
        self.header["blocks"] = self.model.blocks
        self.header["ends"] = self.model.blocks + tape.WORDS
        self.model.skip = self.header["ends"] + self.header["contacts_most"]
        if self.rigid is not None and self.rigid.active:
            self._integers = self.model.skip
            self.model.skip += self.rigid.integers

    def _write(self) -> None:
        """The tape: header, then every section with its count in front."""
        names = {
            name[2:].lower(): value for name, value in vars(tape).items() if name.startswith("H_")
        }
        body: list[int] = []
        for name in names:
            if name == "rigid" and self.rigid is not None and self.rigid.active:
                # Last of all: it knows where the others stand.
                self.header[name] = HEADER + len(body)
                body += self.rigid.place(self._integers, self.header)
            elif name in self.sections:
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


def compile_model(scene: Scene, method: Method, *, special: bool = False) -> Model:
    """Compile a scene for a method; if ``special``, ``specialise`` must follow.

    Raises:
        ValueError: the method cannot do what the scene holds, or its stages call others, which cannot be special.
    """
    method.refuse(scene)
    method = method.for_scene(scene)
    integrator, solver = method.integrator, method.solver
    if special and (integrator.splits or integrator.holds_links or (solver and solver.rigid)):
        raise ValueError(
            f"World: special is given with {integrator} and {solver}, whose stages call others; it is for those that "
            "do not. Leave it out."
        )
    return Compiler(scene.copy(), method, special=special).compile()


def specialise(model: Model) -> None:
    """Put stages on the tape that are compiled for this tape alone."""
    at = int(model.tape[tape.H_RECIPE]) + 1
    model.tape[at : at + 2 * len(model.recipe) : 2] = 0
    words = model.tape.copy()
    for index, (stage, part) in enumerate(model.recipe):
        address = stage.special_address(words, part, planar=model.scene.planar)
        model.tape[at + 2 * index] = address
