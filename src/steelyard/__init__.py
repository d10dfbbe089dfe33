"""Steelyard: a batched physics engine that lets you weigh speed against accuracy."""

from . import draw, extension, scenes
from .candidates import (
    CANDIDATES,
    Candidate,
    candidates,
    contacts_at_a_time,
    kinks_per_second,
)
from .choice import Choice, Considered, choose_method
from .diagnostics.landmarks import landmarks
from .integrators.backward_euler import BackwardEuler
from .integrators.closed_form import ClosedForm, flight, flight_fall_time, flight_impact
from .integrators.composed_rattle import ComposedRattle
from .integrators.explicit_euler import ExplicitEuler
from .integrators.exponential import ExponentialRungeKutta
from .integrators.generalised_alpha import GeneralisedAlpha
from .integrators.impact_rattle import ImpactRattle
from .integrators.implicit_midpoint import ImplicitMidpoint
from .integrators.kink_rk4 import KinkRungeKutta4
from .integrators.linearly_implicit import LinearlyImplicit
from .integrators.rattle import Rattle
from .integrators.rk4 import RungeKutta4
from .integrators.step_impact import hermite, hermite_fall_time, step_impact
from .integrators.symplectic_euler import SymplecticEuler
from .kernel import inner, kernel
from .math.random import normal, uniform, uniform_between
from .methods import Method
from .scene.body import Body, BodyPoint
from .scene.body_forces import (
    AeroSurface,
    AngledAeroSurface,
    ControlledAeroSurface,
    Thruster,
    Wrench,
)
from .scene.contacts import Collisions, ContactGenerator, Ground, LinePlatform
from .scene.forces import (
    AnchoredBungee,
    AnchoredSpring,
    Bungee,
    Buoyancy,
    Drag,
    Explosion,
    Gravity,
    Spring,
    StiffSpring,
    UserForce,
)
from .scene.joints import (
    BallJoint,
    DistanceJoint,
    Drive,
    FixedJoint,
    HingeJoint,
    SliderJoint,
    WheelJoint,
)
from .scene.links import Cable, CableConstraint, Rod, RodConstraint
from .scene.particle import Particle
from .scene.rider import Rider
from .scene.scene import Scene
from .scene.shapes import Box, Capsule, Hollow, Part, Sphere
from .scene.triggers import Trigger
from .solvers.direct import Direct
from .solvers.gauss_seidel import GaussSeidel
from .solvers.proximal_newton import ProximalNewton
from .solvers.soft_step import SoftStep
from .solvers.worst_first import WorstFirst
from .solvers.xpbd import Xpbd
from .stepping import advance
from .world import World

__all__ = [
    "CANDIDATES",
    "AeroSurface",
    "AnchoredBungee",
    "AnchoredSpring",
    "AngledAeroSurface",
    "BackwardEuler",
    "BallJoint",
    "Body",
    "BodyPoint",
    "Box",
    "Bungee",
    "Buoyancy",
    "Cable",
    "CableConstraint",
    "Candidate",
    "Capsule",
    "Choice",
    "ClosedForm",
    "Collisions",
    "ComposedRattle",
    "Considered",
    "ContactGenerator",
    "ControlledAeroSurface",
    "Direct",
    "DistanceJoint",
    "Drag",
    "Drive",
    "ExplicitEuler",
    "Explosion",
    "ExponentialRungeKutta",
    "FixedJoint",
    "GaussSeidel",
    "GeneralisedAlpha",
    "Gravity",
    "Ground",
    "HingeJoint",
    "Hollow",
    "ImpactRattle",
    "ImplicitMidpoint",
    "KinkRungeKutta4",
    "LinePlatform",
    "LinearlyImplicit",
    "Method",
    "Part",
    "Particle",
    "ProximalNewton",
    "Rattle",
    "Rider",
    "Rod",
    "RodConstraint",
    "RungeKutta4",
    "Scene",
    "SliderJoint",
    "SoftStep",
    "Sphere",
    "Spring",
    "StiffSpring",
    "SymplecticEuler",
    "Thruster",
    "Trigger",
    "UserForce",
    "WheelJoint",
    "World",
    "WorstFirst",
    "Wrench",
    "Xpbd",
    "advance",
    "candidates",
    "choose_method",
    "contacts_at_a_time",
    "draw",
    "extension",
    "flight",
    "flight_fall_time",
    "flight_impact",
    "hermite",
    "hermite_fall_time",
    "inner",
    "kernel",
    "kinks_per_second",
    "landmarks",
    "normal",
    "scenes",
    "step_impact",
    "uniform",
    "uniform_between",
]
