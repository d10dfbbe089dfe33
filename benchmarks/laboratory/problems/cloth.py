"""A cloth of 20 x 20 let go level, .2 s: a network of springs whose stiffness differs ten thousandfold.

    python -m benchmarks.laboratory.problems.cloth

writes data/cloth.npz: the motion by DOP853 (``benchmarks.spring_network``), to 1e-12. Integrated to 1e-10 it is the
same to within 1e-9 m.
"""

from __future__ import annotations

from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.pendulums import DATA
from benchmarks.laboratory.problem import Motion, Problem, energy, trajectory
from benchmarks.spring_network import SpringNetwork

MASS, WIDTH, GRAVITY, STRETCH, LOOKS = 0.4, 1.0, 9.81, 0.05, (1, 2, 3, 4)
STORED = DATA / "cloth.npz"


def integrate(*, tolerance: float = 1e-12) -> Motion:
    """The motion at the looks."""
    network = SpringNetwork(sy.scenes.cloth())
    return Motion(*network.motion(STRETCH * np.array(LOOKS), tolerance=tolerance))


def stored() -> Motion:
    """The motion as it was written."""
    with np.load(STORED) as kept:
        return Motion(kept["position"], kept["velocity"])


def upside_down() -> sy.Scene:
    """The cloth with gravity upside down."""
    scene = sy.Scene(gravity=(0.0, GRAVITY, 0.0))
    scene.things = list(sy.scenes.cloth().things)
    return scene


def problems() -> tuple[Problem, ...]:
    """The cloth."""
    true = stored()
    of = SpringNetwork(sy.scenes.cloth()).energy
    return (
        Problem(
            name="cloth",
            scene=sy.scenes.cloth,
            stretch=STRETCH,
            looks=LOOKS,
            measures=(trajectory(true), energy(true, of, scale=MASS * GRAVITY * WIDTH)),
            steps=(1, 3, 12, 48, 64, 96, 192),
            best="velocity Verlet",
            wrong={
                "gravity points up": upside_down,
                "springs a tenth softer": partial(sy.scenes.cloth, stiffness=900.0),
                "a tenth heavier": partial(sy.scenes.cloth, mass=1.1 * MASS),
                "other damping": partial(sy.scenes.cloth, damping=0.5),
            },
        ),
    )


def main() -> None:
    """Integrate and write."""
    motion = integrate()
    np.savez_compressed(STORED, position=motion.position, velocity=motion.velocity)


if __name__ == "__main__":
    main()
