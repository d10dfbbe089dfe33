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
from benchmarks.peers.rigid import UPRIGHT, JointGaps, Moving, turn
from benchmarks.scenes import Array

Form = Literal["tree", "equalities"]


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
            "quat": _quaternion(UPRIGHT),
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
        element.set("quat", _quaternion(_relative(parent, turn(body.orientation))))
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


def _quaternion(rotation: Rotation) -> str:
    """As (w, x, y, z) in words."""
    return _text(np.roll(rotation.as_quat(), 1))


def _local(parent: sy.Body | None, place: np.ndarray) -> np.ndarray:
    if parent is None:
        return place
    return np.asarray(turn(parent.orientation).inv().apply(place - np.array(parent.position)))


def _relative(parent: sy.Body | None, rotation: Rotation) -> Rotation:
    return rotation if parent is None else turn(parent.orientation).inv() * rotation


def _joint(joint: sy.BallJoint | sy.HingeJoint, body: sy.Body) -> dict[str, str]:
    found = {"type": "ball", "pos": _text(_local(body, np.array(joint.place)))}
    if isinstance(joint, sy.HingeJoint):
        axis = turn(body.orientation).inv().apply(np.array(joint.axis))
        found |= {"type": "hinge", "axis": _text(axis)}
        if np.isfinite((joint.drive.low, joint.drive.high)).all():
            found |= {"limited": "true", "range": _text((joint.drive.low, joint.drive.high))}
    return found


def _geom(part: sy.Part, friction: float) -> dict[str, str]:
    shape, own = part.shape, turn(part.orientation)
    found = {
        "pos": _text(part.offset), "density": repr(part.density),
        "friction": f"{friction!r} 0.005 0.0001",
    }  # fmt: skip
    if isinstance(shape, sy.Sphere):
        return found | {"type": "sphere", "size": repr(shape.radius)}
    if isinstance(shape, sy.Box):
        return found | {"type": "box", "size": _text(shape.half_size), "quat": _quaternion(own)}
    assert isinstance(shape, sy.Capsule)
    size = _text((shape.radius, shape.half_length))
    return found | {
        "type": "capsule",
        "size": size,
        "quat": _quaternion(own * UPRIGHT),
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
        self._gaps = JointGaps(scene)
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION

    def push(self, velocity: np.ndarray, spin: np.ndarray) -> None:
        """Add to the velocities and spins (bodies, 3) of free bodies, in the world's axes."""
        for k in range(len(self.scene.bodies)):
            axes = self.data.xmat[self._index[k]].reshape(3, 3)
            self.data.qvel[6 * k : 6 * k + 3] += velocity[k]
            self.data.qvel[6 * k + 3 : 6 * k + 6] += axes.T @ spin[k]

    def step(self, steps: int) -> None:
        """Advance."""
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def saved(self) -> Array:
        """All that the steps to come depend on."""
        state = np.empty(mujoco.mj_stateSize(self.model, self._kind))
        mujoco.mj_getState(self.model, self.data, state, self._kind)
        return state

    def restore(self, state: Array) -> None:
        """Back to what was saved."""
        mujoco.mj_setState(self.model, self.data, state, self._kind)

    @property
    def moving(self) -> Moving:
        """Of free bodies, now; a step leaves what follows from their coordinates where it started."""
        mujoco.mj_kinematics(self.model, self.data)
        turns = self._turns
        speed = self.data.qvel.reshape(-1, 6)
        return (
            self.position,
            turns,
            speed[:, :3].copy(),
            np.einsum("bij,bj->bi", turns, speed[:, 3:]),
        )

    @property
    def _turns(self) -> Array:
        return np.array(self.data.xmat[self._index].reshape(-1, 3, 3))

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
        return self._gaps.most(self.position, self._turns)

    @property
    def energy(self) -> float:
        """Kinetic and of gravity [J]."""
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy.sum())
