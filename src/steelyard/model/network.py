"""The direct solver's sparse matrix, settled when a scene is compiled: blocks, order, fill and index tapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.links import RodConstraint
from . import sparsity
from .clusters import Clusters
from .elimination import add_contact_system, add_elimination, lower
from .tape import CONTACT, LINK

if TYPE_CHECKING:
    from .compile import Compiler

_DIAGONAL = (0, 2, 5)

# A movable particle of a block row: index, row of its coefficient, row of its inverse mass.
Node = tuple[int, int, int]


class Network:
    """Blocks of a scene's constraints and the tapes that assemble, factorise and solve them."""

    def __init__(self, compiler: Compiler) -> None:
        self.c = compiler
        self.link_blocks: list[list[int]] = []
        self.clusters = Clusters(compiler)

    def build(self) -> None:
        """Fill the compiler's sections of the direct solver."""
        self._blocks()
        self._rows()
        self._assembly()
        self._masks()
        add_elimination(self)
        add_contact_system(self)
        self.c.model.blocks = self.count

    # Blocks and rows

    def _ends(self, link: int) -> list[tuple[int, int, int]]:
        """Movable ends of a link: (particle, inverse mass row, sign of d there)."""
        thing = self.c.links[link]
        first = getattr(thing, "a", None) or thing.particle
        ends = [(first, 1), (getattr(thing, "b", None), -1)]
        return [
            (self.c.of(p), self.c.header["inverse_mass"] + self.c.of(p), sign)
            for p, sign in ends
            if p is not None and p.movable
        ]

    def choose(self) -> list[Any]:
        """Links with a row of their own: cables, and rods that others or a rigid cluster do not imply.

        Riders that a cluster carries are taken from the compiler's list.
        """
        c = self.c
        points = [p.position for p in c.particles]
        masses = [float(p.inverse_mass or 0.0) for p in c.particles]
        rods: list[Any] = []
        pairs: list[tuple[int, int]] = []
        for link in c.links:
            if c.is_cable(link):
                continue
            if isinstance(link, RodConstraint):
                pair = (c.of(link.particle), len(points))
                points.append(link.anchor)
                masses.append(0.0)
            else:
                pair = (c.of(link.a), c.of(link.b))
            if masses[pair[0]] + masses[pair[1]] > 0.0:
                rods.append(link)
                pairs.append(pair)
        inside = self.clusters.find(rods, pairs)
        independent = sparsity.independent_rods(
            np.array(points), pairs, np.array(masses), first=inside
        )
        own = {id(rods[k]) for k in set(independent) - set(inside)}
        carried = {id(rider) for riders in self.clusters.riders for rider in riders}
        c.riders = [rider for rider in c.riders if id(rider) not in carried]
        c.model.dropped = [rod for rod in rods if id(rod) not in own]
        return [link for link in c.links if c.is_cable(link) or id(link) in own]

    def _node(self, p: int) -> int:
        """Blocks that share a node couple: a particle is one, or its whole cluster."""
        of = self.clusters.of
        return -1 - of[p] if p in of else p

    def _blocks(self) -> None:
        """Group links, number blocks and settle the elimination order; contacts come last."""
        c = self.c
        self.clusters.build()
        ends = [
            frozenset(self._node(p) for p, _, _ in self._ends(link)) for link in range(len(c.links))
        ]
        self.link_blocks = sparsity.group(ends)
        nodes = [
            frozenset(self._node(p) for link in block for p, _, _ in self._ends(link))
            for block in self.link_blocks
        ]
        #: Particles of riders' and contacts' blocks: (index, row of the coefficient, row of the inverse mass).
        self.points: dict[int, list[Node]] = {}
        self.frames: dict[int, int] = {}
        identity = c.slot(9, (), lambda: np.eye(3).ravel()) if c.riders else -1
        at = 0
        records = c.sections["riders"]
        for rider in c.riders:
            block = len(nodes)
            deck = [p for p in rider.deck]
            held = records[at + 9]
            self.points[block] = self._nodes(
                [(rider.particle, c.one)] + [(p, held + k) for k, p in enumerate(deck)]
            )
            self.frames[block] = identity
            records[at + 4] = 3 * block
            nodes.append(frozenset(self._node(p) for p, _, _ in self.points[block]))
            at += 10 + 4 * len(deck)
        self.structural = len(nodes)
        for k, (_, a, b, _) in enumerate(c.contacts):
            block = len(nodes)
            pairs = [(a, c.one)] + ([(b, c.minus_one)] if b is not None else [])
            self.points[block] = self._nodes(pairs)
            record = c.sections["contacts"]
            self.frames[block] = record[CONTACT * k + 16]
            record[CONTACT * k + 19] = 3 * block
            record[CONTACT * k + 20] = block
            nodes.append(frozenset(self._node(p) for p, _, _ in self.points[block]))
        self.count = len(nodes)
        adjacency = sparsity.neighbours(nodes)
        links = len(self.link_blocks)
        self.order = (
            sparsity.minimum_degree(adjacency, 0, links)
            + sparsity.minimum_degree(adjacency, links, self.structural)
            + sparsity.minimum_degree(adjacency, self.structural, self.count)
        )
        self.pattern = sparsity.fill(adjacency, self.order)
        for block, members in enumerate(self.link_blocks):
            for row, link in enumerate(members):
                c.sections["links"][LINK * link + 15] = 3 * block + row

    def _nodes(self, pairs: list) -> list[Node]:
        c = self.c
        return [
            (c.of(p), coefficient, c.header["inverse_mass"] + c.of(p))
            for p, coefficient in pairs
            if p.movable
        ]

    def _rows(self) -> None:
        """Scratch rows of the matrix, its factor and the solution."""
        c = self.c
        pairs = [(row, column) for row in range(self.count) for column in self.pattern[row]]
        size = 6 * self.count + 9 * len(pairs)
        matrix = c.take(size)
        c.header["matrix"] = matrix
        c.header["matrix_rows"] = size
        self.diagonal = {position: matrix + 6 * position for position in range(self.count)}
        base = matrix + 6 * self.count
        self.a = {pair: base + 9 * k for k, pair in enumerate(pairs)}
        self.inverse = {position: c.take(6) for position in range(self.structural)}
        self.p = {pair: c.take(9) for pair in pairs if pair[1] < self.structural}
        self.reference = {position: c.take(3) for position in range(self.count)}
        for name in ("right", "guess", "mask", "used_mask", "total"):
            c.header[name] = c.take(3 * self.count)
        self.place = {block: position for position, block in enumerate(self.order)}

    # Assembly

    def _assembly(self) -> None:
        c = self.c
        diagonals: list[int] = []
        couplings: list[int] = []
        touching: dict[int, list[tuple[int, int, int]]] = {}
        for block, members in enumerate(self.link_blocks):
            for row, link in enumerate(members):
                record = c.sections["links"][LINK * link : LINK * link + LINK]
                target = self.diagonal[self.place[block]] + _DIAGONAL[row]
                masses = [c.zero, c.zero]
                for p, mass, sign in self._ends(link):
                    if p in self.clusters.of:
                        continue
                    masses[0 if sign > 0 else 1] = mass
                    touching.setdefault(p, []).append((3 * block + row, record[13], sign))
                diagonals += [target, record[13], *masses]
        for p, around in touching.items():
            mass = c.header["inverse_mass"] + p
            for k, (slot, d, sign) in enumerate(around):
                for other, e, opposite in around[:k]:
                    target, _ = self._entry(slot, other)
                    one = c.one if sign == opposite else c.minus_one
                    couplings += [target, d, e, mass, one]
        point_diagonals: list[int] = []
        point_links: list[int] = []
        point_points: list[int] = []
        for block, nodes in self.points.items():
            row = self.place[block]
            for p, coefficient, mass in nodes:
                if p in self.clusters.of:
                    continue
                point_diagonals += [self.diagonal[row], coefficient, mass]
                for slot, d, sign in touching.get(p, []):
                    target = self.a[row, self.place[slot // 3]] + slot % 3
                    one = c.minus_one if sign > 0 else c.one
                    point_links += [target, self.frames[block], coefficient, mass, one, d]
                for other, others in self.points.items():
                    column = self.place[other]
                    if column < row:
                        for q, coefficient_q, _ in others:
                            if q == p:
                                target = self.a[row, column]
                                frames = [self.frames[block], self.frames[other]]
                                point_points += [target, *frames, coefficient, coefficient_q, mass]
        c.sections["link_diagonals"] = diagonals
        c.sections["link_couplings"] = couplings
        c.sections["point_diagonals"] = point_diagonals
        c.sections["point_links"] = point_links
        c.sections["point_points"] = point_points
        c.widths |= {
            "link_diagonals": 4, "link_couplings": 5, "point_diagonals": 3, "point_links": 6,
            "point_points": 6, "wrench_products": 6, "link_masks": 3, "padding": 2, "references": 2,
            "contact_copies": 5,
        }  # fmt: skip
        self._wrenches()

    def _wrenches(self) -> None:
        """What each block does to each cluster it touches, and the couplings that follow.

        Record of a wrench: forces and moments of the block's three rows (18 rows), the motion they cause (18 rows),
        inverse mass, inverse inertia, block, frame or -1; with a frame then a count of (coefficient, arm), without
        a count of (row of the block, gradient, sign, arm).
        """
        c = self.c
        clusters = self.clusters
        ends: dict[tuple[int, int], list[list[int]]] = {}
        for block, members in enumerate(self.link_blocks):
            for row, link in enumerate(members):
                d = c.sections["links"][LINK * link + 13]
                for p, _, sign in self._ends(link):
                    if p in clusters.of:
                        cluster = clusters.of[p]
                        # A link's impulse is minus its multiplier times the gradient.
                        one = c.minus_one if sign > 0 else c.one
                        ends.setdefault((block, cluster), []).append(
                            [row, d, one, clusters.arms[p]]
                        )
        for block, nodes in self.points.items():
            for p, coefficient, _ in nodes:
                if p in clusters.of:
                    ends.setdefault((block, clusters.of[p]), []).append(
                        [coefficient, clusters.arms[p]]
                    )
        records: list[int] = []
        rows: dict[tuple[int, int], int] = {}
        for (block, cluster), entries in ends.items():
            rows[block, cluster] = c.take(36)
            wrench = rows[block, cluster]
            frame = self.frames.get(block, -1)
            records += [wrench, *clusters.inverses[cluster], block, frame, len(entries)]
            for entry in entries:
                records += entry
        products: list[int] = []
        for (block, cluster), wrench in rows.items():
            i = self.place[block]
            for (other, same), motion in rows.items():
                j = self.place[other]
                if same == cluster and j <= i:
                    target = self.diagonal[i] if i == j else self.a[i, j]
                    products += [target, int(i == j), wrench, motion + 18, block, other]
        c.sections["wrenches"] = records
        c.counts["wrenches"] = len(ends)
        c.sections["wrench_products"] = products

    def _entry(self, slot: int, other: int) -> tuple[int, bool]:
        """Matrix row of the entry of two link rows, and whether it lies on a diagonal block."""
        i, j = self.place[slot // 3], self.place[other // 3]
        r, s = slot % 3, other % 3
        if i == j:
            return self.diagonal[i] + lower(max(r, s), min(r, s)), True
        if i < j:
            i, j, r, s = j, i, s, r
        return self.a[i, j] + 3 * r + s, False

    def _masks(self) -> None:
        """Entries to clear for slack cables, and the ones on the diagonal of rows out of use."""
        c = self.c
        mask = c.header["mask"]
        cables = {
            3 * block + row
            for block, members in enumerate(self.link_blocks)
            for row, link in enumerate(members)
            if c.is_cable(c.links[link])
        }
        masks: list[int] = []
        padding: list[int] = []
        references: list[int] = []
        for position, block in enumerate(self.order):
            diagonal = self.diagonal[position]
            size = len(self.link_blocks[block]) if block < len(self.link_blocks) else 3
            for row in range(3):
                slot = 3 * block + row
                references += [self.reference[position] + row, diagonal + _DIAGONAL[row]]
                if row >= size:
                    padding += [diagonal + _DIAGONAL[row], c.zero]
                elif slot in cables:
                    padding += [diagonal + _DIAGONAL[row], mask + slot]
                for column in range(row):
                    if {slot, 3 * block + column} & cables:
                        masks += [
                            diagonal + lower(row, column),
                            mask + slot,
                            mask + 3 * block + column,
                        ]
            for column_position in self.pattern[position]:
                other = self.order[column_position]
                entry = self.a[position, column_position]
                for row in range(3):
                    for column in range(3):
                        slots = (3 * block + row, 3 * other + column)
                        if set(slots) & cables:
                            rows = [mask + slot if slot in cables else c.one for slot in slots]
                            masks += [entry + 3 * row + column, *rows]
        c.sections["link_masks"] = masks
        c.sections["padding"] = padding
        c.sections["references"] = references
