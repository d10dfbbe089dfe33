"""The sparse matrix of implicit methods, M - r D - r^2 K, settled once when a scene is compiled.

D and K are the derivatives of the forces by velocity and position. Blocks are the movable particles, coupled by the
springs between them; their order (minimum fill), fill and index tapes are those of the direct solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..scene.forces import Buoyancy
from . import sparsity
from .elimination import add_elimination
from .parameters import PARTICLES

if TYPE_CHECKING:
    from .compile import Compiler

_YY = 2


class Stiffness:
    """Rows and tapes of the matrix of implicit methods."""

    def __init__(self, compiler: Compiler) -> None:
        self.c = compiler
        #: Particle of each block.
        self.particles = [p for p, x in enumerate(compiler.particles) if x.movable]
        self.block = {p: k for k, p in enumerate(self.particles)}
        self.count = self.structural = len(self.particles)
        #: First rows of diagonal blocks, by position in the order, and of couplings, by two of them.
        self.diagonal: dict[int, int] = {}
        self.a: dict[tuple[int, int], int] = {}

    def build(self) -> None:
        """Fill the compiler's sections."""
        self._order()
        self._rows()
        add_elimination(self)
        self._unknowns()
        self._springs()
        self._diagonals()
        self.c.model.blocks = self.count

    def _order(self) -> None:
        adjacency: list[set[int]] = [set() for _ in self.particles]
        for a, b in self.c.spring_ends:
            if a is not None and b is not None:
                adjacency[self.block[a]].add(self.block[b])
                adjacency[self.block[b]].add(self.block[a])
        self.order = sparsity.minimum_fill(adjacency)
        self.pattern = sparsity.fill(adjacency, self.order)
        self.place = {block: position for position, block in enumerate(self.order)}

    def _rows(self) -> None:
        c = self.c
        pairs = [(row, column) for row in range(self.count) for column in self.pattern[row]]
        size = 6 * self.count + 9 * len(pairs)
        matrix = c.header["matrix"] = c.take(size)
        c.header["matrix_rows"] = size
        self.diagonal = {position: matrix + 6 * position for position in range(self.count)}
        base = matrix + 6 * self.count
        self.a = {pair: base + 9 * k for k, pair in enumerate(pairs)}
        self.p = {pair: c.take(9) for pair in pairs}
        self.inverse = {position: c.take(6) for position in range(self.count)}
        # Pivots need be no more than positive: the matrix is positive definite, however stiff its springs.
        self.reference = dict.fromkeys(range(self.count), c.zero)
        c.header["right"] = c.take(3 * self.count)
        self._constants()

    def _constants(self) -> None:
        """Rows that no unknown has, masses, and how far the method reaches."""
        c = self.c
        self.spare = c.take(9)
        c.header["reach"] = c.constant(c.method.integrator.reach * c.method.substep)
        c.header["mass"] = c.slot(
            len(c.particles),
            ((PARTICLES, "inverse_mass"),),
            lambda inverse: np.where(
                inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), 0.0
            ),
        )

    def _diagonal(self, particle: int | None) -> int:
        if particle is None:
            return self.spare
        return self.diagonal[self.place[self.block[particle]]]

    def _unknowns(self) -> None:
        c = self.c
        c.sections["unknowns"] = [
            word
            for k, p in enumerate(self.particles)
            for word in (3 * p, p, self._right(k), self._diagonal(p))
        ]

    def _right(self, block: int) -> int:
        """First row of a block's right side."""
        return self.c.header["right"] + 3 * block

    def _springs(self) -> None:
        """Per spring: the blocks of its ends and of their coupling, and the lowest stiffness across that counts."""
        c = self.c
        ends = [tuple(self.block[p] for p in some if p is not None) for some in c.spring_ends]
        records: list[int] = []
        square = (c.method.integrator.reach * c.method.dt) ** 2
        for (a, b), row in zip(c.spring_ends, self._limits(ends, square), strict=True):
            records += [self._diagonal(a), self._diagonal(b), self._coupling(a, b), row]
        c.sections["spring_blocks"] = records

    def _limits(self, ends: Sequence[Sequence[int]], square: float = 1.0) -> list[int]:
        """Rows of -m/(4 s square) for every spring or link, m and s the mass and the number of them at one of its ends.

        The lesser counts, so that all together take half of every mass at most.
        """
        c = self.c
        touching = np.zeros(self.count)
        for some in ends:
            touching[list(some)] += 4.0 * square
        rows = []
        for some in ends:

            def limit(inverse: np.ndarray, some: Sequence[int] = some) -> np.ndarray:
                loads = [touching[k] * inverse[self.particles[k]] for k in some]
                return -1.0 / np.max(loads, axis=0, keepdims=True) if loads else np.zeros(1)

            rows.append(c.slot(1, ((PARTICLES, "inverse_mass"),), limit))
        return rows

    def _coupling(self, a: int | None, b: int | None) -> int:
        if a is None or b is None:
            return self.spare
        i, j = self.place[self.block[a]], self.place[self.block[b]]
        return self.a[max(i, j), min(i, j)]

    def _diagonals(self) -> None:
        """Blocks of drags and entries of floats."""
        c = self.c
        velocity = c.header["velocity"]
        widths = c.widths
        drags = c.sections["drags"]
        starts = range(0, len(drags), widths["drags"])
        c.sections["drag_blocks"] = [self._diagonal((drags[k] - velocity) // 3) for k in starts]
        floats: list[int] = []
        for thing in c.scene.of(Buoyancy):
            movable = c.of(thing.particle) if thing.particle.movable else None
            floats.append(self._diagonal(movable) + _YY)
        c.sections["float_blocks"] = floats
