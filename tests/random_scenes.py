"""Hypothesis strategies: scenes of random topology whose state satisfies their links."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Literal

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from tests.reference_solver import Array, DenseScene, Link, link_jacobian, project_velocity

# Singular values of the scaled Jacobian lie on one side of this gap or the other: near a singular
# posture a scene has no accurate answer to compare with.
INDEPENDENT = 0.05
DEPENDENT = 1e-10

Edges = list[tuple[int, int]]


@st.composite
def random_scene(draw: st.DrawFn, *, with_cables: bool = True) -> DenseScene:
    """A scene of 2 to 7 particles whose rods may be redundant and whose cables may be slack.

    The links form a chain, a tree, a strip of triangles, or a complete graph of rods on 4 to 6
    particles (redundant from 5 upwards); anchored links, further cables and immovable particles
    come on top. Lengths fit the positions, and the velocities stretch no taut link. Every cable's
    force is determined: a cable that would share its load with redundant links is left out.

    Args:
        draw: Given by Hypothesis.
        with_cables: Whether some links may be cables; otherwise all are rods.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    shape = draw(st.sampled_from(["chain", "tree", "triangles", "complete"]), label="shape")
    position, edges = draw(_topology(rng, shape))
    count = len(position)
    particle = st.integers(0, count - 1)
    immovable = draw(st.sets(particle, max_size=min(2, count - 1)), label="immovable")
    inverse_mass = 1.0 / rng.uniform(0.2, 5.0, count)
    inverse_mass[list(immovable)] = 0.0
    movable = inverse_mass > 0.0

    kind = st.sampled_from(["rod", "cable"]) if with_cables else st.just("rod")
    ends: list[tuple[str, int, int | tuple[float, float, float]]] = [
        ("rod" if shape == "complete" else draw(kind), a, b) for a, b in edges
    ]
    for a in draw(st.lists(particle, max_size=2), label="anchored"):
        x, y, z = (position[a] + rng.uniform(0.5, 1.5) * _direction(rng)).tolist()
        ends.append((draw(kind), a, (x, y, z)))
    if with_cables:
        further = draw(st.lists(st.tuples(particle, particle), max_size=2), label="further cables")
        ends += [("cable", a, b) for a, b in further if a != b]

    gravity = draw(st.sampled_from([0.0, -9.81]), label="gravity")
    bare = DenseScene(
        position=position,
        velocity=np.zeros((count, 3)),
        inverse_mass=inverse_mass,
        acceleration=np.tile([0.0, gravity, 0.0], (count, 1)),
        damping=draw(st.sampled_from([1.0, 0.9, 0.3]), label="damping"),
    )
    free = [end for end in ends if movable[end[1]] or (isinstance(end[2], int) and movable[end[2]])]
    scene = replace(
        bare, links=tuple(_link(bare, "rod", a, b, 1.0) for name, a, b in free if name == "rod")
    )
    assume(well_posed(scene))
    taut = []
    for name, a, b in free:
        if name == "cable":
            slack = draw(st.sampled_from([1.0, 1.001, 1.2]), label="slack")
            trial = replace(scene, links=(*scene.links, _link(bare, "cable", a, b, slack)))
            rank = _rank(trial)
            if rank is not None and rank > (_rank(scene) or 0):
                if slack == 1.0:
                    taut.append(len(scene.links))
                scene = trial
    speed = draw(st.sampled_from([0.0, 0.3, 1.0]), label="speed")
    wanted = np.where(movable[:, None], speed * rng.standard_normal((count, 3)), 0.0)
    return replace(scene, velocity=project_velocity(scene, wanted, cables=taut)[0])


def well_posed(scene: DenseScene) -> bool:
    """Whether the scene is away from singular postures, into which a mechanism may also move."""
    return _rank(scene) is not None


@st.composite
def _topology(draw: st.DrawFn, rng: np.random.Generator, shape: str) -> tuple[Array, Edges]:
    """Positions [m], shape (particles, 3), and the pairs of particles to link."""
    if shape == "complete":
        count = draw(st.integers(4, 6), label="particles")
        return rng.uniform(-1.5, 1.5, (count, 3)), list(combinations(range(count), 2))
    count = draw(st.integers(2, 7), label="particles")
    position = np.zeros((count, 3))
    edges = []
    for child in range(1, count):
        parent = draw(st.integers(0, child - 1)) if shape == "tree" else child - 1
        position[child] = position[parent] + rng.uniform(0.6, 1.4) * _direction(rng)
        edges.append((child, parent))
    if shape == "triangles":
        edges += [(child, child - 2) for child in range(2, count)]
    return position, edges


def _link(
    scene: DenseScene,
    kind: Literal["rod", "cable"],
    a: int,
    b: int | tuple[float, float, float],
    slack: float,
) -> Link:
    """A link whose length is `slack` times the distance between its ends."""
    end = scene.position[b] if isinstance(b, int) else b
    return Link(kind, a, b, slack * float(np.linalg.norm(scene.position[a] - end)))


def _rank(scene: DenseScene) -> int | None:
    """Number of independent links; None near a singular posture."""
    spread = np.sqrt(np.repeat(scene.inverse_mass, 3))
    rows = link_jacobian(scene, scene.position) * spread
    norm = np.linalg.norm(rows, axis=1, keepdims=True)
    values = np.linalg.svd(rows / norm, compute_uv=False)
    if ((values > DEPENDENT) & (values < INDEPENDENT)).any():
        return None
    return int((values >= INDEPENDENT).sum())


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.standard_normal(3)
    return direction / np.linalg.norm(direction)
