"""Chains of particles on massless rods in a plane: reference motions in the angles of their rods.

    python -m benchmarks.laboratory.pendulums

writes problems/data/NAME.npz for every chain that is charted.

With u_i the direction of rod i from the anchor outwards and T_i its tension, the accelerations are
a_i = g + (T_(i+1) u_(i+1) - T_i u_i) / m_i. Rods keep their length: u_i . (a_i - a_(i-1)) = -l_i theta_i'^2,
tridiagonal in the tensions and well conditioned for any masses, unlike the matrix of masses in the angles; then
l_i theta_i'' is the component across the rod. Integrated by DOP853 near the limit of double precision.

How far they can be trusted: end x 1 and x 1000 agree with multipliers in space to 7e-13 m over the whole
second. End x 1e6 takes three minutes at a tolerance of 1e-12, agrees with one of 1e-11 to 9.4e-11 m, and with
multipliers in space to 1e-10 m over the first .2 s; beyond, that check takes long and was not made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

from benchmarks.laboratory.problem import Motion
from benchmarks.scenes import Array, ParticleScene

GRAVITY = 9.81
DATA = Path(__file__).parent / "problems" / "data"


@dataclass(frozen=True, kw_only=True)
class Pendulums:
    """A chain that hangs from the origin, at rest at the start.

    Attributes:
        mass: Masses from the anchor outwards [kg].
        length: Length of each rod [m].
        angle: Angle of all rods from hanging at the start [rad].
        times: Times of the looks [s].
        tolerance: Of the integration. Where light links carry much, rounding of the tensions is
            larger than the least that DOP853 takes, and steps would shrink without end.
    """

    mass: tuple[float, ...]
    length: float
    angle: float
    times: tuple[float, ...]
    tolerance: float = 2.5e-14


def even(seconds: float, stretch: float) -> tuple[float, ...]:
    """Looks at every stretch of time."""
    return tuple(stretch * k for k in range(1, round(seconds / stretch) + 1))


LEVEL = 0.5 * np.pi
CHAINS: Mapping[str, Pendulums] = {
    "triple": Pendulums(mass=(1.0,) * 3, length=0.5, angle=LEVEL, times=even(2.0, 0.1)),
    **{
        f"chain_{ratio:g}": Pendulums(
            mass=(*(0.1,) * 19, 0.1 * ratio),
            length=0.1,
            angle=LEVEL,
            times=even(1.0, 0.1),
            tolerance=tolerance,
        )
        for ratio, tolerance in ((1.0, 2.5e-14), (1e3, 2.5e-14), (1e6, 1e-12))
    },
}


def scene(chain: Pendulums, *, gravity: float = GRAVITY) -> ParticleScene:
    """Particles and rods of a chain at the start."""
    count = len(chain.mass)
    out = chain.length * np.arange(1, count + 1)
    zero = np.zeros(count)
    return ParticleScene(
        position=np.stack([out * np.sin(chain.angle), -out * np.cos(chain.angle), zero], axis=1),
        velocity=np.zeros((count, 3)),
        mass=np.array(chain.mass),
        rods=tuple((k, k + 1, chain.length) for k in range(count - 1)),
        pins=((0, (0.0, 0.0, 0.0), chain.length),),
        gravity=(0.0, -gravity, 0.0),
    )


def integrate(chain: Pendulums, *, tolerance: float | None = None) -> Motion:
    """The motion at the looks, to the chain's tolerance or another one."""
    tolerance = chain.tolerance if tolerance is None else tolerance
    count, length = len(chain.mass), chain.length
    inverse = 1.0 / np.array(chain.mass)
    band = np.zeros((3, count))

    def rate(_: float, state: Array) -> Array:
        angle, speed = state.reshape(2, count)
        along = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        across = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        # Row i: u_i . (a_i - a_(i-1)), with a_0 = 0 at the anchor; gravity enters the first row alone.
        coupling = (along[1:] * along[:-1]).sum(axis=1) * inverse[:-1]
        band[0, 1:] = -coupling
        band[1] = inverse
        band[1, 1:] += inverse[:-1]
        band[2, :-1] = -coupling
        right = length * speed**2
        right[0] -= GRAVITY * along[0, 1]
        tension = solve_banded((1, 1), band, right)
        pull = tension[:, None] * along
        a = -inverse[:, None] * pull
        a[:-1] += inverse[:-1, None] * pull[1:]
        a[:, 1] -= GRAVITY
        relative = a
        relative[1:] = a[1:] - a[:-1].copy()
        return np.concatenate([speed, (relative * across).sum(axis=1) / length])

    states = [np.concatenate([np.full(count, chain.angle), np.zeros(count)])]
    before = 0.0
    for time in chain.times:
        # Looks are ends of integrations: values inside a step are interpolated at a lower order.
        done = solve_ivp(
            rate, (before, time), states[-1], method="DOP853", rtol=tolerance, atol=tolerance
        )
        states.append(done.y[:, -1])
        before = time
    angle, speed = np.array(states[1:]).reshape(-1, 2, count).transpose(1, 0, 2)
    zero = np.zeros_like(angle)
    span = length * np.stack([np.sin(angle), -np.cos(angle), zero], axis=2)
    turn = length * speed[:, :, None] * np.stack([np.cos(angle), np.sin(angle), zero], axis=2)
    return Motion(span.cumsum(axis=1), turn.cumsum(axis=1))


def stored(name: str) -> Motion:
    """The motion of a chain as it was written."""
    with np.load(DATA / f"{name}.npz") as kept:
        return Motion(kept["position"], kept["velocity"])


def main() -> None:
    """Write the motions of all chains."""
    DATA.mkdir(exist_ok=True)
    for name, chain in CHAINS.items():
        motion = integrate(chain)
        np.savez(DATA / f"{name}.npz", position=motion.position, velocity=motion.velocity)


if __name__ == "__main__":
    main()
