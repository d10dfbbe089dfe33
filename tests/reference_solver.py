"""A plain reference for the engine's RATTLE with rods and cables: dense, slow, easy to check.

One world, numpy only, nothing shared with the engine. A step from (x, v) over h is

    v_half = d^(h/2) v + h/2 a
    x1     = x + h v_half + M^-1 J(x)^T position_multiplier
    v1     = d^(h/2) [(x1 - x) / h + h/2 a + M^-1 J(x1)^T velocity_multiplier]

where a link's row of J is the vector along it, e = x_a - x_b, for its end a and -e for its end b.
The position multipliers make (|e|^2 - L^2) / 2 zero at x1 for a rod; for a cable that value is not
positive, the multiplier is not positive (a cable pulls), and one of the two is zero. The velocity
multipliers do the same for J(x1) v1, for rods and those cables that pulled in the position stage.

After Andersen (1983), "Rattle: a velocity version of the Shake algorithm".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

# Singular values below this share of the greatest belong to redundant links.
RANK_TOLERANCE = 1e-9
# Of a squared length; the rounding of coordinates of a few metres stays below it.
CLOSURE_TOLERANCE = 1e-14
# What rounding may leave of a multiplier or residual that should be zero, of the greatest one.
SIGN_TOLERANCE = 1e-11
NEWTON_LIMIT = 30
ACTIVE_SET_LIMIT = 20
CASE_LIMIT = 4096


@dataclass(frozen=True)
class Link:
    """A rod (fixed length) or a cable (greatest length [m]) to a particle or a fixed point [m]."""

    kind: Literal["rod", "cable"]
    a: int
    b: int | tuple[float, float, float]
    length: float


@dataclass(frozen=True, kw_only=True)
class DenseScene:
    """State and parameters of one world.

    Attributes:
        position: [m], shape (particles, 3).
        velocity: [m/s], shape (particles, 3).
        inverse_mass: [1/kg], shape (particles,); at 0 a particle is immovable.
        acceleration: Constant acceleration [m/s^2], shape (particles, 3).
        damping: Share of its velocity that a particle keeps over one second.
        links: Rods and cables.
    """

    position: Array
    velocity: Array
    inverse_mass: Array
    acceleration: Array
    damping: float = 1.0
    links: tuple[Link, ...] = ()


class Outcome(NamedTuple):
    """A stage's result for one choice of taut cables, and the cables that contradict it."""

    value: Array
    multiplier: Array
    pushing: Indices
    stretched: Indices


def step(scene: DenseScene, dt: float) -> DenseScene:
    """Advance a scene by `dt` [s]."""
    half_damping = scene.damping ** (0.5 * dt)
    movable = (scene.inverse_mass > 0.0)[:, None]
    kick = np.where(movable, 0.5 * dt * scene.acceleration, 0.0)
    v_half = np.where(movable, half_damping * scene.velocity, 0.0) + kick
    position, multiplier = solve_positions(scene, scene.position + dt * v_half)
    velocity = (position - scene.position) / dt + kick
    moved = replace(scene, position=position)
    velocity, _ = project_velocity(moved, velocity, cables=np.flatnonzero(multiplier < 0.0))
    return replace(moved, velocity=half_damping * velocity)


def solve_positions(scene: DenseScene, predicted: Array) -> tuple[Array, Array]:
    """Move predicted positions so that they satisfy every link.

    Args:
        scene: The scene at the start of the step: the corrections act along its links.
        predicted: Positions without link forces [m], shape (particles, 3).

    Returns:
        Positions [m], shape (particles, 3), and multipliers [kg], shape (links,).
        Twice a multiplier times its length over dt^2 is the force along the link [N], negative
        when the link pulls.

    Raises:
        ArithmeticError: No choice of taut cables satisfies every condition.
    """
    cables = _cables(scene)

    def attempt(taut: Indices) -> Outcome | None:
        solution = _close(scene, predicted, taut)
        if solution is None:
            return None
        position, multiplier = solution
        stretch = _excess(scene, position) / _lengths(scene) ** 2
        return _judge(position, multiplier, taut, cables, stretch, 1.0)

    guess = cables[_excess(scene, predicted)[cables] > 0.0]
    outcome = _settle(cables, guess, attempt)
    return outcome.value, outcome.multiplier


def project_velocity(
    scene: DenseScene, velocity: Array, *, cables: Sequence[int] | Indices
) -> tuple[Array, Array]:
    """Change velocities by the least impulses after which no rod and no given cable stretches.

    Args:
        scene: Gives the positions and links; its velocity is not read.
        velocity: [m/s], shape (particles, 3).
        cables: Indices of the cables that are taut; they may still slacken.

    Returns:
        Velocities [m/s], shape (particles, 3), and multipliers [kg/s], shape (links,).

    Raises:
        ArithmeticError: No choice of cables satisfies every condition.
    """
    candidates = np.asarray(cables, dtype=np.intp)
    jacobian = link_jacobian(scene, scene.position)
    weight = np.repeat(scene.inverse_mass, 3)
    rate = jacobian @ velocity.ravel()

    def attempt(pulling: Indices) -> Outcome:
        rows = _active(scene, pulling)
        multiplier = np.zeros(len(scene.links))
        matrix = jacobian[rows] @ (weight[:, None] * jacobian[rows].T)
        multiplier[rows] = np.linalg.lstsq(matrix, -rate[rows], rcond=RANK_TOLERANCE)[0]
        result = velocity + (weight * (multiplier @ jacobian)).reshape(-1, 3)
        scale = np.abs(rate).max(initial=0.0)
        return _judge(result, multiplier, pulling, candidates, jacobian @ result.ravel(), scale)

    outcome = _settle(candidates, candidates, attempt)
    return outcome.value, outcome.multiplier


