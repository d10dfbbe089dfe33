"""A doll of twelve bodies and eleven joints."""

from __future__ import annotations

import math

from ..scene.body import Body
from ..scene.contacts import Collisions, Ground
from ..scene.joints import BallJoint, Drive, HingeJoint
from ..scene.scene import Scene
from ..scene.shapes import Box, Capsule, Sphere

_LYING = (math.sqrt(0.5), 0.0, 0.0, -math.sqrt(0.5))
#: Half sizes and places of the trunk's boxes [m], from the hips up.
_TRUNK = (
    ("hips", (0.15, 0.08, 0.10), 1.00),
    ("belly", (0.13, 0.09, 0.09), 1.20),
    ("chest", (0.16, 0.11, 0.10), 1.42),
)


def ragdoll(
    *, height: float = 0.0, ground: bool = True, friction: float = 0.6, angular_damping: float = 1.0
) -> Scene:
    """Hips, belly, chest, head, arms and legs of two bones: 1.79 m tall, arms level; elbows and knees are hinges.

    Args:
        height: of the soles above the ground [m].
        ground: whether there is one, and whether the doll's parts touch each other.
        friction: of the ground and of the parts.
        angular_damping: fraction of its angular velocity that each part keeps per second; joints have no friction.
    """
    scene = Scene()
    parts: dict[str, Body] = {}

    def put(
        name: str, x: float, y: float, shape: Box | Capsule | Sphere, lying: bool = False
    ) -> None:
        turn = _LYING if lying else (1.0, 0.0, 0.0, 0.0)
        place = (x, y + height, 0.0)
        body = Body(position=place, orientation=turn, parts=shape, angular_damping=angular_damping)
        parts[name] = scene.add(body)

    def ball(a: str, b: str, x: float, y: float) -> None:
        scene.add(BallJoint(a=parts[a], b=parts[b], place=(x, y + height, 0.0)))

    def hinge(
        a: str, b: str, x: float, y: float, axis: tuple[float, float, float], bend: Drive
    ) -> None:
        place = (x, y + height, 0.0)
        scene.add(HingeJoint(a=parts[a], b=parts[b], place=place, axis=axis, drive=bend))

    for name, half, y in _TRUNK:
        put(name, 0.0, y, Box(half))
    put("head", 0.0, 1.68, Sphere(0.11))
    ball("belly", "hips", 0.0, 1.10)
    ball("chest", "belly", 0.0, 1.30)
    ball("head", "chest", 0.0, 1.55)
    for side, x in (("left", -1.0), ("right", 1.0)):
        put(f"{side} arm", 0.34 * x, 1.48, Capsule(0.05, 0.11), lying=True)
        put(f"{side} forearm", 0.64 * x, 1.48, Capsule(0.04, 0.11), lying=True)
        put(f"{side} thigh", 0.09 * x, 0.70, Capsule(0.07, 0.15))
        put(f"{side} shin", 0.09 * x, 0.21, Capsule(0.05, 0.16))
        ball(f"{side} arm", "chest", 0.18 * x, 1.48)
        ball(f"{side} thigh", "hips", 0.09 * x, 0.92)
        elbow = Drive(3, low=-0.05, high=2.5) if x > 0.0 else Drive(3, low=-2.5, high=0.05)
        hinge(f"{side} forearm", f"{side} arm", 0.49 * x, 1.48, (0.0, 1.0, 0.0), elbow)
        hinge(
            f"{side} shin",
            f"{side} thigh",
            0.09 * x,
            0.455,
            (1.0, 0.0, 0.0),
            Drive(3, low=-0.05, high=2.5),
        )
    if ground:
        scene.add(Ground(friction=friction))
        scene.add(Collisions(friction=friction))
    return scene
