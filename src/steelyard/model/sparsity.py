"""Sparsity of the constraint matrix J M^-1 J^T, settled once per scene.

Rows come in *blocks of three*: three links that share particles, the three components of a rider, the
normal and two tangents of a contact. Blocks are what is ordered, filled and eliminated, because a 3 x 3
update does nine multiply-adds for each pair of loaded rows, where a scalar one does one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def group(links: Sequence[frozenset[int]]) -> list[list[int]]:
    """Group links into blocks of at most three that share particles.

    Args:
        links: the movable particles (one or two) of each link.

    Returns:
        Blocks of link indices. Each block grows from the first link left by the link that brings in the
        fewest new particles, so that blocks couple to few others.
    """
    left = list(range(len(links)))
    blocks = []
    while left:
        block = [left.pop(0)]
        nodes = set(links[block[0]])
        while len(block) < 3:
            near = [link for link in left if links[link] & nodes]
            if not near:
                break
            best = min(near, key=lambda link: (len(links[link] - nodes), link))
            left.remove(best)
            block.append(best)
            nodes |= links[best]
        blocks.append(block)
    return blocks


def neighbours(nodes: Sequence[frozenset[int]]) -> list[set[int]]:
    """Blocks that share a particle with each block."""
    touching: dict[int, set[int]] = {}
    for block, members in enumerate(nodes):
        for node in members:
            touching.setdefault(node, set()).add(block)
    return [
        set().union(*(touching[node] for node in members)) - {block}
        for block, members in enumerate(nodes)
    ]


def minimum_degree(adjacency: Sequence[Iterable[int]], first: int, last: int) -> list[int]:
    """Elimination order of blocks ``first`` ... ``last - 1``: always one with the fewest neighbours left.

    Source: Tinney & Walker (1967), scheme 2; ties go to the lowest index.
    """
    graph = {
        block: {other for other in adjacency[block] if first <= other < last}
        for block in range(first, last)
    }
    order = []
    while graph:
        block = min(graph, key=lambda key: (len(graph[key]), key))
        around = graph.pop(block)
        for other in around:
            graph[other] |= around
            graph[other] -= {other, block}
        order.append(block)
    return order


def minimum_degree_after(
    adjacency: Sequence[Iterable[int]], widths: Sequence[int], after: Sequence[Iterable[int]]
) -> list[int]:
    """Minimum degree over blocks of different widths, each after all blocks that it must come ``after``.

    The degree is what it costs: the widths of the neighbours left, summed; ties go to the lowest index.
    """
    graph = {block: set(around) for block, around in enumerate(adjacency)}
    order = []
    while graph:
        free = (block for block in graph if graph.keys().isdisjoint(after[block]))
        block = min(free, key=lambda key: (sum(widths[k] for k in graph[key]), key))
        around = graph.pop(block)
        for other in around:
            graph[other] |= around
            graph[other] -= {other, block}
        order.append(block)
    return order


def minimum_fill(adjacency: Sequence[Iterable[int]]) -> list[int]:
    """Elimination order of all blocks: always one whose neighbours lack fewest couplings among themselves.

    Source: Tinney & Walker (1967), scheme 3; ties go to the fewest neighbours, then to the lowest index. On a cloth
    of 20 x 20 it leaves a fifth less to do than the minimum degree, and takes longer to find.
    """
    graph = {block: set(around) for block, around in enumerate(adjacency)}

    def rank(block: int) -> tuple[int, int, int]:
        around = graph[block]
        return sum(len(around - graph[other]) - 1 for other in around), len(around), block

    ranks = {block: rank(block) for block in graph}
    order = []
    while graph:
        block = min(ranks.values())[2]
        around = graph.pop(block)
        del ranks[block]
        for other in around:
            graph[other] |= around
            graph[other] -= {other, block}
        for other in around.union(*(graph[other] for other in around)):
            ranks[other] = rank(other)
        order.append(block)
    return order


def fill(adjacency: Sequence[Iterable[int]], order: Sequence[int]) -> list[list[int]]:
    """Pattern of the factor: for each position of the order, the earlier positions it couples to."""
    place = {block: position for position, block in enumerate(order)}
    later = [{place[other] for other in adjacency[block]} for block in order]
    pattern: list[list[int]] = [[] for _ in order]
    for position in range(len(order)):
        after = sorted(other for other in later[position] if other > position)
        for other in after:
            pattern[other].append(position)
            later[other] |= set(after) - {other}
    return pattern


def _independent(
    rows: np.ndarray, kept: list[int], limit: float, among: Sequence[int] | None = None
) -> list[int]:
    """Extend ``kept`` by rows (``among`` some) independent of it, largest remainder first (pivoted Gram-Schmidt)."""
    rest = rows.copy()
    size = np.maximum((rows**2).sum(axis=1), 1e-300)

    def drop(row: int) -> None:
        direction = rest[row] / np.linalg.norm(rest[row])
        rest[:] -= np.outer(rest @ direction, direction)

    for row in kept:
        drop(row)
    kept = list(kept)
    while len(kept) < len(rows):
        left = (rest**2).sum(axis=1) / size
        left[kept] = 0.0
        if among is not None:
            left[np.setdiff1d(np.arange(len(rows)), among)] = 0.0
        row = int(left.argmax())
        if left[row] < limit:
            break
        kept.append(row)
        drop(row)
    return kept


def independent_rods(
    positions: np.ndarray,
    ends: Sequence[tuple[int, int]],
    inverse_mass: np.ndarray,
    first: Sequence[int] = (),
) -> list[int]:
    """Rods that suffice: the others are implied by them in every configuration.

    A rod is redundant when its row of J M^-1/2 depends on the others at *generic* positions; rank there
    is never below the rank anywhere (generic rigidity), so nothing needed is dropped. Rows independent in
    the start configuration are kept first.

    Args:
        positions: (points, 3) start positions [m]; anchors after particles.
        ends: the two points of each rod.
        inverse_mass: (points,) [1/kg], 0 for anchors.
        first: rods that are taken before any other.
    """
    if not ends:
        return []
    rng = np.random.default_rng(0)
    weight = np.sqrt(inverse_mass)

    def rows(points: np.ndarray) -> np.ndarray:
        jacobian = np.zeros((len(ends), len(points), 3))
        for row, (a, b) in enumerate(ends):
            direction = points[a] - points[b]
            jacobian[row, a] += weight[a] * direction
            jacobian[row, b] -= weight[b] * direction
        return jacobian.reshape(len(ends), -1)

    scale = max(float(np.ptp(positions, axis=0).max()), 1.0)
    generic = rows(positions + rng.uniform(-scale, scale, positions.shape))
    kept = _independent(rows(positions), [], 1e-9, among=first)
    kept = _independent(generic, kept, 1e-9, among=first)
    kept = _independent(rows(positions), kept, 1e-9)
    return sorted(_independent(generic, kept, 1e-9))
