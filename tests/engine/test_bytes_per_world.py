"""What one more world costs in memory: no array that the scene does not need."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import steelyard as sy

STAGED = sy.Method(sy.Rattle(), sy.Direct())
WORST_FIRST = sy.Method(sy.SymplecticEuler(), sy.WorstFirst())


def cost(*build: Callable[[sy.Particle, sy.Particle], object], method: sy.Method = STAGED) -> int:
    """Bytes per world of two particles and some things on them."""
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 2, 0), damping=0.9))
    b = scene.add(sy.Particle(position=(1, 2, 0)))
    for each in build:
        scene.add(each(a, b))
    return sy.World(scene, worlds=5, method=method).bytes_per_world


def test_a_free_particle_costs_its_position_and_velocity() -> None:
    # Beside 6 numbers per particle: the time and the two flags of the world's health.
    assert cost() <= 8 * (2 * 6 + 3)


FORCES: dict[str, Callable[[sy.Particle, sy.Particle], object]] = {
    "Gravity": lambda a, b: sy.Gravity((0, 1, 0)),
    "Drag": lambda a, b: sy.Drag(linear=1.0),
    "Spring": lambda a, b: sy.Spring(a, b, 1.0, 1.0),
    "Bungee": lambda a, b: sy.Bungee(a, b, 1.0, 1.0),
    "AnchoredSpring": lambda a, b: sy.AnchoredSpring(a, (0, 0, 0), 1.0, 1.0),
    "AnchoredBungee": lambda a, b: sy.AnchoredBungee(a, (0, 0, 0), 1.0, 1.0),
    "StiffSpring": lambda a, b: sy.StiffSpring(a, (0, 0, 0), 1.0),
    "Buoyancy": lambda a, b: sy.Buoyancy(a, 0.0, 1.0, 1.0),
}


@pytest.mark.parametrize("kind", FORCES)
def test_a_force_with_shared_parameters_costs_nothing(kind: str) -> None:
    assert cost(FORCES[kind]) == cost()


LINKED: dict[str, tuple[Callable[[sy.Particle, sy.Particle], object], int, int]] = {
    # Numbers in the state: multipliers with a staged solver, the moves of both ends with worst
    # first, and what control moves.
    "Rod": (lambda a, b: sy.Rod(a, b), 1, 6),
    "RodConstraint": (lambda a, b: sy.RodConstraint(a, (0, 5, 0)), 1, 6),
    "Cable": (lambda a, b: sy.Cable(a, b, 1.0), 1, 6),
    "CableConstraint": (lambda a, b: sy.CableConstraint(a, (0, 5, 0), 3.0), 1, 6),
    "winch": (lambda a, b: sy.Cable(a, b, 1.0, winch=True), 1 + 3, 6 + 3),
    "Ground": (lambda a, b: sy.Ground(), 2 * 3, 2 * 6),
    "Ground for one": (lambda a, b: sy.Ground(particles=[b]), 3, 6),
    "LinePlatform": (
        lambda a, b: sy.LinePlatform(start=(0, 0, 0), end=(1, 0, 0), radius=0.1, particles=[a]),
        3,
        6,
    ),
    # Weight, rate and acceleration of each deck particle; worst first holds no rider.
    "Rider": (lambda a, b: sy.Rider(b, [a]), 3 + 3, 0),
}


@pytest.mark.parametrize("kind", LINKED)
def test_links_and_contacts_cost_what_the_solver_remembers_of_them(kind: str) -> None:
    build, staged, worst_first = LINKED[kind]
    assert cost(build) - cost() == 8 * staged
    if worst_first:
        assert cost(build, method=WORST_FIRST) - cost() == 8 * worst_first


@pytest.mark.parametrize(
    "method",
    [
        sy.Method(sy.Rattle()),
        sy.Method(sy.ComposedRattle()),
        sy.Method(sy.ClosedForm()),
        sy.Method(sy.RungeKutta4()),
        sy.Method(sy.ExponentialRungeKutta()),
        sy.Method(sy.LinearlyImplicit()),
        sy.Method(sy.BackwardEuler()),
        sy.Method(sy.ImplicitMidpoint()),
        WORST_FIRST,
    ],
    ids=lambda method: type(method.solver or method.integrator).__name__,
)
def test_a_solver_without_links_and_contacts_costs_nothing(method: sy.Method) -> None:
    assert cost(method=method) == cost()


def test_written_functions_cost_what_they_return() -> None:
    force = cost(lambda a, b: sy.UserForce(lambda x, v, t: np.zeros(x.shape)))
    assert force - cost() == 8 * 2 * 3

    def none(x: np.ndarray, y: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(x.shape), np.zeros(x.shape[:2])

    contact = cost(lambda a, b: sy.ContactGenerator(none, [(a, b)]))
    # A normal and a depth per pair, and its multipliers.
    assert contact - cost() == 8 * (4 + 3)


def test_what_another_scene_uses_costs_nothing_here() -> None:
    before = cost()
    cost(*FORCES.values())
    cost(LINKED["Rod"][0], LINKED["Ground"][0])
    assert cost() == before


def test_a_parameter_costs_where_it_differs_between_worlds() -> None:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 2, 0)))
    spring = scene.add(sy.AnchoredSpring(a, (0, 0, 0), 1.0, 1.0))
    world = sy.World(scene, worlds=5)
    before = world.bytes_per_world
    world[spring].stiffness = 3.0
    assert world.bytes_per_world == before
    world[spring].stiffness = np.arange(1.0, 6.0)
    assert world.bytes_per_world == before + 8
    world[spring].anchor = np.ones((5, 3))
    assert world.bytes_per_world == before + 8 * 4
    world[spring].stiffness = 2.0
    world[spring].anchor = (0, 0, 0)
    assert world.bytes_per_world == before


@pytest.mark.parametrize("worlds", [1, 8, 100])
def test_the_cost_does_not_depend_on_the_number_of_worlds(worlds: int) -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 2, 0)))
    scene.add(sy.Ground())
    one = sy.World(scene).bytes_per_world
    assert sy.World(scene, worlds=worlds).bytes_per_world == one
