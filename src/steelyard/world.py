"""World: a scene, a number of copies of it and a method, stepping."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from .diagnostics.energy import world_energy
from .diagnostics.residual import link_residuals
from .math.lanes import LANES
from .methods import DEFAULT, Method
from .model.compile import PARTICLES, Model, compile_model
from .model.tape import H_DAMPED
from .scene import checks
from .scene.contacts import ContactGenerator
from .scene.forces import UserForce
from .scene.particle import Particle
from .scene.scene import Scene
from .state import Handle, Particles, Snapshot, aligned, available_memory
from .stepping import FIRST_HALF, SECOND_HALF, advance

NONFINITE, UNSETTLED = 1, 2


class World:
    """``worlds`` independent copies of a scene, stepped together by one method.

    Args:
        scene: what the worlds hold; copied, so later changes to it do not reach this world.
        worlds: number of copies, at least 1.
        method: how to step; velocity Verlet with the direct solver at 60 Hz by default.
        threads: worlds are shared among so many threads; results do not depend on it.

    Raises:
        ValueError: the method cannot do what the scene holds, or a count is out of range.
        MemoryError: the batch does not fit into memory.
    """

    def __init__(
        self, scene: Scene, *, worlds: int = 1, method: Method = DEFAULT, threads: int = 1
    ) -> None:
        for name, value in (("worlds", worlds), ("threads", threads)):
            checks.number("World", name, value, least=1, remedy="Use at least one.")
            if int(value) != value:
                raise ValueError(
                    f"World: {name} is {value!r}; it must be a whole number. Round it."
                )
        if not scene.particles:
            raise ValueError(
                "World: the scene has 0 particles; it must have at least 1. Add a Particle."
            )
        self.worlds = int(worlds)
        self.threads = int(threads)
        self.method = method
        self.scene = scene.copy()
        self._compile(None)

    # Stepping

    def step(self, steps: int = 1) -> None:
        """Advance all worlds by ``steps`` times ``method.dt``."""
        if self._stale:
            self._prepare()
        if self._split:
            for _ in range(steps):
                self._step_split()
        else:
            self._run(steps, FIRST_HALF | SECOND_HALF)

    def _run(self, steps: int, phase: int) -> None:
        blocks = -(-self.worlds // LANES)
        if self._split:
            # Between the halves of a step a block's scratch keeps what the step's start decided.
            edges = np.arange(blocks + 1)
        else:
            edges = np.linspace(0, blocks, min(self.threads, blocks) + 1).astype(int)
        jobs = [(k, int(a), int(b)) for k, (a, b) in enumerate(pairwise(edges))]
        if self.threads == 1 or len(jobs) == 1:
            for job in jobs:
                self._chunk(*job, steps, phase)
        else:
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(lambda job: self._chunk(*job, steps, phase), jobs))

    def _chunk(self, thread: int, first: int, last: int, steps: int, phase: int) -> None:
        scratch, skip, ends, values = self._scratch[thread]
        advance(
            self.model.tape, scratch, skip, ends, values, self._state, self._given, self._given_rows,
            first, last, self.worlds, steps, phase,
        )  # fmt: skip

    def _step_split(self) -> None:
        """One step in parts, with user-written forces and contacts evaluated in between."""
        self._generate_contacts()
        self._evaluate_forces()
        if self.method.integrator.damping_share == 1.0 or not self.scene.of(UserForce):
            self._run(1, FIRST_HALF | SECOND_HALF)
        else:
            self._run(1, FIRST_HALF)
            self._evaluate_forces(self.method.dt)
            self._run(1, SECOND_HALF)

    def _evaluate_forces(self, later: float = 0.0) -> None:
        forces = self.scene.of(UserForce)
        if not forces:
            return
        particles = self.scene.particles
        total = np.zeros((self.worlds, len(particles), 3))
        position, velocity = self.particles.position.copy(), self.particles.velocity.copy()
        for force in forces:
            given = np.asarray(force.function(position, velocity, self.time + later))
            if given.shape != total.shape:
                raise ValueError(
                    f"UserForce: the function returned shape {given.shape}; it must be {total.shape} "
                    "(worlds, particles, 3). Return one force per particle."
                )
            if force.particles is None:
                total += given
            else:
                chosen = [self._index(p) for p in force.particles]
                total[:, chosen] += given[:, chosen]
        self._view(PARTICLES, "user")[:] = total.reshape(self.worlds, -1)

    def _generate_contacts(self) -> None:
        for generator in self.scene.of(ContactGenerator):
            a = [self._index(pair[0]) for pair in generator.pairs]
            b = [self._index(pair[1] or pair[0]) for pair in generator.pairs]
            position = self.particles.position
            normal, depth = generator.function(position[:, a], position[:, b], self.time.copy())
            normal, depth = np.asarray(normal), np.asarray(depth)
            shape = (self.worlds, len(a))
            if normal.shape != (*shape, 3) or depth.shape != shape:
                raise ValueError(
                    f"ContactGenerator: the function returned shapes {normal.shape} and {depth.shape}; they must "
                    f"be {(*shape, 3)} and {shape} (worlds, pairs). Return one contact per pair."
                )
            for k in range(len(a)):
                rows = self._view(generator, f"pair {k}")
                rows[:, :3] = normal[:, k]
                rows[:, 3] = depth[:, k]

    # Access

    @property
    def particles(self) -> Particles:
        """Positions, velocities and parameters of all particles."""
        return Particles(self)

    def __getitem__(self, thing: Any) -> Handle:
        """What can be read or assigned of a link, rider, contact generator or force.

        Raises:
            KeyError: the thing is not in this world's scene.
        """
        if thing not in self.scene:
            raise KeyError(
                f"World: this {type(thing).__name__} is not in the world's scene; only what was in the "
                "scene when the world was built, or was added by World.add, can be read. Add it."
            )
        return Handle(self, thing)

    def add(self, thing: Any) -> Any:
        """Add a link, rider, contact generator, force or particle between steps; all else keeps its state."""
        self.scene.add(thing)
        self._recompile(lambda: self.scene.remove(thing))
        return thing

    def remove(self, thing: Any) -> None:
        """Remove a thing between steps; all else keeps its state."""
        before = list(self.scene.things)
        self.scene.remove(thing)
        self._recompile(lambda: setattr(self.scene, "things", before))

    def _recompile(self, undo: Any) -> None:
        try:
            self._compile(self)
        except (ValueError, MemoryError):
            undo()
            raise

    @property
    def gravity(self) -> np.ndarray:
        """Gravity [m/s^2], shape (3,) if shared, (worlds, 3) if per world; assignable in both shapes."""
        return self._get((PARTICLES, "gravity"))

    @gravity.setter
    def gravity(self, value: Any) -> None:
        self._set((PARTICLES, "gravity"), value, 3)
        given = self.model.parameters.values[PARTICLES, "gravity"]
        key = (PARTICLES, "acceleration")
        own = self.model.parameters.values[key]
        if given.ndim > own.ndim:
            own = np.repeat(own[:, None], self.worlds, axis=1)
        elif own.ndim > given.ndim:
            given = np.repeat(given[:, None], self.worlds, axis=1)
        own = own.copy()
        for p, particle in enumerate(self.scene.particles):
            if particle.acceleration is None:
                own[3 * p : 3 * p + 3] = given
        self.model.parameters.values[key] = own

    @property
    def time(self) -> np.ndarray:
        """Time [s] of every world, a view of shape (worlds,)."""
        return self._view(PARTICLES, "time")[:, 0]

    # For kernels that read and write worlds in place

    @property
    def state(self) -> np.ndarray:
        """The whole state, shape (state rows, padded worlds); ``row`` says what lies where."""
        return self._state

    def row(self, thing: Any, name: str) -> int:
        """First row in ``state`` of a part of it.

        Args:
            thing: "particles", or a link, rider or generator of the scene.
            name: "position" (3 rows per particle), "velocity", "time", "nonfinite"; "length", "rate" or
                "acceleration" of a winch; "weights", "rates" or "accelerations" of a rider.
        """
        return self.model.places[thing, name][0]

    @property
    def launch(self) -> tuple[np.ndarray, ...]:
        """The first eight arguments of ``steelyard.advance``, for kernels that step worlds themselves.

        Raises:
            ValueError: the scene has user-written forces or contacts, which only ``step`` can call.
        """
        if self._split:
            raise ValueError(
                "World.launch: the scene has user-written forces or contacts; use World.step."
            )
        if self._stale:
            self._prepare()
        return (self.model.tape, *self._scratch[0], self._state, self._given, self._given_rows)

    # Diagnostics

    @property
    def health(self) -> np.ndarray:
        """Flags per world, shape (worlds,) uint8: 1 non-finite, 2 constraints missed their tolerance.

        Flags stay until ``reset`` or ``restore``. A non-finite world goes on stepping as NaN and touches no
        other.
        """
        broken = self._view(PARTICLES, "nonfinite")[:, 0] > 0
        late = self._view(PARTICLES, "unsettled")[:, 0] > 0
        return (NONFINITE * broken + UNSETTLED * late).astype(np.uint8)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy [J] of every world, shape (worlds,)."""
        return world_energy(self)

    @property
    def momentum(self) -> np.ndarray:
        """Linear momentum [kg m/s] of the movable particles, shape (worlds, 3)."""
        return np.einsum("wp,wpc->wc", self.particles.mass_or_zero, self.particles.velocity)

    @property
    def angular_momentum(self) -> np.ndarray:
        """Angular momentum [kg m^2/s] about the origin, shape (worlds, 3)."""
        moment = np.cross(self.particles.position, self.particles.velocity)
        return np.einsum("wp,wpc->wc", self.particles.mass_or_zero, moment)

    @property
    def residual(self) -> np.ndarray:
        """Violation of every link over its length, shape (worlds, links); slack cables count 0."""
        return link_residuals(self)

    # State

    def snapshot(self) -> Snapshot:
        """Copy of the whole state: what varies, multipliers, clocks, flags and assigned parameters."""
        values = {key: value.copy() for key, value in self.model.parameters.values.items()}
        return Snapshot(self.model, self._state.copy(), values)

    def restore(self, snapshot: Snapshot) -> None:
        """Put back a snapshot of this world.

        Raises:
            ValueError: the snapshot is of another scene, method or number of worlds.
        """
        if snapshot.model is not self.model or snapshot.state.shape != self._state.shape:
            raise ValueError(
                f"World.restore: the snapshot is of {snapshot.state.shape} rows and worlds of another "
                f"model; this world has {self._state.shape}. Restore it where it was taken."
            )
        self._state[:] = snapshot.state
        self.model.parameters.values = {key: value.copy() for key, value in snapshot.values.items()}
        self._stale = True

    def reset(self, mask: np.ndarray | None = None) -> None:
        """Put the state of all worlds, or of those in ``mask`` (worlds,) bool, back to the scene's start.

        Parameters that were assigned stay as they are.
        """
        chosen = slice(0, self.worlds) if mask is None else np.flatnonzero(mask)
        self._state[:, chosen] = self.model.start[:, None]

    @property
    def bytes_per_world(self) -> int:
        """Memory [bytes] that one more world costs: its state and own parameters."""
        if self._stale:
            self._prepare()
        return 8 * (self.model.state_rows + len(self._given_rows))

    def __getstate__(self) -> dict[str, Any]:
        values = list(self.model.parameters.values.values())
        names = ("scene", "worlds", "threads", "method", "_state")
        return {name: getattr(self, name) for name in names} | {"values": values}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        values = kept.pop("values")
        self.__dict__.update(kept)
        state = self._state
        self._compile(None)
        self._state[:] = state
        parameters = self.model.parameters.values
        parameters = dict(zip(parameters, values, strict=True))
        self.model.parameters.values = parameters
        self.model.tape[H_DAMPED] = int((parameters[PARTICLES, "damping"] != 1.0).any())

    # Inside

    def _compile(self, before: World | None) -> None:
        old = None if before is None else (self.model, self._state)
        model = compile_model(self.scene, self.method)
        width = -(-self.worlds // LANES)
        width = LANES * (
            width if width % 2 else width + 1
        )  # odd multiples: rows do not alias in cache
        needed = 8 * width * model.state_rows
        if needed > available_memory():
            raise MemoryError(
                f"World: {self.worlds} worlds of {8 * model.state_rows} bytes need {needed / 2**30:.1f} GiB; "
                f"{available_memory() / 2**30:.1f} GiB are free. Use at most "
                f"{int(available_memory() / (8 * model.state_rows))} worlds."
            )
        state = aligned((model.state_rows, width))
        state[:] = model.start[:, None]
        if old is not None:
            _carry(old[0], old[1], model, state)
        self.model = model
        self._state = state
        self._split = bool(self.scene.of(UserForce, ContactGenerator))
        self._scratch = [
            (
                aligned((model.rows, LANES)),
                np.zeros(max(model.blocks, 1), dtype=np.int64),
                np.zeros(max(model.contacts_most, 1), dtype=np.int64),
                np.zeros((max(model.contacts_most, 1), 12)),
            )
            for _ in range(-(-self.worlds // LANES) if self._split else self.threads)
        ]
        self._stale = True

    def _prepare(self) -> None:
        """Lay out the rows that follow from the parameters."""
        shared, self._given, self._given_rows = self.model.parameters.rows(self._state.shape[1])
        for scratch, *_ in self._scratch:
            for row, value in shared:
                scratch[row : row + len(value)] = value[:, None]
        self._stale = False

    def _index(self, particle: Particle) -> int:
        return next(p for p, other in enumerate(self.scene.particles) if other is particle)

    def _view(self, thing: Any, name: str) -> np.ndarray:
        row, size = self.model.places[thing, name]
        return self._state[row : row + size, : self.worlds].T

    def _get(self, key: tuple[Any, str]) -> np.ndarray:
        return self.model.parameters.values[key].T

    def _set(self, key: tuple[Any, str], value: Any, size: int) -> None:
        given = np.asarray(value, dtype=np.float64)
        shapes = [(), (size,), (self.worlds, size)] + ([(self.worlds,)] if size == 1 else [])
        if given.shape not in shapes or not np.isfinite(given).all():
            raise ValueError(
                f"World: {key[1]} was given shape {given.shape} (finite: {bool(np.isfinite(given).all())}); "
                f"it must be finite, of shape {shapes[1]} for all worlds or {shapes[2]} one per world."
            )
        if given.ndim < 2 and not (size == 1 and given.shape == (self.worlds,) and self.worlds > 1):
            stored = np.broadcast_to(given, (size,)).copy()
        else:
            stored = np.ascontiguousarray(given.reshape(self.worlds, size).T)
        check = self.model.parameters.checks.get(key)
        if check is not None:
            check(stored)
        self.model.parameters.values[key] = stored
        self._stale = True

    def __repr__(self) -> str:
        lines = [
            f"World of {self.worlds} x {self.scene}",
            f"  method: {self.method.integrator}, {self.method.solver}, dt {self.method.dt:.6g} s",
            f"  {self.bytes_per_world} bytes per world, {self.model.rows * LANES * 8} bytes of scratch per thread",
        ]
        if self.model.dropped:
            lines.append(
                f"  {len(self.model.dropped)} rods implied by the others have no row of their own"
            )
        return "\n".join(lines)


def _carry(old: Model, old_state: np.ndarray, new: Model, state: np.ndarray) -> None:
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
        elif key in old.places and old.places[key][1] == size:
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
    new.tape[H_DAMPED] = int((new.parameters.values[PARTICLES, "damping"] != 1.0).any())


def _carry_particles(old: Model, new: Model, before: dict, key: Any, value: np.ndarray) -> None:
    """Copy a parameter of the particles that both models hold; new ones take the assigned gravity."""
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
