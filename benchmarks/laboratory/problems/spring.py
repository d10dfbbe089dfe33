"""A damped spring on an anchor: phase, amplitude, stability.

m x'' = -k x - c x' with omega = sqrt(k/m) and zeta = c / (2 m omega), in closed form. The kick at the start
excites amplitude and phase; the stiff variants oscillate 2,650 times between two frames.
"""

from __future__ import annotations

from functools import partial

import numpy as np

import steelyard as sy
from benchmarks.laboratory.peers import mujoco_document, pymunk_space
from benchmarks.laboratory.problem import Measure, Motion, Problem, energy, trajectory
from benchmarks.references import oscillator
from benchmarks.scenes import Array

MASS, STRETCH = 2.0, 0.1
START = 0.5
#: Angular frequency [rad/s] and damping ratio of each variant. Stiff ones must still move at the looks: at a
#: ratio of .1 they would stand still after a thousandth of a second, and any engine that stands still be right.
VARIANTS = ((5.0, 0.0), (5.0, 0.1), (5.0, 1.0), (50.0, 10.0), (1e6, 5e-7), (1e6, 0.0))


def spring(*, omega: float, zeta: float) -> sy.Scene:
    """An anchored spring of no rest length and linear drag."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    particle = _particle(scene, omega, START)
    scene.add(sy.AnchoredSpring(particle, (0.0, 0.0, 0.0), MASS * omega**2, 0.0))
    if zeta > 0.0:
        scene.add(sy.Drag(linear=2.0 * zeta * omega * MASS))
    return scene


def stiff_spring(*, omega: float, zeta: float, position: float = START) -> sy.Scene:
    """The same written as the force that is solved in closed form over each step."""
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    particle = _particle(scene, omega, position)
    damping = 2.0 * zeta * omega * MASS
    scene.add(sy.StiffSpring(particle, (0.0, 0.0, 0.0), MASS * omega**2, damping))
    return scene


def _particle(scene: sy.Scene, omega: float, position: float) -> sy.Particle:
    """One particle with half the energy in its speed."""
    return scene.add(
        sy.Particle(position=(position, 0, 0), velocity=(START * omega, 0, 0), mass=MASS)
    )


def reference(omega: float, zeta: float, times: Array) -> Motion:
    """The closed form at the times [s]."""
    states = [
        oscillator(
            START,
            START * omega,
            stiffness=MASS * omega**2,
            damping=2.0 * zeta * omega * MASS,
            mass=MASS,
            time=float(time),
        )
        for time in times
    ]
    motion = np.zeros((2, len(times), 1, 3))
    motion[:, :, 0, 0] = np.array(states).T
    return Motion(*motion)


def problem(*, omega: float, zeta: float) -> Problem:
    """The spring for two seconds."""
    looks = tuple(range(1, 21))
    true = reference(omega, zeta, STRETCH * np.array(looks))
    stiffness = MASS * omega**2

    def of(position: Array, velocity: Array) -> Array:
        return np.asarray(0.5 * (MASS * velocity**2 + stiffness * position**2).sum(axis=(1, 2)))

    measures: tuple[Measure, ...] = (
        trajectory(true),
        energy(true, of, scale=MASS * (START * omega) ** 2),
    )
    stiff = omega > 1e3
    build = partial(spring, omega=omega, zeta=zeta)
    fixed = partial(stiff_spring, omega=omega, zeta=zeta)
    return Problem(
        name=f"spring, omega {omega:g}, zeta {zeta:g}",
        scene=build,
        stretch=STRETCH,
        looks=looks,
        measures=measures,
        # 60 Hz is 6 steps a stretch.
        steps=(1, 3, 6) if stiff else (2, 6, 18, 54, 162, 486, 1458),
        peers=_peers(omega, zeta),
        peer_steps=(6, 18, 54),
        forms={"stiff spring": fixed},
        best="stiff spring, velocity Verlet",
        wrong={
            # In closed form: how another spring moves, at any stiffness.
            "stiffness 1 % off": partial(stiff_spring, omega=1.005 * omega, zeta=zeta),
            "damping 1 % off": partial(stiff_spring, omega=omega, zeta=1.01 * zeta + 5e-3 / omega),
            "starts elsewhere": partial(fixed, position=1.001 * START),
        },
    )


def _peers(omega: float, zeta: float) -> dict:
    document = f"""<mujoco><option timestep="{{dt}}" integrator="{{integrator}}" gravity="0 0 0">
    <flag contact="disable"/></option><worldbody><body>
    <joint type="slide" axis="1 0 0" stiffness="{MASS * omega**2!r}"
     damping="{2.0 * zeta * omega * MASS!r}" springref="0"/>
    <geom size=".01" mass="{MASS!r}"/><site name="p"/></body></worldbody></mujoco>"""

    def space() -> tuple:
        import pymunk

        made = pymunk.Space()
        body = pymunk.Body(MASS, 1.0)
        body.position, body.velocity = (START, 0.0), (START * omega, 0.0)
        link = pymunk.DampedSpring(
            made.static_body, body, (0, 0), (0, 0), 0.0, MASS * omega**2, 2 * zeta * omega * MASS
        )
        made.add(body, link)
        return made, [body]

    return {
        **mujoco_document(
            document,
            particles=["p"],
            integrators=("Euler", "implicit", "RK4"),
            position=np.array([START]),
            velocity=np.array([START * omega]),
        ),
        **pymunk_space(space),
    }


def problems() -> tuple[Problem, ...]:
    """All variants."""
    return tuple(problem(omega=omega, zeta=zeta) for omega, zeta in VARIANTS)
