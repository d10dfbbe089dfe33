"""Contacts of bodies and particles as solids compiled to records: what ``solvers.proximal_newton`` works on."""

from __future__ import annotations

from itertools import combinations, combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np

from ..collision.broad_phase import MANY
from ..collision.hierarchy import BOX_NUMBERS, STACK, tree_numbers, tree_words
from ..collision.narrow_phase import ALL_POINTS, MOST_POINTS, POINT, WORK
from ..collision.placement import PLACED_ENTRIES
from ..integrators.rotor import ROTOR_ROWS
from ..math.pointers import LANES
from ..scene.body import Body
from ..scene.contacts import Collisions, Ground
from ..scene.joints import JOINTS, DistanceJoint, named_drives
from ..scene.particle import Particle
from ..solvers.block_cholesky import SIX
from . import rigid_layout as at
from .colliders import BOX, CAPSULE, HALF_SPACE, SPHERE, Colliders, colliders_of
from .parameters import PARTICLES, RIGID

if TYPE_CHECKING:
    from .compile import Compiler

#: Most points of a pair by both kinds; of those not named, MOST_POINTS.
_POINTS = {SPHERE: 1, CAPSULE: 2}
#: Most contacts of a solid that a buffer is made for, where nothing else is said.
_USUAL = 16


_SECTIONS = ("solids", "colliders", "pairs", "meetings", "partings", "joints", "wakers")


def _rows(joint: Any) -> int:
    """Rows that a joint may have."""
    return len(joint.locked) + at.DRIVE_ROWS * len(joint.drives)


