"""State: what varies, seen world first without a copy."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .math.pointers import LANES
from .model.compile import Model
from .model.derived import LOWER, symmetric
from .model.parameters import BODIES, PARTICLES, RIGID, Key
from .model.rigid_layout import REST
from .scene import checks
from .scene.body import Body
from .scene.particle import Particle
from .scene.shapes import rotation_matrix

if TYPE_CHECKING:
    from .world import World


def aligned(shape: tuple[int, int]) -> np.ndarray:
    """Zeros of float64 that start on a cache line, as wide vector loads like it."""
    size = int(np.prod(shape))
    buffer = np.zeros(size + 8)
    offset = (-buffer.ctypes.data // 8) % 8
    return buffer[offset : offset + size].reshape(shape)


def available_memory() -> int:
    """Free physical memory [bytes]; 2**62 where the system does not say."""
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 2**62


def new_state(model: Model, worlds: int) -> np.ndarray:
    """State of a batch at the scene's start, shape (state rows, padded worlds).

    Raises:
        MemoryError: it does not fit into memory.
    """
    blocks = -(-worlds // LANES)
    width = LANES * (blocks + 1 - blocks % 2)  # odd multiples: rows do not alias in cache
    size, free = 8 * model.state_rows, available_memory()
    if size * width > free:
        raise MemoryError(
            f"World: {worlds} worlds of {size} bytes need {size * width / 2**30:.1f} GiB; "
            f"{free / 2**30:.1f} GiB are free. Use at most {free // size} worlds."
        )
    state = aligned((model.state_rows, width))
    state[:] = model.start[:, None]
    return state


def new_scratch(model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Work arrays of one thread: rows, skipped blocks, ends and values of contacts."""
    return (
        aligned((model.rows, LANES)),
        np.zeros(model.skip, dtype=np.int64),
        np.zeros(3 * LANES, dtype=np.int64),
    )


@dataclass(frozen=True)
class Snapshot:
    """The whole state of a world at one time."""

    model: Model
    state: np.ndarray
    values: dict[Key, np.ndarray]


