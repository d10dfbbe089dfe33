"""The direct solver under a load that moves over bridge and platform, in its own way in every world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import steelyard as sy
from benchmarks.scenes import bridge, bridge_mass, tumbling_platform
from tests.engine.builders import Array, from_particle_scene

WORLDS = 17
DT = 0.01


def walk(time: float, worlds: int = WORLDS) -> tuple[Array, Array]:
    """Places of the loads along and across, each in [0, 1] and its own in every world."""
    phase = np.arange(worlds)
    along = 0.5 + 0.5 * np.sin(0.4 * time * (1.0 + phase / worlds) + phase)
    return along, 0.5 + 0.5 * np.sin(0.7 * time + 2.0 * phase)


def bridge_weights(time: float) -> Array:
    """Share of the load on each particle of the bridge, shape (worlds, 12)."""
    along, across = walk(time)
    places = zip((5.0 * along).tolist(), across.tolist(), strict=True)
    return np.array([bridge_mass(x=x, z=z, load=1.0) - 1.0 for x, z in places])


def platform_weights(time: float) -> Array:
    """Share of the load on each particle of the platform, shape (worlds, 6)."""
    x, z = walk(time)
    none = np.zeros(WORLDS)
    return np.stack(
        [none, none, (1 - x) * z, (1 - x) * (1 - z), x * z, x * (1 - z)],
        axis=1,
    )


def bridge_scene() -> sy.Scene:
    return from_particle_scene(bridge())


def platform_scene() -> sy.Scene:
    """The platform on frictional ground, damped as in the source: it stands, tilts and falls."""
    upright = tumbling_platform()
    source = replace(
        upright,
        velocity=np.zeros_like(upright.velocity),
        mass=np.ones(6),
        gravity=(0.0, -9.81, 0.0),
        damping=0.9,
    )
    scene = from_particle_scene(source)
    scene.add(sy.Ground(friction=0.8))
    return scene


CARRIERS = {
    "bridge": (bridge_scene, bridge_weights),
    "platform": (platform_scene, platform_weights),
}


@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("share", ["rider", "lumped"])
def test_direct_holds_every_link_under_a_moving_load(carrier: str, share: str) -> None:
    build: Callable[[], sy.Scene]
    build, weights = CARRIERS[carrier]
    scene = build()
    deck = scene.particles
    at = weights(0.0)
    if share == "rider":
        load = scene.add(sy.Particle(position=deck[0].position, mass=10.0, damping=0.9))
        rider = scene.add(sy.Rider(load, deck, at[0]))
    world = sy.World(scene, worlds=WORLDS, method=sy.Method(sy.Rattle(), sy.Direct(), dt=DT))
    if share == "rider":
        world[rider].weights = at
        world.particles.position[:, -1] = np.einsum(
            "wk,wkc->wc", at, world.particles.position[:, :-1]
        )
    worst = 0.0
    for step in range(1000):
        then = weights((step + 1) * DT)
        if share == "rider":
            world[rider].rates = (then - at) / DT
        else:
            world.particles.mass = 1.0 + 10.0 * at
        world.step()
        at = then
        worst = max(worst, np.abs(world.residual).max())
    assert worst <= 1e-10
    np.testing.assert_array_equal(world.health, 0)
