"""Rigid clusters: particles that rods hold at fixed places to one another, solved as one frame.

A cluster of n particles has six degrees of freedom, and its 3n - 6 or more rods need no rows of their own. It
starts from three particles joined by three rods and takes in whatever three more rods join to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.forces import StiffSpring
from ..scene.rider import Rider
from . import sparsity
from .parameters import PARTICLES
from .tape import ARMS, INVERSE, LOAD_ROWS

if TYPE_CHECKING:
    from .compile import Compiler

#: A triangle of rods saves too few rows.
_LEAST = 4
#: Narrowest triangle, as a share of the square of its longest side, that can carry a frame.
_NARROW = 1e-6


def find_clusters(pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Disjoint rigid clusters of at least four points in a graph of rods, each sorted."""
    around: dict[int, set[int]] = {}
    for a, b in pairs:
        around.setdefault(a, set()).add(b)
        around.setdefault(b, set()).add(a)
    free = set(around)
    clusters = []
    for first, second in sorted(pairs):
        if not {first, second} <= free:
            continue
        for third in sorted(around[first] & around[second] & free):
            members = {first, second, third}
            while True:
                joined = [p for p in sorted(free - members) if len(around[p] & members) >= 3]
                if not joined:
                    break
                members.add(joined[0])
            if len(members) >= _LEAST:
                clusters.append(sorted(members))
                free -= members
                break
    return clusters


def widest_triangle(points: np.ndarray) -> tuple[int, int, int] | None:
    """The three points that span most, or None if all lie on a line."""
    best, widest = None, 0.0
    for a, b, c in combinations(range(len(points)), 3):
        area = float(np.linalg.norm(np.cross(points[b] - points[a], points[c] - points[a])))
        if area > widest:
            best, widest = (a, b, c), area
    extent = float(np.ptp(points, axis=0).max())
    return best if widest > _NARROW * extent * extent else None


