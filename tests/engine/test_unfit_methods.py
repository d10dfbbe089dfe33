"""A method refuses what it cannot do, and takes what it can."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import steelyard as sy
from steelyard.scene.scene import CONTACTS, FORCES, LINKS
from tests.engine.refusals import ORIGIN, pair, refused, things

NAN, INF = math.nan, math.inf
A = sy.Particle(position=(0, 0, 0), radius=0.1)
B = sy.Particle(position=(1, 0, 0))


@pytest.mark.parametrize("dt", [0.0, -0.01, NAN, INF, "fast"])
def test_a_step_that_is_no_step(dt: Any) -> None:
    with refused("dt", repr(dt), "greater than 0"):
        sy.Method(sy.Rattle(), dt=dt)


def test_methods_made_of_the_wrong_parts() -> None:
    with refused("integrator", "Rattle"):
        sy.Method(sy.Rattle)
    with refused("integrator", "Direct"):
        sy.Method(sy.Direct())
    with refused("solver", "Direct"):
        sy.Method(sy.Rattle(), sy.Direct)
    scene, *_ = pair()
    with refused("method", "Rattle"):
        sy.World(scene, method=sy.Rattle())
    with refused("scene"):
        sy.World("bridge")


@pytest.mark.parametrize(
    "solver",
    [
        lambda bad: sy.GaussSeidel(passes=bad),
        lambda bad: sy.Direct(passes=bad),
        lambda bad: sy.WorstFirst(iterations=bad),
        lambda bad: sy.Xpbd(iterations=bad),
        lambda bad: sy.Xpbd(substeps=bad),
    ],
    ids=["GaussSeidel", "Direct", "WorstFirst", "Xpbd", "Xpbd substeps"],
)
@pytest.mark.parametrize("bad", [-1, 2.5, NAN, INF, "x"], ids=str)
def test_passes_are_a_whole_number(solver: Callable[..., Any], bad: Any) -> None:
    with refused(repr(bad), "whole number"):
        sy.Method(sy.ExplicitEuler(), solver(bad))


@pytest.mark.parametrize("bad", [-1e-9, 0.0, NAN, INF, "x"], ids=str)
def test_a_tolerance_that_cannot_be_met(bad: Any) -> None:
    with refused("tolerance", repr(bad)):
        sy.Method(sy.Rattle(), sy.Direct(tolerance=bad))


HELD = [thing for thing in things(A, B) if isinstance(thing, (*LINKS, *CONTACTS, sy.Rider))]
STAGED = [sy.Direct(), sy.GaussSeidel()]
SMOOTH = [
    sy.RungeKutta4(),
    sy.KinkRungeKutta4(),
    sy.ExponentialRungeKutta(),
    sy.LinearlyImplicit(),
    sy.BackwardEuler(),
    sy.ImplicitMidpoint(),
]
# What cannot be combined, whatever the scene holds.
UNFIT = [
    (sy.ExplicitEuler(), None),
    (sy.ExplicitEuler(), sy.Direct()),
    (sy.ExplicitEuler(), sy.GaussSeidel()),
    (sy.SymplecticEuler(), None),
    (sy.Rattle(), None),
    (sy.ComposedRattle(), None),
    (sy.ComposedRattle(), sy.WorstFirst()),
    (sy.Rattle(), sy.WorstFirst()),
    (sy.ClosedForm(), None),
    (sy.ClosedForm(), sy.Direct()),
    (sy.ClosedForm(), sy.GaussSeidel()),
    (sy.ClosedForm(), sy.WorstFirst()),
    *(
        (i, sy.Xpbd())
        for i in (sy.ExplicitEuler(), sy.Rattle(), sy.ClosedForm(), sy.ComposedRattle())
    ),
    *((i, s) for i in SMOOTH for s in (None, *STAGED, sy.WorstFirst(), sy.Xpbd())),
    *((sy.GeneralisedAlpha(), s) for s in (*STAGED, sy.WorstFirst(), sy.Xpbd())),
]
FIT = [
    (sy.ExplicitEuler(), sy.WorstFirst()),
    (sy.SymplecticEuler(), sy.WorstFirst()),
    (sy.SymplecticEuler(), sy.Direct()),
    (sy.SymplecticEuler(), sy.GaussSeidel()),
    (sy.SymplecticEuler(), sy.Xpbd()),
    (sy.Rattle(), sy.Direct()),
    (sy.Rattle(), sy.GaussSeidel()),
    (sy.ComposedRattle(), sy.Direct()),
    (sy.ComposedRattle(), sy.GaussSeidel()),
]


def _names(method: Any) -> str:
    return "-".join(type(part).__name__ for part in method)


def test_every_combination_is_either_fit_or_unfit() -> None:
    integrators = [sy.ExplicitEuler, sy.SymplecticEuler, sy.Rattle, sy.ClosedForm]
    integrators += [*map(type, SMOOTH), sy.ComposedRattle]
    integrators.append(sy.GeneralisedAlpha)
    solvers = [type(None), sy.WorstFirst, sy.Direct, sy.GaussSeidel, sy.Xpbd]
    tried = [(type(i), type(s)) for i, s in UNFIT + FIT]
    tried.append((sy.GeneralisedAlpha, type(None)))  # takes links, no contacts
    assert sorted(map(str, tried)) == sorted(str((i, s)) for i in integrators for s in solvers)


@pytest.mark.parametrize("method", UNFIT, ids=_names)
@pytest.mark.parametrize("k", range(len(HELD)), ids=lambda k: type(HELD[k]).__name__)
def test_a_method_that_cannot_hold_what_the_scene_holds(method: Any, k: int) -> None:
    scene, a, b = pair()
    thing = [t for t in things(a, b) if isinstance(t, (*LINKS, *CONTACTS, sy.Rider))][k]
    scene.add(thing)
    integrator, solver = method
    words = [type(integrator).__name__, "Use "]
    if solver is None or not (integrator.solver_stages or integrator.holds_links):
        words.append(type(thing).__name__)
    else:
        words.append(type(solver).__name__)
    with refused(*words, kind=ValueError):
        sy.World(scene, method=sy.Method(integrator, solver))


@pytest.mark.parametrize("method", FIT, ids=_names)
@pytest.mark.parametrize("k", range(len(HELD)), ids=lambda k: type(HELD[k]).__name__)
def test_a_method_that_can_hold_it(method: Any, k: int) -> None:
    scene, a, b = pair()
    thing = [t for t in things(a, b) if isinstance(t, (*LINKS, *CONTACTS, sy.Rider))][k]
    scene.add(thing)
    if isinstance(thing, sy.Rider) and isinstance(method[1], sy.WorstFirst):
        with refused("WorstFirst", "Rider", "Direct()", kind=ValueError):
            sy.World(scene, method=sy.Method(*method))
    elif method[0].reverses and isinstance(thing, (sy.Cable, sy.CableConstraint, *CONTACTS)):
        with refused("ComposedRattle", type(thing).__name__, "backwards", kind=ValueError):
            sy.World(scene, method=sy.Method(*method))
    else:
        world = sy.World(scene, method=sy.Method(*method))
        world.step(2)
        assert world.health[0] & 1 == 0


@pytest.mark.parametrize("kind", FORCES)
def test_closed_form_flight_takes_no_force(kind: type) -> None:
    scene, a, b = pair()
    scene.add(next(thing for thing in things(a, b) if type(thing) is kind))
    with refused("ClosedForm", kind.__name__, "constant acceleration", "Rattle()"):
        sy.World(scene, method=sy.Method(sy.ClosedForm()))


@pytest.mark.parametrize("k", range(len(HELD)), ids=lambda k: type(HELD[k]).__name__)
def test_a_stiff_spring_acts_alone(k: int) -> None:
    scene, a, b = pair()
    scene.add(sy.StiffSpring(a, ORIGIN, 1.0))
    thing = [t for t in things(a, b) if isinstance(t, (*LINKS, *CONTACTS, sy.Rider))][k]
    scene.add(thing)
    solver = sy.WorstFirst() if not isinstance(thing, sy.Rider) else sy.Direct()
    with refused("StiffSpring", type(thing).__name__, "AnchoredSpring"):
        sy.World(scene, method=sy.Method(sy.SymplecticEuler(), solver))


def test_a_stiff_spring_shares_no_ground_by_default() -> None:
    scene, a, b = pair()
    scene.add(sy.StiffSpring(a, ORIGIN, 1.0))
    ground = scene.add(sy.Ground())
    with refused("StiffSpring", "Ground", "name the other particles"):
        sy.World(scene)
    scene.remove(ground)
    scene.add(sy.Ground(particles=[b]))
    sy.World(scene).step()


def test_explicit_euler_drives_no_winch() -> None:
    scene, a, b = pair()
    scene.add(sy.Cable(a, b, 1.0, winch=True))
    with refused("ExplicitEuler", "winch", "Rattle()"):
        sy.World(scene, method=sy.Method(sy.ExplicitEuler(), sy.WorstFirst()))


def test_adding_what_the_method_cannot_hold_leaves_the_world_as_it_was() -> None:
    scene, a, b = pair()
    world = sy.World(scene, method=sy.Method(sy.Rattle()))
    world.step(5)
    before = world.particles.position.copy()
    with refused("Rattle", "Rod", "solver"):
        world.add(sy.Rod(a, b))
    assert len(world.scene.things) == 2
    np.testing.assert_array_equal(world.particles.position, before)
    world.step(5)
