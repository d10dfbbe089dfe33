"""A scene refuses bad input, with the value, the limit and the remedy in the message."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from steelyard.scene.scene import CONTACTS, FORCES, LINKS
from tests.engine.refusals import ORIGIN, no_contact, no_force, pair, refused, things

NAN, INF = math.nan, math.inf


# Numbers

A = sy.Particle(position=(0, 0, 0))
B = sy.Particle(position=(1, 0, 0))


# Per kind: a builder, and for every numeric argument the finite values that are out of its limits.
NUMBERS: dict[type, tuple[Callable[..., Any], dict[str, list[float]]]] = {
    sy.Particle: (
        lambda **k: sy.Particle(**({"position": ORIGIN} | k)),
        {
            "mass": [0.0, -1.0],
            "inverse_mass": [-1.0],
            "damping": [0.0, -0.5, 1.1],
            "radius": [-0.1],
        },
    ),
    sy.Rod: (lambda **k: sy.Rod(A, B, **k), {"length": [0.0, -1.0]}),
    sy.RodConstraint: (lambda **k: sy.RodConstraint(A, (0, 1, 0), **k), {"length": [0.0, -1.0]}),
    sy.Cable: (
        lambda **k: sy.Cable(A, B, **({"max_length": 1.0} | k)),
        {"max_length": [0.0, -1.0], "restitution": [-0.1, 1.1]},
    ),
    sy.CableConstraint: (
        lambda **k: sy.CableConstraint(A, ORIGIN, **({"max_length": 1.0} | k)),
        {"max_length": [0.0, -1.0], "restitution": [-0.1, 1.1]},
    ),
    sy.Ground: (
        lambda **k: sy.Ground(**k),
        {"height": [], "restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    sy.LinePlatform: (
        lambda **k: sy.LinePlatform(start=ORIGIN, end=(1, 0, 0), **({"radius": 0.1} | k)),
        {"radius": [-0.1], "restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    sy.Collisions: (
        lambda **k: sy.Collisions(**k),
        {"restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    sy.ContactGenerator: (
        lambda **k: sy.ContactGenerator(no_contact, [(A, B)], **k),
        {"restitution": [-0.1, 1.1], "friction": [-0.1]},
    ),
    sy.Drag: (lambda **k: sy.Drag(**k), {"linear": [-1.0], "quadratic": [-1.0]}),
    sy.Spring: (
        lambda **k: sy.Spring(A, B, **({"stiffness": 1.0, "rest_length": 1.0} | k)),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    sy.Bungee: (
        lambda **k: sy.Bungee(A, B, **({"stiffness": 1.0, "rest_length": 1.0} | k)),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    sy.AnchoredSpring: (
        lambda **k: sy.AnchoredSpring(A, ORIGIN, **({"stiffness": 1.0, "rest_length": 1.0} | k)),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    sy.AnchoredBungee: (
        lambda **k: sy.AnchoredBungee(A, ORIGIN, **({"stiffness": 1.0, "rest_length": 1.0} | k)),
        {"stiffness": [0.0, -5.0], "rest_length": [-1.0]},
    ),
    sy.StiffSpring: (
        lambda **k: sy.StiffSpring(A, ORIGIN, **({"stiffness": 1.0} | k)),
        {"stiffness": [0.0, -5.0], "damping": [-1.0]},
    ),
    sy.Buoyancy: (
        lambda **k: sy.Buoyancy(A, **({"surface": 0.0, "half_depth": 1.0, "volume": 1.0} | k)),
        {
            "surface": [],
            "half_depth": [0.0, -1.0],
            "volume": [0.0, -1.0],
            "density": [0.0, -1.0],
            "gravity": [0.0, -9.81],
        },
    ),
}
VECTORS: dict[str, tuple[Callable[..., Any], list[str]]] = {
    "Scene": (sy.Scene, ["gravity"]),
    "Particle": (NUMBERS[sy.Particle][0], ["position", "velocity", "acceleration"]),
    "Ground": (sy.Ground, ["normal"]),
    "LinePlatform": (
        lambda **k: sy.LinePlatform(**({"start": ORIGIN, "end": (1, 0, 0), "radius": 0.1} | k)),
        ["start", "end"],
    ),
    "Gravity": (sy.Gravity, ["acceleration"]),
    "Drag": (sy.Drag, ["wind"]),
    "RodConstraint": (lambda **k: sy.RodConstraint(A, **k), ["anchor"]),
    "CableConstraint": (lambda **k: sy.CableConstraint(A, max_length=1.0, **k), ["anchor"]),
    "AnchoredSpring": (
        lambda **k: sy.AnchoredSpring(A, stiffness=1.0, rest_length=0.0, **k),
        ["anchor"],
    ),
    "AnchoredBungee": (
        lambda **k: sy.AnchoredBungee(A, stiffness=1.0, rest_length=0.0, **k),
        ["anchor"],
    ),
    "StiffSpring": (lambda **k: sy.StiffSpring(A, stiffness=1.0, **k), ["anchor"]),
}


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (kind, name, value)
        for kind, (_, names) in NUMBERS.items()
        for name, bad in names.items()
        for value in [*bad, NAN, INF, -INF, "x", (1.0, 2.0)]
    ],
    ids=str,
)
def test_a_number_out_of_its_limits(kind: type, name: str, value: Any) -> None:
    with refused(kind.__name__, name, repr(value), "must be", kind=ValueError):
        NUMBERS[kind][0](**{name: value})


@pytest.mark.parametrize(
    ("owner", "name"), [(owner, name) for owner, (_, names) in VECTORS.items() for name in names]
)
@pytest.mark.parametrize(
    "value", [(0.0, NAN, 0.0), (0.0, INF, 0.0), (1.0, 2.0), 1.0, "up", np.zeros((1, 3))], ids=str
)
def test_a_vector_that_is_not_three_finite_numbers(owner: str, name: str, value: Any) -> None:
    with refused(owner, name, repr(value), "three finite numbers", kind=ValueError):
        VECTORS[owner][0](**{name: value})


@pytest.mark.parametrize("mass", [{"mass": 1e-320}, {"inverse_mass": 1e-320}], ids=str)
def test_a_mass_whose_inverse_overflows(mass: dict[str, float]) -> None:
    with refused("Particle", "1e-320"):
        sy.Particle(position=ORIGIN, **mass)


def test_what_a_particle_cannot_be() -> None:
    with refused("mass (1.0)", "inverse_mass (1.0)", "at most one"):
        sy.Particle(position=ORIGIN, mass=1.0, inverse_mass=1.0)
    with refused("velocity", "(1.0, 0.0, 0.0)", "inverse_mass"):
        sy.Particle(position=ORIGIN, velocity=(1, 0, 0), inverse_mass=0.0)


def test_degenerate_shapes() -> None:
    with refused("Ground", "normal", "0.0"):
        sy.Ground(normal=(0, 0, 0))
    with refused("LinePlatform", "distance from start to end", "0.0"):
        sy.LinePlatform(start=(1, 1, 1), end=(1, 1, 1), radius=0.1)
    for kind in (sy.Rod, sy.Cable, sy.Spring, sy.Bungee):
        settings = {} if kind is sy.Rod else {"max_length": 1.0}
        if kind in (sy.Spring, sy.Bungee):
            settings = {"stiffness": 1.0, "rest_length": 1.0}
        with refused(kind.__name__, "same particle", "needs two"):
            kind(A, A, **settings)
    coincident = sy.Particle(position=ORIGIN)
    with refused("Rod", "length", "0.0", "greater than 0"):
        sy.Rod(A, coincident)


def test_a_bar_and_a_particle_without_thickness_can_never_touch() -> None:
    scene, *_ = pair()
    with refused("LinePlatform", "radius", "0"):
        scene.add(sy.LinePlatform(start=ORIGIN, end=(1, 0, 0)))
        sy.World(scene)


# Riders, functions, pairs


@pytest.mark.parametrize(
    ("deck", "weights", "words"),
    [
        ([], None, ["deck", "0 particles"]),
        ([A, A], None, ["deck", "2 particles", "each once"]),
        ([B], None, ["not the load itself"]),
        ([A], [0.5], ["weights", "0.5", "sum 1"]),
        ([A], [0.5, 0.5], ["weights", "one per deck particle"]),
        ([A], [NAN], ["weights", "nan"]),
        ([A], ["x"], ["weights", "x"]),
        (A, None, ["deck"]),
        ([None], None, ["deck", "None"]),
    ],
)
def test_a_rider_that_nothing_carries(deck: Any, weights: Any, words: list[str]) -> None:
    with refused("Rider", *words):
        sy.Rider(B, deck, weights)


def test_a_rider_that_is_no_load() -> None:
    with refused("Rider", "inverse_mass", "0"):
        sy.Rider(sy.Particle(position=ORIGIN, inverse_mass=0.0), [A])
    with refused("Rider", "None"):
        sy.Rider(None, [A])


@pytest.mark.parametrize("function", [3, None, "f", np.zeros(3)])
def test_a_function_that_cannot_be_called(function: Any) -> None:
    with refused("UserForce", "function", repr(function), "callable"):
        sy.UserForce(function)
    with refused("ContactGenerator", "function", repr(function), "callable"):
        sy.ContactGenerator(function, [(A, B)])


def test_an_energy_that_cannot_be_called() -> None:
    with refused("UserForce", "energy", "3"):
        sy.UserForce(no_force, energy=3)


@pytest.mark.parametrize(
    "pairs", [[], [A, B], 5, [(A, A)], [(None, A)], [(A, B, A)], [(A,)]], ids=lambda p: str(p)[:20]
)
def test_pairs_that_are_no_pairs(pairs: Any) -> None:
    with refused("ContactGenerator", "pair"):
        sy.ContactGenerator(no_contact, pairs)


# What belongs to a scene


def test_every_kind_of_thing_is_tried() -> None:
    kinds = {type(thing) for thing in things(A, B)}
    assert kinds == {*LINKS, *CONTACTS, *FORCES, sy.Rider}


@pytest.mark.parametrize(
    "k", range(len(things(A, B))), ids=lambda k: type(things(A, B)[k]).__name__
)
def test_a_thing_with_a_particle_of_another_scene(k: int) -> None:
    _, foreign, _ = pair()
    scene, _, own = pair()
    with refused(type(things(A, B)[k]).__name__, str(foreign.position), "same scene"):
        scene.add(things(foreign, own)[k])
    assert len(scene.things) == 2
    world = sy.World(scene)
    with refused("same scene"):
        world.add(things(foreign, own)[k])
    assert len(world.scene.things) == 2


# The second particle is the one that may be missing.
ENDS: list[Callable[..., Any]] = [
    lambda a, x: sy.Rod(a, x, 1.0),
    lambda a, x: sy.Rod(a, x),
    lambda a, x: sy.RodConstraint(x, ORIGIN, 1.0),
    lambda a, x: sy.Cable(a, x, 1.0),
    lambda a, x: sy.CableConstraint(x, ORIGIN, 1.0),
    lambda a, x: sy.Spring(a, x, 1.0, 1.0),
    lambda a, x: sy.StiffSpring(x, ORIGIN, 1.0),
    lambda a, x: sy.AnchoredSpring(x, ORIGIN, 1.0, 1.0),
    lambda a, x: sy.Buoyancy(x, 0.0, 1.0, 1.0),
    lambda a, x: sy.Gravity((0, 1, 0), particles=[x]),
    lambda a, x: sy.Ground(particles=[x]),
]


@pytest.mark.parametrize("other", [None, "b", 3], ids=str)
@pytest.mark.parametrize("build", ENDS, ids=lambda build: type(build(A, B)).__name__)
def test_an_end_that_is_no_particle(build: Callable[..., Any], other: Any) -> None:
    scene, a, _ = pair()
    with refused(repr(other)):
        scene.add(build(a, other))


CHOOSING: list[Callable[..., Any]] = [
    lambda some: sy.Gravity((0, 1, 0), particles=some),
    lambda some: sy.Drag(linear=1.0, particles=some),
    lambda some: sy.UserForce(no_force, particles=some),
    lambda some: sy.Explosion(place=ORIGIN, particles=some),
    lambda some: sy.Ground(particles=some),
    lambda some: sy.Collisions(particles=some),
    lambda some: sy.LinePlatform(start=ORIGIN, end=(1, 0, 0), radius=0.1, particles=some),
]


@pytest.mark.parametrize("build", CHOOSING, ids=lambda build: type(build(None)).__name__)
def test_particles_that_are_no_list_of_particles(build: Callable[..., Any]) -> None:
    scene, a, _ = pair()
    with refused("particles"):
        scene.add(build(a))


@pytest.mark.parametrize("build", CHOOSING, ids=lambda build: type(build(None)).__name__)
def test_a_particle_chosen_twice(build: Callable[..., Any]) -> None:
    scene, a, _ = pair()
    with refused(type(build(None)).__name__, "particles"):
        scene.add(build([a, a]))


@pytest.mark.parametrize("thing", [None, 3, sy.Particle, "ground"], ids=str)
def test_a_scene_holds_only_its_kinds(thing: Any) -> None:
    scene, *_ = pair()
    with refused("Scene.add", repr(thing), "Particle", "Rod", kind=TypeError):
        scene.add(thing)


def test_a_thing_is_in_a_scene_once() -> None:
    scene, a, _ = pair()
    with refused("Particle", "already"):
        scene.add(a)
    spring = scene.add(sy.StiffSpring(a, ORIGIN, 1.0))
    with refused("StiffSpring", "already"):
        scene.add(spring)
    with refused("StiffSpring", str(a.position), "1 per particle", "AnchoredSpring"):
        scene.add(sy.StiffSpring(a, (1, 1, 1), 1.0))


def test_removal_of_what_is_not_there_or_still_needed() -> None:
    scene, a, b = pair()
    scene.add(sy.Rod(a, b))
    with refused("Rod", "particle", "remove"):
        scene.remove(a)
    with refused("Gravity", "not in the scene"):
        scene.remove(sy.Gravity((0, 1, 0)))
    world = sy.World(scene)
    with refused("Rod", "remove"):
        world.remove(a)
    assert len(world.scene.things) == 3
    world.step()


def test_a_world_keeps_a_particle() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=ORIGIN))
    with refused("0 particles", "at least 1"):
        sy.World(sy.Scene())
    world = sy.World(scene)
    with refused("0 particles", "at least 1"):
        world.remove(a)
    world.step()
    assert world.particles.position.shape == (1, 1, 3)