def link_jacobian(scene: DenseScene, position: Array) -> Array:
    """Rows of the links at the given positions [m], shape (links, 3 * particles)."""
    jacobian = np.zeros((len(scene.links), len(position), 3))
    for row, (link, span) in enumerate(zip(scene.links, _spans(scene, position), strict=True)):
        jacobian[row, link.a] = span
        if isinstance(link.b, int):
            jacobian[row, link.b] = -span
    return jacobian.reshape(len(scene.links), position.size)


def residuals(scene: DenseScene) -> Array:
    """Error of each link as a share of its length, shape (links,): a slack cable has none."""
    strain = np.linalg.norm(_spans(scene, scene.position), axis=1) / _lengths(scene) - 1.0
    cables = _cables(scene)
    strain[cables] = np.maximum(strain[cables], 0.0)
    return strain


def kinetic_energy(scene: DenseScene) -> float:
    """Kinetic energy of the movable particles [J]."""
    movable = scene.inverse_mass > 0.0
    return float(
        0.5 * ((scene.velocity[movable] ** 2).sum(axis=1) / scene.inverse_mass[movable]).sum()
    )


def potential_energy(scene: DenseScene) -> float:
    """Potential energy of the movable particles in their constant accelerations [J]."""
    movable = scene.inverse_mass > 0.0
    work = (scene.acceleration[movable] * scene.position[movable]).sum(axis=1)
    return float(-(work / scene.inverse_mass[movable]).sum())


def energy(scene: DenseScene) -> float:
    """Kinetic and potential energy [J]."""
    return kinetic_energy(scene) + potential_energy(scene)


def _close(scene: DenseScene, predicted: Array, taut: Indices) -> tuple[Array, Array] | None:
    """Newton's method for the multipliers of the rods and the taut cables.

    None where it does not converge: then the chosen links cannot all have their length.
    """
    rows = _active(scene, taut)
    weight = np.repeat(scene.inverse_mass, 3)
    direction = weight[:, None] * link_jacobian(scene, scene.position)[rows].T
    scale = _lengths(scene)[rows] ** 2
    multiplier = np.zeros(len(scene.links))
    for _ in range(NEWTON_LIMIT):
        position = predicted + (direction @ multiplier[rows]).reshape(-1, 3)
        excess = _excess(scene, position)[rows]
        if (np.abs(excess) <= CLOSURE_TOLERANCE * scale).all():
            return position, multiplier
        slope = link_jacobian(scene, position)[rows] @ direction
        multiplier[rows] -= np.linalg.lstsq(slope, excess, rcond=RANK_TOLERANCE)[0]
    return None


def _judge(
    value: Array,
    multiplier: Array,
    taut: Indices,
    cables: Indices,
    stretch: Array,
    stretch_scale: float,
) -> Outcome:
    """Name the cables that break a condition: taut ones that push, slack ones that stretch."""
    push_limit = SIGN_TOLERANCE * np.abs(multiplier).max(initial=0.0)
    slack = np.setdiff1d(cables, taut)
    return Outcome(
        value=value,
        multiplier=multiplier,
        pushing=taut[multiplier[taut] > push_limit],
        stretched=slack[stretch[slack] > SIGN_TOLERANCE * stretch_scale],
    )


def _settle(
    cables: Indices, guess: Indices, attempt: Callable[[Indices], Outcome | None]
) -> Outcome:
    """Find the cables that carry force: what is found is checked, so how it is found is free.

    From the guess, cables that push are let go and cables that stretch are taken up; should that
    run in circles or fail, every choice is tried, the smallest first.
    """
    taut = guess
    for _ in range(ACTIVE_SET_LIMIT):
        outcome = attempt(taut)
        if outcome is None:
            break
        if not outcome.pushing.size and not outcome.stretched.size:
            return outcome
        taut = np.union1d(np.setdiff1d(taut, outcome.pushing), outcome.stretched)
    choices = (
        choice for size in range(len(cables) + 1) for choice in combinations(cables.tolist(), size)
    )
    for choice in islice(choices, CASE_LIMIT):
        outcome = attempt(np.array(choice, dtype=np.intp))
        if outcome is not None and not outcome.pushing.size and not outcome.stretched.size:
            return outcome
    raise ArithmeticError(f"No choice among {len(cables)} cables satisfies every condition.")


def _cables(scene: DenseScene) -> Indices:
    return np.array([c for c, link in enumerate(scene.links) if link.kind == "cable"], np.intp)


def _active(scene: DenseScene, cables: Indices) -> Indices:
    """Indices of all rods and of the given cables."""
    rods = [c for c, link in enumerate(scene.links) if link.kind == "rod"]
    return np.union1d(np.array(rods, dtype=np.intp), cables)


def _spans(scene: DenseScene, position: Array) -> Array:
    """Vector along each link, towards its particle a [m], shape (links, 3)."""
    return np.array(
        [
            position[link.a] - (position[link.b] if isinstance(link.b, int) else link.b)
            for link in scene.links
        ]
    ).reshape(-1, 3)


def _excess(scene: DenseScene, position: Array) -> Array:
    """(|e|^2 - L^2) / 2 of each link [m^2], shape (links,)."""
    return 0.5 * ((_spans(scene, position) ** 2).sum(axis=1) - _lengths(scene) ** 2)


def _lengths(scene: DenseScene) -> Array:
    return np.array([link.length for link in scene.links])