class Group:
    """All things of a kind, of all worlds: particles or bodies."""

    __slots__ = ("_world",)
    key: ClassVar[str]
    kind: ClassVar[type[Particle] | type[Body]]

    def __init__(self, world: World) -> None:
        self._world = world

    def _vector(self, name: str, width: int = 3) -> np.ndarray:
        world = self._world
        if (self.key, name) not in world._model.places:
            return np.zeros((world._worlds, 0, width))
        row, size = world._model.places[self.key, name]
        rows = world._state[row : row + size, : world._worlds]
        return rows.reshape(size // width, width, world._worlds).transpose(2, 0, 1)

    @property
    def _count(self) -> int:
        return len(self._world.scene.of(self.kind))

    def _parameter(self, name: str) -> np.ndarray:
        return self._world._get((self.key, name))

    def _assign(self, name: str, value: Any, width: int = 1) -> None:
        self._world._set((self.key, name), value, width * self._count)

    @property
    def position(self) -> np.ndarray:
        """Positions [m], of bodies of their frames' origins, a writable view of shape (worlds, things, 3)."""
        return self._vector("position")

    @property
    def velocity(self) -> np.ndarray:
        """Velocities [m/s], a writable view of shape (worlds, things, 3)."""
        return self._vector("velocity")

    @property
    def asleep(self) -> np.ndarray:
        """What has been at rest for so long that it is not solved until something changes, (worlds, things) bool."""
        world = self._world
        if (RIGID, "rest") not in world._model.places:
            return np.zeros((world._worlds, self._count), dtype=bool)
        # Bodies stand before particles.
        first = 0 if self.kind is Body else len(world.scene.bodies)
        rest = world._view(RIGID, "rest")[:, REST * first : REST * (first + self._count) : REST]
        return np.asarray(rest < 0.0)

    @property
    def inverse_mass(self) -> np.ndarray:
        """1/mass [1/kg], (things,) if shared, (worlds, things) if per world; assignable."""
        return self._parameter("inverse_mass")

    @inverse_mass.setter
    def inverse_mass(self, value: Any) -> None:
        self._assign("inverse_mass", value)

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg], inf where immovable; assignable as ``inverse_mass`` is."""
        inverse = self.inverse_mass
        mass = np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), np.inf)
        mass.flags.writeable = False  # a write would be lost
        return mass

    @mass.setter
    def mass(self, value: Any) -> None:
        world = self._world
        mass = checks.fitted("World", "mass", value, size=self._count, worlds=world.worlds)
        finite = np.where(mass == np.inf, 1.0, mass)  # inf is allowed here: it stays immovable
        self.kind.LIMITS["mass"].check("World", "mass", finite)
        world._store((self.key, "inverse_mass"), 1.0 / mass)

    @property
    def mass_or_zero(self) -> np.ndarray:
        """Mass [kg], 0 where immovable, shape (worlds, things)."""
        mass = self.mass
        mass = np.where(np.isfinite(mass), mass, 0.0)
        return np.broadcast_to(mass, (self._world.worlds, self._count))

    @property
    def damping(self) -> np.ndarray:
        """Fraction of velocity kept per second, (things,) or (worlds, things); assignable."""
        return self._parameter("damping")

    @damping.setter
    def damping(self, value: Any) -> None:
        self._assign("damping", value)

    @property
    def acceleration(self) -> np.ndarray:
        """Constant accelerations [m/s^2], shape (worlds, things, 3)."""
        values = self._parameter("acceleration")
        shape = (self._world.worlds, 3 * self._count)
        each = np.broadcast_to(values, shape).reshape(shape[0], self._count, 3)
        each.flags.writeable = False
        return each


class Particles(Group):
    """All particles of all worlds."""

    __slots__ = ()
    key, kind = PARTICLES, Particle


class Bodies(Group):
    """All bodies of all worlds."""

    __slots__ = ()
    key, kind = BODIES, Body

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (w, x, y, z) that turn the body's axes into the world's, a view (worlds, bodies, 4).

        It can be written into; what is written must be of length 1.
        """
        return self._vector("orientation", 4)

    @property
    def centre(self) -> np.ndarray:
        """Centres of mass [m], shape (worlds, bodies, 3): the positions, but for bodies with a pivot."""
        return self.position + self._arms

    @property
    def centre_velocity(self) -> np.ndarray:
        """Velocities of the centres of mass [m/s], shape (worlds, bodies, 3)."""
        return self.velocity + np.cross(self.angular_velocity, self._arms)

    @property
    def _arms(self) -> np.ndarray:
        arms = np.array([body.arm for body in self._world.scene.bodies]).reshape(-1, 3)
        return np.asarray(np.einsum("wbij,bj->wbi", rotation_matrix(self.orientation), arms))

    @property
    def angular_momentum(self) -> np.ndarray:
        """Angular momentum of each about its frame's origin [kg m^2/s] along the world's axes, (worlds, bodies, 3).

        A writable view; it is what the state holds, so it stays where orientation or inertia are assigned.
        """
        return self._vector("angular_momentum")

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities [rad/s] along the world's axes, (worlds, bodies, 3), of orientation and momentum.

        Assignable in this shape or (bodies, 3): assign it after orientation and inertia.
        """
        turn = rotation_matrix(self.orientation)
        movable = np.array([body.movable for body in self._world.scene.bodies])
        inertia = np.where(movable[:, None, None], self.inertia, np.eye(3))
        own = np.linalg.solve(
            inertia, np.einsum("wbji,wbj->wbi", turn, self.angular_momentum)[..., None]
        )
        velocity = np.einsum("wbij,wbj->wbi", turn, own[..., 0])
        velocity.flags.writeable = False  # a write would be lost
        return velocity

    @angular_velocity.setter
    def angular_velocity(self, value: Any) -> None:
        world = self._world
        size = 3 * self._count
        given = checks.floats(value)
        flat = value if given is None else given.reshape(*given.shape[:-2], -1)
        spin = checks.fitted("World", "angular_velocity", flat, size=size, worlds=world.worlds)
        checks.FINITE.check("World", "angular_velocity", spin)
        spin = np.moveaxis(spin.reshape(self._count, 3, -1), -1, 0)
        turn = rotation_matrix(self.orientation)
        spin = np.broadcast_to(spin, turn.shape[:-1])
        own = np.einsum("wbji,wbj->wbi", turn, spin)
        own = np.einsum("wbij,wbj->wbi", self.inertia, own)
        self.angular_momentum[:] = np.einsum("wbij,wbj->wbi", turn, own)

    @property
    def angular_damping(self) -> np.ndarray:
        """Fraction of angular velocity kept per second, (bodies,) or (worlds, bodies); assignable."""
        return self._parameter("angular_damping")

    @angular_damping.setter
    def angular_damping(self, value: Any) -> None:
        self._assign("angular_damping", value)

    @property
    def inertia(self) -> np.ndarray:
        """Inertia [kg m^2] about the frame's origin along the body's axes, shape (worlds, bodies, 3, 3).

        Assignable in shape (bodies, 3, 3) or (worlds, bodies, 3, 3).
        """
        values = self._parameter("inertia")
        shape = (self._world.worlds, 6 * self._count)
        each = np.broadcast_to(values, shape).reshape(shape[0], self._count, 6)
        matrix = symmetric(np.moveaxis(each, -1, 0))
        matrix.flags.writeable = False  # a write would be lost
        return matrix

    @inertia.setter
    def inertia(self, value: Any) -> None:
        world = self._world
        given = checks.floats(value)
        shape = (self._count, 3, 3)
        if given is None or given.shape not in (shape, (world.worlds, *shape)):
            raise ValueError(
                f"World: inertia is {checks.described(value)}; it must be of shape {shape} for all worlds, or of shape "
                f"{(world.worlds, *shape)} for each its own. Give matrices."
            )
        if not np.array_equal(given, np.swapaxes(given, -1, -2)):
            raise ValueError("World: inertia is not symmetric; it must be. Give (A + A^T)/2.")
        numbers = given[..., LOWER[0], LOWER[1]]
        self._assign("inertia", numbers.reshape(*numbers.shape[:-2], -1), 6)


def strike(
    world: World,
    body: Body,
    impulse: Any,
    *,
    at: Any = None,
    angular: bool = False,
    mask: Any = None,
) -> None:
    """See ``World.apply_impulse`` and ``apply_angular_impulse``."""
    if body not in world.scene:
        raise KeyError("World: this body is not in the world's scene; add it.")
    if not body.movable:
        raise ValueError(
            "World: an impulse on an immovable body; its inverse mass is 0 and must be above 0. Give it a mass."
        )
    worlds, k = world.worlds, world._index(body)
    blow = checks.fitted("World", "impulse", impulse, size=3, worlds=worlds).reshape(3, -1).T
    checks.FINITE.check("World", "impulse", blow.T)
    chosen = np.ones(worlds, dtype=bool)
    if mask is not None:
        chosen = checks.mask("World.apply_impulse", mask, worlds=worlds)
    bodies = world.bodies
    moment = blow
    if not angular:
        place = bodies.centre[:, k]
        if at is not None:
            place = checks.fitted("World", "at", at, size=3, worlds=worlds).reshape(3, -1).T
        moment = np.cross(place - bodies.position[:, k], blow)
        if body.pivot is None:
            change = blow / bodies.mass_or_zero[:, k, None]
            bodies.velocity[chosen, k] += change[chosen]
    bodies.angular_momentum[chosen, k] += np.broadcast_to(moment, (worlds, 3))[chosen]


def assigned(key: Key, value: Any, *, size: int, worlds: int) -> np.ndarray:
    """An assigned value as it is stored, by the limits of the kind of thing.

    Raises:
        ValueError: of another shape, not finite or out of its limits.
    """
    thing, name = key
    kinds: dict[str, Any] = {PARTICLES: Particle, BODIES: Body}
    own = isinstance(thing, str)
    kind, owner = (kinds[thing], "World") if own else (type(thing), type(thing).__name__)
    given = checks.fitted(owner, name, value, size=size, worlds=worlds)
    return kind.LIMITS.get(name, checks.FINITE).check(owner, name, given)


class Handle:
    """What can be read and assigned of one thing of a scene: ``world[thing].name``.

    State that control moves (winch ``length``, ``rate`` and ``acceleration``, rider ``weights``,
    ``rates`` and ``accelerations``) reads as a writable view, world first; what is written into the
    view is not checked. Parameters read as they were given, shared or per world, and cannot be
    written into. Both are assigned in shape (), (size,) or (worlds, size), (worlds,) for size 1,
    and checked by the limits of the thing's constructor.
    """

    __slots__ = ("_thing", "_world")
    _thing: Any
    _world: World

    def __init__(self, world: World, thing: Any) -> None:
        object.__setattr__(self, "_world", world)
        object.__setattr__(self, "_thing", thing)

    def __getattr__(self, name: str) -> np.ndarray:
        model = self._world.model
        key = (self._thing, name)
        if key in model.places:
            view = self._world._view(self._thing, name)
            return view[:, 0] if view.shape[1] == 1 else view
        if key in model.parameters.values:
            value = self._world._get(key)
            return value[..., 0] if value.shape[-1] == 1 else value
        raise AttributeError(self._unknown(name))

    def __setattr__(self, name: str, value: Any) -> None:
        world = self._world
        key = (self._thing, name)
        if key in world.model.places:
            view = world._view(self._thing, name)
            view[:] = assigned(key, value, size=view.shape[1], worlds=world.worlds).T
        elif key in world.model.parameters.values:
            world._set(key, value, world.model.parameters.values[key].shape[0])
        else:
            raise AttributeError(self._unknown(name))

    def _unknown(self, name: str) -> str:
        kind = type(self._thing).__name__
        if isinstance(self._thing, Particle | Body):
            plural = "particles" if isinstance(self._thing, Particle) else "bodies"
            return f"{kind} has no {name!r} in a world; use world.{plural} for all of them."
        model = self._world.model
        keys = [*model.places, *model.parameters.values]
        # Rows of single pairs have names with a number, and are no one's business.
        names = {n for thing, n in keys if thing is self._thing and " " not in n}
        return f"{kind} has no {name!r} in a world; it has {', '.join(sorted(names)) or 'nothing'}."


def follow_gravity(model: Model) -> None:
    """Give the assigned gravity to all particles and bodies that bring no acceleration of their own."""
    values = model.parameters.values
    for key, things in _groups(model).items():
        if things:
            gravity, own = values[PARTICLES, "gravity"], values[key, "acceleration"]
            if max(gravity.ndim, own.ndim) == 2:
                gravity, own = gravity.reshape(3, -1), own.reshape(len(own), -1)
                worlds = max(gravity.shape[1], own.shape[1])
                own = np.broadcast_to(own, (len(own), worlds))
            own = own.copy()
            for p, thing in enumerate(things):
                if thing.acceleration is None:
                    own[3 * p : 3 * p + 3] = gravity
            values[key, "acceleration"] = own


def _groups(model: Model) -> dict[str, list[Any]]:
    """Particles and bodies by the key of their state."""
    return {PARTICLES: model.scene.particles, BODIES: model.scene.bodies}


def carry(old: Model, old_state: np.ndarray, new: Model, state: np.ndarray) -> None:
    """Copy what both models hold: things by identity, those of groups too."""
    groups = _groups(new)
    before = {
        key: {id(thing): k for k, thing in enumerate(things)}
        for key, things in _groups(old).items()
    }
    for key, (row, size) in new.places.items():
        thing, name = key
        # What sleeps wakes: something that it rested on may be gone.
        if key not in old.places or name in ("mark", "rest"):
            continue
        source = old.places[key][0]
        if thing in groups and name in _EACH:
            width = size // len(groups[thing]) if groups[thing] else 0
            for k, member in enumerate(groups[thing]):
                if id(member) in before[thing]:
                    at = source + width * before[thing][id(member)]
                    state[row + width * k : row + width * (k + 1)] = old_state[at : at + width]
        elif old.places[key][1] == size:
            state[row : row + size] = old_state[source : source + size]
    for key, value in old.parameters.values.items():
        present = new.parameters.values.get(key)
        if present is None:
            continue
        if key[0] in groups and key[1] != "gravity":
            _carry_each(old, new, groups[key[0]], before[key[0]], key, value)
        elif present.shape[0] == value.shape[0]:
            new.parameters.values[key] = value


#: Parts of the state of which every particle or body has its own.
_EACH = ("position", "velocity", "user", "orientation", "angular_momentum")


def _carry_each(
    old: Model, new: Model, things: list[Any], before: dict[int, int], key: Key, value: np.ndarray
) -> None:
    """Copy a parameter of particles or bodies that both models hold; new ones take the assigned gravity."""
    if not before or not things:
        return
    width = value.shape[0] // len(before)
    present = new.parameters.values[key]
    gravity = old.parameters.values[PARTICLES, "gravity"]
    if value.ndim == 2 or gravity.ndim == 2:
        worlds = value.shape[1] if value.ndim == 2 else gravity.shape[1]
        present = np.repeat(present[:, None], worlds, axis=1)
        value = np.broadcast_to(value.reshape(len(value), -1), (len(value), worlds))
        gravity = np.broadcast_to(gravity.reshape(3, -1), (3, worlds))
    for p, thing in enumerate(things):
        target = slice(width * p, width * p + width)
        if id(thing) in before:
            source = width * before[id(thing)]
            present[target] = value[source : source + width]
        elif key[1] == "acceleration" and thing.acceleration is None:
            present[target] = gravity
    new.parameters.values[key] = present
