"""The benchmark scenes as plain arrays.

References and peers read the same numbers from here, so neither depends on the engine under test.
The y axis points up; every quantity is in SI units.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Pair = tuple[int, int, float]
Support = tuple[int, tuple[float, float, float], float]

STANDARD_GRAVITY = (0.0, -9.81, 0.0)
BRIDGE_PAIRS = 6
BRIDGE_SUPPORT_LENGTH = (3.0, 3.5, 4.0, 4.0, 3.5, 3.0)


@dataclass(frozen=True, kw_only=True)
class ParticleScene:
    """Particles, links and one uniform acceleration.

    Attributes:
        position: Particle positions [m], shape (particles, 3).
        velocity: Particle velocities [m/s], shape (particles, 3).
        mass: Particle masses [kg], shape (particles,).
        rods: Links of fixed length, as (particle, particle, length [m]).
        pins: Links of fixed length to fixed points, as (particle, anchor [m], length [m]).
        cables: Links of bounded length, as (particle, particle, greatest length [m]).
        supports: Cables to fixed points, as (particle, anchor [m], greatest length [m]).
        gravity: Acceleration of every particle [m/s^2].
        damping: Share of its velocity that a particle keeps over one second.
    """

    position: Array
    velocity: Array
    mass: Array
    rods: tuple[Pair, ...] = ()
    pins: tuple[Support, ...] = ()
    cables: tuple[Pair, ...] = ()
    supports: tuple[Support, ...] = ()
    gravity: tuple[float, float, float] = STANDARD_GRAVITY
    damping: float = 1.0

    def spans(self) -> tuple[Array, Array, Array]:
        """All links in the order rods, pins, cables, supports.

        Returns:
            Matrix and anchors [m] of which `matrix @ position - anchors` are the vectors along the
            links, shapes (links, particles) and (links, 3), and the lengths [m], shape (links,).
        """
        links = [*self.rods, *self.pins, *self.cables, *self.supports]
        matrix, anchor = np.zeros((len(links), len(self.mass))), np.zeros((len(links), 3))
        for row, (a, b, _) in enumerate(links):
            matrix[row, a] = 1.0
            if isinstance(b, int):
                matrix[row, b] = -1.0
            else:
                anchor[row] = b
        return matrix, anchor, np.array([length for _, _, length in links])


def tumbling_platform() -> ParticleScene:
    """The T-shaped platform with a heavy middle, spinning freely about its centre of mass."""
    position = np.array(
        [[0, 0, 1], [0, 0, -1], [-3, 2, 1], [-3, 2, -1], [4, 2, 1], [4, 2, -1]], dtype=np.float64
    )
    mass = np.array([1.0, 1.0, 6.0, 6.0, 1.0, 1.0])
    centre = mass @ position / mass.sum()
    return ParticleScene(
        position=position,
        velocity=np.cross([0.5, 1.0, 2.0], position - centre),
        mass=mass,
        rods=tuple(
            (a, b, float(np.linalg.norm(position[a] - position[b])))
            for a, b in combinations(range(len(position)), 2)
        ),
        gravity=(0.0, 0.0, 0.0),
    )


def bridge(*, mass: Array | None = None) -> ParticleScene:
    """The suspended bridge, released from a flat deck at a height of 4 m.

    Args:
        mass: Particle masses [kg], shape (12,); 1 kg each when left out. `bridge_mass` spreads a
            load over the deck.
    """
    pair, side = np.divmod(np.arange(2 * BRIDGE_PAIRS), 2)
    position = np.stack([2.0 * pair - 5.0, np.full(pair.shape, 4.0), 2.0 * side - 1.0], axis=1)
    anchor = np.stack([2.2 * pair - 5.5, np.full(pair.shape, 6.0), 1.6 * side - 0.8], axis=1)
    return ParticleScene(
        position=position,
        velocity=np.zeros_like(position),
        mass=np.ones(len(position)) if mass is None else np.asarray(mass, dtype=np.float64),
        rods=tuple((2 * k, 2 * k + 1, 2.0) for k in range(BRIDGE_PAIRS)),
        cables=tuple((p, p + 2, 1.9) for p in range(2 * BRIDGE_PAIRS - 2)),
        supports=tuple(
            (p, (float(x), float(y), float(z)), BRIDGE_SUPPORT_LENGTH[p // 2])
            for p, (x, y, z) in enumerate(anchor)
        ),
        damping=0.9,
    )


def bridge_mass(*, x: float, z: float, load: float = 10.0) -> Array:
    """Share a load bilinearly between the four nearest particles of the bridge.

    Args:
        x: Place along the deck in bays, from 0 to 5.
        z: Place across the deck, from 0 to 1.
        load: Mass of the load [kg].

    Returns:
        Masses of the particles [kg], shape (12,), 1 kg each and their share of the load.
    """
    if not (0.0 <= x <= BRIDGE_PAIRS - 1 and 0.0 <= z <= 1.0):
        raise ValueError(
            f"The load is at ({x}, {z}), off the deck: x goes from 0 to 5, z from 0 to 1."
        )
    mass = np.ones(2 * BRIDGE_PAIRS)
    bay = min(int(x), BRIDGE_PAIRS - 2)
    along = x - bay
    mass[2 * bay] += load * (1.0 - along) * (1.0 - z)
    mass[2 * bay + 1] += load * (1.0 - along) * z
    mass[2 * bay + 2] += load * along * (1.0 - z)
    mass[2 * bay + 3] += load * along * z
    return mass


def artillery() -> ParticleScene:
    """One artillery shot of the ballistic scene."""
    return ParticleScene(
        position=np.array([[0.0, 1.5, 0.0]]),
        velocity=np.array([[0.0, 30.0, 40.0]]),
        mass=np.array([200.0]),
        gravity=(0.0, -20.0, 0.0),
        damping=0.99,
    )
