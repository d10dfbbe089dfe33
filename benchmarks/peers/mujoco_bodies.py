"""Rigid scenes of the engine in MuJoCo: free bodies with geoms, a ground plane, joints as a tree or as equalities.

As a tree MuJoCo moves joint angles, and joints are closed by construction; as equalities between free bodies they
are soft, as its contacts are. Solver and tolerances stay at MuJoCo's defaults.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import steelyard as sy

Form = Literal["tree", "equalities"]
# From MuJoCo's z to the y along which our capsules lie and our grounds face.
_UPRIGHT = Rotation.from_euler("x", -90, degrees=True)


@dataclass(frozen=True, kw_only=True)
class BodySettings:
    """How MuJoCo steps a rigid scene.

    Attributes:
        dt: step [s].
        integrator: its name of the method that advances time.
        cone: of friction.
        form: of joints.
    """

    dt: float
    integrator: str = "Euler"
    cone: str = "pyramidal"
    form: Form = "equalities"


def build(scene: sy.Scene, settings: BodySettings) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile a scene of bodies, ball joints, hinges, one ground and collisions of all; data at its start."""
    root = ET.Element("mujoco")
    gravity = " ".join(map(repr, scene.gravity))
    ET.SubElement(
        root, "option", timestep=repr(settings.dt), gravity=gravity, integrator=settings.integrator, cone=settings.cone,
    )  # fmt: skip
    ET.SubElement(root, "compiler", angle="radian")
    world = ET.SubElement(root, "worldbody")
    for ground in scene.of(sy.Ground):
        friction = f"{ground.friction!r} 0.005 0.0001"
        plane = {
            "type": "plane",
            "size": "0 0 1",
            "quat": _quaternion(_UPRIGHT),
            "friction": friction,
        }
        ET.SubElement(world, "geom", plane)
    friction = max((c.friction for c in scene.of(sy.Collisions)), default=0.0)
    joints = scene.of(sy.BallJoint, sy.HingeJoint)
    above = {id(joint.a): joint for joint in joints} if settings.form == "tree" else {}
    elements: dict[int, ET.Element] = {}
    for index, body in enumerate(scene.bodies):
        joint = above.get(id(body))
        parent = None if joint is None else joint.b
        element = ET.SubElement(
            world if parent is None else elements[id(parent)], "body", name=f"body {index}"
        )
        element.set("pos", _text(_local(parent, np.array(body.position))))
        element.set("quat", _quaternion(_relative(parent, _turn(body.orientation))))
        if joint is None:
            ET.SubElement(element, "freejoint")
        else:
            ET.SubElement(element, "joint", _joint(joint, body))
        for part in body.parts:
            ET.SubElement(element, "geom", _geom(part, friction))
        elements[id(body)] = element
    if settings.form == "equalities" and joints:
        _equalities(root, scene, joints)
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _turn(quaternion: Any) -> Rotation:
    """From (w, x, y, z)."""
    return Rotation.from_quat(np.roll(np.array(quaternion), -1))


def _quaternion(turn: Rotation) -> str:
    """As (w, x, y, z) in words."""
    return _text(np.roll(turn.as_quat(), 1))


def _local(parent: sy.Body | None, place: np.ndarray) -> np.ndarray:
    if parent is None:
        return place
    return np.asarray(_turn(parent.orientation).inv().apply(place - np.array(parent.position)))


def _relative(parent: sy.Body | None, turn: Rotation) -> Rotation:
    return turn if parent is None else _turn(parent.orientation).inv() * turn


def _joint(joint: sy.BallJoint | sy.HingeJoint, body: sy.Body) -> dict[str, str]:
    found = {"type": "ball", "pos": _text(_local(body, np.array(joint.place)))}
    if isinstance(joint, sy.HingeJoint):
        axis = _turn(body.orientation).inv().apply(np.array(joint.axis))
        found |= {"type": "hinge", "axis": _text(axis)}
        if np.isfinite((joint.drive.low, joint.drive.high)).all():
            found |= {"limited": "true", "range": _text((joint.drive.low, joint.drive.high))}
    return found


def _geom(part: sy.Part, friction: float) -> dict[str, str]:
    shape, turn = part.shape, _turn(part.orientation)
    found = {
        "pos": _text(part.offset), "density": repr(part.density),
        "friction": f"{friction!r} 0.005 0.0001",
    }  # fmt: skip
    if isinstance(shape, sy.Sphere):
        return found | {"type": "sphere", "size": repr(shape.radius)}
    if isinstance(shape, sy.Box):
        return found | {"type": "box", "size": _text(shape.half_size), "quat": _quaternion(turn)}
    assert isinstance(shape, sy.Capsule)
    size = _text((shape.radius, shape.half_length))
    return found | {
        "type": "capsule",
        "size": size,
        "quat": _quaternion(turn * _UPRIGHT),
    }


def _equalities(root: ET.Element, scene: sy.Scene, joints: list[Any]) -> None:
    """A place that both share; for hinges a second one along the axis. Jointed bodies do not touch."""
    names = {id(body): f"body {index}" for index, body in enumerate(scene.bodies)}
    equality = ET.SubElement(root, "equality")
    contact = ET.SubElement(root, "contact")
    for joint in joints:
        pair = {"body1": names[id(joint.a)], "body2": names[id(joint.b)]}
        places = [np.array(joint.place)]
        if isinstance(joint, sy.HingeJoint):
            places.append(places[0] + 0.1 * np.array(joint.axis))
        for place in places:
            ET.SubElement(equality, "connect", pair | {"anchor": _text(_local(joint.a, place))})
        ET.SubElement(contact, "exclude", pair)


class BodyFlight:
    """A rigid scene flown by MuJoCo."""

    def __init__(self, scene: sy.Scene, settings: BodySettings) -> None:
        self.scene, self.settings = scene, settings
        self.model, self.data = build(scene, settings)
        # A tree has its bodies in another order.
        self._index = [self.model.body(f"body {k}").id for k in range(len(scene.bodies))]
        self._ends = [
            [(scene.bodies.index(thing), place) for thing, place, _ in joint.ends]
            for joint in scene.of(sy.BallJoint, sy.HingeJoint)
        ]

    def push(self, velocity: np.ndarray, spin: np.ndarray) -> None:
        """Add to the velocities and spins (bodies, 3) of free bodies, in the world's axes."""
        for k in range(len(self.scene.bodies)):
            turn = self.data.xmat[self._index[k]].reshape(3, 3)
            self.data.qvel[6 * k : 6 * k + 3] += velocity[k]
            self.data.qvel[6 * k + 3 : 6 * k + 6] += turn.T @ spin[k]

    def step(self, steps: int) -> None:
        """Advance."""
        mujoco.mj_step(self.model, self.data, nstep=steps)

    @property
    def position(self) -> np.ndarray:
        """Of all bodies [m], (bodies, 3)."""
        return np.array(self.data.xpos[self._index])

    @property
    def penetration(self) -> float:
        """Of the deepest contact [m]."""
        return max([0.0, *(-contact.dist for contact in self.data.contact)])

    @property
    def gap(self) -> float:
        """Of the most open joint [m]."""
        turns = self.data.xmat[self._index].reshape(-1, 3, 3)
        worst = 0.0
        for (a, at_a), (b, at_b) in self._ends:
            apart = self.position[a] + turns[a] @ at_a - self.position[b] - turns[b] @ at_b
            worst = max(worst, float(np.linalg.norm(apart)))
        return worst

    @property
    def energy(self) -> float:
        """Kinetic and of gravity [J]."""
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy.sum())
