"""What hanging scenes share: kicked out of their equilibrium, strongly damped, they must come back to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.engine_scenes import build
from benchmarks.laboratory.peers import mujoco_particles
from benchmarks.laboratory.problem import Motion, Problem, links, trajectory
from benchmarks.references import equilibrium
from benchmarks.scenes import Array, ParticleScene

#: Rate at which velocity decays [1/s] and duration [s]: critical for the slowest mode
#: of the bridge, of which e^-30 is left.
DECAY, DURATION, KICK = 3.4, 20.0, 0.3


def rest_problem(
    name: str, scene: ParticleScene, place: Array, wrong: Mapping[str, ParticleScene]
) -> Problem:
    """Coming to rest at known places.

    Args:
        name: Name of the problem.
        scene: The scene; its damping, positions and velocities are set here.
        place: Where it rests [m], shape (particles, 3).
        wrong: Scenes that come to rest elsewhere.
    """
    rising = np.zeros_like(place)
    rising[len(place) // 2 - 1 : len(place) // 2 + 1, 1] = KICK
    start = replace(scene, damping=math.exp(-DECAY), position=place, velocity=rising)
    true = Motion(place[None], np.zeros((1, *place.shape)))

    def started(other: ParticleScene) -> ParticleScene:
        return replace(other, damping=start.damping, position=place, velocity=rising)

    return Problem(
        name=name,
        scene=lambda: build(start),
        stretch=0.1,
        looks=(round(DURATION / 0.1),),
        measures=(trajectory(true), links(start)),
        steps=(6, 12),
        peers=mujoco_particles(start),
        peer_steps=(6, 12),
        best="RATTLE, direct",
        wrong={
            defect: (lambda other=other: build(started(other))) for defect, other in wrong.items()
        },
    )


def longer(scene: ParticleScene, supports: int, by: float) -> ParticleScene:
    """The scene with one support longer by a length [m]."""
    p, anchor, length = scene.supports[supports]
    changed = (p, anchor, length + by)
    return replace(
        scene, supports=(*scene.supports[:supports], changed, *scene.supports[supports + 1 :])
    )


def settled(scene: ParticleScene) -> Array:
    """Where a scene of taut links rests [m]."""
    return equilibrium(scene).position
