"""World: a scene, a number of copies of it and a method, stepping."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from .choice import Choice, choose_method
from .diagnostics.contacts import Contacts, contacts_of
from .diagnostics.energy import world_energy
from .diagnostics.health import health_flags
from .diagnostics.joints import Joints, joints_of
from .diagnostics.penetration import penetration_of
from .diagnostics.residual import link_residuals
from .math.pointers import LANES
from .methods import Method, default_for
from .model.compile import Model, compile_model, specialise
from .model.parameters import BODIES, PARTICLES, Key
from .model.tape import H_BODIES_DAMPED, H_DAMPED
from .queries.ask import Queries
from .scene import checks
from .scene.body import Body
from .scene.contacts import ContactGenerator
from .scene.forces import UserForce
from .scene.particle import Particle
from .scene.scene import Scene
from .scene.triggers import Trigger
from .state import (
    Bodies,
    Handle,
    Particles,
    Snapshot,
    assigned,
    carry,
    follow_gravity,
    new_scratch,
    new_state,
    strike,
)
from .stepping import WHOLE_STEP, advance_blocks, launch, start_again
from .triggers import Events, events_of, poses, watch
from .written import evaluate_forces, generate_contacts


class World:
    """``worlds`` independent copies of a scene, stepped together by one method.

    Args:
        scene: what the worlds hold; copied, so later changes to it do not reach this world.
        worlds: number of copies, at least 1.
        method: how to step; velocity Verlet with the direct solver at 60 Hz by default.
        tolerance: instead of a method: the cheapest that holds this error, see ``choose_method``.
        horizon: over which time [s] it must hold.
        threads: worlds are shared among so many threads; results do not depend on it.
        special: compile the method's stages for this scene alone: the same results, to the bit, in up to a third less
            time, for seconds of compiling when the scene is first stepped (kept on disk).

    Raises:
        TypeError: no scene or no method.
        ValueError: the method cannot do what the scene holds, nothing holds the tolerance, or a count is
            out of range.
        MemoryError: the batch does not fit into memory.
    """

    # Slots, so that a misspelt assignment is an error and not a new attribute.
    __slots__ = (
        "_choice", "_given", "_given_rows", "_launch", "_method", "_model", "_scene", "_scratch", "_special", "_split",
        "_stale", "_state", "_threads", "_watched", "_worlds",
    )  # fmt: skip
    _model: Model
    _state: np.ndarray

    def __init__(
        self,
        scene: Scene,
        *,
        worlds: int = 1,
        method: Method | None = None,
        tolerance: float | None = None,
        horizon: float = 1.0,
        threads: int = 1,
        special: bool = False,
    ) -> None:
        checks.instance("World", "scene", scene, Scene, remedy="Build one.")
        self._choice = None
        if tolerance is not None:
            if method is not None:
                raise ValueError(
                    f"World: both a method and a tolerance of {tolerance!r} are given; one follows from the "
                    "other. Give one of them."
                )
            self._choice = choose_method(scene, tolerance=tolerance, horizon=horizon)
            method = self._choice.method
        elif method is None:
            method = default_for(scene)
        checks.instance("World", "method", method, Method, remedy="Use Method(Rattle(), Direct()).")
        self._worlds = checks.whole("World", "worlds", worlds, least=1, remedy="Use one.")
        self._threads = checks.whole("World", "threads", threads, least=1, remedy="Use one.")
        self._special = special
        self._method = method
        self._scene = scene.copy()
        self._compile(None)

    @property
    def scene(self) -> Scene:
        """What the worlds hold; changed by ``add`` and ``remove``."""
        return self._scene

    @property
    def worlds(self) -> int:
        """Number of copies."""
        return self._worlds

    @property
    def method(self) -> Method:
        """How they step."""
        return self._method

    @property
    def choice(self) -> Choice | None:
        """Why this method, where a tolerance was given; None where a method was."""
        return self._choice

    @property
    def threads(self) -> int:
        """Number of threads that share the worlds."""
        return self._threads

    @property
    def model(self) -> Model:
        """The scene compiled for the method."""
        return self._model

    # Stepping

    def step(self, steps: int = 1) -> None:
        """Advance all worlds by ``steps`` times ``method.dt``.

        Raises:
            ValueError: ``steps`` is no whole number of at least 0, or a user-written force or
                contact generator returned what it must not.
        """
        if type(steps) is not int or steps < 0:
            steps = checks.whole("World.step", "steps", steps, least=0, remedy="Give a count.")
        if self._stale:
            self._prepare()
        steps *= self.method.substeps
        if self._split or self._watched:
            for k in range(steps):
                self._step_split(k % self.method.substeps == 0)
        else:
            self._run(steps, WHOLE_STEP)

    def _run(self, steps: int, phase: int) -> None:
        blocks = -(-self._worlds // LANES)
        if self._split:
            # Between the parts of a step a block's scratch keeps what the step's start decided.
            edges = np.arange(blocks + 1)
        else:
            edges = np.linspace(0, blocks, min(self._threads, blocks) + 1).astype(int)
        jobs = [(k, int(a), int(b), steps, phase) for k, (a, b) in enumerate(pairwise(edges))]
        if self._threads == 1 or len(jobs) == 1:
            for job in jobs:
                self._chunk(*job)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(self._chunk, *zip(*jobs, strict=True)))

    def _chunk(self, thread: int, first: int, last: int, steps: int, phase: int) -> None:
        advance_blocks(self._launch[thread], first, last, steps, phase)

    def _step_split(self, fresh: bool) -> None:
        """One substep in parts, user-written forces and contacts evaluated in between; then triggers look.

        ``fresh``: it is the first of its step.
        """
        start = poses(self) if self._watched else None
        generate_contacts(self)
        written = self.scene.of(UserForce)
        shares = self.method.integrator.evaluations if written else (None,)
        for part, share in enumerate(shares):
            if share is not None:
                evaluate_forces(self, share * self.method.substep)
            self._run(1, 1 << part if part < len(shares) - 1 else WHOLE_STEP << part)
        if start is not None:
            watch(self, start, fresh)

    # Access

    @property
    def particles(self) -> Particles:
        """Positions, velocities and parameters of all particles."""
        return Particles(self)

    @property
    def bodies(self) -> Bodies:
        """Positions, orientations, velocities and parameters of all bodies."""
        return Bodies(self)

    def apply_impulse(
        self, body: Body, impulse: Any, *, at: Any = None, mask: np.ndarray | None = None
    ) -> None:
        """Change a body's velocities at once, as by a blow.

        Args:
            body: a movable body of the scene.
            impulse: [N s], (3,) or (worlds, 3), along the world's axes.
            at: where [m], (3,) or (worlds, 3), in the world; the centre of mass by default.
            mask: (worlds,) bool, those that get it; all by default.

        Raises:
            KeyError: the body is not in the scene.
            ValueError: it is immovable, or an array of another shape.
        """
        strike(self, body, impulse, at=at, mask=mask)

    def apply_angular_impulse(
        self, body: Body, impulse: Any, *, mask: np.ndarray | None = None
    ) -> None:
        """Change a body's angular velocity at once, as by a couple of blows.

        Args:
            body: a movable body of the scene.
            impulse: [N m s], (3,) or (worlds, 3), along the world's axes.
            mask: (worlds,) bool, those that get it; all by default.

        Raises:
            KeyError: the body is not in the scene.
            ValueError: it is immovable, or an array of another shape.
        """
        strike(self, body, impulse, angular=True, mask=mask)

    def __getitem__(self, thing: Any) -> Handle:
        """What can be read or assigned of a link, rider, contact generator or force.

        Raises:
            KeyError: the thing is not in this world's scene.
        """
        if thing not in self.scene:
            raise KeyError(
                f"World: this {type(thing).__name__} is not in the world's scene; only what was in "
                "it when the world was built, or was added by World.add, can be read. Add it."
            )
        return Handle(self, thing)

    def add(self, thing: Any) -> Any:
        """Add a thing between steps; all else keeps its state.

        Raises:
            TypeError: not something that a scene holds.
            ValueError: the scene or the method cannot take it; the world is as before.
        """
        self.scene.add(thing)
        self._recompile(lambda: self.scene.remove(thing))
        return thing

    def remove(self, thing: Any) -> None:
        """Remove a thing between steps; all else keeps its state.

        Raises:
            ValueError: not in the scene, or something in it cannot be without; the world is as
                before.
        """
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
        """Gravity [m/s^2], (3,) if shared, (worlds, 3) if per world; assignable in both shapes."""
        return self._get((PARTICLES, "gravity"))

    @gravity.setter
    def gravity(self, value: Any) -> None:
        self._set((PARTICLES, "gravity"), value, 3)
        follow_gravity(self.model)

    @property
    def time(self) -> np.ndarray:
        """Time [s] of every world, a view of shape (worlds,)."""
        return self._view(PARTICLES, "time")[:, 0]

    # For kernels that read and write worlds in place

    @property
    def state(self) -> np.ndarray:
        """The whole state, shape (state rows, padded worlds); ``row`` says what lies where."""
        return self._state

    @property
    def given(self) -> np.ndarray:
        """Parameter rows that differ between worlds, (n, padded worlds), in the order of declaration."""
        if self._stale:
            self._prepare()
        return self._given

    def row(self, thing: Any, name: str) -> int:
        """First row in ``state`` of a part of it.

        Args:
            thing: "particles", "bodies", or a link, rider, generator or force of the scene.
            name: "position" (3 rows per particle or body), "velocity", of bodies also "orientation" (4 rows) and
                "angular_momentum" (3); "time", "nonfinite" of particles; "length", "rate" or "acceleration" of a
                winch; "weights", "rates" or "accelerations" of a rider; "force" and "torque" of a wrench;
                "throttle" of a thruster; "control" of a surface.
        """
        return self.model.places[thing, name][0]

    @property
    def launch(self) -> np.ndarray:
        """What ``steelyard.advance`` steps these worlds by, (n,) int64, for kernels of one's own.

        It holds addresses of this world's arrays: ask for it at every call.

        Raises:
            ValueError: the scene has user-written forces or contacts, or triggers, which only ``step`` can call.
        """
        if self._split or self._watched:
            raise ValueError(
                "World.launch: the scene has user-written forces or contacts, or triggers; use World.step."
            )
        if self._stale:
            self._prepare()
        return self._launch[0]

    # Diagnostics

    @property
    def health(self) -> np.ndarray:
        """Flags per world, shape (worlds,) uint8, of which several may be set.

        1: non-finite. 2: constraints missed their tolerance. Both stay until ``reset`` or
        ``restore``; a non-finite world goes on stepping as NaN and touches no other. 4: out of
        range, as long as the length of a winch is not above 0. 8: more contacts than the buffer holds, of
        which the deepest were kept; stays as 1 and 2 do (give the solver more: ``ProximalNewton(contacts=...)``).
        """
        return health_flags(self)

    @property
    def energy(self) -> np.ndarray:
        """Kinetic plus potential energy [J] of every world, shape (worlds,)."""
        return world_energy(self)

    @property
    def momentum(self) -> np.ndarray:
        """Linear momentum [kg m/s] of the movable particles and bodies, shape (worlds, 3)."""
        total = np.einsum("wp,wpc->wc", self.particles.mass_or_zero, self.particles.velocity)
        if self.scene.bodies:
            total += np.einsum("wb,wbc->wc", self.bodies.mass_or_zero, self.bodies.centre_velocity)
        return total

    @property
    def angular_momentum(self) -> np.ndarray:
        """Angular momentum [kg m^2/s] about the origin, shape (worlds, 3)."""
        moment = np.cross(self.particles.position, self.particles.velocity)
        total = np.einsum("wp,wpc->wc", self.particles.mass_or_zero, moment)
        if self.scene.bodies:
            # That of a pivot is where the body's own is taken.
            moment = np.cross(self.bodies.position, self.bodies.centre_velocity)
            total += np.einsum("wb,wbc->wc", self.bodies.mass_or_zero, moment)
            total += self.bodies.angular_momentum.sum(axis=1)
        return total

    @property
    def residual(self) -> np.ndarray:
        """Violation of every link over its length, (worlds, links); slack cables count 0."""
        return link_residuals(self)

    @property
    def contacts(self) -> Contacts:
        """What touches what, and with which force, after the last step, of scenes with contacts of bodies.

        Raises:
            ValueError: this world's method keeps no list of contacts.
        """
        return contacts_of(self)

    @property
    def penetration(self) -> np.ndarray:
        """Depth of the deepest overlap of bodies with each other or the ground [m], 0 without any, (worlds,)."""
        return penetration_of(self)

    @property
    def joints(self) -> Joints:
        """What joints bear after the last step, how far they are open, and where what they leave free stands."""
        return joints_of(self)

    def events(self, trigger: Trigger) -> Events:
        """What a trigger of the scene saw in the last step, how often things came and went, and when they last came.

        Raises:
            KeyError: it is not in the scene.
        """
        return events_of(self, trigger)

    @property
    def queries(self) -> Queries:
        """Casts, overlaps and lines of sight in all worlds; none of them changes anything."""
        return Queries(self)

    # State

    def snapshot(self) -> Snapshot:
        """Copy of the whole state: what varies, multipliers, clocks, flags, parameters."""
        values = {key: value.copy() for key, value in self.model.parameters.values.items()}
        return Snapshot(self.model, self._state.copy(), values)

    def restore(self, snapshot: Snapshot) -> None:
        """Put back a snapshot of this world.

        Raises:
            TypeError: no snapshot.
            ValueError: the snapshot is of another scene, method or number of worlds.
        """
        checks.instance("World.restore", "snapshot", snapshot, Snapshot, remedy="Take one first.")
        if snapshot.model is not self.model or snapshot.state.shape != self._state.shape:
            raise ValueError(
                f"World.restore: the snapshot is of {snapshot.state.shape} rows and worlds of "
                f"another model; this world has {self._state.shape}. Restore it where it was taken."
            )
        self._state[:] = snapshot.state
        values = self.model.parameters.values
        if any(not np.array_equal(values[key], value) for key, value in snapshot.values.items()):
            # What follows from parameters takes longer than many steps.
            self.model.parameters.values = {key: v.copy() for key, v in snapshot.values.items()}
            self._stale = True

    def reset(self, mask: np.ndarray | None = None) -> None:
        """Put the state of all worlds back to the scene's start, or of those in a mask.

        Parameters that were assigned stay as they are.

        Args:
            mask: (worlds,) bool, true for those to reset.

        Raises:
            ValueError: the mask has another shape or type.
        """
        if mask is None:
            self._state[:, : self.worlds] = self.model.start[:, None]
        else:
            start_again(
                checks.mask("World.reset", mask, worlds=self.worlds), self.model.start, self._state
            )

    @property
    def bytes_per_world(self) -> int:
        """Memory [bytes] that one more world costs: its state and own parameters."""
        if self._stale:
            self._prepare()
        return 8 * (self.model.state_rows + len(self._given_rows))

    def __getstate__(self) -> dict[str, Any]:
        names = ("_scene", "_worlds", "_threads", "_special", "_method", "_choice", "_state")
        values = list(self.model.parameters.values.values())
        return {name: getattr(self, name) for name in names} | {"values": values}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        values = kept.pop("values")
        for name, value in kept.items():
            setattr(self, name, value)
        state = self._state
        self._compile(None)
        self._state[:] = state
        parameters = self.model.parameters
        parameters.values = dict(zip(parameters.values, values, strict=True))

    # Inside

    def _compile(self, before: World | None) -> None:
        self.scene.check()
        model = compile_model(self.scene, self.method, special=self._special)
        state = new_state(model, self.worlds)
        if before is not None:
            carry(before.model, before._state, model, state)
        self._model = model
        self._state = state
        self._split = bool(self.scene.of(UserForce, ContactGenerator))
        self._watched = bool(self.scene.of(Trigger))
        count = -(-self.worlds // LANES) if self._split else self.threads
        self._scratch = [new_scratch(model) for _ in range(count)]
        self._stale = True

    def _prepare(self) -> None:
        """Lay out what follows from the parameters."""
        damping = self.model.parameters.values[PARTICLES, "damping"]
        self.model.tape[H_DAMPED] = int((damping != 1.0).any())
        if self.scene.bodies:
            kept = [self.model.parameters.values[BODIES, n] for n in ("damping", "angular_damping")]
            self.model.tape[H_BODIES_DAMPED] = int(any((value != 1.0).any() for value in kept))
        if self._special:
            specialise(self.model)
        shared, self._given, self._given_rows = self.model.parameters.rows(self._state.shape[1])
        for scratch, *_ in self._scratch:
            for row, value in shared:
                scratch[row : row + len(value)] = value[:, None]
        given = self._given, self._given_rows
        self._launch = [
            launch(self._model, scratch, self._state, given, self._worlds)
            for scratch in self._scratch
        ]
        self._stale = False

    def _index(self, thing: Particle | Body) -> int:
        group = self.scene.of(type(thing))
        return next(k for k, other in enumerate(group) if other is thing)

    def _view(self, thing: Any, name: str) -> np.ndarray:
        row, size = self._model.places[thing, name]
        return self._state[row : row + size, : self._worlds].T

    def _get(self, key: Key) -> np.ndarray:
        value = self.model.parameters.values[key].T
        value.flags.writeable = False  # a write would not reach the rows that kernels read
        return value

    def _set(self, key: Key, value: Any, size: int) -> None:
        self._store(key, assigned(key, value, size=size, worlds=self.worlds))

    def _store(self, key: Key, value: np.ndarray) -> None:
        if self.scene.planar and key[1] in checks.VECTORS:
            thing = key[0]
            checks.in_plane(
                "World" if isinstance(thing, str) else type(thing).__name__, key[1], value
            )
        check = self.model.parameters.checks.get(key)
        if check is not None:
            check(value)
        self.model.parameters.values[key] = value
        self._stale = True

    def __repr__(self) -> str:
        lines = [
            f"World of {self.worlds} x {self.scene}",
            f"  method: {self.method.integrator}, {self.method.solver}, dt {self.method.dt:.6g} s",
            f"  {self.bytes_per_world} bytes per world, "
            f"{self.model.rows * LANES * 8} bytes of scratch per thread",
        ]
        if self._choice is not None:
            lines.append(
                f"  chosen for {self._choice.tolerance:g} over {self._choice.horizon:g} s: error "
                f"{self._choice.error:.2g}, {self._choice.cost:.3g} us per simulated second and world expected"
            )
        if self.model.dropped:
            lines.append(
                f"  {len(self.model.dropped)} rods implied by others or by a rigid cluster have no row"
            )
        return "\n".join(lines)
