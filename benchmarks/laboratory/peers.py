"""Other engines as peers of a problem, through their own Python packages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import mujoco
import numpy as np
import pymunk

import steelyard as sy
from benchmarks.laboratory.engines import BrokenRunError
from benchmarks.laboratory.problem import Peer
from benchmarks.peers import drake, mujoco_scenes
from benchmarks.peers.mujoco_bodies import BodyFlight, BodySettings
from benchmarks.peers.rigid import Moving
from benchmarks.scenes import Array, ParticleScene

# By default MuJoCo writes each warning to a file of the working folder.
mujoco.set_mju_user_warning(lambda message: None)


class MuJoCo:
    """A model of MuJoCo, with the state from which it starts.

    Args:
        model: The compiled model.
        velocity: Start velocities of the joints; zero by default.
        position: Start positions of the joints; the compiled ones by default.
        particles: Names of the sites that are the particles, in their order.
    """

    def __init__(
        self,
        model: Any,
        *,
        velocity: Array | None = None,
        position: Array | None = None,
        particles: Sequence[str],
    ) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        if position is not None:
            self.data.qpos[:] = position
        if velocity is not None:
            self.data.qvel[:] = velocity
        mujoco.mj_forward(model, self.data)
        self.sites = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, n) for n in particles]
        self.kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self.start = np.empty(mujoco.mj_stateSize(model, self.kind))
        mujoco.mj_getState(model, self.data, self.start, self.kind)

    def reset(self) -> None:
        """See ``Stepper``."""
        mujoco.mj_setState(self.model, self.data, self.start, self.kind)
        for warning in self.data.warning:
            warning.number = 0

    def step(self, steps: int) -> None:
        """See ``Stepper``."""
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[Array, Array]:
        """See ``Stepper``.

        Raises:
            BrokenRunError: MuJoCo found its state unstable and put it back to the start.
        """
        kinds = mujoco.mjtWarning
        for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC):
            if self.data.warning[kind].number:
                raise BrokenRunError("unstable")
        # A step leaves what follows from the joints at the state that it started from.
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        velocity = np.empty((len(self.sites), 6))
        for row, site in zip(velocity, self.sites, strict=True):
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, site, row, 0)
        return self.data.site_xpos[self.sites].copy(), velocity[:, 3:]


def mujoco_document(
    document: str | Callable[[float, str], str],
    *,
    particles: Sequence[str],
    integrators: Sequence[str] = ("Euler", "RK4"),
    **start: Any,
) -> dict[str, Peer]:
    """Peers of an MJCF document, one per integrator.

    Args:
        document: Leaves ``{dt}`` and ``{integrator}`` open, or is a function of both.
        particles: Names of the sites that are the particles.
        integrators: MuJoCo's names of the integrators.
        start: Start positions and velocities of the joints, as ``MuJoCo`` takes them.
    """

    def peer(integrator: str) -> Peer:
        def build(dt: float) -> MuJoCo:
            if callable(document):
                text = document(dt, integrator)
            else:
                text = document.replace("{dt}", repr(dt)).replace("{integrator}", integrator)
            model = mujoco.MjModel.from_xml_string(text)
            return MuJoCo(model, particles=particles, **start)

        return build

    return {f"MuJoCo {integrator}": peer(integrator) for integrator in integrators}


def mujoco_particles(
    scene: ParticleScene, *, links: Sequence[str] = ("default", "tight")
) -> dict[str, Peer]:
    """Peers that hold a scene in maximal coordinates: slide joints, tendons for links.

    Args:
        scene: Particles and links.
        links: Softness of the links: MuJoCo's default, or "tight", which follows the step.
    """
    particles = [f"particle{p}" for p in range(len(scene.mass))]

    def peer(integrator: mujoco_scenes.Integrator, softness: str) -> Peer:
        def build(dt: float) -> MuJoCo:
            solref = mujoco_scenes.tight_solref(dt) if softness == "tight" else None
            model, _ = mujoco_scenes.build(scene, dt=dt, integrator=integrator, solref=solref)
            return MuJoCo(model, velocity=scene.velocity.ravel(), particles=particles)

        return build

    if not (scene.rods or scene.pins or scene.cables or scene.supports):
        return {f"MuJoCo {name}": peer(name, "default") for name in ("Euler", "RK4")}
    return {
        f"MuJoCo {name}, {softness} links": peer(name, softness)
        for name in ("Euler", "RK4")
        for softness in links
    }


class Pymunk:
    """A space of pymunk with its moving bodies, all of it in the plane z = 0.

    Args:
        build: Makes the space and its bodies, anew at each reset.
        dt: Step [s].
    """

    def __init__(
        self, build: Callable[[], tuple[pymunk.Space, list[pymunk.Body]]], dt: float
    ) -> None:
        self.build, self.dt = build, dt
        self.reset()

    def reset(self) -> None:
        """See ``Stepper``."""
        self.space, self.bodies = self.build()

    def step(self, steps: int) -> None:
        """See ``Stepper``."""
        step, dt = self.space.step, self.dt
        for _ in range(steps):
            step(dt)

    def state(self) -> tuple[Array, Array]:
        """See ``Stepper``."""
        return (
            np.array([(*body.position, 0.0) for body in self.bodies]),
            np.array([(*body.velocity, 0.0) for body in self.bodies]),
        )


def pymunk_space(
    build: Callable[[], tuple[pymunk.Space, list[pymunk.Body]]], *, name: str = "pymunk"
) -> dict[str, Peer]:
    """The peer that a space makes."""
    return {name: lambda dt: Pymunk(build, dt)}


class Flight(Protocol):
    """A rigid scene flown by another engine."""

    def push(self, velocity: Array, spin: Array) -> None:
        """Add to velocities [m/s] and spins [rad/s] (bodies, 3), in the world's axes."""

    def step(self, steps: int) -> None:
        """Advance.

        Raises:
            ArithmeticError: the engine cannot.
        """

    def saved(self) -> Array:
        """All that the steps to come depend on."""

    def restore(self, state: Array) -> None:
        """Back to what was saved."""

    @property
    def moving(self) -> Moving:
        """Places, orientations and their rates."""


