"""What the engine's contract tests share: methods, and scenes of the benchmarks and of the reference solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

import steelyard as sy
from benchmarks.scenes import ParticleScene
from tests.reference_solver import DenseScene

Array = npt.NDArray[np.float64]

# Solvers of displacements and velocities ("staged") with every integrator that takes them. The sweeps
# suffice to settle the small scenes of the tests; a test that needs more says so.
STAGED = {
    "Rattle-Direct": (sy.Rattle(), sy.Direct()),
    "Rattle-GaussSeidel": (sy.Rattle(), sy.GaussSeidel(passes=60)),
    "ImpactRattle-Direct": (sy.ImpactRattle(), sy.Direct()),
    "SymplecticEuler-Direct": (sy.SymplecticEuler(), sy.Direct()),
    "SymplecticEuler-GaussSeidel": (sy.SymplecticEuler(), sy.GaussSeidel(passes=60)),
}
# The source's resolver of impulses.
RESOLVED = {
    "SymplecticEuler-WorstFirst": (sy.SymplecticEuler(), sy.WorstFirst()),
    "ExplicitEuler-WorstFirst": (sy.ExplicitEuler(), sy.WorstFirst()),
}
# Velocities from positions, in substeps.
SMALL_STEPS = {"SymplecticEuler-Xpbd": (sy.SymplecticEuler(), sy.Xpbd(substeps=10))}
METHODS = STAGED | RESOLVED | SMALL_STEPS
# Those that take each step as one, and so contacts that are known between steps.
STEPWISE = {name: parts for name, parts in METHODS.items() if not parts[0].splits}
# What cannot hold cables and contacts.
COMPOSED = {
    "ComposedRattle-Direct": (sy.ComposedRattle(), sy.Direct()),
    "ComposedRattle-GaussSeidel": (sy.ComposedRattle(), sy.GaussSeidel(passes=60)),
}
# What steps particles under forces alone.
SMOOTH = {
    "RungeKutta4": (sy.RungeKutta4(), None),
    "KinkRungeKutta4": (sy.KinkRungeKutta4(), None),
    "ExponentialRungeKutta": (sy.ExponentialRungeKutta(), None),
    "LinearlyImplicit": (sy.LinearlyImplicit(), None),
    "BackwardEuler": (sy.BackwardEuler(passes=4, tolerance=1e-3), None),
    "ImplicitMidpoint": (sy.ImplicitMidpoint(tolerance=1e-6), None),
}

# What holds links by itself.
LINKED = {
    "GeneralisedAlpha": (sy.GeneralisedAlpha(), None),
}

# An exact solver's residual is its tolerance; the sweeps' what 60 passes leave on the tests' scenes;
# the source's resolver leaves what the last contacts resolved did to the others. Small steps leave what one pass
# does not settle.
_RESIDUAL = {"Direct": 1e-12, "GaussSeidel": 1e-4, "Xpbd": 1e-4, "WorstFirst": 0.1}


def method(name: str, *, dt: float) -> sy.Method:
    """A method of the tables above."""
    integrator, solver = (METHODS | COMPOSED | SMOOTH | LINKED)[name]
    return sy.Method(integrator, solver, dt=dt)


def undivided(name: str, *, dt: float) -> sy.Method:
    """A method of the tables above that takes its step in one, for tests that look at each step."""
    chosen = method(name, dt=dt)
    return replace(chosen, solver=sy.Xpbd(substeps=1)) if name in SMALL_STEPS else chosen


def residual_limit(name: str) -> float:
    """Greatest violation of a link over its length that a method of the tables may leave."""
    return _RESIDUAL[name.split("-")[1]]


def swung(scene: sy.Scene, name: str, *, dt: float, seconds: float) -> sy.World:
    """A world of the scene after some time."""
    world = sy.World(scene, method=method(name, dt=dt))
    world.step(round(seconds / dt))
    return world


def from_particle_scene(source: ParticleScene, *, cable_restitution: float = 0.0) -> sy.Scene:
    """Particles, then rods, cables and supports, each in the order of the source."""
    scene = sy.Scene(gravity=source.gravity)
    particles = [
        scene.add(sy.Particle(position=x, velocity=v, mass=m, damping=source.damping))
        for x, v, m in zip(source.position, source.velocity, source.mass.tolist(), strict=True)
    ]
    for a, b, length in source.rods:
        scene.add(sy.Rod(particles[a], particles[b], length))
    for a, b, length in source.cables:
        scene.add(sy.Cable(particles[a], particles[b], length, restitution=cable_restitution))
    for p, anchor, length in source.supports:
        scene.add(sy.CableConstraint(particles[p], anchor, length, restitution=cable_restitution))
    return scene


def from_dense_scene(source: DenseScene) -> sy.Scene:
    """Particles, then links in the order of the source."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    particles = [
        scene.add(
            sy.Particle(
                position=x, velocity=v, inverse_mass=w, acceleration=a, damping=source.damping
            )
        )
        for x, v, w, a in zip(
            source.position,
            source.velocity,
            source.inverse_mass.tolist(),
            source.acceleration,
            strict=True,
        )
    ]
    for link in source.links:
        rod = link.kind == "rod"
        if isinstance(link.b, int):
            ends = particles[link.a], particles[link.b]
            scene.add(sy.Rod(*ends, link.length) if rod else sy.Cable(*ends, link.length))
        else:
            kind = sy.RodConstraint if rod else sy.CableConstraint
            scene.add(kind(particles[link.a], link.b, link.length))
    return scene


def advance(world: sy.World, steps: int) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] at the start and after each step.

    Returns:
        Two arrays of shape (steps + 1, worlds, particles, 3).
    """
    position = [world.particles.position.copy()]
    velocity = [world.particles.velocity.copy()]
    for _ in range(steps):
        world.step()
        position.append(world.particles.position.copy())
        velocity.append(world.particles.velocity.copy())
    return np.array(position), np.array(velocity)