class Rigid:
    """Colliders, pairs and rows of a scene whose solver holds contacts of bodies."""

    def __init__(self, c: Compiler) -> None:
        self._c = c
        self.colliders: Colliders = colliders_of(c.scene, points=True)
        self.joints: list[Any] = c.scene.of(*JOINTS)
        self.group, self.meetings = self._groups()
        self.partings = self._partings()
        #: Colliders with an end; half-spaces stand behind them.
        self.planes = int((self.colliders.kind != HALF_SPACE).sum())
        broad_phase = getattr(c.method.solver, "broad_phase", None)
        #: Whether near pairs are found by a tree, and not all are listed.
        self.tree = broad_phase == "tree" or (broad_phase is None and self.planes >= MANY)
        self.pairs = [] if self.tree else self._pairs()
        self.touching = self._any_meets()
        self.capacity = self._capacity()

    @property
    def _things(self) -> list[Body | Particle]:
        """What solids are of, in order."""
        return [*self._c.scene.bodies, *self._c.particles]

    def _groups(self) -> tuple[list[int], list[list[Any]]]:
        """The group of each collider, and what two groups meet by: the last generator that names both, or None."""
        scene, colliders = self._c.scene, self.colliders
        generators = scene.of(Ground, Collisions)
        everything = {id(thing) for thing in self._things}
        named = [
            everything if g.particles is None else {id(thing) for thing in g.particles}
            for g in generators
        ]
        keys: dict[tuple[bool, tuple[int, ...]], int] = {}
        group: list[int] = []
        for owner in colliders.owner:
            plane = isinstance(owner, Ground)
            names = (
                g is owner if plane else id(owner) in some
                for g, some in zip(generators, named, strict=True)
            )
            key = plane, tuple(k for k, name in enumerate(names) if name)
            group.append(keys.setdefault(key, len(keys)))

        def meets(one: tuple[bool, tuple[int, ...]], other: tuple[bool, tuple[int, ...]]) -> Any:
            wanted = Collisions if one[0] == other[0] else Ground
            both = [generators[k] for k in one[1] if k in other[1]]
            return next((g for g in reversed(both) if isinstance(g, wanted)), None)

        return group, [[meets(one, other) for other in keys] for one in keys]

    def _pairs(self) -> list[tuple[int, int]]:
        """(collider that can move, other collider) of every two that can meet, in order."""
        scene, colliders = self._c.scene, self.colliders
        everything = self._things
        pairs: list[tuple[int, int]] = []
        parted = set(self.partings)
        index = {id(thing): i for i, thing in enumerate(everything)}
        for generator in scene.of(Ground, Collisions):
            chosen = everything if generator.particles is None else list(generator.particles)
            own = colliders.of(*chosen)
            if isinstance(generator, Ground):
                (plane,) = colliders.of(generator)
                pairs += [(k, plane) for k in own if colliders.owner[k].movable]
                continue
            for a, b in combinations(own, 2):
                first, second = colliders.owner[a], colliders.owner[b]
                apart = first is not second and self._key(index, first, second) not in parted
                latest = self.meetings[self.group[a]][self.group[b]] is generator
                if apart and latest and (first.movable or second.movable):
                    pairs.append((a, b) if first.movable else (b, a))
        # As a tree finds them.
        return sorted(pairs, key=lambda pair: (pair[1] < self.planes, pair))

    def _key(self, index: dict[int, int], one: Any, other: Any) -> int:
        """Number of two solids, whatever their order."""
        a, b = sorted((index[id(one)], index[id(other)]))
        return a * len(index) + b

    def _partings(self) -> list[int]:
        """Keys of joined solids that may lie in each other, ascending."""
        index = {id(thing): i for i, thing in enumerate(self._things)}
        ends = [tuple(joint.members()) for joint in self.joints if not joint.collide]
        return sorted({self._key(index, *pair) for pair in ends if len(pair) == 2})

    def _any_meets(self) -> bool:
        """Whether two colliders can meet, of which one can move."""
        if not self.tree:
            return bool(self.pairs)
        counts = [self.group.count(g) for g in range(len(self.meetings))]
        return any(
            self.meetings[g][h] is not None and (g != h or counts[g] > 1)
            for g, h in combinations_with_replacement(range(len(counts)), 2)
        )

    def _capacity(self) -> int:
        """Contacts that the buffer of a world holds."""
        given: int | None = getattr(self._c.method.solver, "contacts", None)
        if given is not None:
            return given
        kind = self.colliders.kind
        each = (
            min(_POINTS.get(kind[a], MOST_POINTS), _POINTS.get(kind[b], MOST_POINTS))
            for a, b in self.pairs
        )
        usual = _USUAL * sum(thing.movable for thing in self._things)
        return usual if self.tree else min(sum(each), usual)

    @property
    def stored(self) -> int:
        """Numbers of the state per contact."""
        generators = self._c.scene.of(Ground, Collisions)
        brakes = any(generator.brakes for generator in generators)
        return at.STORED_WITH_BRAKES if brakes else at.STORED_USUALLY

    @property
    def active(self) -> bool:
        """Whether there is anything to hold."""
        return self.touching or bool(self.joints)

    def state(self) -> None:
        """Stored contacts, and whether some did not fit; impulses of joints, what drives them, and what is broken."""
        c = self._c
        if not self.active:
            return
        c.state((RIGID, "contacts"), np.zeros(self.stored * self.capacity))
        c.state((RIGID, "overflow"), [0.0])
        c.state((RIGID, "bound"), np.zeros(sum(map(_rows, self.joints))))
        for joint in self.joints:
            c.state((joint, "broken"), [0.0])
            c.state((joint, "force"), np.zeros(3))
            c.state((joint, "torque"), np.zeros(3))
            for prefix, drive in named_drives(joint):
                c.state((joint, f"{prefix}speed"), [drive.speed])
        if getattr(c.method.solver, "rest_time", None) is not None:
            c.state((RIGID, "rest"), np.zeros(at.REST * len(self._things) + 1))

    def build(self) -> None:
        """Records, numbers and work rows."""
        c = self._c
        c.header["rigid"] = -1
        if not self.active:
            return
        c.model.touching = self.touching
        things = self._things
        index = {id(thing): i for i, thing in enumerate(things)}
        solids = [word for thing in things for word in self._solid(thing)]
        colliders = [word for k in range(len(self.colliders)) for word in self._collider(k, index)]
        meetings = [
            row
            for generators in self.meetings
            for generator in generators
            for row in self._surface(generator)
        ]
        pairs = [collider for pair in self.pairs for collider in pair]
        self._numbers()
        joints: list[int] = []
        first = 0
        for joint in self.joints:
            joints += self._joint(joint, first, index)
            first += _rows(joint)
        wakers = self._wakers(solids, meetings, colliders, joints)
        for name, records in zip(
            _SECTIONS,
            (solids, colliders, pairs, meetings, self.partings, joints, wakers),
            strict=True,
        ):
            c.sections[name] = records
        self._record(len(things), len(wakers))

    def _wakers(
        self, solids: list[int], meetings: list[int], colliders: list[int], joints: list[int]
    ) -> list[int]:
        """Rows of what all solids share, and of masses: what sleeps wakes if one of them changes."""
        rows: list[int] = []
        for k in range(0, len(solids), at.SOLID):
            place, turn, _, _, mass, *_, flags, _ = solids[k : k + at.SOLID]
            if flags != 0:
                rows.append(mass)
            else:
                rows += [*range(place, place + 3), *(range(turn, turn + 4) if turn >= 0 else ())]
        rows += meetings
        for k in range(0, len(colliders), at.COLLIDER):
            kind, row = colliders[k], colliders[k + 3]
            rows += range(row, row + (4 if kind == HALF_SPACE else row >= 0))
        for k in range(0, len(joints), at.JOINT):
            # But of the reaction, which is read only.
            joint = joints[k : k + at.JOINT]
            rows += [joint[at.JOINT_BROKEN], *joint[at.JOINT_TORN : at.JOINT_DRIVES]]
            for drive in range(joint[at.JOINT_DRIVES]):
                first = at.DRIVES_AT + at.DRIVE * drive
                rows += joint[first + 1 : first + at.DRIVE]
        return sorted({row for row in rows if row >= 0})

    def _surface(self, generator: Any) -> list[int]:
        """Rows of a generator's numbers, -1 for what it does not have."""
        names: tuple[str, ...] = ()
        if generator is not None:
            names = ("restitution", "friction", *generator.brakes)
        rows = [self._c.parameter(generator, name, getattr(generator, name)) for name in names]
        return rows + [-1] * (at.MEETING - len(rows))

    def _solid(self, thing: Body | Particle) -> list[int]:
        """Record of what contacts push."""
        c = self._c
        flags = int(thing.movable)
        if isinstance(thing, Particle):
            mass = c.header["inverse_mass"] + c.of(thing)
            own = c.at("acceleration", thing)
            return [
                c.at("position", thing),
                -1,
                c.at("velocity", thing),
                -1,
                mass,
                -1,
                -1,
                flags,
                own,
            ]
        if thing.movable:
            flags = (3 if thing.pivot is None else 2) + 4 * (not self._is_round(thing))
        return [*c.bodies.rows(thing), flags, c.bodies.acceleration(thing)]

    def _is_round(self, body: Body) -> bool:
        """Whether all that a body is made of are balls about its origin."""
        own = self.colliders.of(body)
        return bool(
            (self.colliders.kind[own] == SPHERE).all() and not self.colliders.place[own].any()
        )

    def _collider(self, k: int, index: dict[int, int]) -> list[int]:
        """Record of a collider."""
        c = self._c
        owner, kind = self.colliders.owner[k], int(self.colliders.kind[k])
        if kind == HALF_SPACE:
            normal = c.parameter(owner, "normal", owner.normal)
            height = c.parameter(owner, "height", owner.height)
            assert height == normal + 3
            return [kind, -1, k, normal, self.group[k]]
        row = -1
        if isinstance(owner, Particle):
            p = c.of(owner)
            row = c.slot(1, ((PARTICLES, "radius"),), lambda value: value[p : p + 1])
        return [kind, index[id(owner)], k, row, self.group[k]]

    def _numbers(self) -> None:
        """Settings and local geometry."""
        colliders = self.colliders
        geometry = np.zeros((len(colliders), at.GEOMETRY))
        geometry[:, at.G_PLACE : at.G_PLACE + 3] = colliders.place
        geometry[:, at.G_TURN : at.G_TURN + 9] = colliders.turn.reshape(-1, 9)
        geometry[:, at.G_SIZE : at.G_SIZE + 3] = colliders.size
        reach = colliders.size.sum(axis=1)
        boxes = colliders.kind == BOX
        reach[boxes] = np.linalg.norm(colliders.size[boxes], axis=1)
        geometry[:, at.G_REACH] = reach
        settings = np.array(self._c.method.solver.settings)  # type: ignore[union-attr]
        ends = [
            number
            for joint in self.joints
            for _, place, axes in joint.ends
            for number in (*place, *axes.ravel())
        ]
        self._ends = len(settings) + geometry.size
        self._c.model.numbers = np.concatenate([settings, geometry.ravel(), ends])

    def _joint(self, joint: Any, first: int, index: dict[int, int]) -> list[int]:
        """Record of a joint, whose rows begin at ``first``."""
        c = self._c
        ends = [-1 if thing is None else index[id(thing)] for thing, _, _ in joint.ends]
        record = [
            sum(1 << k for k in joint.locked), *ends,
            self._ends + at.JOINT_NUMBERS * self.joints.index(joint), first, _rows(joint),
            c.model.places[joint, "broken"][0], c.model.places[joint, "force"][0], c.model.places[joint, "torque"][0],
            c.parameter(joint, "break_force", joint.break_force),
            c.parameter(joint, "break_torque", joint.break_torque),
            c.parameter(joint, "length", joint.length) if isinstance(joint, DistanceJoint) else -1,
            len(joint.drives),
        ]  # fmt: skip
        for prefix, drive in named_drives(joint):
            record += [drive.coordinate, c.model.places[joint, f"{prefix}speed"][0]]
            record += [
                c.parameter(joint, prefix + name, getattr(drive, name))
                for name in ("strength", "low", "high", "stiffness", "damping", "rest")
            ]
        return record + [-1] * (at.JOINT - len(record))

    def _record(self, solids: int, wakers: int) -> None:
        """The record that holds it all together."""
        c = self._c
        capacity = self.capacity

        def entries(size: int) -> int:
            return LANES * c.take(-(-size // LANES))

        words = dict.fromkeys(range(at.RIGID_WORDS), 0)
        words[at.SOLIDS] = solids
        words[at.COLLIDERS] = len(self.colliders)
        words[at.PAIRS] = len(self.pairs)
        words[at.PLANES] = self.planes
        words[at.STORED] = self.stored
        words[at.GROUPS] = len(self.meetings)
        words[at.PARTINGS] = len(self.partings)
        words[at.BOXES] = -1
        if self.tree:
            words[at.BOXES] = entries(LANES * (tree_numbers(self.planes) + BOX_NUMBERS))
        words[at.NUMBERS] = c.model.numbers.ctypes.data
        words[at.STORED_ROW] = c.model.places[RIGID, "contacts"][0]
        words[at.OVERFLOW_ROW] = c.model.places[RIGID, "overflow"][0]
        words[at.CAPACITY] = capacity
        words[at.START_ROW] = c.take(6 * solids)
        words[at.JOINTS] = len(self.joints)
        words[at.REST_ROW] = c.model.places.get((RIGID, "rest"), (-1, 0))[0]
        words[at.WAKERS] = wakers
        words[at.SOLVE] = c.method.solver.island.address(planar=c.scene.planar)  # type: ignore[union-attr]
        words[at.BOUND_ROW] = c.model.places[RIGID, "bound"][0]
        words[at.ROW_WORK] = entries(at.ROW_ENTRIES * sum(map(_rows, self.joints)))
        words[at.FRAME_WORK] = entries(at.FRAME_ENTRIES)
        words[at.PACK_ROW] = c.take(13 + ROTOR_ROWS)
        words[at.SOLID_WORK] = entries(at.SOLID_ENTRIES * (solids + 1))
        words[at.PLACED_WORK] = entries(PLACED_ENTRIES * len(self.colliders))
        words[at.CONTACT_WORK] = entries(at.CONTACT_ENTRIES * capacity)
        words[at.POINTS_WORK] = entries(POINT * ALL_POINTS)
        words[at.NARROW_WORK] = entries(WORK)
        blocks = SIX * (solids * (solids + 1) // 2)
        words[at.MATRIX_ROW] = c.take(blocks)
        words[at.HELD_ROW] = c.take(blocks if self.joints else 0)
        words[at.VECTOR_ROW] = c.take(solids + 8)
        place = 0
        bonds = capacity + len(self.joints)
        for word, size in (
            (at.DEGREES, solids + 1), (at.ADJACENT, 2 * bonds), (at.ORDER, solids), (at.LOCAL, solids),
            (at.FIRST, solids), (at.STARTS, solids), (at.END_A, bonds), (at.END_B, bonds),
            (at.LIST, capacity), (at.MATCHED, capacity), (at.HELD, len(self.joints)),
            (at.ISLAND, at.ISLAND_ENTRIES), (at.TREES, LANES * tree_words(self.planes) if self.tree else 0),
            (at.NEAR, STACK + 3 * self.planes + 2 * len(self.colliders) if self.tree else 2),
        ):  # fmt: skip
            words[word] = place
            place += size
        #: Integers of the work area.
        self.integers = place
        self.words = words

    def place(self, first: int, sections: dict[str, int]) -> list[int]:
        """The record's words, given where integers begin and where the sections stand on the tape."""
        words = dict(self.words)
        for name in _SECTIONS:
            words[getattr(at, f"{name[:-1].upper()}_RECORDS")] = sections[name] + 1
        for word in range(at.DEGREES, at.RIGID_WORDS):
            words[word] += first
        return [words[k] for k in range(at.RIGID_WORDS)]
