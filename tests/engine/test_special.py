"""Worlds whose stages are compiled for their scene alone."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import steelyard as sy

METHOD = sy.Method(sy.Rattle(), sy.Direct(tolerance=1e-5), dt=0.02)


def shaken(*, special: bool, worlds: int = 20) -> sy.World:
    """Platforms on their feet, each pushed its own way so that some slip and some lift a foot."""
    world = sy.World(sy.scenes.platform(), worlds=worlds, method=METHOD, special=special)
    random = np.random.default_rng(3)
    world.particles.velocity[:] += 2.0 * random.standard_normal((worlds, 1, 3))
    return world


def test_the_bits_are_those_of_ordinary_stages() -> None:
    ordinary, special = shaken(special=False), shaken(special=True)
    for world in (ordinary, special):
        for _ in range(40):
            world.step()
    np.testing.assert_array_equal(special.state, ordinary.state)


def test_an_assigned_damping_changes_the_code() -> None:
    ordinary, special = shaken(special=False), shaken(special=True)
    for world in (ordinary, special):
        world.step(2)
        world.particles.damping = 1.0
        world.step(2)
        world.particles.damping = 0.5
        world.step(2)
    np.testing.assert_array_equal(special.state, ordinary.state)


def test_a_pickled_world_and_one_with_more_in_it_go_on() -> None:
    ordinary, special = shaken(special=False), shaken(special=True)
    again = pickle.loads(pickle.dumps(special))
    for world in (ordinary, again):
        world.step(2)
        world.add(sy.Particle(position=(0.0, 9.0, 0.0)))
        world.step(2)
    np.testing.assert_array_equal(again.state, ordinary.state)


def test_stages_that_call_others_are_refused() -> None:
    with pytest.raises(ValueError, match="special"):
        sy.World(
            sy.scenes.platform(), method=sy.Method(sy.ImpactRattle(), sy.Direct()), special=True
        )
