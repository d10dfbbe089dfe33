"""One engine following a case: for timing without looking, and for scoring stretch by stretch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import mujoco
import numpy as np

import steelyard as sy
from benchmarks.cases import Case, side_by_side
from benchmarks.engine_scenes import build
from benchmarks.peers import mujoco_scenes
from benchmarks.scenes import Array


class Flight(Protocol):
    """A case followed from start to end.

    Attributes:
        simulated: Simulated seconds of one call, over all worlds.
    """

    simulated: float

    def __call__(self) -> None:
        """Follow the case, without looking."""

    def trajectory(self) -> tuple[Array, Array]:
        """Positions [m] and velocities [m/s] of world 0 at the end of each stretch.

        Each has the shape (stretches, particles, 3).
        """


class EngineFlight:
    """This engine on all worlds of a case.

    Args:
        case: What to follow.
        method: How to step; its dt must divide the stretch.
        worlds: Number of worlds.
        step_by_step: One call of `World.step` per step, as an agent makes that acts at each,
            instead of one per stretch.
    """

    def __init__(
        self, case: Case, method: sy.Method, *, worlds: int, step_by_step: bool = False
    ) -> None:
        self.case = case
        self.steps = _steps(case, method.dt)
        self.calls = self.steps if step_by_step else 1
        self.simulated = worlds * case.duration
        self.world = sy.World(build(case.scene), worlds=worlds, method=method)
        self.world.particles.position[:] = case.position[:worlds]
        self.world.particles.velocity[:] = case.velocity[:worlds]
        self._set_mass(0)
        self.start = self.world.snapshot()

    def __call__(self) -> None:
        """Follow the case; setting the masses of the load is part of the cost."""
        for _ in self._stretches():
            pass

    def trajectory(self) -> tuple[Array, Array]:
        """Positions and velocities of world 0.

        Raises:
            ArithmeticError: A world is flagged.
        """
        position, velocity = [], []
        for _ in self._stretches():
            position.append(self.world.particles.position[0].copy())
            velocity.append(self.world.particles.velocity[0].copy())
        if self.world.health.any():
            raise ArithmeticError(
                f"{self.case.name} at dt {self.world.method.dt}: "
                f"{np.count_nonzero(self.world.health)} worlds are flagged in their health."
            )
        return np.stack(position), np.stack(velocity)

    def _stretches(self) -> Iterator[None]:
        self.world.restore(self.start)
        for k in range(self.case.stretches):
            self._set_mass(k)
            for _ in range(self.calls):
                self.world.step(self.steps // self.calls)
            yield

    def _set_mass(self, stretch: int) -> None:
        if self.case.masses is not None:
            self.world.particles.mass = self.case.masses[stretch, : self.world.worlds]


@dataclass(frozen=True, kw_only=True)
class PeerMethod:
    """A way to step in MuJoCo.

    Attributes:
        integrator: MuJoCo's name of the method.
        links: Softness of rods and cables: "default", or following the step as "safe" or "tight"
            (see `benchmarks.peers.mujoco_scenes`).
    """

    integrator: mujoco_scenes.Integrator = "Euler"
    links: str = "default"

    def solref(self, dt: float) -> tuple[float, float] | None:
        """Softness of the links in MuJoCo's terms."""
        by_name = {"safe": mujoco_scenes.safe_solref, "tight": mujoco_scenes.tight_solref}
        return by_name[self.links](dt) if self.links in by_name else None


class PeerFlight:
    """MuJoCo on world 0 of a case, over and over: one model that stays in the caches.

    Every place of the load has a model of its own, compiled beforehand, so that a change of mass is
    exact and costs MuJoCo nothing.

    Args:
        case: What to follow.
        method: How to step.
        dt: Step [s]; it must divide the stretch.
        rounds: Times that a call follows the case.
        copies: Worlds that one model holds side by side.
        step_by_step: One call of `mj_step` per step instead of one per stretch.
    """

    def __init__(
        self,
        case: Case,
        method: PeerMethod,
        *,
        dt: float,
        rounds: int = 1,
        copies: int = 1,
        step_by_step: bool = False,
    ) -> None:
        self.case = case
        self.steps = _steps(case, dt)
        self.calls = self.steps if step_by_step else 1
        self.rounds = rounds
        self.simulated = rounds * copies * case.duration
        scene = side_by_side(case.scene, copies)
        masses = [case.scene.mass] if case.masses is None else list(case.masses[:, 0])
        built = [
            mujoco_scenes.build(
                replace(scene, mass=np.tile(mass, copies)),
                dt=dt,
                integrator=method.integrator,
                solref=method.solref(dt),
            )
            for mass in masses
        ]
        self.models = [model for model, _ in built]
        self.data = built[0][1]
        self.origin = scene.position
        self.kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self.start = np.empty(mujoco.mj_stateSize(self.models[0], self.kind))
        mujoco.mj_getState(self.models[0], self.data, self.start, self.kind)

    def __call__(self) -> None:
        """Follow the case `rounds` times."""
        for _ in range(self.rounds):
            for _ in self._stretches():
                pass

    def trajectory(self) -> tuple[Array, Array]:
        """Positions and velocities of the first copy."""
        particles = len(self.case.scene.mass)
        position, velocity = [], []
        for _ in self._stretches():
            # Positions of slide joints count from where the particle was compiled.
            moved = self.data.qpos.reshape(-1, 3) + self.origin
            position.append(moved[:particles])
            velocity.append(mujoco_scenes.velocities(self.data)[:particles])
        return np.stack(position), np.stack(velocity)

    def _stretches(self) -> Iterator[None]:
        mujoco.mj_setState(self.models[0], self.data, self.start, self.kind)
        for k in range(self.case.stretches):
            model = self.models[k % len(self.models)]
            for _ in range(self.calls):
                mujoco.mj_step(model, self.data, nstep=self.steps // self.calls)
            yield


def _steps(case: Case, dt: float) -> int:
    """Steps per stretch."""
    steps = round(case.stretch / dt)
    if abs(steps * dt - case.stretch) > 1e-9 * case.stretch:
        raise ValueError(
            f"dt {dt} s does not divide the {case.stretch} s between looks: choose one."
        )
    return steps
