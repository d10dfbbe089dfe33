"""The saddle-point matrix of motion and links, settled once when a scene is compiled.

    [M - r D - r^2 K + geometric stiffness   J^T]
    [J                                       0  ]

Unknowns are the movable particles, three each (two in a planar scene), links, one each, and riders, as particles. The
order is that of the fewest neighbours left, with one rule: a link or rider comes after all of its particles. What is
eliminated by then holds whole rows of J, so no pivot can vanish unless the links themselves depend on each other; after
but one of its particles is cheaper by 2/7 and meets a pivot of zero in a straight chain.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np

from ..scene.links import CableConstraint, RodConstraint
from ..solvers.saddle import solve_saddle
from . import sparsity
from .elimination import lower
from .stiffness import Stiffness
from .tape import LINK, SADDLE_LINK

# Rows of a pair of scalars: of the entry, which elimination makes u = l d, and of l.
Pair = tuple[int, int]


class Saddle(Stiffness):
    """Rows and tapes of the matrix of motion and links."""

    def choose(self) -> list[Any]:
        """Cables, and rods that others do not imply, each with at least one movable end."""
        c = self.c
        points = [p.position for p in c.particles]
        masses = [float(p.inverse_mass or 0.0) for p in c.particles]
        rods: list[Any] = []
        ends: list[tuple[int, int]] = []
        for link in c.links:
            if not c.is_cable(link) and self._movable(link):
                second = getattr(link, "b", None)
                if second is None:
                    points.append(link.anchor)
                    masses.append(0.0)
                first = link.particle if second is None else link.a
                ends.append((c.of(first), len(points) - 1 if second is None else c.of(second)))
                rods.append(link)
        kept = sparsity.independent_rods(np.array(points), ends, np.array(masses))
        own = {id(rods[k]) for k in kept}
        c.model.dropped = [rod for rod in rods if id(rod) not in own]
        return [
            link
            for link in c.links
            if id(link) in own or (c.is_cable(link) and self._movable(link))
        ]

    def build(self) -> None:
        """Fill the compiler's sections."""
        self._order()
        self._rows()
        self._elimination()
        self._unknowns()
        self._springs()
        self._diagonals()
        self._links()
        self._riders()
        self.c.header["saddle_solve"] = solve_saddle.address(planar=self.c.scene.planar)

    def _movable(self, thing: Any) -> list[int]:
        """Blocks of the movable particles of a link or rider, a before b."""
        if hasattr(thing, "deck"):
            some = [thing.particle, *thing.deck]
        elif isinstance(thing, RodConstraint | CableConstraint):
            some = [thing.particle]
        else:
            some = [thing.a, thing.b]
        return [self.block[self.c.of(p)] for p in some if p.movable]

    def _order(self) -> None:
        c = self.c
        held = [*c.links, *c.riders]
        members = [set(self._movable(thing)) for thing in held]
        axes = c.scene.axes
        self.width = [axes] * self.count + [1] * len(c.links) + [axes] * len(c.riders)
        adjacency: list[set[int]] = [set() for _ in self.width]

        def couple(some: Iterable[int]) -> None:
            for block in some:
                adjacency[block] |= set(some) - {block}

        for a, b in c.spring_ends:
            if a is not None and b is not None:
                couple((self.block[a], self.block[b]))
        for k, some in enumerate(members):
            block = self.count + k
            if k < len(c.links):
                couple((*some, block))
            else:
                for particle in some:
                    couple((particle, block))
        after = [set[int]()] * self.count + members
        self.order = sparsity.minimum_degree_after(adjacency, self.width, after)
        self.pattern = sparsity.fill(adjacency, self.order)
        self.place = {block: position for position, block in enumerate(self.order)}

    def _rows(self) -> None:
        """Rows of the matrix, of its factor and of the right sides, which stand in the order of elimination."""
        c = self.c
        self.entry: dict[Pair, Pair] = {}
        self.inverse_of: dict[int, int] = {}
        self.pivot: dict[int, int] = {}
        self.first: dict[int, int] = {}
        first = 0
        for position, block in enumerate(self.order):
            self.first[position] = first
            first += self.width[block]
        self.size = first
        matrix = c.next_row
        sprung = self._sprung()
        for position, block in enumerate(self.order):
            width = self.width[block]
            own = c.take(6 if width > 1 else 1)
            self.diagonal[position] = own
            for row in range(width):
                i = self.first[position] + row
                self.pivot[i] = own + lower(row, row)
                for column in range(row):
                    self.entry[i, i - row + column] = (own + lower(row, column), -1)
            for other in self.pattern[position]:
                if (position, other) in sprung:
                    self.a[position, other] = c.take(9)
                    for row, column in product(range(width), repeat=2):
                        i, j = self.first[position] + row, self.first[other] + column
                        self.entry[i, j] = (self.a[position, other] + 3 * row + column, -1)
            for row in range(width):
                i = self.first[position] + row
                for j in self._columns(position):
                    if (i, j) not in self.entry:
                        self.entry[i, j] = (c.take(1), -1)
        c.header["matrix"] = matrix
        c.header["matrix_rows"] = c.next_row - matrix
        for i, j in sorted(self.entry):
            self.entry[i, j] = (self.entry[i, j][0], c.take(1))
        self.inverse_of = {i: c.take(1) for i in range(self.size)}
        c.header["right"] = c.take(self.size)
        self._constants()

    def _sprung(self) -> set[Pair]:
        """Pairs of positions whose couplings springs add to, and need as nine rows."""
        pairs = set()
        for a, b in self.c.spring_ends:
            if a is not None and b is not None:
                i, j = self.place[self.block[a]], self.place[self.block[b]]
                pairs.add((max(i, j), min(i, j)))
        return pairs

    def _columns(self, position: int) -> list[int]:
        """Scalars of the earlier blocks that a block couples to."""
        return [
            self.first[other] + k
            for other in self.pattern[position]
            for k in range(self.width[self.order[other]])
        ]

    def _elimination(self) -> None:
        """Tapes of the factor and of both substitutions."""
        c = self.c
        right = c.header["right"]
        factor: list[int] = []
        forward: list[int] = []
        columns: dict[int, list[int]] = {}
        for position, block in enumerate(self.order):
            earlier = self._columns(position)
            for row in range(self.width[block]):
                i = self.first[position] + row
                columns[i] = earlier + [self.first[position] + k for k in range(row)]
                factor.append(len(columns[i]))
                for j in columns[i]:
                    shared = sorted(set(columns[i]) & set(columns[j]))
                    products = [(self.entry[i, k][0], self.entry[j, k][1]) for k in shared]
                    factor += [*self.entry[i, j], self.inverse_of[j], *_runs(products)]
                products = [self.entry[i, k] for k in columns[i]]
                constraint = int(block >= self.count)
                factor += [self.pivot[i], self.inverse_of[i], constraint, *_runs(products)]
                products = [(self.entry[i, k][1], right + k) for k in columns[i]]
                forward += [right + i, *_runs(products)]
        backward: list[int] = []
        later: dict[int, list[int]] = {i: [] for i in range(self.size)}
        for i, some in columns.items():
            for j in some:
                later[j].append(i)
        for j in reversed(range(self.size)):
            products = [(self.entry[i, j][1], right + i) for i in later[j]]
            backward += [right + j, self.inverse_of[j], *_runs(products)]
        c.sections |= {"factor": factor, "forward": forward, "backward": backward}
        c.counts |= dict.fromkeys(("factor", "forward", "backward"), self.size)

    def _right(self, block: int) -> int:
        return self.c.header["right"] + self.first[self.place[block]]

    def _row(self, block: int, particle: int) -> int:
        """First entry of a link's row at one of its particles."""
        i, j = self.first[self.place[block]], self.first[self.place[particle]]
        return self.entry[i, j][0]

    def _links(self) -> None:
        """Per link: right side, diagonal, entries at a and b, diagonals of a and b, entries of their coupling, least
        stiffness that counts.
        """
        c = self.c
        limits = self._limits([self._movable(link) for link in c.links], 2.0)
        mask = c.take(len(c.links))
        records: list[int] = []
        for k, link in enumerate(c.links):
            block = self.count + k
            c.sections["links"][LINK * k + 15] = mask + k
            ends = [getattr(link, "a", None) or link.particle, getattr(link, "b", None)]
            some = [self.block[c.of(p)] if p is not None and p.movable else -1 for p in ends]
            rows = [-1 if p < 0 else self._row(block, p) for p in some]
            diagonals = [self.spare if p < 0 else self.diagonal[self.place[p]] for p in some]
            couplings = [self.spare] * 3
            if min(some) >= 0:
                i, j = sorted((self.first[self.place[p]] for p in some), reverse=True)
                for axis in range(c.scene.axes):
                    couplings[axis] = self.entry[i + axis, j + axis][0]
            diagonal = self.diagonal[self.place[block]]
            records += [self._right(block), diagonal, *rows, *diagonals, *couplings, limits[k]]
        c.sections["saddle_links"] = records
        c.widths["saddle_links"] = SADDLE_LINK

    def _riders(self) -> None:
        """Per rider: right side, then per particle, load first, where its entries lie (-1: immovable)."""
        c = self.c
        records: list[int] = []
        for k, rider in enumerate(c.riders):
            block = self.count + len(c.links) + k
            records.append(self._right(block))
            i = self.first[self.place[block]]
            for p in (rider.particle, *rider.deck):
                rows = [-1] * 3
                if p.movable:
                    j = self.first[self.place[self.block[c.of(p)]]]
                    for axis in range(c.scene.axes):
                        rows[axis] = self.entry[i + axis, j + axis][0]
                records += rows
        c.sections["saddle_riders"] = records
        c.counts["saddle_riders"] = len(c.riders)


def _runs(products: list[Pair]) -> list[int]:
    """Count of runs, then runs (first, first, length) of products whose rows stand next to each other."""
    runs: list[list[int]] = []
    for (left, right), before in zip(products, [None, *products], strict=False):
        if before == (left - 1, right - 1):
            runs[-1][2] += 1
        else:
            runs.append([left, right, 1])
    return [len(runs), *(word for run in runs for word in run)]
