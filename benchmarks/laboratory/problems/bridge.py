"""The cable bridge at rest, bare and with 10 kg on one particle: statics solved to rounding."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.laboratory.problem import Problem
from benchmarks.laboratory.problems.rest import longer, rest_problem, settled
from benchmarks.scenes import bridge, bridge_mass


def problems() -> tuple[Problem, ...]:
    """Bare and loaded."""
    bare, loaded = bridge(), bridge(mass=bridge_mass(x=2.0, z=0.0))
    return tuple(
        rest_problem(
            name,
            scene,
            settled(scene),
            {
                "load elsewhere": replace(scene, mass=bridge_mass(x=2.1, z=0.5)),
                "a cable 1 mm long": longer(scene, 4, 1e-3),
                "a plank 1 cm long": replace(scene, rods=((0, 1, 2.01), *scene.rods[1:])),
            },
        )
        for name, scene in (("bridge at rest", bare), ("loaded bridge at rest", loaded))
    )
