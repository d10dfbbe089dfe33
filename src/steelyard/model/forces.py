"""Forces compiled to rows and records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..forces.explosion import SETTINGS
from ..forces.springs import ONE_SIDED, REST_ALONE, TWO_SIDED
from ..scene.body import Body, BodyPoint
from ..scene.forces import (
    AnchoredBungee,
    AnchoredSpring,
    Bungee,
    Buoyancy,
    Drag,
    Explosion,
    Gravity,
    StiffSpring,
    UserForce,
)
from ..scene.particle import Particle
from . import derived
from .compliances import springs_of
from .parameters import BODIES, PARTICLES

if TYPE_CHECKING:
    from .compile import Compiler


_PLAIN = ("anchor", "stiffness", "damping")


def _movable(c: Compiler, end: Particle | BodyPoint) -> int | None:
    return c.of(end) if isinstance(end, Particle) and end.movable else None


def add_forces(c: Compiler) -> None:
    """Force rows and a record per force."""
    scene = c.scene
    drags = scene.of(Drag)
    integrator = c.method.integrator
    stiff_springs = scene.of(StiffSpring)
    # Springs that the solver holds are no forces.
    summed_springs = [] if c.compliant else springs_of(scene)
    summed = (
        summed_springs
        or scene.of(Gravity, Buoyancy, Explosion, UserForce)
        or (drags and integrator.sums_drag)
        or (stiff_springs and integrator.smooth and not integrator.linear)
    )
    c.header["forced"] = int(bool(summed))
    force = c.take(3 * len(c.particles) + 3) if summed else -1
    c.header["force"] = force
    spare = force + 3 * len(c.particles)
    springs: list[int] = []
    for spring in summed_springs:
        stiffness = c.parameter(spring, "stiffness", spring.stiffness)
        rest = c.parameter(spring, "rest_length", spring.rest_length)
        if isinstance(spring, AnchoredSpring):
            a, b = spring.particle, c.parameter(spring, "anchor", spring.anchor)
            end = spare
            c.spring_ends.append((_movable(c, a), None))
        else:
            a, b, end = spring.a, c.at("position", spring.b), c.at("force", spring.b)
            c.spring_ends.append((_movable(c, a), _movable(c, spring.b)))
        kind = TWO_SIDED
        if isinstance(spring, Bungee | AnchoredBungee):
            kind = ONE_SIDED
        elif isinstance(spring, AnchoredSpring) and integrator.linear:
            index = _movable(c, a)
            if index is not None:
                kind = REST_ALONE
                c.linear.setdefault(index, []).append((spring, None, True))
        springs += [
            c.at("position", a),
            b,
            c.at("force", a),
            end,
            stiffness,
            rest,
            kind,
        ]
    c.sections["springs"] = springs
    c.sections["gravities"] = []
    gravities = scene.of(Gravity)
    if gravities:

        def mass(inverse: np.ndarray) -> np.ndarray:
            return np.where(inverse > 0.0, 1.0 / np.where(inverse > 0.0, inverse, 1.0), 0.0)

        masses = c.slot(len(c.particles), ((PARTICLES, "inverse_mass"),), mass)
        for gravity in gravities:
            g = c.parameter(gravity, "acceleration", gravity.acceleration)
            chosen: list[Any] = [*c.particles, *c.bodies.bodies]
            for p in chosen if gravity.particles is None else gravity.particles:
                mass_row = c.bodies.mass(p) if isinstance(p, Body) else masses + c.of(p)
                c.sections["gravities"] += [c.at("force", p), mass_row, g]
    c.sections["buoyancies"] = []
    for float_ in scene.of(Buoyancy):
        names = ("volume", "density", "gravity")
        for name in names:
            c.parameters.declare((float_, name), getattr(float_, name))
        surface = c.parameter(float_, "surface", float_.surface)
        half = c.parameter(float_, "half_depth", float_.half_depth)
        lift = c.slot(1, tuple((float_, name) for name in names), lambda v, r, g: v * r * g)
        p = float_.particle
        y, f = c.at("position", p) + 1, c.at("force", p) + 1
        c.sections["buoyancies"] += [y, f, surface, half, lift]
    _explosions(c)
    share = integrator.damping_share * c.method.substep
    c.sections["drags"] = []
    for drag in drags:
        linear = c.parameter(drag, "linear", drag.linear)
        quadratic = c.parameter(drag, "quadratic", drag.quadratic)
        wind = c.parameter(drag, "wind", drag.wind)
        everything: list[Any] = [*c.particles, *c.bodies.bodies]
        for p in everything if drag.particles is None else drag.particles:
            if p.movable:
                whole = isinstance(p, Body)
                index = c.bodies.index[id(p)] if whole else c.of(p)
                flow = c.slot(
                    2,
                    ((drag, "linear"), (BODIES if whole else PARTICLES, "inverse_mass")),
                    lambda k1, inverse, i=index: derived.drag(k1, inverse[i : i + 1], share)[:, 0],
                )
                f = c.at("force", p) if force >= 0 else -1
                brake = linear
                if integrator.linear:
                    # The flow holds what brakes; the wind's push k1 w is like a weight.
                    c.linear.setdefault(index, []).append((drag, "linear", False))
                    c.sections["gravities"] += [f, linear, wind]
                    brake = c.zero
                velocity = c.bodies.at("velocity", p) if whole else c.at("velocity", p)
                c.sections["drags"] += [
                    velocity, f, brake, quadratic, wind, flow, flow + 1,
                ]  # fmt: skip
    c.sections["stiff_springs"] = []
    for stiff in stiff_springs:
        if not stiff.particle.movable:
            for name in _PLAIN:
                c.parameters.declare((stiff, name), getattr(stiff, name))
        elif integrator.linear:
            for name in _PLAIN:
                c.parameters.declare((stiff, name), getattr(stiff, name))
            c.linear.setdefault(c.of(stiff.particle), []).append((stiff, "damping", True))
        elif integrator.smooth:
            _plain_spring(c, stiff, spare)
        else:
            _stiff_spring(c, stiff)


def _explosions(c: Compiler) -> None:
    explosions = c.scene.of(Explosion)
    c.header["now"] = c.take(1) if explosions else -1
    c.sections["explosions"] = []
    for explosion in explosions:
        keys = [(explosion, name) for name in ("place", *SETTINGS)]
        for key in keys:
            c.parameters.declare(key, getattr(explosion, key[1]))

        def settings(*values: np.ndarray) -> np.ndarray:
            worlds = max(value.ndim for value in values)
            if worlds == 1:
                return np.concatenate(values)
            width = max(value.shape[1] for value in values if value.ndim == 2)
            return np.concatenate(
                [np.broadcast_to(v.reshape(len(v), -1), (len(v), width)) for v in values]
            )

        rows = c.slot(3 + len(SETTINGS), tuple(keys), settings)
        start = c.model.places[explosion, "start"][0]
        chosen: list[Any] = [*c.particles, *c.bodies.bodies]
        for thing in chosen if explosion.particles is None else explosion.particles:
            if thing.movable:
                place = (
                    c.bodies.place(thing) if isinstance(thing, Body) else c.at("position", thing)
                )
                c.sections["explosions"] += [place, c.at("force", thing), rows, start]


def _plain_spring(c: Compiler, spring: StiffSpring, spare: int) -> None:
    """A stiff spring as an anchored spring of no rest length and a drag in still air."""
    p = spring.particle
    x, v, f = (c.at(name, p) for name in ("position", "velocity", "force"))
    rows = {name: c.parameter(spring, name, getattr(spring, name)) for name in _PLAIN}
    c.sections["springs"] += [x, rows["anchor"], f, spare, rows["stiffness"], c.zero, 0]
    c.spring_ends.append((c.of(p), None))
    c.sections["drags"] += [v, f, rows["damping"], c.zero, c.zero, -1, -1]


def _stiff_spring(c: Compiler, spring: StiffSpring) -> None:
    i = c.of(spring.particle)
    dt = c.method.substep
    anchor = c.parameter(spring, "anchor", spring.anchor)
    c.parameters.declare((spring, "stiffness"), spring.stiffness)
    c.parameters.declare((spring, "damping"), spring.damping)
    mass = (PARTICLES, "inverse_mass")
    p = c.slot(
        4,
        ((spring, "stiffness"), (spring, "damping"), mass),
        lambda k, c, inverse: derived.oscillator(k, c, inverse[i : i + 1], dt)[:, 0],
    )
    give = c.slot(1, ((spring, "stiffness"), mass), lambda k, inverse: 1 / (k * inverse[i : i + 1]))
    f = c.at("force", spring.particle) if c.header["force"] >= 0 else -1
    c.sections["stiff_springs"] += [
        c.at("position", spring.particle),
        c.at("velocity", spring.particle),
        c.at("acceleration", spring.particle),
        f,
        c.header["inverse_mass"] + i,
        p,
        anchor,
        give,
    ]
