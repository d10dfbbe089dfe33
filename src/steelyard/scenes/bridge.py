"""The suspended bridge."""

from __future__ import annotations

import numpy as np

from ..scene.links import Cable, CableConstraint, Rod
from ..scene.particle import Particle
from ..scene.rider import Rider
from ..scene.scene import Scene
from .loads import bilinear_weights

SUPPORT_LENGTHS = (3.0, 3.5, 4.0, 4.0, 3.5, 3.0)


def bridge_weights(x: np.ndarray | float, z: np.ndarray | float, *, planks: int = 6) -> np.ndarray:
    """Shares of all nodes of a bridge in a load's weight.

    Args:
        x: place along the bridge in planks, in [0, planks - 1], any shape.
        z: place across it, in [0, 1], the same shape.
        planks: number of node pairs.

    Returns:
        Weights of shape (..., 2 planks); at most four are not 0.
    """
    x = np.clip(np.asarray(x, dtype=np.float64), 0.0, planks - 1.0)
    cell = np.minimum(x.astype(int), planks - 2)
    shares = bilinear_weights(x - cell, np.asarray(z, dtype=np.float64) + 0.0 * x)
    weights = np.zeros((*x.shape, 2 * planks))
    nodes = 2 * cell[..., None] + np.arange(4)
    np.put_along_axis(weights, nodes, shares, axis=-1)
    return weights


def bridge(
    *,
    planks: int = 6,
    load: float = 0.0,
    place: tuple[float, float] = (0.0, 0.5),
    damping: float = 0.9,
    winches: bool = False,
) -> Scene:
    """Node pairs 2 m apart, joined across by rods and along by cables, hung from cables to fixed points.

    Particles are the nodes, pair by pair (z = -1, then z = 1), then the load. Links are added in the order
    cables along, support cables, rods across.

    Args:
        planks: number of node pairs, at least 2; supports beyond six repeat the pattern's middle.
        load: mass of a rider [kg]; 0 for none.
        place: where it starts: along in planks, across in [0, 1].
        damping: share of velocity that particles keep per second.
        winches: whether the support cables have a rate that control sets.

    Raises:
        ValueError: fewer than two planks.
    """
    if planks < 2:
        raise ValueError(
            f"bridge: planks is {planks!r}; a deck needs at least 2. Use 6 for the demo."
        )
    scene = Scene()
    middle = 0.5 * (planks - 1)
    nodes = [
        scene.add(Particle(position=(2.0 * (k - middle), 4.0, z), damping=damping))
        for k in range(planks)
        for z in (-1.0, 1.0)
    ]
    for k in range(2 * planks - 2):
        scene.add(Cable(nodes[k], nodes[k + 2], 1.9, restitution=0.3))
    for k, node in enumerate(nodes):
        pair = k // 2
        from_end = min(pair, planks - 1 - pair)
        length = SUPPORT_LENGTHS[min(from_end, 2)]
        anchor = (2.2 * (pair - middle), 6.0, 0.8 * (-1.0 if k % 2 == 0 else 1.0))
        scene.add(CableConstraint(node, anchor, length, restitution=0.5, winch=winches))
    for k in range(planks):
        scene.add(Rod(nodes[2 * k], nodes[2 * k + 1], 2.0))
    if load > 0.0:
        weights = bridge_weights(*place, planks=planks)
        position = weights @ np.array([node.position for node in nodes])
        rider = scene.add(Particle(position=position, mass=load, damping=damping))
        scene.add(Rider(rider, nodes, weights))
    return scene
