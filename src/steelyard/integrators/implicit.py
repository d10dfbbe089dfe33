"""The matrix of implicit methods, S = M - r D - r^2 K: assembled at the state at hand, factorised, solved.

D and K are the derivatives of the forces by velocity and position. A spring of stiffness k, length l and rest length
l0 has K = -(k n n^T + t (1 - n n^T)), t = k (1 - l0/l). A compressed one buckles: t < 0, which is kept above -m/(4 s
r^2), s the number of springs at an end of mass m. So S > M/2 always, and K is exact where the step is short enough.
A slack bungee counts nothing. D of drag is -(k1 + k2 |u|) - k2 u u^T/|u|, of damping -m c; a float in part under has
-rho V g/(2 d) in its K.
"""

from __future__ import annotations

from ..forces import buoyancy, drag, springs
from ..kernel import inner
from ..math.lanes import any_lane, fma, load, select, splat, sqrt, store
from ..math.pointers import axes
from ..math.vectors import between, dot, load_coordinates
from ..model.tape import (
    H_ACCELERATION,
    H_ACTIVE,
    H_BACKWARD,
    H_BUOYANCIES,
    H_DAMPING,
    H_DRAG_BLOCKS,
    H_DRAGS,
    H_FACTOR,
    H_FLOAT_BLOCKS,
    H_FORCE,
    H_FORCED,
    H_FORWARD,
    H_MASS,
    H_MATRIX,
    H_MATRIX_ROWS,
    H_REACH,
    H_SPRING_BLOCKS,
    H_SPRINGS,
    H_UNKNOWNS,
    H_VELOCITY,
)
from ..solvers import block_ldl
from ..stage import stage

UNKNOWN, SPRING_BLOCK = 4, 4


@inner
def _add_symmetric(s, target, diagonal, along, x, y, z):
    """Symmetric block in six rows += diagonal + along d d^T."""
    ax = along * x
    ay = along * y
    az = along * z
    store(s, target, load(s, target) + fma(ax, x, diagonal))
    store(s, target + 1, fma(ay, x, load(s, target + 1)))
    store(s, target + 2, load(s, target + 2) + fma(ay, y, diagonal))
    if axes(s) == 3:
        store(s, target + 3, fma(az, x, load(s, target + 3)))
        store(s, target + 4, fma(az, y, load(s, target + 4)))
        store(s, target + 5, load(s, target + 5) + fma(az, z, diagonal))


@inner
def _begin(tape, s, reach):
    """S = M (1 + r c) with c the rate of damping."""
    zero = splat(0.0)
    for row in range(tape[H_MATRIX_ROWS]):
        store(s, tape[H_MATRIX] + row, zero)
    at = tape[H_UNKNOWNS]
    for index in range(tape[at]):
        k = at + 1 + UNKNOWN * index
        mass = load(s, tape[H_MASS] + tape[k + 1])
        mass = fma(mass * reach, load(s, tape[H_DAMPING] + tape[k + 1]), mass)
        target = tape[k + 3]
        store(s, target, mass)
        store(s, target + 2, mass)
        store(s, target + 5, mass)


