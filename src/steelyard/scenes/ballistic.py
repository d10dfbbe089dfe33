"""Shots in free flight."""

from __future__ import annotations

from dataclasses import dataclass

from ..scene.particle import Particle
from ..scene.scene import Scene

MUZZLE = (0.0, 1.5, 0.0)


@dataclass(frozen=True)
class Shot:
    """A kind of shot: mass [kg], start velocity [m/s], vertical acceleration [m/s^2], damping per second."""

    mass: float
    velocity: tuple[float, float, float]
    acceleration: float
    damping: float


SHOTS = {
    "pistol": Shot(2.0, (0.0, 0.0, 35.0), -1.0, 0.99),
    "artillery": Shot(200.0, (0.0, 30.0, 40.0), -20.0, 0.99),
    "fireball": Shot(1.0, (0.0, 0.0, 10.0), 0.6, 0.9),
    "laser": Shot(0.1, (0.0, 0.0, 100.0), 0.0, 0.99),
}


def ballistic(shot: str = "artillery", *, slots: int = 1) -> Scene:
    """Particles that fly from the muzzle, one per slot.

    Args:
        shot: a key of ``SHOTS``.
        slots: number of particles.

    Raises:
        ValueError: no such shot.
    """
    if shot not in SHOTS:
        raise ValueError(f"ballistic: shot is {shot!r}; it must be one of {', '.join(SHOTS)}.")
    kind = SHOTS[shot]
    scene = Scene()
    for _ in range(slots):
        scene.add(
            Particle(
                position=MUZZLE,
                velocity=kind.velocity,
                mass=kind.mass,
                acceleration=(0.0, kind.acceleration, 0.0),
                damping=kind.damping,
            )
        )
    return scene
