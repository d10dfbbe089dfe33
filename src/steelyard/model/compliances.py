"""Springs as constraints of compliance 1/k, for solvers that hold them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..scene.forces import AnchoredBungee, AnchoredSpring, Bungee, Spring
from ..scene.particle import Particle
from ..scene.scene import Scene

if TYPE_CHECKING:
    from .compile import Compiler


def springs_of(scene: Scene) -> list[Any]:
    """What a solver may hold instead of summing it as a force."""
    return scene.of(Spring, Bungee, AnchoredSpring, AnchoredBungee)


def add_compliances(c: Compiler) -> None:
    """A record per spring: places, impulses, inverse masses, stiffness, rest length, one-sided, multiplier."""
    records: list[int] = []
    for spring in springs_of(c.scene) if c.compliant else ():
        stiffness = c.parameter(spring, "stiffness", spring.stiffness)
        rest = c.parameter(spring, "rest_length", spring.rest_length)
        if isinstance(spring, AnchoredSpring):
            a = spring.particle
            assert isinstance(a, Particle)
            anchor = c.parameter(spring, "anchor", spring.anchor)
            b, fb, wb = anchor, c.header["impulse"] + 3 * len(c.particles), c.zero
        else:
            a, other = spring.a, spring.b
            # Points of bodies are refused with a compliant solver.
            assert isinstance(a, Particle) and isinstance(other, Particle)
            b, fb = c.at("position", other), c.at("impulse", other)
            wb = c.header["inverse_mass"] + c.of(other)
        records += [
            c.at("position", a), b, c.at("impulse", a), fb, c.header["inverse_mass"] + c.of(a), wb,
            stiffness, rest, int(isinstance(spring, Bungee | AnchoredBungee)), c.take(1),
        ]  # fmt: skip
    c.sections["compliances"] = records