class FlownBodies:
    """Free bodies in another engine, seen by their landmarks.

    Args:
        scene: The bodies.
        flight: The engine, with the bodies at rest where they start.
    """

    def __init__(self, scene: sy.Scene, flight: Flight) -> None:
        bodies = scene.bodies
        flight.push(
            np.array([body.velocity for body in bodies]),
            np.array([body.angular_velocity for body in bodies]),
        )
        self.flight, self.start = flight, flight.saved()

    def reset(self) -> None:
        """See ``Stepper``."""
        self.flight.restore(self.start)

    def step(self, steps: int) -> None:
        """See ``Stepper``.

        Raises:
            BrokenRunError: the engine gave up.
        """
        try:
            self.flight.step(steps)
        except ArithmeticError as failure:
            raise BrokenRunError(str(failure)) from failure

    def state(self) -> tuple[Array, Array]:
        """See ``Stepper``."""
        return _landmarks(*self.flight.moving)


def _landmarks(place: Array, turn: Array, velocity: Array, spin: Array) -> tuple[Array, Array]:
    """Origins and ends of the unit axes of bodies, and their velocities."""
    arms = np.concatenate([np.zeros_like(turn[:, :1]), np.swapaxes(turn, 1, 2)], axis=1)
    places = place[:, None] + arms
    speeds = velocity[:, None] + np.cross(spin[:, None], arms)
    return places.reshape(-1, 3), speeds.reshape(-1, 3)


def mujoco_bodies(scene: sy.Scene) -> dict[str, Peer]:
    """Peers of a scene of free bodies, one per cone of friction."""

    def peer(cone: str) -> Peer:
        return lambda dt: FlownBodies(scene, BodyFlight(scene, BodySettings(dt=dt, cone=cone)))

    return {f"MuJoCo {cone}": peer(cone) for cone in ("elliptic", "pyramidal")}


def drake_bodies(
    scene: sy.Scene, ways: Mapping[str, dict[str, Any]] = drake.WAYS
) -> dict[str, Peer]:
    """Peers of a scene of free bodies, one for each of Drake's ways; none where it is not installed."""

    def peer(way: dict[str, Any]) -> Peer:
        return lambda dt: FlownBodies(scene, drake.flight(scene, dt, way))

    return {name: peer(way) for name, way in ways.items()} if drake.INSTALLED else {}


class PymunkBodies(Pymunk):
    """A scene of balls and boxes in the plane z = 0, seen by its landmarks."""

    def __init__(self, scene: sy.Scene, dt: float) -> None:
        super().__init__(lambda: _planar_space(scene), dt)

    def state(self) -> tuple[Array, Array]:
        """See ``Stepper``."""
        bodies = self.bodies
        angle, zero = np.array([body.angle for body in bodies]), np.zeros(len(bodies))
        turn = np.zeros((len(bodies), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
        turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
        spin = np.stack([zero, zero, np.array([body.angular_velocity for body in bodies])], axis=-1)
        return _landmarks(
            np.array([(*body.position, 0.0) for body in bodies]),
            turn,
            np.array([(*body.velocity, 0.0) for body in bodies]),
            spin,
        )


def _planar_space(scene: sy.Scene) -> tuple[pymunk.Space, list[pymunk.Body]]:
    """A space with the scene's bodies; friction and restitution, which multiply, are those of the ground."""
    space = pymunk.Space()
    space.gravity = scene.gravity[:2]
    (ground,) = scene.of(sy.Ground)
    floor = pymunk.Segment(space.static_body, (-100, -1), (100, -1), 1.0)
    shapes: list[pymunk.Shape] = [floor]
    space.add(floor)
    bodies = []
    for body in scene.bodies:
        (part,) = body.parts
        moment = float(np.asarray(body.inertia)[2, 2])
        own = pymunk.Body(body.mass, moment)
        own.position, own.velocity = body.position[:2], body.velocity[:2]
        if isinstance(part.shape, sy.Sphere):
            shape: pymunk.Shape = pymunk.Circle(own, part.shape.radius)
        else:
            shape = pymunk.Poly.create_box(
                own, (2 * part.shape.half_size[0], 2 * part.shape.half_size[1])
            )
        shapes.append(shape)
        space.add(own, shape)
        bodies.append(own)
    for shape in shapes:
        shape.friction, shape.elasticity = math.sqrt(ground.friction), math.sqrt(ground.restitution)
    return space, bodies


def pymunk_bodies(scene: sy.Scene) -> dict[str, Peer]:
    """The peer of a planar scene of balls and boxes."""
    return {"pymunk": lambda dt: PymunkBodies(scene, dt)}
