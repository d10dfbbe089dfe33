"""Where the loaded bridge comes to rest in each engine, against its statics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import mujoco
import numpy as np

import steelyard as sy
from benchmarks.engine_scenes import build
from benchmarks.flights import PeerMethod
from benchmarks.peers import mujoco_scenes
from benchmarks.references import equilibrium
from benchmarks.scenes import Array, ParticleScene, bridge, bridge_mass

# The place of rest does not depend on damping, so it is approached with much of it.
DAMPING = 1e-3
DURATION = 20.0


@dataclass(frozen=True, kw_only=True)
class Rest:
    """A bridge that has settled.

    Attributes:
        height: Largest error of a particle's height [m].
        speed: Largest speed that is left [m/s].
    """

    height: float
    speed: float

    def record(self) -> dict[str, Any]:
        """Plain values for a results file."""
        return asdict(self)


def settle(method: sy.Method, peers: Mapping[str, PeerMethod]) -> tuple[Rest, dict[str, Rest]]:
    """Let the bridge settle under 10 kg on one particle, here and in MuJoCo with the same step.

    Returns:
        This engine's rest, and MuJoCo's by the name of its setting.
    """
    scene = replace(bridge(mass=bridge_mass(x=2.0, z=0.0)), damping=DAMPING)
    scene = replace(scene, position=equilibrium(scene).position)
    steps = round(DURATION / method.dt)
    world = sy.World(build(scene), method=method)
    world.step(steps)
    ours = _rest(scene, world.particles.position[0], world.particles.velocity[0])
    theirs = {}
    for name, peer in peers.items():
        model, data = mujoco_scenes.build(
            scene, dt=method.dt, integrator=peer.integrator, solref=peer.solref(method.dt)
        )
        mujoco.mj_step(model, data, nstep=steps)
        theirs[name] = _rest(scene, mujoco_scenes.positions(data), mujoco_scenes.velocities(data))
    return ours, theirs


def _rest(scene: ParticleScene, position: Array, velocity: Array) -> Rest:
    return Rest(
        height=float(np.abs(position[:, 1] - scene.position[:, 1]).max()),
        speed=float(np.linalg.norm(velocity, axis=1).max()),
    )
