"""The source's own method against what the original program computed.

Explicit Euler in the source's order with the worst-first resolver reproduces the recordings of
``tests/data/cyclone`` (its README tells where they come from).

The original resolves contacts in the order of their closing speeds and breaks ties by the last bit.
Its scenes are symmetric, so ties are the rule: any arithmetic that rounds otherwise takes another contact
first and is off by centimetres a step or two later. Agreement to 1e-9 m over many steps is therefore only
possible together with three habits of the original, which the engine shares:

- products are rounded before they are added (no fused multiply-add);
- a cable exactly at its length is a contact along the cable, of no penetration;
- a contact resolved without penetration "moves" its particles by what its place in the contact array
  moved last, be it some steps ago.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import steelyard as sy
from tests.engine.builders import Array, advance

DATA = Path(__file__).parents[1] / "data" / "cyclone"
DT = 1.0 / 60.0
BALLISTIC = ("ballistic_artillery", "ballistic_pistol")
NETWORKS = ("platform_x0_z0.5", "platform_x0.5_z0.5", "bridge_x0_z0", "bridge_x2.5_z0.5")


def recorded(name: str) -> tuple[sy.Scene, Array, Array]:
    """Scene, positions [m] and velocities [m/s] of a recording, each (rows, particles, 3)."""
    with np.load(DATA / f"{name}.npz") as file:
        data = dict(file)
    scene = sy.Scene()
    particles = [
        scene.add(sy.Particle(position=x, velocity=v, inverse_mass=w, acceleration=a, damping=d))
        for x, v, w, a, d in zip(
            data["position"][0],
            data["velocity"][0],
            data["inverse_mass"].tolist(),
            data["acceleration"],
            data["damping"].tolist(),
            strict=True,
        )
    ]
    if "ground" in data:
        height, restitution = data["ground"].tolist()
        scene.add(sy.Ground(height=height, restitution=restitution))
    for a, b, length, restitution in data.get("cables", np.empty((0, 4))).tolist():
        ends = particles[int(a)], particles[int(b)]
        scene.add(sy.Cable(*ends, length, restitution=restitution))
    for p, x, y, z, length, restitution in data.get("supports", np.empty((0, 6))).tolist():
        particle = particles[int(p)]
        scene.add(sy.CableConstraint(particle, (x, y, z), length, restitution=restitution))
    for a, b, length in data.get("rods", np.empty((0, 3))).tolist():
        scene.add(sy.Rod(particles[int(a)], particles[int(b)], length))
    return scene, data["position"], data["velocity"]


def difference(name: str, *, worlds: int = 1) -> Array:
    """Greatest difference [m], [m/s] from the recording, shape (steps, worlds)."""
    scene, position, velocity = recorded(name)
    method = sy.Method(sy.ExplicitEuler(), sy.WorstFirst(), dt=DT)
    world = sy.World(scene, worlds=worlds, method=method)
    x, v = advance(world, len(position) - 1)
    return np.maximum(
        np.abs(x - position[:, None]).max(axis=(2, 3)),
        np.abs(v - velocity[:, None]).max(axis=(2, 3)),
    )[1:]


@pytest.mark.parametrize("name", BALLISTIC)
def test_ballistic_flight(name: str) -> None:
    error = difference(name)
    assert len(error) == 360
    assert error.max() <= 1e-12


@pytest.mark.parametrize("name", NETWORKS)
def test_platform_and_bridge(name: str) -> None:
    # Bit for bit over all 600 recorded steps where d^dt rounds as in the recording. One unit in the
    # last place of that power already parts the bridge at step 28 (and the platform at 50), when a
    # tie falls the other way; the power is not rounded alike in every mathematics library. Nothing
    # but the scene's chaos stops the comparison, so all steps that are kept are compared.
    error = difference(name)
    assert len(error) == 200
    assert error.max() <= 1e-9


def test_every_world_of_a_batch_follows_the_recording() -> None:
    # The resolver works on one world after the other in shared work arrays.
    assert difference("bridge_x2.5_z0.5", worlds=11).max() <= 1e-9


def test_a_load_that_moves_between_steps_changes_the_masses_of_the_next() -> None:
    scene, _, _ = recorded("platform_x0_z0.5")
    method = sy.Method(sy.ExplicitEuler(), sy.WorstFirst(), dt=DT)
    moved, kept, fresh = (sy.World(scene, method=method) for _ in range(3))
    moved.step(3)
    kept.step(4)
    mass = np.array([1.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    moved.particles.mass = fresh.particles.mass = mass
    fresh.particles.position[:] = moved.particles.position
    fresh.particles.velocity[:] = moved.particles.velocity
    moved.step()
    fresh.step()
    np.testing.assert_array_equal(moved.particles.position, fresh.particles.position)
    assert np.abs(kept.particles.position - moved.particles.position).max() > 1e-6
