"""Volumes, inertias and centres of mass, against sums over fine grids and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from steelyard.scene.shapes import mass_properties, rotation_matrix


def inside(shape: Any, x: np.ndarray) -> np.ndarray:
    """Which points (n, 3) a shape holds."""
    if isinstance(shape, sy.Sphere):
        return np.linalg.norm(x, axis=1) < shape.radius
    if isinstance(shape, sy.Box):
        return (np.abs(x) < np.array(shape.half_size)).all(axis=1)
    if isinstance(shape, sy.Capsule):
        nearest = np.zeros_like(x)
        nearest[:, 1] = np.clip(x[:, 1], -shape.half_length, shape.half_length)
        return np.linalg.norm(x - nearest, axis=1) < shape.radius
    return inside(shape.outer, x) & ~inside(shape.inner, x)


SHAPES = [
    sy.Sphere(0.7),
    sy.Box((0.3, 0.8, 0.5)),
    sy.Capsule(0.3, 0.6),
    sy.Hollow(sy.Sphere(0.9), sy.Sphere(0.6)),
    sy.Hollow(sy.Box((0.9, 0.5, 0.4)), sy.Box((0.9, 0.3, 0.2))),
    sy.Hollow(sy.Capsule(0.4, 0.5), sy.Capsule(0.3, 0.5)),
]


@pytest.mark.parametrize("shape", SHAPES, ids=repr)
def test_volume_and_moments_are_those_of_a_fine_grid(shape: Any) -> None:
    cells = 120
    edge = (np.arange(cells) + 0.5) / cells * 2.0 - 1.0
    x = np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3)
    chosen = x[inside(shape, x)]
    cell = (2.0 / cells) ** 3
    assert shape.volume == pytest.approx(cell * len(chosen), rel=0.02)
    squares = (chosen**2).sum(axis=0)
    np.testing.assert_allclose(shape.moments, cell * (squares.sum() - squares), rtol=0.03)


def test_a_box_in_two_halves_is_the_box() -> None:
    whole = sy.Part(shape=sy.Box((1.0, 0.5, 0.25)), density=700.0)
    halves = [
        sy.Part(shape=sy.Box((0.5, 0.5, 0.25)), offset=(x, 0.0, 0.0), density=700.0)
        for x in (-0.5, 0.5)
    ]
    mass, centre, inertia = mass_properties([whole])
    twice, middle, sums = mass_properties(halves)
    assert twice == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(middle, centre, atol=1e-15)
    np.testing.assert_allclose(sums, inertia, rtol=1e-13, atol=1e-10)


def test_a_turned_part_has_a_turned_inertia() -> None:
    angle = math.pi / 2.0
    turn = (math.cos(angle / 2.0), 0.0, 0.0, math.sin(angle / 2.0))
    part = sy.Part(shape=sy.Box((1.0, 0.5, 0.25)), orientation=turn)
    straight = sy.Part(shape=sy.Box((0.5, 1.0, 0.25)))
    np.testing.assert_allclose(part.inertia, straight.inertia, rtol=1e-13, atol=1e-9)


def test_a_body_is_moved_to_its_centre_of_mass() -> None:
    parts = [
        sy.Part(shape=sy.Sphere(0.1), offset=(1.0, 0.0, 0.0), density=3000.0),
        sy.Part(shape=sy.Sphere(0.1), offset=(-1.0, 2.0, 0.0), density=1000.0),
    ]
    body = sy.Body(position=(0.0, 5.0, 0.0), parts=parts)
    np.testing.assert_allclose(body.origin, (0.5, 0.5, 0.0))
    np.testing.assert_allclose(
        [part.offset for part in body.parts], [(0.5, -0.5, 0), (-1.5, 1.5, 0)]
    )
    assert body.mass == pytest.approx(4000.0 * sy.Sphere(0.1).volume)


def test_a_mass_beside_parts_scales_their_inertia() -> None:
    free = sy.Body(position=(0, 0, 0), parts=sy.Box((1.0, 2.0, 3.0)))
    light = sy.Body(position=(0, 0, 0), parts=sy.Box((1.0, 2.0, 3.0)), mass=6.0)
    # A box of 6 kg: m (b^2 + c^2)/3 with half edges; the lineage's .3 for 1/3 would give .9 of it.
    np.testing.assert_allclose(np.diag(light.inertia), [26.0, 20.0, 10.0])
    np.testing.assert_allclose(light.inertia * free.mass / 6.0, free.inertia)


def test_rotation_matrices_turn_as_quaternions_say() -> None:
    half = math.radians(45.0)
    about_z = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    np.testing.assert_allclose(rotation_matrix(about_z) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    many = np.random.default_rng(0).standard_normal((20, 4))
    many /= np.linalg.norm(many, axis=1, keepdims=True)
    turns = rotation_matrix(many)
    np.testing.assert_allclose(
        turns @ np.swapaxes(turns, 1, 2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)


BAD: dict[str, tuple[Any, type[Exception], str]] = {
    "radius 0": (lambda: sy.Sphere(0.0), ValueError, "Sphere: radius is 0.0; it must be .*metres"),
    "flat box": (lambda: sy.Box((1, 0, 1)), ValueError, "Box: half_size is 0.0"),
    "nan": (lambda: sy.Capsule(math.nan, 1.0), ValueError, "Capsule: radius is nan"),
    "density": (lambda: sy.Part(shape=sy.Sphere(1.0), density=-1.0), ValueError, "Part: density is -1"),
    "no shape": (lambda: sy.Part(shape="box"), TypeError, "Part: shape is 'box'; it must be one of"),
    "no turn": (
        lambda: sy.Part(shape=sy.Sphere(1.0), orientation=(0, 0, 0, 0)),
        ValueError,
        r"orientation is \(0, 0, 0, 0\).*Use \(1, 0, 0, 0\)",
    ),
    "inner of another kind": (
        lambda: sy.Hollow(sy.Sphere(1.0), sy.Box((0.1, 0.1, 0.1))),
        ValueError,
        "of the kind of",
    ),
    "inner as large": (lambda: sy.Hollow(sy.Sphere(1.0), sy.Sphere(1.0)), ValueError, "smaller"),
    "hollow of hollow": (
        lambda: sy.Hollow(sy.Hollow(sy.Sphere(1.0), sy.Sphere(0.5)), sy.Sphere(0.1)),
        TypeError,
        "outer is Hollow",
    ),
    "neither parts nor inertia": (lambda: sy.Body(position=(0, 0, 0)), ValueError, "how it turns"),
    "mass 0": (
        lambda: sy.Body(position=(0, 0, 0), mass=0.0, inertia=(1, 1, 1)),
        ValueError,
        "mass is 0.0.*inverse_mass=0",
    ),
    "no body's inertia": (
        lambda: sy.Body(position=(0, 0, 0), inertia=(1, 1, 3)),
        ValueError,
        "each at most the sum of the others",
    ),
    "skew inertia": (
        lambda: sy.Body(position=(0, 0, 0), inertia=[[1, 1, 0], [0, 1, 0], [0, 0, 1]]),
        ValueError,
        "symmetric",
    ),
    "immovable that moves": (
        lambda: sy.Body(position=(0, 0, 0), inverse_mass=0.0, angular_velocity=(0, 1, 0)),
        ValueError,
        "must have velocity 0",
    ),
    "part of inverse mass": (
        lambda: sy.Body(position=(0, 0, 0), inverse_mass=0.5),
        ValueError,
        "inverse_mass must be 0",
    ),
    "parts of what": (lambda: sy.Body(position=(0, 0, 0), parts=3), TypeError, "parts is 3"),
    "damping": (
        lambda: sy.Body(position=(0, 0, 0), parts=sy.Sphere(1.0), angular_damping=0.0),
        ValueError,
        "angular_damping is 0.0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_body_is_refused(name: str) -> None:
    build, error, words = BAD[name]
    with pytest.raises(error, match=words):
        build()
