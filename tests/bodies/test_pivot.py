"""Bodies that turn about a point that stands still: pendulums and tops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

import steelyard as sy
from steelyard.scene.shapes import rotation_matrix

G = 9.81


def pendulum(**more: Any) -> sy.Scene:
    """A level bar of 2 m held at one end."""
    scene = sy.Scene()
    scene.add(
        sy.Body(position=(0, 3, 0), parts=sy.Box((1.0, 0.05, 0.05)), pivot=(-1.0, 0, 0), **more)
    )
    return scene


def test_the_frame_of_a_body_with_a_pivot_lies_there() -> None:
    body = pendulum(mass=3.0).bodies[0]
    assert body.origin == (-1.0, 0.0, 0.0) and body.arm == (1.0, 0.0, 0.0)
    own = 3.0 * (2.0**2 + 0.1**2) / 12.0
    np.testing.assert_allclose(np.diag(body.inertia)[1:], own + 3.0)
    assert body.parts[0].offset == (1.0, 0.0, 0.0)


def test_a_physical_pendulum_has_its_period() -> None:
    """From level, T = 4 K(sin 45) sqrt(I / m g d)."""
    scene = pendulum()
    body = scene.bodies[0]
    period = 4.0 * float(ellipk(0.5)) * math.sqrt(body.inertia[2, 2] / (body.mass * G))
    world = sy.World(scene, method=sy.Method(sy.ComposedRattle(9), dt=period / 400))
    energy = float(world.energy[0])
    lowest = 3.0
    for _ in range(400):
        world.step()
        lowest = min(lowest, float(world.bodies.centre[0, 0, 1]))
    np.testing.assert_allclose(world.bodies.orientation[0, 0], (1, 0, 0, 0), atol=1e-8)
    assert lowest == pytest.approx(2.0, abs=1e-3)
    assert abs(float(world.energy[0]) - energy) < 1e-9 * body.mass * G
    np.testing.assert_array_equal(world.bodies.position[0, 0], (0, 3, 0))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_heavy_top_precesses_steadily(sign: float) -> None:
    """I1 cos(theta) W^2 - I3 w3 W + m g d = 0 has two rates; either goes round with the tilt unchanged."""
    mass, arm, across, along, tilt, rate = 1.0, 0.3, 0.03, 0.02, 0.5, 70.0
    first = across + mass * arm**2
    # The formula's first moment is less by the third, as its w3 is the whole spin about the axis.
    c = math.cos(tilt)
    # Torque m g d sin = W sin (I3 w3 - I1 W cos) + ..., solved for W.
    root = math.sqrt((along * rate) ** 2 - 4.0 * first * c * mass * G * arm)
    turning = (along * rate + sign * root) / (2.0 * first * c)
    axis = np.array([-math.sin(tilt), c, 0.0])
    # All spin: w3 along the axis, and W sin(theta) across it.
    across_axis = np.array([0.0, 1.0, 0.0]) - c * axis
    scene = sy.Scene()
    scene.add(
        sy.Body(
            position=(0, 0, 0),
            mass=mass,
            inertia=(across, along, across),
            pivot=(0, -arm, 0),
            orientation=(math.cos(tilt / 2), 0, 0, math.sin(tilt / 2)),
            angular_velocity=rate * axis + turning * across_axis,
        )
    )
    world = sy.World(scene, method=sy.Method(sy.ComposedRattle(9), dt=1.0 / 480.0))
    world.step(960)
    found = rotation_matrix(world.bodies.orientation[0, 0]) @ [0.0, 1.0, 0.0]
    angle = 2.0 * turning
    expected = [-math.sin(tilt) * math.cos(angle), c, math.sin(tilt) * math.sin(angle)]
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_forces_and_blows_turn_it_and_do_not_move_it() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    body = scene.add(
        sy.Body(
            position=(0, 0, 0),
            mass=2.0,
            inertia=(1, 1, 1),
            pivot=(0, -1.0, 0),
            acceleration=(0, 0, 0),
        )
    )
    wrench = scene.add(sy.Wrench(body, force=(3.0, 0, 0)))
    scene.add(sy.Gravity((0.0, 0.0, 1.0)))
    for integrator in (sy.Rattle(), sy.RungeKutta4(), sy.SymplecticEuler()):
        world = sy.World(scene, method=sy.Method(integrator, dt=1e-4))
        world.step()
        # Lever (0, 1, 0) times (3, 0, 0) and times 2 kg of (0, 0, 1).
        np.testing.assert_allclose(
            world.bodies.angular_momentum[0, 0], (2e-4, 0, -3e-4), atol=1e-10
        )
        np.testing.assert_array_equal(world.bodies.velocity, 0.0)
    world[wrench].force = 0.0
    world.reset()
    world.apply_impulse(body, (0, 0, 5.0))
    np.testing.assert_allclose(world.bodies.angular_momentum[0, 0], (5, 0, 0))
    # About x with moment 1 + 2: the centre of mass, 1 m off, moves with 5/3 m/s.
    np.testing.assert_allclose(world.momentum[0], (0, 0, 10 / 3), atol=1e-12)
    np.testing.assert_allclose(world.angular_momentum[0], (5, 0, 0), atol=1e-12)


def test_a_pivot_that_moves_is_refused() -> None:
    with pytest.raises(ValueError, match="which stands still; it must be 0"):
        pendulum(velocity=(1, 0, 0))
