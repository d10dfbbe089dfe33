"""A world refuses bad calls and assignments, with value, limit and remedy in the message."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from tests.engine.refusals import ORIGIN, no_contact, no_force, pair, refused

NAN, INF = math.nan, math.inf

# Calls


@pytest.mark.parametrize("name", ["worlds", "threads"])
@pytest.mark.parametrize("value", [0, -3, 2.5, NAN, INF, "3", None], ids=str)
def test_a_count_that_is_no_count(name: str, value: Any) -> None:
    scene, *_ = pair()
    with refused("World", name, repr(value)):
        sy.World(scene, **{name: value})


def test_a_batch_too_large_for_memory() -> None:
    scene, *_ = pair()
    with refused("1000000000000 worlds", "GiB", "free", "Use at most", kind=MemoryError):
        sy.World(scene, worlds=10**12)


@pytest.mark.parametrize("steps", [-1, 1.5, "x", None], ids=str)
def test_steps_are_a_whole_number(steps: Any) -> None:
    scene, *_ = pair()
    world = sy.World(scene)
    with refused("steps", repr(steps)):
        world.step(steps)


@pytest.mark.parametrize(
    "mask",
    [
        np.array([True]),
        np.ones(6, dtype=bool),
        np.ones(60, dtype=bool),
        np.ones((4, 1), dtype=bool),
        np.array([0, 2]),
        np.array([0.0, 1.0, 0.0, 1.0]),
        2,
    ],
    ids=["short", "long", "longer", "two axes", "indices", "floats", "an index"],
)
def test_a_mask_names_every_world(mask: Any) -> None:
    scene, *_ = pair()
    world = sy.World(scene, worlds=4)
    with refused("mask", "(4,)", "bool"):
        world.reset(mask)


def test_a_snapshot_of_another_world() -> None:
    scene, *_ = pair()
    world = sy.World(scene, worlds=2)
    for other in (sy.World(scene, worlds=3), sy.World(scene, worlds=2)):
        with refused("restore", "snapshot"):
            world.restore(other.snapshot())
    with refused("restore", "None"):
        world.restore(None)


def test_what_is_not_in_the_world_cannot_be_read() -> None:
    scene, a, b = pair()
    world = sy.World(scene)
    for thing in (sy.Rod(a, b), 0, None, scene):
        with pytest.raises(KeyError, match=r"not in the world's scene.*Add it"):
            world[thing]
    with pytest.raises(AttributeError, match="particles"):
        _ = world[a].position


# Assignments


def held(build: Callable[..., Any], *, worlds: int = 4) -> tuple[sy.World, Any]:
    """A world of three particles and a thing on them."""
    scene, a, b = pair()
    c = scene.add(sy.Particle(position=(0.5, 3, 0)))
    thing = scene.add(build(a, b, c))
    return sy.World(scene, worlds=worlds), thing


# Per kind: a builder, and for every parameter the finite values that are out of its limits.
ASSIGNED: dict[str, tuple[Callable[..., Any], dict[str, list[Any]]]] = {
    "Rod": (lambda a, b, c: sy.Rod(a, b), {"length": [0.0, -1.0]}),
    "RodConstraint": (
        lambda a, b, c: sy.RodConstraint(a, (0, 5, 0)),
        {"length": [0.0, -1.0], "anchor": []},
    ),
    "Cable": (
        lambda a, b, c: sy.Cable(a, b, 1.0),
        {"length": [0.0, -1.0], "restitution": [-0.1, 1.1]},
    ),
    "CableConstraint": (
        lambda a, b, c: sy.CableConstraint(a, (0, 5, 0), 3.0),
        {"length": [0.0, -1.0], "restitution": [-0.1, 1.1], "anchor": []},
    ),
    "winch": (
        lambda a, b, c: sy.Cable(a, b, 1.0, winch=True),
        {"length": [0.0, -1.0], "rate": [], "acceleration": [], "restitution": [-0.1, 1.1]},
    ),
    "Rider": (
        lambda a, b, c: sy.Rider(c, [a, b]),
        {"weights": [(0.7, 0.7)], "rates": [(0.1, 0.1)], "accelerations": [(0.1, 0.1)]},
    ),
    "Ground": (
        lambda a, b, c: sy.Ground(),
        {
            "height": [],
            "normal": [(0.0, 0.0, 0.0)],
            "restitution": [-0.1, 1.1],
            "friction": [-0.1],
        },
    ),
    "LinePlatform": (
        lambda a, b, c: sy.LinePlatform(start=ORIGIN, end=(1, 0, 0), radius=0.1),
        {
            "start": [(1.0, 0.0, 0.0)],
            "end": [(0.0, 0.0, 0.0)],
            "radius": [-0.1],
            "restitution": [-0.1, 1.1],
            "friction": [-0.1],
        },
    ),
    "Collisions": (
        lambda a, b, c: sy.Collisions(particles=[a, b]),
        {"restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    "ContactGenerator": (
        lambda a, b, c: sy.ContactGenerator(no_contact, [(a, b)]),
        {"restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    "Gravity": (lambda a, b, c: sy.Gravity((0, 1, 0)), {"acceleration": []}),
    "Drag": (
        lambda a, b, c: sy.Drag(linear=1.0),
        {"linear": [-1.0], "quadratic": [-1.0], "wind": []},
    ),
    "Spring": (
        lambda a, b, c: sy.Spring(a, b, 1.0, 1.0),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    "Bungee": (
        lambda a, b, c: sy.Bungee(a, b, 1.0, 1.0),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    "AnchoredSpring": (
        lambda a, b, c: sy.AnchoredSpring(a, ORIGIN, 1.0, 1.0),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0], "anchor": []},
    ),
    "AnchoredBungee": (
        lambda a, b, c: sy.AnchoredBungee(a, ORIGIN, 1.0, 1.0),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0], "anchor": []},
    ),
    "StiffSpring": (
        lambda a, b, c: sy.StiffSpring(a, ORIGIN, 1.0),
        {"stiffness": [0.0, -5.0], "damping": [-1.0], "anchor": []},
    ),
    "Buoyancy": (
        lambda a, b, c: sy.Buoyancy(a, 0.0, 1.0, 1.0),
        {
            "surface": [],
            "half_depth": [0.0, -1.0],
            "volume": [0.0, -1.0],
            "density": [0.0, -1.0],
            "gravity": [0.0, -9.81],
        },
    ),
}
EVERY_PARAMETER = [(kind, name) for kind, (_, names) in ASSIGNED.items() for name in names]


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (kind, name, value)
        for kind, (_, names) in ASSIGNED.items()
        for name, bad in names.items()
        for value in bad
    ],
    ids=str,
)
def test_an_assigned_value_out_of_its_limits(kind: str, name: str, value: Any) -> None:
    """An assignment obeys the limits that the constructor sets, and leaves the old value if not."""
    world, thing = held(ASSIGNED[kind][0])
    before = getattr(world[thing], name).copy()
    number = np.ravel(value)[0]
    with refused(name, f"{number:g}", "must be", kind=ValueError):
        setattr(world[thing], name, value)
    with refused(name, f"{number:g}", "must be", kind=ValueError):
        each = np.broadcast_to(before, (4, *np.shape(value))).copy()
        each[2] = value
        setattr(world[thing], name, each)
    np.testing.assert_array_equal(getattr(world[thing], name), before)


@pytest.mark.parametrize(("kind", "name"), EVERY_PARAMETER)
@pytest.mark.parametrize("bad", [NAN, INF], ids=str)
def test_an_assigned_value_that_is_not_finite(kind: str, name: str, bad: float) -> None:
    world, thing = held(ASSIGNED[kind][0])
    before = getattr(world[thing], name).copy()
    own = before.shape[1:] if before.shape[:1] == (4,) else before.shape
    each = np.broadcast_to(before, (4, *own)).copy()
    each[2] = bad
    with refused(name, "finite", kind=ValueError):
        setattr(world[thing], name, each)
    np.testing.assert_array_equal(getattr(world[thing], name), before)


@pytest.mark.parametrize(("kind", "name"), EVERY_PARAMETER)
@pytest.mark.parametrize("shape", [(3,), (5,), (4, 5), (2, 4), (1, 1, 4)], ids=str)
def test_an_assigned_value_of_the_wrong_shape(kind: str, name: str, shape: tuple[int, ...]) -> None:
    world, thing = held(ASSIGNED[kind][0])
    if shape == (3,) and getattr(world[thing], name).shape[-1:] == (3,):
        shape = (4,)
    with refused(name, str(shape), kind=ValueError):
        setattr(world[thing], name, np.ones(shape))


@pytest.mark.parametrize(("kind", "name"), EVERY_PARAMETER)
def test_an_assigned_value_that_is_no_number(kind: str, name: str) -> None:
    world, thing = held(ASSIGNED[kind][0])
    with refused(name, "many"):
        setattr(world[thing], name, "many")


@pytest.mark.parametrize("kind", ASSIGNED)
def test_a_name_that_the_thing_does_not_have(kind: str) -> None:
    world, thing = held(ASSIGNED[kind][0])
    known = ", ".join(sorted(ASSIGNED[kind][1]))
    for use in (lambda: world[thing].colour, lambda: setattr(world[thing], "colour", 1.0)):
        with pytest.raises(AttributeError) as caught:
            use()
        assert "'colour'" in str(caught.value)
        for name in known.split(", "):
            assert name in str(caught.value)


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("mass", 0.0),
        ("mass", -1.0),
        ("mass", NAN),
        ("mass", INF),
        ("inverse_mass", 0.0),
        ("inverse_mass", -1.0),
        ("inverse_mass", NAN),
        ("inverse_mass", INF),
        ("damping", 0.0),
        ("damping", 1.1),
        ("damping", NAN),
    ],
)
def test_assigned_masses_and_dampings(name: str, bad: float) -> None:
    scene, *_ = pair()
    world = sy.World(scene, worlds=4)
    before = getattr(world.particles, name).copy()
    for value in (bad, [1.0, bad], np.full((4, 2), bad)):
        with refused(name if name == "damping" else "mass", kind=ValueError):
            setattr(world.particles, name, value)
    for shape in [(3,), (4,), (4, 3), (2, 4), (4, 2, 1)]:
        with refused(str(shape), kind=ValueError):
            setattr(world.particles, name, np.ones(shape))
    np.testing.assert_array_equal(getattr(world.particles, name), before)


def test_the_message_names_the_value_of_a_damping_out_of_range() -> None:
    scene, *_ = pair()
    with refused("damping", "1.1", "(0, 1]"):
        sy.World(scene).particles.damping = 1.1


def test_an_immovable_particle_stays_immovable() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=ORIGIN, inverse_mass=0.0))
    scene.add(sy.Particle(position=(1, 0, 0)))
    world = sy.World(scene, worlds=4)
    for mass in ([1.0, 1.0], [INF, INF]):
        with refused("immovable", "scene"):
            world.particles.mass = mass
    world.particles.mass = [INF, 3.0]
    np.testing.assert_array_equal(world.particles.mass, [INF, 3.0])


@pytest.mark.parametrize(
    "gravity",
    [(0.0, NAN, 0.0), (0.0, INF, 0.0), (0.0, -9.81), np.zeros((3, 3)), np.zeros((4, 2)), "down"],
    ids=str,
)
def test_an_assigned_gravity(gravity: Any) -> None:
    scene, *_ = pair()
    world = sy.World(scene, worlds=4)
    with refused("gravity", kind=ValueError):
        world.gravity = gravity
    np.testing.assert_array_equal(world.gravity, (0.0, -9.81, 0.0))


@pytest.mark.parametrize("name", ["posiiton", "radius", "mas"])
def test_a_name_that_particles_do_not_have(name: str) -> None:
    scene, *_ = pair()
    world = sy.World(scene)
    with pytest.raises(AttributeError, match=name):
        setattr(world.particles, name, 1.0)


def test_writing_into_a_parameter_is_refused_or_works() -> None:
    """Parameters are assigned; what looks like a write into them must not be lost in silence."""
    scene, a, _ = pair()
    spring = scene.add(sy.AnchoredSpring(a, ORIGIN, 1.0, 1.0))
    world = sy.World(scene, worlds=2)
    for view, index in (
        (world.gravity, 1),
        (world.particles.damping, 0),
        (world.particles.mass, 0),
        (world.particles.inverse_mass, 0),
        (world.particles.acceleration, (0, 0, 1)),
        (world[spring].anchor, 0),
    ):
        with pytest.raises(ValueError, match="read-only"):
            view[index] = 0.5


# What user-written functions return


@pytest.mark.parametrize(
    "given", [None, "a", 0.0, np.zeros(3), np.zeros((1, 3, 3)), np.zeros((4, 3, 1))], ids=repr
)
def test_forces_of_the_wrong_shape(given: Any) -> None:
    world, _ = held(lambda a, b, c: sy.UserForce(lambda x, v, t: given))
    with refused("UserForce", "shape", "(4, 3, 3)", "(worlds, particles, 3)"):
        world.step()


@pytest.mark.parametrize(
    "given", [np.zeros((4, 1)), np.zeros(3), np.zeros((4, 4)), "a", None], ids=repr
)
def test_an_energy_of_the_wrong_shape(given: Any) -> None:
    world, _ = held(lambda a, b, c: sy.UserForce(no_force, energy=lambda x: given))
    with refused("UserForce", "energy", "(4,)"):
        _ = world.energy


@pytest.mark.parametrize(
    "given",
    [
        None,
        np.zeros((4, 1, 3)),
        (np.zeros((4, 1, 3)), np.zeros(4)),
        (np.zeros((4, 3)), np.zeros((4, 1))),
        (np.zeros((1, 3)), 0.0),
        3,
    ],
    ids=lambda given: str(type(given).__name__),
)
def test_contacts_of_the_wrong_shape(given: Any) -> None:
    world, _ = held(lambda a, b, c: sy.ContactGenerator(lambda x, y, t: given, [(a, b)]))
    with refused("ContactGenerator", "(4, 1, 3)", "(4, 1)", "(worlds, pairs)"):
        world.step()


def test_a_contact_normal_that_is_no_unit_vector() -> None:
    def touch(x: Any, y: Any, t: Any) -> Any:
        return np.broadcast_to([7.0, 0.0, 0.0], x.shape), np.full(x.shape[:2], 0.1)

    world, _ = held(lambda a, b, c: sy.ContactGenerator(touch, [(a, None)]))
    with refused("ContactGenerator", "normal", "7", "unit"):
        world.step()
