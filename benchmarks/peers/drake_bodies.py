"""Rigid scenes of the engine in Drake: free bodies that touch at points, stepped by SAP or integrated by CENIC.

Drake's contact is compliant, so it is made stiff: the weight of the whole scene presses a contact in by
``DrakeSettings.allowance``, SAP's own limit of stiffness is off, and SAP damps a contact within a step. A pair of
shapes has a single contact point in Drake: boxes and capsules get balls in their corners and ends to stand on, as some
of Drake's examples do. Hydroelastic contact, which Drake takes by default where faces meet, rolls balls on facets,
costs four times as much on a stack, and at the stiffness that a stack needs CENIC fails on it with a NaN. All else
stays at Drake's defaults.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    CollisionFilterDeclaration,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

import steelyard as sy
from benchmarks.peers.rigid import UPRIGHT, JointGaps, Moving, turn
from benchmarks.scenes import Array

# It says of every half-space that deformable bodies cannot touch it.
logging.getLogger("drake").setLevel(logging.ERROR)

#: By how much round shapes are larger [m]: what touches to rounding does touch, or all that stands falls for a step.
SKIN = 1e-9
#: Radius of the balls in a box's corners, over its least half size. Deeper than it, a corner is pushed out sideways.
CORNER = 1e-2


@dataclass(frozen=True, kw_only=True)
class DrakeSettings:
    """How Drake steps a rigid scene.

    Attributes:
        dt: step of SAP, largest step of the others [s].
        scheme: "sap", or Drake's name of an integrator: "cenic" is that for contact.
        accuracy: what an integrator holds its own estimate of the error to.
        allowance: how far the weight of all bodies presses a contact in [m].
    """

    dt: float
    scheme: str = "sap"
    accuracy: float = 1e-3
    allowance: float = 1e-5


def build(
    scene: sy.Scene, settings: DrakeSettings
) -> tuple[Simulator, MultibodyPlant, list[RigidBody]]:
    """A simulator of a scene of free bodies, its plant and the bodies in their order; all at rest where they start.

    Balls, boxes and capsules, grounds, collisions of all; ball joints, and hinges without limits, as constraints.

    Raises:
        ValueError: something else is in the scene, or something that Drake's contact lacks.
    """
    _refuse(scene, settings)
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlant(
        MultibodyPlantConfig(
            time_step=settings.dt if settings.scheme == "sap" else 0.0,
            contact_model="point",
            discrete_contact_approximation="sap",
            sap_near_rigid_threshold=0.0,
        ),
        builder,
    )
    # CENIC finds it by this name.
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector(np.array(scene.gravity))
    bodies = [
        plant.AddRigidBody(f"body {k}", _inertia(body)) for k, body in enumerate(scene.bodies)
    ]
    for body, ours in zip(bodies, scene.bodies, strict=True):
        plant.SetDefaultFloatingBaseBodyPose(body, _pose(ours.position, ours.orientation))
    _join(plant, scene, bodies)
    _touch(plant, graph, scene, bodies, settings)
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    _integrate(simulator, settings)
    return simulator, plant, bodies


def _integrate(simulator: Simulator, settings: DrakeSettings) -> None:
    """Give it an integrator, which knows no step before the first; SAP is the plant's own."""
    if settings.scheme != "sap":
        config = SimulatorConfig(
            integration_scheme=settings.scheme,
            max_step_size=settings.dt,
            accuracy=settings.accuracy,
        )
        ApplySimulatorConfig(config, simulator)


def _refuse(scene: sy.Scene, settings: DrakeSettings) -> None:
    bodies, grounds, collisions = scene.bodies, scene.of(sy.Ground), scene.of(sy.Collisions)
    joints, hinges = scene.of(sy.BallJoint, sy.HingeJoint), scene.of(sy.HingeJoint)
    known = (sy.Body, sy.Ground, sy.Collisions, sy.BallJoint, sy.HingeJoint)
    reasons = {type(thing).__name__: True for thing in scene.things if type(thing) not in known} | {
        "restitution, which point contact in Drake lacks": any(
            part.restitution for part in (*grounds, *collisions)
        ),
        "contact of some bodies only": any(
            part.particles is not None for part in (*grounds, *collisions)
        ),
        "bodies that touch the ground and pass through each other": (
            len(bodies) > 1 and bool(grounds) and not collisions
        ),
        "a body with a pivot, a damping, an acceleration of its own or without a mass": any(
            body.pivot is not None
            or body.damping != 1.0
            or body.angular_damping != 1.0
            or body.acceleration is not None
            or not body.movable
            for body in bodies
        ),
        "joints, which only SAP has as constraints": bool(joints) and settings.scheme != "sap",
        "a joint to the world": any(joint.b is None for joint in joints),
        "a hinge with limits, a motor or a spring": any(
            np.isfinite((drive.low, drive.high)).any()
            or drive.strength
            or drive.stiffness
            or drive.damping
            for drive in (hinge.drive for hinge in hinges)
        ),
    }
    found = [reason for reason, holds in reasons.items() if holds]
    if found:
        raise ValueError(f"Drake is not given {'; nor '.join(found)}.")


