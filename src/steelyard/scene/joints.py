"""Joints: what two bodies cannot do against each other, and what drives the rest.

A joint fixes a frame to each body, at one place and with the same axes at the start. Coordinates of a's frame against
b's: shifts along the axes of b (0, 1, 2), the angle about the first axis (3), and the distance of the places (6).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from . import checks
from .body import Body, BodyPoint
from .particle import Particle
from .shapes import rotation_matrix

_COUNTED = checks.Limit(least=0.0, remedy="Use 0 for none.")
_STRONG = checks.Limit(above=0.0, infinite=True, remedy="Use inf for a joint that never breaks.")
_BOUND = checks.Limit(infinite=True, remedy="Use -inf or inf for none.")

#: Locked coordinates: shifts, the first axis of a against the third and second of b, its second against the third, and
#: the distance.
SHIFTS, TURNS, HELD_AXIS, DISTANCE = (0, 1, 2), (3, 4, 5), (3, 4), 6
#: The angle of a drive.
ANGLE = 3


@dataclass(eq=False)
class Drive:
    """What acts along a free coordinate of a joint.

    Args:
        coordinate: 0, 1 or 2 (shift), 3 (angle about the first axis) or 6 (distance).
        low: least value [m or rad].
        high: largest value.
        speed: what the motor wants [m/s or rad/s]; assignable in a world, per world, as the state that control moves.
        strength: largest force or torque of the motor [N or N m]; 0 for none.
        stiffness: of a spring [N/m or N m/rad], taken implicitly, so that any will do.
        damping: of that [N s/m or N m s/rad].
        rest: value at which the spring is at rest.
    """

    coordinate: int
    low: float = -math.inf
    high: float = math.inf
    speed: float = 0.0
    strength: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "low": _BOUND,
        "high": _BOUND,
        "strength": _COUNTED,
        "stiffness": _COUNTED,
        "damping": _COUNTED,
        "speed": checks.Limit(remedy="Give m/s or rad/s."),
        "rest": checks.Limit(remedy="Give metres or radians."),
    }

    def __post_init__(self) -> None:
        if self.coordinate not in (*SHIFTS, ANGLE, DISTANCE):
            raise ValueError(
                f"Drive: coordinate is {self.coordinate!r}; it must be 0, 1 or 2 (a shift), 3 (the angle) or 6 (the "
                "distance). Use 3 for a hinge."
            )
        checks.numbers(self, *self.LIMITS)
        if not self.low <= self.high:
            raise ValueError(
                f"Drive: low is {self.low!r} and high is {self.high!r}; low must be at most high. Swap them."
            )


#: What may be assigned to joints in a world, by the names there.
_ASSIGNED: dict[str, checks.Rule] = {
    "break_force": _STRONG,
    "break_torque": _STRONG,
    **Drive.LIMITS,
    **{f"suspension_{name}": rule for name, rule in Drive.LIMITS.items()},
}


@dataclass(eq=False, kw_only=True)
class Joint:
    """Base of all joints; not to be used by itself.

    Args:
        a: a body.
        b: another one, or None for the world.
        place: where both are joined at the start [m], in the world.
        break_force: force at which it breaks [N]; never by default. What is broken stays so until ``reset``.
        break_torque: torque at which it breaks [N m].
        collide: whether both may touch each other.
    """

    a: Body
    b: Body | None = None
    place: checks.Vector = (0.0, 0.0, 0.0)
    break_force: float = math.inf
    break_torque: float = math.inf
    collide: bool = False

    locked: ClassVar[tuple[int, ...]] = ()
    LIMITS: ClassVar[dict[str, checks.Rule]] = _ASSIGNED

    def __post_init__(self) -> None:
        name = type(self).__name__
        checks.instance(name, "a", self.a, Body, remedy="Give one.")
        if self.b is not None:
            checks.instance(name, "b", self.b, Body, remedy="Give one, or None for the world.")
        if self.b is self.a:
            raise ValueError(f"{name}: a and b are the same body; it needs two. Give another.")
        if not self.a.movable and (self.b is None or not self.b.movable):
            raise ValueError(
                f"{name}: neither body can move; one at least must have a mass. Leave the joint out."
            )
        checks.vectors(self, "place")
        checks.numbers(self, "break_force", "break_torque")

    @property
    def axes(self) -> np.ndarray:
        """The frame's axes at the start, in the columns of a matrix (3, 3)."""
        return np.eye(3)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """What acts along free coordinates."""
        return ()

    @property
    def ends(self) -> tuple[tuple[Body | Particle | None, np.ndarray, np.ndarray], ...]:
        """Of both sides: the thing, the place in its frame (3,) and the axes in it (3, 3)."""
        return tuple(self._end(thing) for thing in (self.a, self.b))

    def _end(self, thing: Body | None) -> tuple[Body | None, np.ndarray, np.ndarray]:
        place, axes = np.array(self.place), self.axes
        if thing is None:
            return None, place, axes
        turn = rotation_matrix(np.array(thing.orientation))
        return thing, turn.T @ (place - np.array(thing.position)), turn.T @ axes

    def members(self) -> Iterator[Body | Particle]:
        """The things it joins."""
        yield from (thing for thing, _, _ in self.ends if thing is not None)


