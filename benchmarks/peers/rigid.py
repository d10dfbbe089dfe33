"""What every other engine needs of a rigid scene: turns, and the ends of its joints."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import steelyard as sy
from benchmarks.scenes import Array

#: From the z along which others lay their capsules and grounds face to our y.
UPRIGHT = Rotation.from_euler("x", -90, degrees=True)

#: Of bodies: places [m] (bodies, 3), orientations (bodies, 3, 3), velocities [m/s] and angular velocities [rad/s]
#: (bodies, 3), in the world's axes.
Moving = tuple[Array, Array, Array, Array]


def turn(quaternion: Any) -> Rotation:
    """From (w, x, y, z)."""
    return Rotation.from_quat(np.roll(np.array(quaternion), -1))


class JointGaps:
    """How far the joints of a scene stand open."""

    def __init__(self, scene: sy.Scene) -> None:
        self._ends = [
            [(scene.bodies.index(thing), place) for thing, place, _ in joint.ends]
            for joint in scene.of(sy.BallJoint, sy.HingeJoint)
        ]

    def most(self, position: Array, turns: Array) -> float:
        """That of the most open one [m], from places (bodies, 3) and orientations (bodies, 3, 3)."""
        worst = 0.0
        for (a, at_a), (b, at_b) in self._ends:
            apart = position[a] + turns[a] @ at_a - position[b] - turns[b] @ at_b
            worst = max(worst, float(np.linalg.norm(apart)))
        return worst
