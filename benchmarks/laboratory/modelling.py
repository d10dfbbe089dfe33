"""What a simpler model errs by, beside what the step errs by.

    python -m benchmarks.laboratory.modelling

Writes results/modelling.json and prints a table. The exact model is followed at a fine step; errors are the largest
distance of a node of the deck from there.

- A load that moves: its mass spread over the corners (``lumped_masses``, the source's way) instead of a rider.
- Cables that stretch by E A / L instead of none.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import steelyard as sy
from benchmarks import record
from benchmarks.scenes import Array

LOAD, ACROSS = 10.0, 0.5
FIRST, LAST = 1.0, 4.0
FINE, FRAME = 1.0 / 1920.0, 1.0 / 60.0
#: Crossings of three bays [s].
CROSSINGS = (16.0, 8.0, 4.0, 2.0, 1.0)
#: Stiffnesses of cables [N/m]; a steel rope of 6 mm and 3 m has some 7e5.
STIFFNESSES = (1e3, 1e4, 1e5, 1e6)


def place(share: float) -> tuple[float, float, float]:
    """Place along the bridge [bays] at a share of the crossing, its first and second derivative by the share."""
    way = LAST - FIRST
    smooth = share * share * share * (10.0 - 15.0 * share + 6.0 * share * share)
    rate = 30.0 * share**2 * (1.0 - share) ** 2
    return (
        FIRST + way * smooth,
        way * rate,
        way * 60.0 * share * (1.0 - share) * (1.0 - 2.0 * share),
    )


def crossing(seconds: float, dt: float, *, lumped: bool) -> Array:
    """Nodes at every sixtieth of a second while a load crosses, (frames, 12, 3)."""
    method = sy.Method(sy.Rattle(), sy.Direct(), dt=dt)
    scene = sy.scenes.bridge(load=0.0 if lumped else LOAD, place=(FIRST, ACROSS), damping=0.5)
    world = sy.World(scene, method=method)
    base = np.ones(12)

    def spread(share: float) -> None:
        weights = sy.scenes.bridge_weights(place(share)[0], ACROSS)
        world.particles.mass = sy.scenes.lumped_masses(base, weights, LOAD)

    def ride(share: float, after: float) -> None:
        """Weights follow the way at constant acceleration between the ends of a step."""
        rider: Any = world[world.scene.of(sy.Rider)[0]]
        now, then = (sy.scenes.bridge_weights(place(x)[0], ACROSS) for x in (share, after))
        rates = rider.rates[0].copy()
        rider.accelerations = 2.0 * (then - now - rates * dt) / dt**2

    if lumped:
        spread(0.0)
    # Let it come to rest under the load first.
    world.step(round(40.0 / dt))
    steps, frame = round(seconds / dt), round(FRAME / dt)
    path = []
    for step in range(steps):
        if lumped:
            spread((step + 0.5) / steps)
        else:
            ride(step / steps, (step + 1) / steps)
        world.step()
        if (step + 1) % frame == 0:
            path.append(world.particles.position[0, :12].copy())
    return np.stack(path)


def stretched(stiffness: float) -> tuple[float, float]:
    """How far nodes of a bridge at rest hang lower with elastic cables [m]; largest angular frequency [rad/s]."""
    stiff = _at_rest(sy.scenes.bridge(load=LOAD, place=(2.5, ACROSS), damping=0.1))
    scene = sy.scenes.bridge(load=LOAD, place=(2.5, ACROSS), damping=0.1)
    for cable in scene.of(sy.Cable):
        scene.remove(cable)
        scene.add(sy.Bungee(cable.a, cable.b, stiffness, cable.max_length))
    for cable in scene.of(sy.CableConstraint):
        scene.remove(cable)
        scene.add(sy.AnchoredBungee(cable.particle, cable.anchor, stiffness, cable.max_length))
    soft = _at_rest(scene, dt=min(1.0 / 240.0, 0.5 / np.sqrt(4.0 * stiffness)))
    return float(np.linalg.norm(soft - stiff, axis=1).max()), float(np.sqrt(4.0 * stiffness))


def _at_rest(scene: sy.Scene, dt: float = 1.0 / 240.0) -> Array:
    world = sy.World(scene, method=sy.Method(sy.Rattle(), sy.Direct(), dt=dt))
    world.step(round(20.0 / dt))
    return world.particles.position[0, :12].copy()


def apart(a: Array, b: Array) -> float:
    """Largest distance [m]."""
    return float(np.linalg.norm(a - b, axis=-1).max())


def main() -> None:
    """Measure, print and write."""
    loads = []
    for seconds in CROSSINGS:
        exact = crossing(seconds, FINE, lumped=False)
        loads.append(
            {
                "seconds": seconds,
                "rider_at_60_hz": apart(crossing(seconds, FRAME, lumped=False), exact),
                "lumped": apart(crossing(seconds, FINE, lumped=True), exact),
                "lumped_at_60_hz": apart(crossing(seconds, FRAME, lumped=True), exact),
            }
        )
    cables = []
    for stiffness in STIFFNESSES:
        lower, omega = stretched(stiffness)
        cables.append({"stiffness": stiffness, "distance": lower, "largest_step": 2.0 / omega})
    record.write(
        "modelling", {"moving_load": loads, "elastic_cables": cables}, directory=record.RESULTS
    )
    console = Console(width=110)
    for rows in (loads, cables):
        table = Table(*rows[0])
        for row in rows:
            table.add_row(*(f"{value:.3g}" for value in row.values()))
        console.print(table)


if __name__ == "__main__":
    main()