@dataclass(eq=False, kw_only=True)
class BallJoint(Joint):
    """Both bodies share a place and turn freely about it (see ``Joint``)."""

    locked: ClassVar[tuple[int, ...]] = SHIFTS


@dataclass(eq=False, kw_only=True)
class FixedJoint(Joint):
    """Both bodies move as one (see ``Joint``)."""

    locked: ClassVar[tuple[int, ...]] = SHIFTS + TURNS


@dataclass(eq=False, kw_only=True)
class HingeJoint(Joint):
    """Both bodies share a place and an axis, about which a may turn against b (see ``Joint``).

    Args:
        axis: direction at the start, in the world.
        drive: limits, motor and spring of the angle, from 0 at the start, in (-pi, pi].
    """

    axis: checks.Vector = (0.0, 0.0, 1.0)
    drive: Drive = field(default_factory=lambda: Drive(3))

    locked: ClassVar[tuple[int, ...]] = SHIFTS + HELD_AXIS
    LIMITS: ClassVar[dict[str, checks.Rule]] = _ASSIGNED | {
        "axis": checks.Direction(remedy="Use (0, 0, 1).")
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_axis(self, 3)

    @property
    def axes(self) -> np.ndarray:
        """The first is the hinge's."""
        return _axes_along(np.array(self.axis))

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Of the angle."""
        return (self.drive,)


@dataclass(eq=False, kw_only=True)
class SliderJoint(Joint):
    """Body a slides along an axis of b and does not turn against it (see ``Joint``).

    Args:
        axis: direction at the start, in the world.
        drive: limits, motor and spring of the shift, from 0 at the start.
    """

    axis: checks.Vector = (1.0, 0.0, 0.0)
    drive: Drive = field(default_factory=lambda: Drive(0))

    locked: ClassVar[tuple[int, ...]] = (1, 2, *TURNS)
    LIMITS: ClassVar[dict[str, checks.Rule]] = _ASSIGNED | {
        "axis": checks.Direction(remedy="Use (1, 0, 0).")
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_axis(self, 0)

    @property
    def axes(self) -> np.ndarray:
        """The first is the slider's."""
        return _axes_along(np.array(self.axis))

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Of the shift."""
        return (self.drive,)


@dataclass(eq=False, kw_only=True)
class WheelJoint(Joint):
    """Wheel a spins about an axis of body b, on a suspension across it (see ``Joint``).

    Args:
        axis: the axle's direction at the start, in the world.
        up: direction of the suspension, across the axle.
        drive: motor of the spin.
        suspension: spring and limits of the shift along ``up``, from 0 at the start.
    """

    axis: checks.Vector = (0.0, 0.0, 1.0)
    up: checks.Vector = (0.0, 1.0, 0.0)
    drive: Drive = field(default_factory=lambda: Drive(3))
    suspension: Drive = field(default_factory=lambda: Drive(1, stiffness=1e4, damping=1e3))

    locked: ClassVar[tuple[int, ...]] = (0, 2, *HELD_AXIS)
    LIMITS: ClassVar[dict[str, checks.Rule]] = _ASSIGNED | {
        "axis": checks.Direction(remedy="Use (0, 0, 1)."),
        "up": checks.Direction(remedy="Use (0, 1, 0)."),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_axis(self, 3)
        up = self.LIMITS["up"].check("WheelJoint", "up", np.asarray(self.up, dtype=np.float64))
        self.up = tuple(up.tolist())
        if abs(up @ np.array(self.axis)) > 1e-6:
            raise ValueError(
                f"WheelJoint: up is {self.up} and axis {self.axis}; they must be at right angles. Turn one of them."
            )
        if self.suspension.coordinate != 1:
            raise ValueError(
                f"WheelJoint: suspension has coordinate {self.suspension.coordinate}; it must be 1. Use Drive(1, ...)."
            )

    @property
    def axes(self) -> np.ndarray:
        """Axle, suspension, and across both."""
        axis, up = np.array(self.axis), np.array(self.up)
        return np.stack([axis, up, np.cross(axis, up)], axis=1)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Of the spin and of the suspension."""
        return (self.drive, self.suspension)


@dataclass(eq=False)
class DistanceJoint:
    """A weightless rod, or a range of distances, between points of bodies or particles.

    Args:
        a: a point of a body (``body.at(...)``) or a particle.
        b: another one.
        length: [m]; that at the start by default.
        drive: if given, the distance is free but for what this says (``Drive(6, low=..., high=...)``).
        break_force: force at which it breaks [N].
    """

    a: BodyPoint | Particle
    b: BodyPoint | Particle
    length: float | None = None
    drive: Drive | None = None
    break_force: float = math.inf
    break_torque: ClassVar[float] = math.inf
    collide: ClassVar[bool] = True
    LIMITS: ClassVar[dict[str, checks.Rule]] = _ASSIGNED | {
        "length": checks.Limit(above=0.0, remedy="Give metres.")
    }

    def __post_init__(self) -> None:
        for name in ("a", "b"):
            end = getattr(self, name)
            if not isinstance(end, BodyPoint | Particle):
                raise TypeError(
                    f"DistanceJoint: {name} is {end!r}; it must be a Particle or a point of a body. Use body.at(...)."
                )
        distance = float(np.linalg.norm(_start(self.a) - _start(self.b)))
        if distance == 0.0:
            raise ValueError(
                "DistanceJoint: a and b are at the same place, distance 0.0; it must be greater than 0, to have a "
                "direction. Use a BallJoint."
            )
        self.length = distance if self.length is None else self.length
        checks.numbers(self, "length", "break_force")
        if self.drive is not None and self.drive.coordinate != DISTANCE:
            raise ValueError(
                f"DistanceJoint: drive has coordinate {self.drive.coordinate}; it must be 6. Use Drive(6, ...)."
            )

    @property
    def locked(self) -> tuple[int, ...]:
        """The distance, unless a drive says otherwise."""
        return (DISTANCE,) if self.drive is None else ()

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Of the distance."""
        return () if self.drive is None else (self.drive,)

    @property
    def ends(self) -> tuple[tuple[Body | Particle | None, np.ndarray, np.ndarray], ...]:
        """Of both sides: the thing, the place in its frame (3,) and axes (3, 3)."""
        return tuple(
            (end.body, np.array(end.place), np.eye(3))
            if isinstance(end, BodyPoint)
            else (end, np.zeros(3), np.eye(3))
            for end in (self.a, self.b)
        )

    def members(self) -> Iterator[Body | Particle]:
        """The things it joins."""
        yield from (thing for thing, _, _ in self.ends if thing is not None)


def named_drives(joint: Joint | DistanceJoint) -> list[tuple[str, Drive]]:
    """Drives with what stands before their names in a world: nothing before those of the first."""
    return list(zip(("", "suspension_"), joint.drives, strict=False))


def _start(end: BodyPoint | Particle) -> np.ndarray:
    """Place at the start [m]."""
    if isinstance(end, Particle):
        return np.array(end.position)
    turn = rotation_matrix(np.array(end.body.orientation))
    return np.asarray(np.array(end.body.position) + turn @ np.array(end.place))


def _check_axis(joint: HingeJoint | SliderJoint | WheelJoint, coordinate: int) -> None:
    name = type(joint).__name__
    axis = joint.LIMITS["axis"].check(name, "axis", np.asarray(joint.axis, dtype=np.float64))
    joint.axis = tuple(axis.tolist())
    if joint.drive.coordinate != coordinate:
        raise ValueError(
            f"{name}: drive has coordinate {joint.drive.coordinate}; it must be {coordinate}. Use Drive({coordinate}, "
            "...)."
        )


def _axes_along(axis: np.ndarray) -> np.ndarray:
    """Axes in the columns of a matrix, the first of them given."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    second = np.cross(axis, helper)
    second /= np.linalg.norm(second)
    return np.stack([axis, second, np.cross(axis, second)], axis=1)


JOINTS = (BallJoint, FixedJoint, HingeJoint, SliderJoint, WheelJoint, DistanceJoint)