def _shape(start: np.ndarray, ends: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Positions (worlds, n, 3) nearest to ``start`` (n, 3) with the lengths (rods, worlds), by Newton's method."""
    worlds = lengths.shape[1]
    x = np.repeat(start[None], worlds, axis=0)
    a, b = ends.T
    rods = np.arange(len(ends))
    scale = lengths.max()
    for _ in range(50):
        apart = x[:, a] - x[:, b]
        miss = 0.5 * ((apart**2).sum(axis=2) - lengths.T**2)
        if np.abs(miss).max() <= 4e-15 * scale * scale:
            return x
        rows = np.zeros((worlds, len(ends), *start.shape))
        rows[:, rods, a] += apart
        rows[:, rods, b] -= apart
        rows = rows.reshape(worlds, len(ends), -1)
        x -= (np.linalg.pinv(rows, rcond=1e-12) @ miss[..., None]).reshape(x.shape)
    if np.abs(miss).max() <= 1e-12 * scale * scale:
        return x
    worst = int(np.abs(miss).max(axis=0).argmax())
    raise ValueError(
        f"World: rods that make particles one rigid frame cannot all have their lengths; that of "
        f"{lengths[worst].max():.6g} m is missed by {np.abs(miss[:, worst]).max() / scale:.2g} m. Take the lengths "
        "from positions (leave them out) or change them together."
    )


def rigid_frame(
    start: np.ndarray,
    ends: np.ndarray,
    corners: tuple[int, int, int],
    inverse_mass: np.ndarray,
    *lengths: np.ndarray,
) -> np.ndarray:
    """What the kernels need of a cluster, in the frame of the triangle ``corners`` about its centre of mass.

    Args:
        start: (n, 3) positions in the scene.
        ends: (rods, 2) particles of the rods that settle the shape.
        corners: particles whose triangle carries the frame.
        inverse_mass: (n + k,) or (n + k, worlds) of the particles and of the loads on them [1/kg].
        lengths: of each rod, (1,) or (1, worlds) [m].

    Returns:
        (4n + k + 8,) or (4n + k + 8, worlds): places (n, 3), masses (n), masses of loads (k), mass of all, its inverse,
        inertia without the loads (6, lower half row by row).

    Raises:
        ValueError: the lengths cannot be met together.
    """
    count = len(start)
    widths = [np.shape(value)[1] for value in (inverse_mass, *lengths) if np.ndim(value) > 1]
    worlds = max(widths, default=1)
    mass = 1.0 / np.broadcast_to(
        inverse_mass.reshape(len(inverse_mass), -1).T, (worlds, len(inverse_mass))
    )
    length = np.concatenate(
        [np.broadcast_to(value.reshape(1, -1), (1, worlds)) for value in lengths]
    )
    if all(value.ndim == 1 for value in lengths):
        length = length[:, :1]
    x = np.broadcast_to(_shape(start, ends, length), (worlds, count, 3))
    own = mass[:, :count]
    x = x - (np.einsum("wp,wpi->wi", own, x) / own.sum(axis=1)[:, None])[:, None]
    a, b, c = corners
    first = x[:, b] - x[:, a]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    third = np.cross(first, x[:, c] - x[:, a])
    third /= np.linalg.norm(third, axis=1, keepdims=True)
    x = x @ np.stack([first, np.cross(third, first), third], axis=2)
    square = np.einsum("wp,wpi,wpj->wij", own, x, x)
    inertia = np.einsum("wii->w", square)[:, None, None] * np.eye(3) - square
    total = mass.sum(axis=1)[:, None]
    low = np.tril_indices(3)
    parts = [x.reshape(worlds, -1), mass, total, 1.0 / total, inertia[:, low[0], low[1]]]
    rows = np.concatenate(parts, axis=1).T
    return rows if widths else rows[:, 0]


class Clusters:
    """The rigid clusters of a scene: who belongs to which, and their records on the tape."""

    def __init__(self, compiler: Compiler) -> None:
        self.c = compiler
        self.members: list[list[int]] = []
        #: Cluster of particles and of loads on them.
        self.of: dict[int, int] = {}
        #: First row of the arm of each of them.
        self.arms: dict[int, int] = {}
        #: Row of the inverse mass and first row of the inverse inertia of each cluster.
        self.inverses: list[tuple[int, int]] = []
        self.riders: list[list[Rider]] = []
        self._rods: list[list[tuple[Any, list[int]]]] = []
        self._corners: list[tuple[int, int, int]] = []

    def find(self, rods: Sequence[Any], pairs: Sequence[tuple[int, int]]) -> list[int]:
        """Find the clusters among rods between points ``pairs``; the indices of the rods inside them.

        Particles that are immovable or on a stiff spring, whose own flow moves them, stay apart.
        """
        c = self.c
        sprung = {id(spring.particle) for spring in c.scene.of(StiffSpring)}
        free = {k for k, p in enumerate(c.particles) if p.movable and id(p) not in sprung}
        joining = [k for k, pair in enumerate(pairs) if free >= set(pair)]
        inside: list[int] = []
        for members in find_clusters([pairs[k] for k in joining]):
            points = self._points(members)
            corners = widest_triangle(points)
            if corners is None:
                continue
            place = {p: k for k, p in enumerate(members)}
            own = [k for k in joining if place.keys() >= set(pairs[k])]
            ends = [(place[pairs[k][0]], place[pairs[k][1]]) for k in own]
            kept = sparsity.independent_rods(points, ends, np.ones(len(points)))
            self.of |= dict.fromkeys(members, len(self.members))
            self.members.append(members)
            self._corners.append(corners)
            self._rods.append([(rods[own[k]], list(ends[k])) for k in kept])
            inside += own
        self._find_riders(free)
        return inside

    def _find_riders(self, free: set[int]) -> None:
        """Riders whose deck lies in one cluster and whose load nothing else holds there."""
        c = self.c
        self.riders = [[] for _ in self.members]
        for rider in c.riders:
            load = c.of(rider.particle)
            decks = {self.of.get(c.of(p)) for p in rider.deck}
            if load in free and load not in self.of and len(decks) == 1:
                (cluster,) = decks
                if cluster is not None and all(
                    c.of(p) in self.members[cluster] for p in rider.deck
                ):
                    self.riders[cluster].append(rider)
                    self.of[load] = cluster

    def _points(self, members: list[int]) -> np.ndarray:
        return np.array([self.c.particles[p].position for p in members])

    def build(self) -> None:
        """Write the records."""
        records: list[int] = []
        for cluster in range(len(self.members)):
            records += self._record(cluster)
        self.c.sections["clusters"] = records
        self.c.counts["clusters"] = len(self.members)

    def _record(self, cluster: int) -> list[int]:
        c = self.c
        members, rods, riders = self.members[cluster], self._rods[cluster], self.riders[cluster]
        corners = self._corners[cluster]
        count = len(members)
        points = self._points(members)
        ends = np.array([pair for _, pair in rods])
        moved = members + [c.of(rider.particle) for rider in riders]
        keys = [(PARTICLES, "inverse_mass")] + [(rod, "length") for rod, _ in rods]

        def frame(inverse_mass: np.ndarray, *lengths: np.ndarray) -> np.ndarray:
            return rigid_frame(points, ends, corners, inverse_mass[moved], *lengths)

        given = c.slot(4 * count + len(riders) + 8, tuple(keys), frame)
        total = given + 4 * count + len(riders)
        work = c.take(ARMS + 3 * count)
        self.arms |= {p: work + ARMS + 3 * k for k, p in enumerate(members)}
        self.inverses.append((total + 1, work + INVERSE))
        entries = [
            [3 * p, work + ARMS + 3 * k, given + 3 * count + k, -1] for k, p in enumerate(members)
        ]
        loads: list[int] = []
        for k, rider in enumerate(riders):
            load, own = c.of(rider.particle), c.take(LOAD_ROWS)
            loads += [
                c.held[id(rider)], c.place(rider, "weights"), c.place(rider, "rates"), own,
                len(rider.deck), *(self.arms[c.of(p)] for p in rider.deck),
            ]  # fmt: skip
            self.arms[load] = own
            entries.append([3 * load, own, given + 4 * count + k, own])
        touched = self._touched()
        entries.sort(key=lambda entry: entry[0] // 3 not in touched)
        return [
            count, len(riders), sum(entry[0] // 3 in touched for entry in entries), given,
            given + 4 * count, total, total + 2, work, *(3 * members[k] for k in corners),
            *(word for entry in entries for word in entry), *loads,
        ]  # fmt: skip

    def _touched(self) -> set[int]:
        """Particles that rows of the matrix act on."""
        c = self.c
        ends = [p for _, a, b, _ in c.contacts for p in (a, b)]
        ends += [p for thing in (*c.links, *c.riders) for p in c.scene.touched(thing)]
        return {c.of(p) for p in ends if p is not None}
