"""Rigid tops for 10 s: the free asymmetric one, which turns over and over, and the heavy symmetric one about its pivot.

    python -m benchmarks.laboratory.problems.top

writes data/top.npz: the free top by its Euler equations, the heavy one by the equations of its axis n and angular
momentum L,

    n' = w x n,    L' = m l n x g,    w = L/I1 + (1/I3 - 1/I1) (L.n) n,

both by Taylor series in 25 digits.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import mpmath
import numpy as np

import steelyard as sy
from benchmarks.laboratory.peers import drake_bodies, mujoco_document
from benchmarks.laboratory.pendulums import DATA
from benchmarks.laboratory.problem import Motion, Problem, energy, trajectory
from benchmarks.scenes import Array

STRETCH, LOOKS = 0.5, tuple(range(1, 21))
STORED = DATA / "top.npz"
#: Moments of the free top, and its spin, about the unstable axis.
INERTIA, SPIN = (1.0, 2.0, 3.0), (0.01, 5.0, 0.01)
#: What Drake has for motion without contact, beside what it has for contact.
DRAKES = {
    "Drake SAP": {"scheme": "sap"},
    "Drake CENIC 1e-7": {"scheme": "cenic", "accuracy": 1e-7},
    "Drake RK5 1e-12": {"scheme": "runge_kutta5", "accuracy": 1e-12},
}
#: Mass, distance of the centre of mass, moments about that across and along the axis, tilt and spin of the heavy top.
MASS, ARM, ACROSS, ALONG, TILT, RATE, GRAVITY = 1.0, 0.3, 0.03, 0.02, 0.5, 40.0, 9.81
SITES = """<site name="o"/><site name="x" pos="1 0 0"/><site name="y" pos="0 1 0"/>
    <site name="z" pos="0 0 1"/>"""


def free_top(*, inertia: tuple[float, float, float] = INERTIA, spin: Any = SPIN) -> sy.Scene:
    """A body in space, spinning about its middle axis."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(sy.Body(position=(0, 0, 0), mass=1.0, inertia=inertia, angular_velocity=spin))
    return scene


def heavy_top(
    *, gravity: float = GRAVITY, along: float = ALONG, arm: float = ARM, rate: float = RATE
) -> sy.Scene:
    """A top on its tip, leaning, spinning about its axis alone."""
    scene = sy.Scene(gravity=(0.0, -gravity, 0.0))
    axis = (-math.sin(TILT), math.cos(TILT), 0.0)
    scene.add(
        sy.Body(
            position=(0, 0, 0),
            mass=MASS,
            inertia=(ACROSS, along, ACROSS),
            pivot=(0, -arm, 0),
            orientation=(math.cos(TILT / 2), 0, 0, math.sin(TILT / 2)),
            angular_velocity=rate * np.array(axis),
        )
    )
    return scene


def _landmarks(turn: Array, spin: Array) -> Motion:
    """Of one body at rest in space: matrices (looks, 3, 3) and angular velocities (looks, 3)."""
    arms = np.concatenate([np.zeros_like(turn[:, :1]), np.swapaxes(turn, 1, 2)], axis=1)
    return Motion(arms, np.cross(spin[:, None], arms))


def free_motion() -> Motion:
    """The free top: its angular velocity by Euler's equations, its orientation beside them."""
    a, b, c = INERTIA

    def rates(time: Any, y: list[Any]) -> list[Any]:
        u, v, w = y[:3]
        found = [(b - c) * v * w / a, (c - a) * w * u / b, (a - b) * u * v / c]
        # Rows of the matrix, each across the spin.
        for k in (3, 6, 9):
            p, q, r = y[k : k + 3]
            found += [q * w - r * v, r * u - p * w, p * v - q * u]
        return found

    found = _solve(rates, [*SPIN, *np.eye(3).ravel().tolist()])
    turn = found[:, 3:].reshape(-1, 3, 3)
    return _landmarks(turn, np.einsum("tij,tj->ti", turn, found[:, :3]))


def heavy_motion() -> Motion:
    """The heavy top: axis, a direction across it that turns with the body, and angular momentum."""
    first = ACROSS + MASS * ARM**2
    weight, ease = MASS * ARM * GRAVITY, 1.0 / ALONG - 1.0 / first

    def rates(time: Any, y: list[Any]) -> list[Any]:
        axis, across, momentum = y[:3], y[3:6], y[6:]
        spin = ease * sum(m * n for m, n in zip(momentum, axis, strict=True))
        u, v, w = (m / first + spin * n for m, n in zip(momentum, axis, strict=True))
        found = []
        for p, q, r in (axis, across):
            found += [v * r - w * q, w * p - u * r, u * q - v * p]
        return [*found, weight * axis[2], mpmath.mpf(0), -weight * axis[0]]

    axis = [-math.sin(TILT), math.cos(TILT), 0.0]
    across = [math.cos(TILT), math.sin(TILT), 0.0]
    found = _solve(rates, [*axis, *across, *(ALONG * RATE * n for n in axis)]).reshape(-1, 3, 3)
    axes, sides, momentum = np.moveaxis(found, 1, 0)
    along = np.einsum("tc,tc->t", momentum, axes)[:, None]
    spin = momentum / first + ease * along * axes
    turn = np.stack([sides, axes, np.cross(sides, axes)], axis=2)
    return _landmarks(turn, spin)


