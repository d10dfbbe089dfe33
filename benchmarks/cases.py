"""Motions with a trusted solution, and the score of an engine that follows them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from benchmarks.moving_load import load_masses, loaded_bridge, taut_motion
from benchmarks.references import projectile, rigid_motion
from benchmarks.scenes import Array, ParticleScene, artillery, tumbling_platform

#: Errors below this, in metres or as a share, are rounding and count as none.
ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True)
class Score:
    """How far an engine strays from the solution.

    Attributes:
        rms: Root mean square over the particles of their distance from the solution [m], at the
            worst of the times that are looked at.
        most: Largest distance of any particle at any of these times [m].
        strain: Largest error of a rod's length and largest overstretch of a cable, over its length.
        energy: Largest change of energy as a share of the start's; 0 where it is not conserved.
    """

    rms: float
    most: float
    strain: float
    energy: float

    def within(self, other: Score) -> bool:
        """Whether no error is larger than the other's, up to rounding."""
        return all(
            getattr(self, field.name) <= max(getattr(other, field.name), ROUNDING)
            for field in fields(self)
        )


@dataclass(frozen=True, kw_only=True)
class Case:
    """A motion, looked at after every one of several equal stretches of time.

    Attributes:
        name: Name of the scene.
        scene: What moves, at the start.
        stretch: Duration of a stretch [s].
        masses: Particle masses during each stretch [kg], shape (stretches, worlds, particles),
            where they change; None where they are the scene's.
        position: Start positions of all worlds [m], shape (worlds, particles, 3); world 0 is the
            scene's and the others differ, as worlds in training do.
        velocity: Start velocities of all worlds [m/s], shape (worlds, particles, 3).
        solution: Positions of world 0 at the end of each stretch [m], shape (stretches, particles,
            3).
        conserves_energy: Whether energy is an invariant of the motion.
    """

    name: str
    scene: ParticleScene
    stretch: float
    position: Array
    velocity: Array
    solution: Array
    masses: Array | None = None
    conserves_energy: bool = False

    @property
    def stretches(self) -> int:
        """Number of stretches."""
        return len(self.solution)

    @property
    def duration(self) -> float:
        """Duration of the whole motion [s]."""
        return self.stretch * self.stretches

    def score(self, position: Array, velocity: Array) -> Score:
        """Errors of a motion of world 0, given at the end of each stretch.

        Args:
            position: Positions [m], shape (stretches, particles, 3).
            velocity: Velocities [m/s], shape (stretches, particles, 3).
        """
        rms, most = distance(position, self.solution)
        energy = 0.0
        if self.conserves_energy:
            start = _energy(self.scene, self.scene.position[None], self.scene.velocity[None])
            energy = float(np.abs(_energy(self.scene, position, velocity) / start - 1.0).max())
        return Score(
            rms=rms,
            most=most,
            strain=_strain(self.scene, position),
            energy=energy,
        )


def distance(position: Array, other: Array) -> tuple[float, float]:
    """How far two motions are apart [m]: rms over the particles at the worst time, and at most.

    Args:
        position: Positions [m], shape (stretches, particles, 3).
        other: The same of the other motion.
    """
    gap = np.linalg.norm(position - other, axis=2)
    return float(np.sqrt((gap**2).mean(axis=1)).max()), float(gap.max())


def platform(worlds: int) -> Case:
    """The tumbling platform for 2 s; the other worlds spin up to 20 % faster."""
    scene = tumbling_platform()
    stretch = 0.5
    solution, _ = rigid_motion(scene, stretch * np.arange(1, 5))
    return Case(
        name="platform",
        scene=scene,
        stretch=stretch,
        position=_repeat(scene.position, worlds),
        velocity=_spread(worlds)[:, None, None] * scene.velocity,
        solution=solution,
        conserves_energy=True,
    )


def bridge(worlds: int) -> Case:
    """A 10 kg load crosses the hanging bridge in 2 s, in each world along another line."""
    stretch, stretches, lines = 0.04, 50, 16
    z = np.linspace(0.3, 0.7, lines)
    scenes = [loaded_bridge(z=float(line)) for line in z]
    masses = np.stack([load_masses(stretches, z=float(line)) for line in z], axis=1)
    line = np.arange(worlds) % lines
    scene = scenes[0]
    solution, _ = taut_motion(scene, masses[:, 0], stretch)
    return Case(
        name="bridge",
        scene=scene,
        stretch=stretch,
        position=np.stack([other.position for other in scenes])[line],
        velocity=np.zeros((worlds, *scene.position.shape)),
        solution=solution,
        masses=masses[:, line],
    )


def ballistic(worlds: int) -> Case:
    """The first 3 s of an artillery shot; in the other worlds it flies up to 20 % faster."""
    scene = artillery()
    stretch = 1.0
    flights = [
        projectile(
            scene.position[0],
            scene.velocity[0],
            acceleration=scene.gravity,
            damping=scene.damping,
            time=stretch * k,
        )[0]
        for k in (1, 2, 3)
    ]
    return Case(
        name="ballistic",
        scene=scene,
        stretch=stretch,
        position=_repeat(scene.position, worlds),
        velocity=_spread(worlds)[:, None, None] * scene.velocity,
        solution=np.array(flights)[:, None],
    )


def side_by_side(scene: ParticleScene, copies: int) -> ParticleScene:
    """A scene that holds another one several times; copies do not touch each other."""
    count = len(scene.mass)
    first = [count * k for k in range(copies)]
    return replace(
        scene,
        position=np.tile(scene.position, (copies, 1)),
        velocity=np.tile(scene.velocity, (copies, 1)),
        mass=np.tile(scene.mass, copies),
        rods=tuple((k + a, k + b, length) for k in first for a, b, length in scene.rods),
        cables=tuple((k + a, k + b, length) for k in first for a, b, length in scene.cables),
        supports=tuple(
            (k + p, point, length) for k in first for p, point, length in scene.supports
        ),
    )


def _repeat(rows: Array, worlds: int) -> Array:
    return np.repeat(rows[None], worlds, axis=0)


def _spread(worlds: int) -> Array:
    """Factors from 1 to 1.2, shape (worlds,); neighbours, which are stepped together, differ."""
    return np.linspace(1.0, 1.2, 16)[np.arange(worlds) % 16]


def _energy(scene: ParticleScene, position: Array, velocity: Array) -> Array:
    kinetic = 0.5 * np.einsum("p,tpc,tpc->t", scene.mass, velocity, velocity)
    potential = -np.einsum("p,c,tpc->t", scene.mass, np.asarray(scene.gravity), position)
    return np.asarray(kinetic + potential, dtype=np.float64)


def _strain(scene: ParticleScene, position: Array) -> float:
    incidence, anchor, length = scene.spans()
    span = np.linalg.norm(np.einsum("lp,tpc->tlc", incidence, position) - anchor, axis=2)
    strain = span / length - 1.0
    rigid = len(scene.rods) + len(scene.pins)
    strain[:, :rigid] = np.abs(strain[:, :rigid])
    return float(strain.max(initial=0.0))
