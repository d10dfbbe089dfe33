"""State: what varies, seen world first without a copy."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .math.pointers import LANES
from .model.compile import Model
from .model.parameters import PARTICLES, Key
from .scene import checks
from .scene.particle import Particle

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


class Particles:
    """All particles of all worlds."""

    __slots__ = ("_world",)

    def __init__(self, world: World) -> None:
        self._world = world

    def _vector(self, name: str) -> np.ndarray:
        world = self._world
        row, size = world._model.places[PARTICLES, name]
        rows = world._state[row : row + size, : world._worlds]
        return rows.reshape(size // 3, 3, -1).transpose(2, 0, 1)

    @property
    def position(self) -> np.ndarray:
        """Positions [m], a writable view of shape (worlds, particles, 3)."""
        return self._vector("position")

    @property
    def velocity(self) -> np.ndarray:
        """Velocities [m/s], a writable view of shape (worlds, particles, 3)."""
        return self._vector("velocity")

    @property
    def inverse_mass(self) -> np.ndarray:
        """1/mass [1/kg], (particles,) if shared, (worlds, particles) if per world; assignable."""
        return self._world._get((PARTICLES, "inverse_mass"))

    @inverse_mass.setter
    def inverse_mass(self, value: Any) -> None:
        self._world._set((PARTICLES, "inverse_mass"), value, self._count)

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
        Particle.LIMITS["mass"].check("World", "mass", finite)
        world._store((PARTICLES, "inverse_mass"), 1.0 / mass)

    @property
    def mass_or_zero(self) -> np.ndarray:
        """Mass [kg], 0 where immovable, shape (worlds, particles)."""
        mass = self.mass
        mass = np.where(np.isfinite(mass), mass, 0.0)
        return np.broadcast_to(mass, (self._world.worlds, self._count))

    @property
    def damping(self) -> np.ndarray:
        """Fraction of velocity kept per second, (particles,) or (worlds, particles); assignable."""
        return self._world._get((PARTICLES, "damping"))

    @damping.setter
    def damping(self, value: Any) -> None:
        self._world._set((PARTICLES, "damping"), value, self._count)

    @property
    def acceleration(self) -> np.ndarray:
        """Constant accelerations [m/s^2], shape (worlds, particles, 3)."""
        values = self._world._get((PARTICLES, "acceleration"))
        shape = (self._world.worlds, 3 * self._count)
        each = np.broadcast_to(values, shape).reshape(-1, self._count, 3)
        each.flags.writeable = False
        return each

    @property
    def _count(self) -> int:
        return len(self._world.scene.particles)


def assigned(key: Key, value: Any, *, size: int, worlds: int) -> np.ndarray:
    """An assigned value as it is stored, by the limits of the kind of thing.

    Raises:
        ValueError: of another shape, not finite or out of its limits.
    """
    thing, name = key
    kind, owner = (Particle, "World") if thing == PARTICLES else (type(thing), type(thing).__name__)
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
        if isinstance(self._thing, Particle):
            return f"{kind} has no {name!r} in a world; use world.particles for all of them."
        model = self._world.model
        keys = [*model.places, *model.parameters.values]
        # Rows of single pairs have names with a number, and are no one's business.
        names = {n for thing, n in keys if thing is self._thing and " " not in n}
        return f"{kind} has no {name!r} in a world; it has {', '.join(sorted(names)) or 'nothing'}."


def follow_gravity(model: Model) -> None:
    """Give the assigned gravity to all particles that bring no acceleration of their own."""
    values = model.parameters.values
    gravity, own = values[PARTICLES, "gravity"], values[PARTICLES, "acceleration"]
    if max(gravity.ndim, own.ndim) == 2:
        gravity, own = gravity.reshape(3, -1), own.reshape(len(own), -1)
        own = np.repeat(own, max(gravity.shape[1], own.shape[1]) // own.shape[1], axis=1)
    own = own.copy()
    for p, particle in enumerate(model.scene.particles):
        if particle.acceleration is None:
            own[3 * p : 3 * p + 3] = gravity
    values[PARTICLES, "acceleration"] = own


def carry(old: Model, old_state: np.ndarray, new: Model, state: np.ndarray) -> None:
    """Copy what both models hold: things by identity, particles by identity."""
    before = {id(p): k for k, p in enumerate(old.scene.particles)}
    for key, (row, size) in new.places.items():
        thing, name = key
        if thing == PARTICLES and name in ("position", "velocity", "user"):
            if key in old.places:
                for p, particle in enumerate(new.scene.particles):
                    if id(particle) in before:
                        source = old.places[key][0] + 3 * before[id(particle)]
                        state[row + 3 * p : row + 3 * p + 3] = old_state[source : source + 3]
        elif name != "mark" and key in old.places and old.places[key][1] == size:
            source = old.places[key][0]
            state[row : row + size] = old_state[source : source + size]
    for key, value in old.parameters.values.items():
        present = new.parameters.values.get(key)
        if present is None:
            continue
        if key[0] == PARTICLES and key[1] != "gravity":
            _carry_particles(old, new, before, key, value)
        elif present.shape[0] == value.shape[0]:
            new.parameters.values[key] = value


def _carry_particles(
    old: Model, new: Model, before: dict[int, int], key: Key, value: np.ndarray
) -> None:
    """Copy a parameter of particles that both models hold; new ones take the assigned gravity."""
    width = value.shape[0] // len(before)
    present = new.parameters.values[key]
    gravity = old.parameters.values[PARTICLES, "gravity"]
    if value.ndim == 2 or gravity.ndim == 2:
        worlds = value.shape[1] if value.ndim == 2 else gravity.shape[1]
        present = np.repeat(present[:, None], worlds, axis=1)
        value = np.broadcast_to(value.reshape(len(value), -1), (len(value), worlds))
        gravity = np.broadcast_to(gravity.reshape(3, -1), (3, worlds))
    for p, particle in enumerate(new.scene.particles):
        target = slice(width * p, width * p + width)
        if id(particle) in before:
            source = width * before[id(particle)]
            present[target] = value[source : source + width]
        elif key[1] == "acceleration" and particle.acceleration is None:
            present[target] = gravity
    new.parameters.values[key] = present