def _pose(place: Any, quaternion: Any) -> RigidTransform:
    return RigidTransform(Quaternion(np.array(quaternion)), np.array(place))


def _inertia(body: sy.Body) -> SpatialInertia:
    """About the origin of the body's frame, as ``Body.inertia`` is too."""
    unit = np.asarray(body.inertia) / body.mass
    return SpatialInertia(
        body.mass,
        np.array(body.arm),
        UnitInertia(*np.diag(unit), unit[0, 1], unit[0, 2], unit[1, 2]),
    )


def _join(plant: MultibodyPlant, scene: sy.Scene, bodies: list[RigidBody]) -> None:
    """A place that both share; for hinges a second one along the axis."""
    index = {id(body): k for k, body in enumerate(scene.bodies)}
    for joint in scene.of(sy.BallJoint, sy.HingeJoint):
        reaches = (0.0, 0.1) if isinstance(joint, sy.HingeJoint) else (0.0,)
        for reach in reaches:
            a, b = (
                (bodies[index[id(thing)]], place + reach * axes[:, 0])
                for thing, place, axes in joint.ends
            )
            plant.AddBallConstraint(*a, *b)


def _touch(
    plant: MultibodyPlant,
    graph: SceneGraph,
    scene: sy.Scene,
    bodies: list[RigidBody],
    settings: DrakeSettings,
) -> None:
    """Shapes and who may touch whom."""
    weight = sum(body.mass for body in scene.bodies) * float(np.linalg.norm(scene.gravity))
    # Two surfaces in series are half as stiff as each; without gravity Drake's default will do.
    stiffness = 2.0 * weight / settings.allowance if weight else None
    grounds, collisions = scene.of(sy.Ground), scene.of(sy.Collisions)
    own = max((part.friction for part in collisions or grounds), default=0.0)

    def surface(friction: float) -> ProximityProperties:
        found = ProximityProperties()
        AddContactMaterial(
            found, point_stiffness=stiffness, friction=CoulombFriction(friction, friction)
        )
        found.AddProperty("material", "relaxation_time", settings.dt)
        return found

    for k, ground in enumerate(grounds):
        normal = np.array(ground.normal)
        pose = HalfSpace.MakePose(normal, ground.height * normal)
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            pose,
            HalfSpace(),
            f"ground {k}",
            surface(_across(ground.friction, own)),
        )
    if not (grounds or collisions):
        return
    corners = []
    for k, (body, ours) in enumerate(zip(bodies, scene.bodies, strict=True)):
        for p, part in enumerate(ours.parts):
            for c, (shape, pose) in enumerate(_shapes(part)):
                entry = plant.RegisterCollisionGeometry(
                    body, pose, shape, f"body {k} part {p} shape {c}", surface(own)
                )
                if c:
                    corners.append(entry)
    # Corners push faces; two that meet would push each other aside.
    rules = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(corners))
    index = {id(body): k for k, body in enumerate(scene.bodies)}
    for joint in scene.of(sy.BallJoint, sy.HingeJoint):
        if not joint.collide:
            pair = [
                GeometrySet(plant.GetCollisionGeometriesForBody(bodies[index[id(thing)]]))
                for thing, _, _ in joint.ends
            ]
            rules.ExcludeBetween(*pair)
    graph.collision_filter_manager().Apply(rules)


def _across(friction: float, own: float) -> float:
    """What the ground must have: Drake takes the harmonic mean of two surfaces.

    Raises:
        ValueError: no such surface.
    """
    if friction in (0.0, own):
        return friction
    if friction >= 2.0 * own:
        raise ValueError(
            f"Drake is not given a ground of friction {friction} below bodies of {own}: the mean of two surfaces is "
            "less than twice either."
        )
    return friction * own / (2.0 * own - friction)