@inner
def add_spring_blocks(tape, s, reach):
    zero = splat(0.0)
    one = splat(1.0)
    square = reach * reach
    at = tape[H_SPRINGS]
    blocks = tape[H_SPRING_BLOCKS]
    for index in range(tape[at]):
        k = at + 1 + springs.RECORD * index
        j = blocks + 1 + SPRING_BLOCK * index
        x, y, z = between(s, tape[k], tape[k + 1])
        square_length = dot(x, y, z, x, y, z)
        apart = square_length > zero
        inverse = one / sqrt(select(apart, square_length, one))
        inverse = select(apart, inverse, zero)
        rest = load(s, tape[k + 5])
        stiffness = load(s, tape[k + 4])
        if tape[k + 6] == springs.ONE_SIDED:
            stiffness = select(rest * inverse < one, stiffness, zero)
            stiffness = select(apart, stiffness, zero)
        across = stiffness * (one - rest * inverse)
        lowest = load(s, tape[j + 3])
        across = select(across > lowest, across, lowest)
        along = (stiffness - across) * inverse * inverse
        along = square * along
        across = square * across
        _add_symmetric(s, tape[j], across, along, x, y, z)
        _add_symmetric(s, tape[j + 1], across, along, x, y, z)
        target = tape[j + 2]
        ax = along * x
        ay = along * y
        az = along * z
        store(s, target, load(s, target) - fma(ax, x, across))
        store(s, target + 4, load(s, target + 4) - fma(ay, y, across))
        xy = ax * y
        store(s, target + 1, load(s, target + 1) - xy)
        store(s, target + 3, load(s, target + 3) - xy)
        if axes(s) == 3:
            xz = ax * z
            yz = ay * z
            store(s, target + 8, load(s, target + 8) - fma(az, z, across))
            store(s, target + 2, load(s, target + 2) - xz)
            store(s, target + 5, load(s, target + 5) - yz)
            store(s, target + 6, load(s, target + 6) - xz)
            store(s, target + 7, load(s, target + 7) - yz)


@inner
def add_drag_blocks(tape, s, reach):
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_DRAGS]
    for index in range(tape[at]):
        k = at + 1 + drag.RECORD * index
        x, y, z = between(s, tape[k], tape[k + 4])
        speed = sqrt(dot(x, y, z, x, y, z))
        moves = speed > zero
        quadratic = reach * load(s, tape[k + 3])
        diagonal = fma(quadratic, speed, reach * load(s, tape[k + 2]))
        along = select(moves, quadratic / select(moves, speed, one), zero)
        _add_symmetric(s, tape[tape[H_DRAG_BLOCKS] + 1 + index], diagonal, along, x, y, z)


@inner
def add_float_blocks(tape, s, reach):
    zero = splat(0.0)
    at = tape[H_BUOYANCIES]
    for index in range(tape[at]):
        k = at + 1 + buoyancy.RECORD * index
        target = tape[tape[H_FLOAT_BLOCKS] + 1 + index]
        half = load(s, tape[k + 3])
        depth = load(s, tape[k + 2]) + half - load(s, tape[k])
        slope = load(s, tape[k + 4]) / (half + half)
        slope = select(depth > zero, slope, zero)
        slope = select(depth < half + half, slope, zero)
        store(s, target, fma(reach * reach, slope, load(s, target)))


@stage
def factorise_motion(tape, s, skip, part):
    """S at the state at hand, assembled and factorised; nothing where no world is active."""
    if any_lane(load(s, tape[H_ACTIVE]) > splat(0.5)):
        reach = load(s, tape[H_REACH])
        _begin(tape, s, reach)
        add_spring_blocks(tape, s, reach)
        add_drag_blocks(tape, s, reach)
        add_float_blocks(tape, s, reach)
        block_ldl.factor(tape, tape[H_FACTOR], s, skip)


@inner
def load_force(tape, s, k):
    """Force on an unknown's particle at the state at hand, damping and constant acceleration in it."""
    mass = load(s, tape[H_MASS] + tape[k + 1])
    damping = load(s, tape[H_DAMPING] + tape[k + 1])
    ax, ay, az = load_coordinates(s, tape[H_ACCELERATION] + tape[k])
    vx, vy, vz = load_coordinates(s, tape[H_VELOCITY] + tape[k])
    x = mass * (ax - damping * vx)
    y = mass * (ay - damping * vy)
    z = mass * (az - damping * vz)
    if tape[H_FORCED] != 0:
        fx, fy, fz = load_coordinates(s, tape[H_FORCE] + tape[k])
        x = x + fx
        y = y + fy
        z = z + fz
    return x, y, z


@inner
def solve_motion(tape, s, skip):
    """Right sides := S^-1 right sides."""
    block_ldl.forward(tape, tape[H_FORWARD], s, skip)
    block_ldl.backward(tape, tape[H_BACKWARD], s, skip)