def _solve(rates: Any, start: list[float]) -> Array:
    """States at the looks, by Taylor series in 25 digits."""
    with mpmath.workdps(25):
        path = mpmath.odefun(rates, 0, [mpmath.mpf(x) for x in start], tol=mpmath.mpf("1e-20"))
        found = [path(mpmath.mpf(STRETCH) * look) for look in LOOKS]
    return np.array([[float(x) for x in state] for state in found])


def stored(name: str) -> Motion:
    """A motion as it was written."""
    with np.load(STORED) as kept:
        return Motion(kept[f"{name} position"], kept[f"{name} velocity"])


def _energy_of(moments: tuple[float, float, float], weight: float) -> Any:
    """Energy from the landmarks of one body at rest: half w.I w and the height of its axis y times ``weight`` [N m]."""

    def of(position: Array, velocity: Array) -> Array:
        arms = position[:, 1:] - position[:, :1]
        speeds = velocity[:, 1:] - velocity[:, :1]
        spin = 0.5 * np.cross(arms, speeds).sum(axis=1)
        own = np.einsum("tkc,tc->tk", arms, spin)
        return np.asarray(0.5 * (own**2 @ np.array(moments)) + weight * arms[:, 1, 1])

    return of


def problems() -> tuple[Problem, ...]:
    """Both tops."""
    start = f'<inertial pos="0 0 0" mass="1" diaginertia="{" ".join(map(str, INERTIA))}"/>'
    free = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}" gravity="0 0 0">
    <flag contact="disable"/></option><worldbody><body><freejoint/>{start}{SITES}</body>
    </worldbody></mujoco>"""
    lean = f"{math.cos(TILT / 2)!r} 0 0 {math.sin(TILT / 2)!r}"
    heavy = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}"
    gravity="0 {-GRAVITY} 0"><flag contact="disable"/></option><worldbody><body quat="{lean}">
    <joint type="ball"/><inertial pos="0 {ARM} 0" mass="{MASS}"
     diaginertia="{ACROSS} {ALONG} {ACROSS}"/>{SITES}</body></worldbody></mujoco>"""
    names = ["o", "x", "y", "z"]
    integrators = ("Euler", "implicit", "RK4")
    first = ACROSS + MASS * ARM**2
    true, leaning = stored("free"), stored("heavy")
    steps = (15, 30, 60, 120, 240, 480, 960)
    return (
        Problem(
            name="free top",
            scene=free_top,
            stretch=STRETCH,
            looks=LOOKS,
            measures=(trajectory(true), energy(true, _energy_of(INERTIA, 0.0), scale=25.0)),
            steps=steps,
            peers=mujoco_document(
                free,
                particles=names,
                integrators=integrators,
                velocity=np.array([0.0, 0.0, 0.0, *SPIN]),
            )
            | drake_bodies(free_top(), DRAKES),
            best="velocity Verlet",
            wrong={
                "box inertia of .3 for 1/3": partial(free_top, inertia=(1.0, 2.0, 2.7)),
                "no gyroscopic term": partial(free_top, inertia=(2.0, 2.0, 2.0)),
                "spin 1 % off": partial(free_top, spin=(0.01, 5.05, 0.01)),
            },
        ),
        Problem(
            name="heavy top",
            scene=heavy_top,
            stretch=STRETCH,
            looks=LOOKS,
            measures=(
                trajectory(leaning),
                energy(
                    leaning,
                    _energy_of((first, ALONG, first), MASS * GRAVITY * ARM),
                    scale=MASS * GRAVITY * ARM,
                ),
            ),
            steps=steps,
            peers=mujoco_document(
                heavy,
                particles=names,
                integrators=integrators,
                velocity=np.array([0.0, RATE, 0.0]),
            ),
            best="velocity Verlet, order 6",
            wrong={
                "gravity points up": partial(heavy_top, gravity=-GRAVITY),
                "moment 1 % off": partial(heavy_top, along=1.01 * ALONG),
                "pivot 1 % off": partial(heavy_top, arm=1.01 * ARM),
                "spin 1 % off": partial(heavy_top, rate=1.01 * RATE),
            },
        ),
    )


def main() -> None:
    """Integrate and write."""
    motions = {"free": free_motion(), "heavy": heavy_motion()}
    parts = {}
    for name, motion in motions.items():
        parts |= {f"{name} position": motion.position, f"{name} velocity": motion.velocity}
    np.savez_compressed(STORED, **parts)


if __name__ == "__main__":
    main()
