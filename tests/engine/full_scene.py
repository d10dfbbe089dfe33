"""One scene with everything that a method can hold, for tests of a world's state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import steelyard as sy

METHODS = {
    "rattle direct": sy.Method(sy.Rattle(), sy.Direct()),
    "rattle gauss-seidel": sy.Method(sy.Rattle(), sy.GaussSeidel()),
    "symplectic direct": sy.Method(sy.SymplecticEuler(), sy.Direct()),
    "symplectic gauss-seidel": sy.Method(sy.SymplecticEuler(), sy.GaussSeidel()),
    "symplectic xpbd": sy.Method(sy.SymplecticEuler(), sy.Xpbd(substeps=4)),
    "symplectic worst-first": sy.Method(sy.SymplecticEuler(), sy.WorstFirst()),
    "explicit worst-first": sy.Method(sy.ExplicitEuler(), sy.WorstFirst()),
}
every_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


def full_scene(method: sy.Method, *, written: bool = False) -> tuple[sy.Scene, dict[str, Any]]:
    """Particles p0 ... p6 with links, contacts, forces, a winch and a rider, by name.

    Args:
        method: What it cannot hold is left out: winches under explicit Euler, riders under worst
            first.
        written: Whether a user-written force and contact generator take part.
    """
    scene = sy.Scene()
    p = [
        scene.add(sy.Particle(position=place, velocity=speed, mass=mass, damping=0.95))
        for place, speed, mass in [
            ((0.0, 2.0, 0.0), (0.5, 0.0, 0.0), 1.0),
            ((1.0, 2.0, 0.0), (0.5, 0.0, 0.0), 2.0),
            ((0.0, 1.0, 0.0), (0.5, -1.0, 0.25), 0.5),
            ((2.5, 2.0, 0.0), (0.0, 0.0, 1.0), 1.0),
            ((3.0, 0.4, 0.5), (1.0, -2.0, 0.0), 1.5),
            ((4.0, 3.0, 0.0), (0.0, 1.0, 0.0), 1.0),
        ]
    ]
    p.append(scene.add(sy.Particle(position=(0.0, 5.0, 0.0), inverse_mass=0.0)))
    things: dict[str, Any] = {
        "rod": sy.Rod(p[0], p[1]),
        "cable": sy.Cable(p[0], p[2], 1.05, restitution=0.5),
        "rod to a point": sy.RodConstraint(p[3], (2.5, 4.0, 0.0)),
        "hanger": sy.Cable(p[1], p[6], 3.4),
        "ground": sy.Ground(restitution=0.3, friction=0.4, particles=[p[2], p[4]]),
        "spring": sy.Spring(p[1], p[3], 40.0, 1.2),
        "bungee": sy.AnchoredBungee(p[4], (3.0, 1.0, 0.0), 10.0, 0.5),
        "drag": sy.Drag(linear=0.1, quadratic=0.05, wind=(0.0, 0.0, 1.0)),
        "stiff spring": sy.StiffSpring(p[5], (4.0, 3.5, 0.0), 3e4, 2.0),
        "float": sy.Buoyancy(p[4], surface=0.3, half_depth=0.5, volume=1e-3),
    }
    if not isinstance(method.integrator, sy.ExplicitEuler):
        things["winch"] = sy.CableConstraint(p[0], (0.0, 4.0, 0.0), 2.05, winch=True)
    if not isinstance(method.solver, sy.WorstFirst):
        load = scene.add(sy.Particle(position=(0.25, 2.0, 0.0), velocity=(0.5, 0, 0), mass=0.3))
        things["rider"] = sy.Rider(load, [p[0], p[1]], [0.75, 0.25])
        p.append(load)
    if written:
        things["user force"] = sy.UserForce(lambda x, v, t: -2.0 * x - 0.1 * v)
        things["user contact"] = sy.ContactGenerator(_low_ceiling, [(p[1], None)], 0.2, 0.1)
    for thing in things.values():
        scene.add(thing)
    return scene, things | {f"p{k}": particle for k, particle in enumerate(p)}


def _low_ceiling(x: Any, y: Any, time: Any) -> Any:
    """A ceiling at 2.2 m."""
    normal = np.zeros(x.shape)
    normal[..., 1] = -1.0
    return normal, x[..., 1] - 2.2


def control(world: sy.World, things: dict[str, Any]) -> None:
    """Give every world its own start, winch speed and rider speed."""
    rng = np.random.default_rng(3)
    world.particles.velocity[:, :6] += 0.1 * rng.normal(size=(world.worlds, 6, 3))
    if "winch" in things:
        world[things["winch"]].rate = rng.uniform(-0.2, 0.2, world.worlds)
        world[things["winch"]].acceleration = rng.uniform(-0.1, 0.1, world.worlds)
    if "rider" in things:
        speed = rng.uniform(-0.3, 0.3, world.worlds)
        world[things["rider"]].rates = np.stack([speed, -speed], axis=1)
        world[things["rider"]].accelerations = np.stack([-speed, speed], axis=1)


def state(world: sy.World, things: dict[str, Any]) -> dict[str, np.ndarray]:
    """Copies of all that a person can read and that stepping changes."""
    found = {
        "position": world.particles.position,
        "velocity": world.particles.velocity,
        "time": world.time,
        "health": world.health,
    }
    staged = not isinstance(world.method.solver, sy.WorstFirst)
    for name, thing in things.items():
        if name in ("winch", "rider"):
            kept = {
                "winch": ("length", "rate", "acceleration"),
                "rider": ("weights", "rates", "accelerations"),
            }
            found |= {f"{name} {each}": getattr(world[thing], each) for each in kept[name]}
        if staged and name in ("rod", "cable", "rod to a point", "hanger", "winch", "rider"):
            found[f"{name} multiplier"] = world[thing].multiplier
    return {name: value.copy() for name, value in found.items()}


def assert_same_bits(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> None:
    """Fail where any two arrays differ."""
    assert first.keys() == second.keys()
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)
