"""A fall into a net of bungees, 1 s: 84 kinks that open and close all over it, several in a step.

    python -m benchmarks.laboratory.problems.net

writes data/net.npz: the motion by DOP853 (``benchmarks.spring_network``), to 1e-12, in parts that end where a bungee
goes slack or taut. Its energy is kept to 3e-12 J of 300; with steps of a tenth it is the same to 3e-13 m.
"""

from __future__ import annotations

from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.pendulums import DATA
from benchmarks.laboratory.problem import Motion, Problem, energy, trajectory
from benchmarks.spring_network import SpringNetwork

SIDE, SPACING, GRAVITY = 7, 0.5, 9.81
KNOT, JUMPER, SPEED = 0.5, 30.0, (0.6, -4.0, 0.3)
STIFFNESS, LENGTH = 1500.0, 0.55
STRETCH, LOOKS = 0.1, tuple(range(1, 11))
STORED = DATA / "net.npz"


def net(
    *,
    gravity: float = GRAVITY,
    stiffness: float = STIFFNESS,
    length: float = LENGTH,
    kind: type[sy.Spring] = sy.Bungee,
) -> sy.Scene:
    """Knots on a grid, the outer ones held; the jumper has met the middle one, which falls with his speed."""
    scene = sy.Scene(gravity=(0.0, -gravity, 0.0))
    middle = SIDE // 2
    knots = {}
    for row in range(SIDE):
        for column in range(SIDE):
            met = row == column == middle
            held = {row, column} & {0, SIDE - 1}
            knots[row, column] = scene.add(
                sy.Particle(
                    position=(SPACING * column, 0.0, SPACING * row),
                    velocity=SPEED if met else (0.0, 0.0, 0.0),
                    inverse_mass=0.0 if held else 1.0 / (JUMPER if met else KNOT),
                )
            )
    for (row, column), knot in knots.items():
        for beside in ((row + 1, column), (row, column + 1)):
            if beside in knots:
                scene.add(kind(knot, knots[beside], stiffness, length))
    return scene


def integrate(*, tolerance: float = 1e-12) -> Motion:
    """The motion at the looks."""
    return Motion(*SpringNetwork(net()).motion(STRETCH * np.array(LOOKS), tolerance=tolerance))


def stored() -> Motion:
    """The motion as it was written."""
    with np.load(STORED) as kept:
        return Motion(kept["position"], kept["velocity"])


def problems() -> tuple[Problem, ...]:
    """The net."""
    true = stored()
    scale = JUMPER * GRAVITY * 1.0
    return (
        Problem(
            name="net of bungees",
            scene=net,
            stretch=STRETCH,
            looks=LOOKS,
            measures=(trajectory(true), energy(true, SpringNetwork(net()).energy, scale=scale)),
            steps=(6, 12, 24, 48, 96, 192, 384, 768),
            best="RK4, kinks inside",
            wrong={
                "gravity points up": partial(net, gravity=-GRAVITY),
                "stiffness 1 % off": partial(net, stiffness=1.01 * STIFFNESS),
                "pushes when short": partial(net, kind=sy.Spring),
                "length 1 cm off": partial(net, length=LENGTH + 0.01),
            },
        ),
    )


def main() -> None:
    """Integrate and write."""
    motion = integrate()
    np.savez_compressed(STORED, position=motion.position, velocity=motion.velocity)


if __name__ == "__main__":
    main()
