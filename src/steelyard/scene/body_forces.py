"""Forces on rigid bodies as a person writes them; their kernels are in ``steelyard.forces``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from . import checks
from .body import Body, BodyPoint

_CONTROL = checks.Limit(least=-1.0, most=1.0, remedy="Use 0 for the middle.")


def check_point(thing: Any) -> None:
    """Make sure that a thing's ``point`` is one of a body.

    Raises:
        TypeError: it is not.
    """
    checks.instance(
        type(thing).__name__, "point", thing.point, BodyPoint, remedy="Use body.at((x, y, z))."
    )


@dataclass(eq=False)
class Wrench:
    """A force and a torque on a body, along the world's axes, that control sets: ``world[wrench].force = ...``.

    They act until something else is assigned.

    Args:
        body: what they act on.
        force: force [N] through the centre of mass at the start.
        torque: torque [N m] at the start.
    """

    body: Body
    force: checks.Vector = (0.0, 0.0, 0.0)
    torque: checks.Vector = (0.0, 0.0, 0.0)

    LIMITS: ClassVar[dict[str, checks.Rule]] = {}

    def __post_init__(self) -> None:
        checks.instance("Wrench", "body", self.body, Body, remedy="Give one.")
        checks.vectors(self, "force", "torque")


@dataclass(eq=False)
class Thruster:
    """A force fixed in a body: throttle times the greatest force, along a direction of the body's frame.

    Args:
        point: where it acts, ``body.at(...)``.
        direction: where it pushes, in the body's frame; of any length but 0.
        force: force at full throttle [N], above 0.
        throttle: at the start; ``world[thruster].throttle`` afterwards, in [-1, 1].
    """

    point: BodyPoint
    direction: checks.Vector
    force: float
    throttle: float = 0.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "direction": checks.Direction(remedy="Give an axis."),
        "force": checks.Limit(above=0.0, remedy="Give newtons."),
        "throttle": _CONTROL,
    }

    def __post_init__(self) -> None:
        check_point(self)
        checks.vectors(self, "direction")
        unit = self.LIMITS["direction"].check("Thruster", "direction", np.array(self.direction))
        self.direction = tuple(unit.tolist())
        checks.numbers(self, "force", "throttle")


def _matrix(thing: Any, name: str) -> None:
    """Make an attribute an array (3, 3).

    Raises:
        ValueError: it is none, or not finite.
    """
    value = checks.floats(getattr(thing, name))
    if value is None or value.shape not in ((3,), (3, 3)) or not np.isfinite(value).all():
        raise ValueError(
            f"{type(thing).__name__}: {name} is {getattr(thing, name)!r}; it must be a matrix (3, 3) or its "
            "diagonal (3,), finite [N s/m]. A surface that brakes along z alone has (0, 0, -k)."
        )
    setattr(thing, name, np.diag(value) if value.ndim == 1 else value.copy())


@dataclass(eq=False)
class AeroSurface:
    """An aerodynamic surface: F = A u in the body's frame, u the velocity of its point relative to the air.

    Source: Millington, *Game Physics Engine Development*, ch. 11, whose velocity of the air has the wrong sign.

    Args:
        point: where it acts, ``body.at(...)``.
        tensor: A [N s/m], a matrix (3, 3) or its diagonal, in the body's frame; a brake has negative numbers.
        wind: velocity of the air [m/s], along the world's axes.
    """

    point: BodyPoint
    tensor: Any
    wind: checks.Vector = (0.0, 0.0, 0.0)

    LIMITS: ClassVar[dict[str, checks.Rule]] = {}

    def __post_init__(self) -> None:
        check_point(self)
        checks.vectors(self, "wind")
        _matrix(self, "tensor")


@dataclass(eq=False)
class AngledAeroSurface(AeroSurface):
    """An aerodynamic surface whose tensor is given in a frame of its own, turned against the body's.

    Args:
        orientation: the turn, a quaternion (w, x, y, z); ``world[surface].orientation`` may be assigned, a sail's say.
    """

    orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0)

    LIMITS: ClassVar[dict[str, checks.Rule]] = {
        "orientation": checks.Direction(remedy="Give a quaternion (w, x, y, z), not all 0.")
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        name = type(self).__name__
        self.orientation = checks.quaternion(name, "orientation", self.orientation)


@dataclass(eq=False)
class ControlledAeroSurface(AeroSurface):
    """An aerodynamic surface with a control: its tensor lies between ``low`` at -1, ``tensor`` at 0 and ``high`` at 1.

    Args:
        low: A at control -1.
        high: A at control 1.
        control: at the start; ``world[surface].control`` afterwards, in [-1, 1].
    """

    low: Any = None
    high: Any = None
    control: float = 0.0

    LIMITS: ClassVar[dict[str, checks.Rule]] = {"control": _CONTROL}

    def __post_init__(self) -> None:
        super().__post_init__()
        _matrix(self, "low")
        _matrix(self, "high")
        checks.numbers(self, "control")


SURFACES = (AeroSurface, AngledAeroSurface, ControlledAeroSurface)
BODY_FORCES = (Wrench, Thruster, *SURFACES)