def _shapes(part: sy.Part) -> list[tuple[Shape, RigidTransform]]:
    """Drake's shape in the body's frame, and the balls that a box has in its corners and a capsule in its ends."""
    shape, own, place = part.shape, turn(part.orientation), np.array(part.offset)
    if isinstance(shape, sy.Sphere):
        return [(Sphere(shape.radius + SKIN), RigidTransform(place))]
    if isinstance(shape, sy.Box):
        half = np.array(shape.half_size)
        radius = CORNER * float(half.min())
        balls = np.array(list(product((-1.0, 1.0), repeat=3))) * (half - radius)
        whole: Shape = Box(*(2.0 * half))
        lying = own
    elif isinstance(shape, sy.Capsule):
        radius = shape.radius
        balls = shape.half_length * np.array([(0.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
        whole = Capsule(radius, 2.0 * shape.half_length)
        lying = own * UPRIGHT
    else:
        raise ValueError(f"Drake is not given {shape!r}; balls, boxes and capsules it is.")
    corners = [(Sphere(radius + SKIN), RigidTransform(place + own.apply(ball))) for ball in balls]
    return [(whole, RigidTransform(RotationMatrix(lying.as_matrix()), place)), *corners]


class DrakeFlight:
    """A rigid scene flown by Drake."""

    def __init__(self, scene: sy.Scene, settings: DrakeSettings) -> None:
        self.scene, self.settings = scene, settings
        self.simulator, self.plant, self._bodies = build(scene, settings)
        self._root = self.simulator.get_mutable_context()
        self._context = self.plant.GetMyMutableContextFromRoot(self._root)
        self._gaps = JointGaps(scene)
        self._steps = 0

    def push(self, velocity: Array, spin: Array) -> None:
        """Add to the velocities and spins (bodies, 3), in the world's axes."""
        for body, speed, turning in zip(self._bodies, velocity, spin, strict=True):
            now = self.plant.EvalBodySpatialVelocityInWorld(self._context, body)
            pushed = SpatialVelocity(now.rotational() + turning, now.translational() + speed)
            self.plant.SetFreeBodySpatialVelocity(self._context, body, pushed)

    def step(self, steps: int) -> None:
        """Advance.

        Raises:
            ArithmeticError: Drake gave up, or its state is not finite.
        """
        self._steps += steps
        try:
            # Steps are counted: a sum of times would miss the last one now and then.
            self.simulator.AdvanceTo(self._steps * self.settings.dt)
        except (RuntimeError, SystemExit) as failure:
            # Drake's own assertions ask Python to exit.
            raise ArithmeticError(str(failure).splitlines()[0]) from failure

    def saved(self) -> Array:
        """Coordinates and speeds of all bodies."""
        return np.array(self.plant.GetPositionsAndVelocities(self._context))

    def restore(self, state: Array) -> None:
        """Back to what was saved, at time 0."""
        self._root.SetTime(0.0)
        self._steps = 0
        self.plant.SetPositionsAndVelocities(self._context, state)
        # Or it would begin with the step at which it ended.
        _integrate(self.simulator, self.settings)
        self.simulator.Initialize()

    @property
    def moving(self) -> Moving:
        """Of all bodies."""
        poses = self._poses
        speeds = [self.plant.EvalBodySpatialVelocityInWorld(self._context, b) for b in self._bodies]
        return (
            np.array([pose.translation() for pose in poses]),
            np.array([pose.rotation().matrix() for pose in poses]),
            np.array([speed.translational() for speed in speeds]),
            np.array([speed.rotational() for speed in speeds]),
        )

    @property
    def _poses(self) -> list[RigidTransform]:
        return [self.plant.EvalBodyPoseInWorld(self._context, body) for body in self._bodies]

    @property
    def position(self) -> Array:
        """Of all bodies [m], (bodies, 3)."""
        return np.array([pose.translation() for pose in self._poses])

    @property
    def penetration(self) -> float:
        """Of the deepest contact [m]."""
        query = self.plant.get_geometry_query_input_port().Eval(self._context)
        return max([0.0, *(pair.depth for pair in query.ComputePointPairPenetration())])

    @property
    def gap(self) -> float:
        """Of the most open joint [m]."""
        place, turns, _, _ = self.moving
        return self._gaps.most(place, turns)

    @property
    def energy(self) -> float:
        """Kinetic and of gravity [J]."""
        kinetic = self.plant.EvalKineticEnergy(self._context)
        return float(kinetic + self.plant.EvalPotentialEnergy(self._context))
