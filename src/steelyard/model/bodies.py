"""Rigid bodies, their points and the forces on them compiled to rows and records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..integrators.rotor import ROTOR_ROWS
from ..scene.body import Body, BodyPoint
from ..scene.body_forces import (
    SURFACES,
    AeroSurface,
    AngledAeroSurface,
    ControlledAeroSurface,
    Thruster,
    Wrench,
)
from ..scene.forces import Explosion
from ..scene.shapes import rotation_matrix
from . import derived
from .parameters import BODIES

if TYPE_CHECKING:
    from .compile import Compiler

_STATE = {"position": 3, "orientation": 4, "velocity": 3, "angular_momentum": 3}


class Bodies:
    """What the compiler needs to know of a scene's bodies.

    Attributes:
        bodies: all of them, in order.
        index: place of each among them, by identity.
    """

    def __init__(self, c: Compiler) -> None:
        self._c = c
        self.bodies: list[Body] = c.scene.bodies
        self.index = {id(body): k for k, body in enumerate(self.bodies)}
        self._rows: dict[str, int] = {}
        #: First row of the wrench of every body that a force acts on.
        self._wrenches: dict[int, int] = {}
        self._points: dict[tuple[int, tuple[float, ...]], dict[str, int]] = {}
        self._records: list[int] = []
        self._inverses: dict[int, int] = {}
        self._inertias: dict[int, int] = {}
        self._accelerations: dict[int, int] = {}
        self._masses: dict[int, int] = {}

    def state(self) -> None:
        """Rows of the state."""
        for name in _STATE if self.bodies else ():
            values = [getattr(body, name) for body in self.bodies]
            self._rows[name] = self._c.state((BODIES, name), values)
        for thing in self._c.scene.of(Explosion):
            self._c.state((thing, "start"), [thing.start])
        for thing in self._c.scene.of(Wrench):
            self._c.state((thing, "force"), thing.force)
            self._c.state((thing, "torque"), thing.torque)
        for thing in self._c.scene.of(Thruster):
            self._c.state((thing, "throttle"), [thing.throttle])
        for thing in self._c.scene.of(ControlledAeroSurface):
            self._c.state((thing, "control"), [thing.control])

    def at(self, name: str, body: Body) -> int:
        """First row of a part of the state of a body."""
        return self._rows[name] + _STATE[name] * self.index[id(body)]

    def wrench(self, body: Body) -> int:
        """First of six rows that sum force and torque on a body; its angular velocity is in three behind them."""
        if id(body) not in self._wrenches:
            self._wrenches[id(body)] = self._c.take(9)
        return self._wrenches[id(body)]

    def centre(self, body: Body) -> int:
        """First row of the force through a body's centre of mass."""
        return self.wrench(body) if body.pivot is None else self.point("force", body.at(body.arm))

    def place(self, body: Body) -> int:
        """First row of the position of a body's centre of mass."""
        if body.pivot is None:
            return self.at("position", body)
        return self.point("position", body.at(body.arm))

    def _inverse(self, body: Body) -> int:
        """Rows of the inverse inertia, 0 where the body is immovable."""
        if id(body) not in self._inverses:
            k = self.index[id(body)]
            six = slice(6 * k, 6 * k + 6)

            def inverse(value: np.ndarray) -> np.ndarray:
                return derived.inverse_inertia(value[six])

            self._inverses[id(body)] = (
                self._c.slot(6, ((BODIES, "inertia"),), inverse)
                if body.movable
                else self._c.constant(0.0, 6)
            )
        return self._inverses[id(body)]

    def acceleration(self, body: Body) -> int:
        """Rows of a body's constant acceleration."""
        if id(body) not in self._accelerations:
            three = slice(3 * self.index[id(body)], 3 * self.index[id(body)] + 3)
            self._accelerations[id(body)] = self._c.slot(
                3, ((BODIES, "acceleration"),), lambda value: value[three]
            )
        return self._accelerations[id(body)]

    def _inertia(self, body: Body) -> int:
        """Rows of the inertia."""
        if id(body) not in self._inertias:
            k = self.index[id(body)]
            six = slice(6 * k, 6 * k + 6)
            self._inertias[id(body)] = self._c.slot(
                6, ((BODIES, "inertia"),), lambda value: value[six]
            )
        return self._inertias[id(body)]

    def _inverse_mass(self, body: Body) -> int:
        """Row of the inverse mass."""
        if id(body) not in self._masses:
            k = self.index[id(body)]
            self._masses[id(body)] = self._c.slot(
                1, ((BODIES, "inverse_mass"),), lambda value: value[k : k + 1]
            )
        return self._masses[id(body)]

    def rows(self, body: Body) -> list[int]:
        """Rows of a body's state, inverse mass, inertia and inverse of that."""
        state = [self.at(name, body) for name in _STATE]
        return [*state, self._inverse_mass(body), self._inertia(body), self._inverse(body)]

    def point(self, name: str, point: BodyPoint) -> int:
        """First row of position, velocity or force of a point; those at one place are one."""
        body = point.body
        key = (id(body), tuple(point.place))
        if key not in self._points:
            place = np.array(point.place)
            local = self._c.slot(3, (), lambda: place)
            rows = {each: self._c.take(3) for each in ("position", "velocity", "force")}
            self._points[key] = rows
            self._records += [
                *(self.at(each, body) for each in ("position", "orientation", "velocity")),
                self.wrench(body) + 6, self.wrench(body), local, *rows.values(),
            ]  # fmt: skip
        return self._points[key][name]

    def mass(self, body: Body) -> int:
        """Row of a body's mass, 0 where it is immovable."""
        k = self.index[id(body)]

        def mass(inverse: np.ndarray) -> np.ndarray:
            own = inverse[k : k + 1]
            return np.where(own > 0.0, 1.0 / np.where(own > 0.0, own, 1.0), 0.0)

        return self._c.slot(1, ((BODIES, "inverse_mass"),), mass)

    def forces(self) -> None:
        """Records of the forces that act on bodies alone."""
        c = self._c
        c.sections["applied"] = []
        for thing in c.scene.of(Wrench):
            c.sections["applied"] += [
                self.centre(thing.body), self.wrench(thing.body) + 3, c.model.places[thing, "force"][0],
            ]  # fmt: skip
        c.sections["thrusts"] = []
        for thing in c.scene.of(Thruster):
            c.sections["thrusts"] += [
                self.at("orientation", thing.point.body), self.point("force", thing.point),
                c.parameter(thing, "direction", thing.direction), c.parameter(thing, "force", thing.force),
                c.model.places[thing, "throttle"][0],
            ]  # fmt: skip
        c.sections["surfaces"] = []
        for thing in c.scene.of(*SURFACES):
            point = thing.point
            c.sections["surfaces"] += [
                self.at("orientation", point.body), self.point("velocity", point), self.point("force", point),
                c.parameter(thing, "wind", thing.wind), *self._tensor(thing),
            ]  # fmt: skip

    def _tensor(self, thing: AeroSurface) -> list[int]:
        """Rows of a surface's matrix, of its changes by control, and of the control."""
        c = self._c
        if isinstance(thing, AngledAeroSurface):
            tensor = thing.tensor
            c.parameters.declare((thing, "orientation"), thing.orientation)

            def turned(quaternion: np.ndarray) -> np.ndarray:
                turn = rotation_matrix(np.moveaxis(quaternion, 0, -1))
                matrix = turn @ tensor @ np.swapaxes(turn, -1, -2)
                return np.moveaxis(matrix.reshape(*matrix.shape[:-2], 9), -1, 0)

            return [c.slot(9, ((thing, "orientation"),), turned), -1, -1, -1]
        tensor = thing.tensor
        c.parameters.declare((thing, "tensor"), tensor.ravel())
        base = c.slot(9, ((thing, "tensor"),), lambda value: value)
        if not isinstance(thing, ControlledAeroSurface):
            return [base, -1, -1, -1]
        changes = []
        for name in ("low", "high"):
            c.parameters.declare((thing, name), np.asarray(getattr(thing, name)).ravel())
            keys = ((thing, name), (thing, "tensor"))
            changes.append(c.slot(9, keys, _difference))
        return [base, *changes, c.model.places[thing, "control"][0]]

    def finish(self) -> None:
        """Records of points and bodies; parameters of bodies."""
        c = self._c
        c.header["rotor"], c.header["bodies_damped"] = -1, 0
        if not self.bodies:
            return
        self._declare()
        moving = [body for body in self.bodies if body.movable]
        c.sections["points"] = self._records
        c.sections["wrenched"] = [
            word
            for body in self.bodies
            if (row := self._wrenches.get(id(body))) is not None
            for word in (
                row, self.at("orientation", body), self.at("angular_momentum", body), self._inverse(body), row + 6,
            )
        ]  # fmt: skip
        nothing = c.constant(0.0, 6)
        c.header["rotor"] = c.take(ROTOR_ROWS)
        c.header["bodies_damped"] = int(self.damped)
        c.sections["bodies"] = []
        integrator = c.method.integrator
        work = integrator.body_work
        if len(integrator.fractions) > 1:
            damping = c.take(2 * len(moving))
        else:
            damping = self.powers(integrator.damping_share * c.method.substep)
        for place, body in enumerate(moving):
            *state, mass, inertia, inverse = self.rows(body)
            c.sections["bodies"] += [
                *state, self._wrenches.get(id(body), nothing), mass, inertia, inverse,
                self.acceleration(body),
                damping + 2 * place,
                c.take(work),
                *self._pivot(body),
            ]  # fmt: skip

    @property
    def damped(self) -> bool:
        """Whether any body loses speed by itself."""
        return any(body.damping != 1.0 or body.angular_damping != 1.0 for body in self.bodies)

    def powers(self, time: float) -> int:
        """Rows of what damping keeps of v and w over a time, of each movable body; -1 where there is none.

        Methods that take damping as a force get its rates instead.
        """
        chosen = [k for k, body in enumerate(self.bodies) if body.movable]
        if not chosen:
            return -1
        smooth = self._c.method.integrator.smooth

        def kept(linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
            pairs = [part[k] for k in chosen for part in (linear, angular)]
            both = np.stack(np.broadcast_arrays(*pairs))
            return derived.rate(both) if smooth else derived.decay(both, time)

        keys = ((BODIES, "damping"), (BODIES, "angular_damping"))
        return self._c.slot(2 * len(chosen), keys, kept)

    def _pivot(self, body: Body) -> tuple[int, int]:
        """Rows of the mass of a body with a pivot and of its arm."""
        if body.pivot is None:
            return -1, -1
        arm = np.array(body.arm)
        return self.mass(body), self._c.slot(3, (), lambda: arm)

    def _declare(self) -> None:
        scene, declare = self._c.scene, self._c.parameters.declare
        inverse = np.array([body.inverse_mass for body in self.bodies], dtype=np.float64)
        movable = inverse > 0.0

        def check_mass(value: np.ndarray) -> None:
            now = value > 0.0
            if (now != (movable if value.ndim == 1 else movable[:, None])).any():
                raise ValueError(
                    "World: an immovable body cannot be given a finite mass, nor a movable one made immovable, while "
                    "worlds exist. Change the scene instead."
                )

        def check_inertia(value: np.ndarray) -> None:
            each = value.reshape(len(self.bodies), 6, -1)[movable]
            moments = np.linalg.eigvalsh(derived.symmetric(np.moveaxis(each, 1, 0)))
            bad = (moments[..., 0] <= 0.0) | (
                moments[..., 2] > (moments[..., 0] + moments[..., 1]) * (1.0 + 1e-9)
            )
            if bad.any():
                first = np.argwhere(bad)[0]
                raise ValueError(
                    f"World: inertia has principal moments {tuple(moments[tuple(first)].tolist())}; they must be above "
                    "0, each at most the sum of the others. Scale the inertia of a real body."
                )

        declare((BODIES, "inverse_mass"), inverse, check_mass)
        inertia = np.stack([np.asarray(body.inertia)[derived.LOWER] for body in self.bodies])
        declare((BODIES, "inertia"), inertia.ravel(), check_inertia)
        declare((BODIES, "damping"), [body.damping for body in self.bodies])
        declare((BODIES, "angular_damping"), [body.angular_damping for body in self.bodies])
        own = [
            scene.gravity if body.acceleration is None else body.acceleration
            for body in self.bodies
        ]
        declare((BODIES, "acceleration"), np.array(own, dtype=np.float64).ravel())


def _difference(there: np.ndarray, here: np.ndarray) -> np.ndarray:
    if there.ndim == here.ndim:
        return there - here
    return there.reshape(len(there), -1) - here.reshape(len(here), -1)
