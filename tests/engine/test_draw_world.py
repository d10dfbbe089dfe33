"""A world's drawing shows everything it holds, where it is."""

import numpy as np
import pytest

import steelyard as sy
from steelyard.draw import palette
from steelyard.scene.shapes import rotation_matrix


def one_of_each() -> sy.Scene:
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0.0, 3.0, 0.0)))
    b = scene.add(sy.Particle(position=(1.0, 3.0, 0.0)))
    c = scene.add(sy.Particle(position=(0.0, 0.2, 1.0), radius=0.2))
    post = scene.add(sy.Particle(position=(4.0, 3.0, 0.0), inverse_mass=0.0))
    load = scene.add(sy.Particle(position=(0.5, 3.0, 0.0)))
    scene.add(sy.Rod(a, b))
    scene.add(sy.RodConstraint(a, anchor=(0.0, 5.0, 0.0)))
    scene.add(sy.Cable(b, post, max_length=3.0))
    scene.add(sy.CableConstraint(b, anchor=(1.0, 5.0, 0.0), max_length=9.0))
    scene.add(sy.Spring(a, c, stiffness=1.0, rest_length=1.0))
    scene.add(sy.Bungee(b, c, stiffness=1.0, rest_length=9.0))
    scene.add(sy.AnchoredSpring(c, anchor=(2.0, 2.0, 2.0), stiffness=1.0, rest_length=9.0))
    scene.add(sy.Rider(load, [a, b]))
    scene.add(sy.Ground())
    scene.add(sy.LinePlatform(start=(5.0, 1.0, 0.0), end=(7.0, 1.0, 0.0), radius=0.1))
    return scene


def test_every_thing_is_drawn_where_it_is() -> None:
    world = sy.World(one_of_each(), worlds=3)
    world.particles.position[2, :, 0] += 1.0
    drawing = sy.draw.draw_world(world, 2)
    balls = [circle for circle in drawing.circles if circle.fill]
    centres = np.array([circle.centre for circle in balls])
    for place in world.particles.position[2]:
        assert np.abs(centres - place).sum(axis=1).min() == 0.0
    assert sum(circle.color == palette.LOAD for circle in balls) == 1
    assert max(circle.radius for circle in balls) == 0.2
    colors = {line.color for line in drawing.lines}
    assert {palette.STEEL, palette.ROPE, palette.TARGET, palette.WIND, palette.EARTH} <= colors
    # Slack: the cable to the anchor and the bungee; the cable to the post is taut in the world that was moved.
    assert any(len(color) == 4 for color in colors)
    assert len(drawing.faces) == 1


def test_touching_contacts_are_marked_and_no_others() -> None:
    world = sy.World(one_of_each())
    rings = [circle for circle in sy.draw.draw_world(world).circles if not circle.fill]
    assert [ring.centre for ring in rings] == [(0.0, 0.0, 1.0)]
    world.particles.position[0, 2, 1] = 1.0
    assert all(circle.fill for circle in sy.draw.draw_world(world).circles)


def test_forces_are_arrows_in_proportion() -> None:
    scene = sy.Scene(gravity=(0.0, -10.0, 0.0))
    for mass in (1.0, 3.0):
        scene.add(sy.Particle(position=(mass, 1.0, 0.0), mass=mass))
    drawing = sy.draw.draw_world(sy.World(scene), forces=True)
    shafts = [
        np.subtract(line.end, line.start) for line in drawing.lines if line.end[0] == line.start[0]
    ]
    lengths = sorted(np.linalg.norm(shaft) for shaft in shafts)
    assert lengths[-1] == pytest.approx(3.0 * lengths[0])
    assert all(shaft[1] < 0.0 for shaft in shafts)


def test_a_broken_world_still_makes_a_drawing() -> None:
    world = sy.World(one_of_each())
    world.particles.position[0, 0] = np.nan
    assert sy.draw.draw_world(world, forces=True).circles


def test_a_world_that_is_not_there_is_refused() -> None:
    with pytest.raises(IndexError, match="index is 3"):
        sy.draw.draw_world(sy.World(one_of_each(), worlds=3), 3)


def test_bodies_are_drawn_as_they_lie() -> None:
    scene = sy.Scene()
    box = scene.add(
        sy.Body(
            position=(1.0, 2.0, 0.0),
            parts=[sy.Box((0.5, 0.1, 0.2)), sy.Part(shape=sy.Sphere(0.3), offset=(0.0, 0.0, 0.0))],
        )
    )
    scene.add(sy.Body(position=(-2.0, 2.0, 0.0), parts=sy.Capsule(0.1, 0.4), inverse_mass=0.0))
    scene.add(sy.Body(position=(0.0, 4.0, 0.0), inertia=(1.0, 1.0, 1.0)))
    scene.add(sy.AnchoredSpring(box.at((0.5, 0.0, 0.0)), (1.0, 5.0, 0.0), 1.0, 1.0))
    world = sy.World(scene, worlds=2)
    # A quarter turn about z lays the long side upright.
    world.bodies.orientation[1, 0] = np.array([1.0, 0.0, 0.0, 1.0]) / np.sqrt(2.0)
    drawing = sy.draw.draw_world(world, 1)
    corners = np.array([point for face in drawing.faces for point in face.points])
    assert len(drawing.faces) == 6
    np.testing.assert_allclose(np.ptp(corners, axis=0), (0.2, 1.0, 0.4), atol=1e-12)
    np.testing.assert_allclose(corners.mean(axis=0), (1.0, 2.0, 0.0), atol=1e-12)
    tip = np.array([line.start for line in drawing.lines if line.color == palette.TARGET])
    assert np.abs(tip - (1.0, 2.5, 0.0)).sum(axis=1).min() < 1e-12
    assert any(line.width == 0.2 and line.color == palette.EARTH for line in drawing.lines)
    axes = [line for line in drawing.lines if line.start == (0.0, 4.0, 0.0)]
    assert len(axes) == 3


def test_joints_contacts_of_bodies_and_triggers_are_drawn() -> None:
    scene = sy.Scene()
    box = scene.add(sy.Body(position=(0, 0.5, 0), parts=sy.Box((0.5, 0.5, 0.5))))
    arm = scene.add(sy.Body(position=(0.9, 1.2, 0), parts=sy.Capsule(0.1, 0.3)))
    hinge = scene.add(sy.HingeJoint(a=arm, b=box, place=(0.5, 1.2, 0)))
    scene.add(sy.Ground())
    scene.add(sy.Trigger(sy.Sphere(0.4), place=(2, 1, 0)))
    world = sy.World(scene, worlds=2)
    world.step(30)
    drawing = sy.draw.draw_world(world, 1)
    volumes = [c for c in drawing.circles if len(c.color) == 4]
    assert len([c for c in volumes if c.centre == (2.0, 1.0, 0.0)]) >= 1
    marks = [line for line in drawing.lines if line.color == palette.LOAD]
    assert len(marks) == 1
    place = world.bodies.position[1, 0] + rotation_matrix(world.bodies.orientation[1, 0]) @ (
        0.5,
        0.7,
        0,
    )
    np.testing.assert_allclose(np.mean([marks[0].start, marks[0].end], axis=0), place, atol=1e-6)
    rings = [c for c in drawing.circles if c.color == palette.CONTACT]
    assert len(rings) == int((np.linalg.norm(world.contacts.force[1], axis=1) > 0).sum()) >= 3
    world[hinge].broken = 1.0
    assert palette.LOAD not in [line.color for line in sy.draw.draw_world(world, 1).lines]
