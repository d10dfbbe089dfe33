"""The benchmark scenes in this engine, through its public face."""

from __future__ import annotations

import steelyard as sy
from benchmarks.scenes import ParticleScene


def build(scene: ParticleScene) -> sy.Scene:
    """The same particles and links, in the same order: rods, pins, cables, supports.

    Cables do not rebound, as those of the peers do not.
    """
    built = sy.Scene(gravity=scene.gravity)
    particles = [
        built.add(
            sy.Particle(position=(x, y, z), velocity=(u, v, w), mass=mass, damping=scene.damping)
        )
        for (x, y, z), (u, v, w), mass in zip(
            scene.position.tolist(), scene.velocity.tolist(), scene.mass.tolist(), strict=True
        )
    ]
    for a, b, length in scene.rods:
        built.add(sy.Rod(particles[a], particles[b], length=length))
    for p, anchor, length in scene.pins:
        built.add(sy.RodConstraint(particles[p], anchor=anchor, length=length))
    for a, b, length in scene.cables:
        built.add(sy.Cable(particles[a], particles[b], max_length=length))
    for p, anchor, length in scene.supports:
        built.add(sy.CableConstraint(particles[p], anchor=anchor, max_length=length))
    return built
