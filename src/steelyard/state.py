"""State: what varies, seen world first without a copy."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .model.compile import PARTICLES, Model
from .model.parameters import Key
from .model.tape import H_DAMPED

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


@dataclass(frozen=True)
class Snapshot:
    """The whole state of a world at one time."""

    model: Model
    state: np.ndarray
    values: dict[Key, np.ndarray]


class Particles:
    """All particles of all worlds."""

    def __init__(self, world: World) -> None:
        self._world = world

    def _vector(self, name: str) -> np.ndarray:
        row, size = self._world.model.places[PARTICLES, name]
        rows = self._world._state[row : row + size, : self._world.worlds]
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
        """1/mass [1/kg], shape (particles,) if shared, (worlds, particles) if per world; assignable."""
        return self._world._get((PARTICLES, "inverse_mass"))

    @inverse_mass.setter
    def inverse_mass(self, value: Any) -> None:
        given = np.asarray(value, dtype=np.float64)
        if not (given >= 0.0).all():
            raise ValueError(
                f"World: inverse_mass has {given.min()!r}; the limit is 0. Use 0 or more."
            )
        self._world._set((PARTICLES, "inverse_mass"), given, self._count)

    @property
    def mass(self) -> np.ndarray:
        """Mass [kg], inf where immovable; assignable as ``inverse_mass`` is."""
        inverse = self.inverse_mass
        return np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), np.inf)

    @mass.setter
    def mass(self, value: Any) -> None:
        given = np.asarray(value, dtype=np.float64)
        if not (given > 0.0).all():
            raise ValueError(
                f"World: mass has {given.min()!r}; it must be greater than 0 kg. Use inf for immovable."
            )
        self.inverse_mass = 1.0 / given

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
        given = np.asarray(value, dtype=np.float64)
        if not ((given > 0.0) & (given <= 1.0)).all():
            raise ValueError("World: damping must be in (0, 1]; use 1 for none.")
        if (given != 1.0).any():
            self._world.model.tape[H_DAMPED] = 1
        self._world._set((PARTICLES, "damping"), given, self._count)

    @property
    def acceleration(self) -> np.ndarray:
        """Constant accelerations [m/s^2], shape (worlds, particles, 3)."""
        values = self._world._get((PARTICLES, "acceleration"))
        shape = (self._world.worlds, 3 * self._count)
        return np.broadcast_to(values, shape).reshape(-1, self._count, 3)

    @property
    def _count(self) -> int:
        return len(self._world.scene.particles)


class Handle:
    """What can be read and assigned of one thing of a scene: ``world[thing].name``.

    State that control moves (winch ``length`` and ``rate``, rider ``weights`` and ``rates``) reads as a writable
    view, world first. Parameters read as they were given, shared or per world, and are assigned in shape
    (), (size,) or (worlds, size).
    """

    __slots__ = ("_thing", "_world")

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
        model = self._world.model
        key = (self._thing, name)
        if key in model.places:
            view = self._world._view(self._thing, name)
            given = np.asarray(value, dtype=np.float64)
            view[:] = given[:, None] if given.ndim == 1 and view.shape[1] == 1 else given
        elif key in model.parameters.values:
            self._world._set(key, value, model.parameters.values[key].shape[0])
        else:
            raise AttributeError(self._unknown(name))

    def _unknown(self, name: str) -> str:
        model = self._world.model
        names = {n for t, n in [*model.places, *model.parameters.values] if t is self._thing}
        return f"{type(self._thing).__name__} has no {name!r} in a world; it has {', '.join(sorted(names))}."
