"""A hanging cloth of springs."""

from __future__ import annotations

import math

from ..scene.forces import Spring
from ..scene.particle import Particle
from ..scene.scene import Scene


def cloth(
    *,
    side: int = 20,
    width: float = 1.0,
    mass: float = 0.4,
    stiffness: float = 1000.0,
    ratio: float = 1e4,
    damping: float = 0.9,
    held: str = "edge",
) -> Scene:
    """A square of ``side`` x ``side`` particles let go level, held along one edge or at two corners.

    Structural springs join neighbours along both sides, shear springs across the squares, softer by ``ratio``; all
    are as long as the cloth lies. Particles come row by row from the held edge (z = 0), each row along x. At rest
    the fastest modes have w = 2 sqrt(stiffness/mass of a particle), 2,000/s with the default values: velocity
    Verlet needs 1,000 steps a second.

    Args:
        side: particles along a side, at least 2.
        width: length of a side [m].
        mass: of the whole cloth [kg].
        stiffness: of structural springs [N/m].
        ratio: stiffness of structural over that of shear springs; infinity for no shear springs.
        damping: share of velocity that particles keep per second.
        held: "edge" or "corners".

    Raises:
        ValueError: fewer than two particles a side, or no such way to hold it.
    """
    if side < 2:
        raise ValueError(f"cloth: side is {side!r}; it needs at least 2. Use 20 for the demo.")
    if held not in ("edge", "corners"):
        raise ValueError(f"cloth: held is {held!r}; it must be 'edge' or 'corners'. Use 'edge'.")
    scene = Scene()
    pitch = width / (side - 1)
    own = mass / side**2
    rows = []
    for i in range(side):
        row = []
        for j in range(side):
            fixed = i == 0 and (held == "edge" or j in (0, side - 1))
            place = (pitch * j - 0.5 * width, 0.0, pitch * i)
            if fixed:
                row.append(scene.add(Particle(position=place, inverse_mass=0.0)))
            else:
                row.append(scene.add(Particle(position=place, mass=own, damping=damping)))
        rows.append(row)
    joined = [((0, 1), pitch, stiffness), ((1, 0), pitch, stiffness)]
    if math.isfinite(ratio):
        across = pitch * math.sqrt(2.0)
        joined += [((1, 1), across, stiffness / ratio), ((1, -1), across, stiffness / ratio)]
    for (down, along), length, k in joined:
        for i in range(side - down):
            for j in range(side):
                if 0 <= j + along < side:
                    a, b = rows[i][j], rows[i + down][j + along]
                    if a.movable or b.movable:
                        scene.add(Spring(a, b, k, length))
    return scene
