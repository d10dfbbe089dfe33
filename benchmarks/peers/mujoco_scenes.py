"""The benchmark scenes in MuJoCo.

A particle is a body with three slide joints, a rod is a spatial tendon held at its length by an
equality constraint, a cable is a spatial tendon with an upper limit. Solver and tolerances stay at
MuJoCo's defaults, and so does the softness of the links unless `solref` names another; contacts are
off unless the scene stands on ground.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import Literal

import mujoco
import numpy as np

from benchmarks.scenes import Array, ParticleScene

PARTICLE_RADIUS = 1e-3

Integrator = Literal["Euler", "RK4", "implicit", "implicitfast"]


def build(
    scene: ParticleScene,
    *,
    dt: float,
    integrator: Integrator = "Euler",
    solref: tuple[float, float] | None = None,
    ground_friction: float | None = None,
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile a scene for MuJoCo.

    Args:
        scene: Particles, links, gravity and damping.
        dt: Step [s].
        integrator: MuJoCo's name of the method that advances time.
        solref: Softness of rods and cables in MuJoCo's terms; None keeps its default of (.02, 1).
            `tight_solref` and `safe_solref` follow the step, as an error that is to fall with the
            step needs.
        ground_friction: Coulomb coefficient of a ground plane at y = 0; without it there is no
            ground and no contact.

    Returns:
        The model, and data at the scene's initial state. `mujoco.mj_step(model, data, nstep=n)`
        advances it without a return to Python.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(scene, dt, integrator, solref, ground_friction))
    data = mujoco.MjData(model)
    data.qvel[:] = scene.velocity.ravel()
    mujoco.mj_forward(model, data)
    return model, data


def safe_solref(dt: float) -> tuple[float, float]:
    """The stiffest critically damped link that MuJoCo's own guard lets pass: two steps' time."""
    return (2.0 * dt, 1.0)


def tight_solref(dt: float) -> tuple[float, float]:
    """Links that semi-implicit Euler closes in one step: stiffness 1/dt^2 and damping 1/dt.

    The strain left by a motion falls fourfold against `safe_solref`, at the same cost.
    """
    return (-1.0 / dt**2, -1.0 / dt)


def mjcf(
    scene: ParticleScene,
    dt: float,
    integrator: Integrator,
    solref: tuple[float, float] | None,
    ground_friction: float | None,
) -> str:
    """The scene as an MJCF document; arguments as in `build`."""
    root = ET.Element("mujoco", model="particles")
    option = ET.SubElement(
        root, "option", timestep=repr(dt), integrator=integrator, gravity=_text(scene.gravity)
    )
    # A touch as wide as the visible sphere would lift the scene; particles are points.
    if ground_friction is None:
        ET.SubElement(option, "flag", contact="disable")
    world = ET.SubElement(root, "worldbody")
    if ground_friction is not None:
        ET.SubElement(
            world,
            "geom",
            type="plane",
            size="0 0 1",
            pos=_text((0.0, -PARTICLE_RADIUS, 0.0)),
            zaxis="0 1 0",
            friction=_text((ground_friction, 0.0, 0.0)),
        )
    for p, (position, mass) in enumerate(zip(scene.position, scene.mass, strict=True)):
        _add_particle(world, p, position, float(mass), _joint_damping(scene, float(mass)))
    for kind, links in (("pin", scene.pins), ("anchor", scene.supports)):
        for c, (_, anchor, _) in enumerate(links):
            ET.SubElement(world, "site", name=f"{kind}{c}", pos=_text(anchor))
    _add_links(root, scene, solref)
    return ET.tostring(root, encoding="unicode")


def positions(data: mujoco.MjData) -> Array:
    """Particle positions [m], shape (particles, 3), of the state that was reached last.

    A step leaves the body frames at the state that it started from, so they are brought up to date
    here, outside anything that is timed.
    """
    mujoco.mj_kinematics(data.model, data)
    return data.xpos[1:].copy()


def velocities(data: mujoco.MjData) -> Array:
    """Particle velocities [m/s], shape (particles, 3)."""
    return data.qvel.reshape(-1, 3).copy()


def set_mass(model: mujoco.MjModel, scene: ParticleScene, mass: Array) -> None:
    """Give the particles new masses [kg], shape (particles,): a load that moves over a deck.

    The damping of a joint is a force per velocity, so it is scaled with the mass. MuJoCo reads the inertia of
    bodies that only slide from ``dof_M0``, not from their mass.
    """
    model.body_mass[1:] = mass
    model.dof_M0[:] = np.repeat(mass, 3)
    model.dof_damping[:] = np.repeat(_joint_damping(scene, mass), 3)


def _joint_damping(scene: ParticleScene, mass: float | Array) -> float | Array:
    """Joint damping [N s/m] under which velocity keeps the scene's share over one second."""
    return -math.log(scene.damping) * mass


def _add_particle(
    world: ET.Element, p: int, position: Array, mass: float, joint_damping: float | Array
) -> None:
    body = ET.SubElement(world, "body", name=f"particle{p}", pos=_text(position))
    for axis in ("1 0 0", "0 1 0", "0 0 1"):
        ET.SubElement(body, "joint", type="slide", axis=axis, damping=repr(float(joint_damping)))
    # Contact type 2 against affinity 1: particles meet the ground and never each other.
    ET.SubElement(
        body,
        "geom",
        type="sphere",
        size=repr(PARTICLE_RADIUS),
        mass=repr(mass),
        contype="2",
        conaffinity="1",
        friction="0 0 0",
    )
    ET.SubElement(body, "site", name=f"particle{p}")


def _add_links(root: ET.Element, scene: ParticleScene, solref: tuple[float, float] | None) -> None:
    tendon = ET.SubElement(root, "tendon")
    equality = ET.SubElement(root, "equality")
    rods = [
        *(
            (f"rod{c}", f"particle{a}", f"particle{b}", length, scene.position[b])
            for c, (a, b, length) in enumerate(scene.rods)
        ),
        *(
            (f"held{c}", f"particle{a}", f"pin{c}", length, np.asarray(point))
            for c, (a, point, length) in enumerate(scene.pins)
        ),
    ]
    for name, site_a, site_b, length, end in rods:
        _add_tendon(tendon, name, site_a, site_b)
        # The constraint measures from the length in the initial pose.
        start = scene.position[int(site_a.removeprefix("particle"))]
        stretch = length - float(np.linalg.norm(start - end))
        rod = ET.SubElement(
            equality, "tendon", tendon1=name, polycoef=_text((stretch, 1.0, 0.0, 0.0, 0.0))
        )
        if solref is not None:
            rod.set("solref", _text(solref))
    cables = [
        *(
            (f"cable{c}", f"particle{a}", f"particle{b}", length)
            for c, (a, b, length) in enumerate(scene.cables)
        ),
        *(
            (f"support{c}", f"particle{p}", f"anchor{c}", length)
            for c, (p, _, length) in enumerate(scene.supports)
        ),
    ]
    for name, site_a, site_b, length in cables:
        cable = _add_tendon(tendon, name, site_a, site_b)
        cable.set("limited", "true")
        cable.set("range", _text((0.0, length)))
        if solref is not None:
            cable.set("solreflimit", _text(solref))


def _add_tendon(tendon: ET.Element, name: str, site_a: str, site_b: str) -> ET.Element:
    spatial = ET.SubElement(tendon, "spatial", name=name)
    for site in (site_a, site_b):
        ET.SubElement(spatial, "site", site=site)
    return spatial


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
