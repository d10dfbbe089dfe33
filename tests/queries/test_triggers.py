"""Triggers against looking at every step oneself, for particles and bodies."""

from __future__ import annotations

import numpy as np
import pytest

import steelyard as sy
from steelyard.scene.shapes import rotation_matrix


def test_what_falls_through_enters_stays_and_leaves() -> None:
    """A ball of .25 m through a box of 1 m: by the parabola, when."""
    scene = sy.Scene()
    ball = scene.add(sy.Particle(position=(0, 5, 0), mass=1.0, radius=0.25))
    body = scene.add(sy.Body(position=(0.4, 5, 0), parts=sy.Sphere(0.25)))
    aside = scene.add(sy.Particle(position=(5, 5, 0), mass=1.0, radius=0.25))
    gate = scene.add(sy.Trigger(sy.Box((1, 0.5, 1)), place=(0, 2, 0)))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), dt=1 / 240))
    seen = []
    for _ in range(240):
        world.step()
        events = world.events(gate)
        height = float(world.particles.position[0, 0, 1])
        within = 1.25 <= height <= 2.75
        assert events.inside[0].tolist() == [within, False, within]
        assert (events.entered[0] & events.stayed[0]).sum() == 0
        seen += [("in", height)] * int(events.entered[0, 0]) + [("out", height)] * int(
            events.left[0, 0]
        )
    assert [name for name, _ in seen] == ["in", "out"]
    assert seen[0][1] == pytest.approx(2.75, abs=0.04) and seen[1][1] == pytest.approx(
        1.25, abs=0.04
    )
    assert events.things == (ball, aside, body)
    assert events.entries[0].tolist() == [1, 0, 1] and events.exits[0].tolist() == [1, 0, 1]


def test_many_steps_in_one_call_count_what_comes_and_goes_between() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    hook = scene.add(sy.Particle(position=(0, 0, 0), inverse_mass=0.0))
    bob = scene.add(sy.Particle(position=(2, 0, 0), mass=1.0))
    scene.add(sy.Spring(hook, bob, stiffness=(2 * np.pi) ** 2, rest_length=0.0))
    gate = scene.add(sy.Trigger(sy.Sphere(0.5), place=(2, 0, 0)))
    world = sy.World(scene, method=sy.Method(sy.Rattle(), dt=1 / 100))
    world.step(450)
    events = world.events(gate)
    assert events.things == (bob,)
    # Within at the first look; then back after each second.
    assert events.entries[0, 0] == 5 and events.exits[0, 0] == 5


@pytest.mark.parametrize("shape", [sy.Sphere(0.6), sy.Box((0.5, 0.3, 0.9)), sy.Capsule(0.3, 0.6)])
def test_a_carried_trigger_sees_what_an_overlap_at_its_place_does(shape: object) -> None:
    rng = np.random.default_rng(3)
    scene = sy.Scene(gravity=(0, 0, 0))
    carrier = scene.add(
        sy.Body(position=(0, 0, 0), angular_velocity=(0, 0, 2), parts=sy.Box((0.2, 0.2, 0.2)))
    )
    for _ in range(12):
        scene.add(
            sy.Body(
                position=tuple(rng.uniform(-3, 3, 3)),
                velocity=tuple(rng.normal(size=3)),
                parts=sy.Sphere(0.4),
            )
        )
    arm = scene.add(sy.Trigger(shape, place=(1.5, 0, 0), body=carrier))
    world = sy.World(scene, worlds=3)
    some = 0
    for _ in range(60):
        world.step()
        angle = 2.0 * float(world.time[0])
        place = 1.5 * np.array((np.cos(angle), np.sin(angle), 0))
        turn = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
        hits = world.queries.overlap(shape, place, orientation=turn, ignore=[carrier])
        events = world.events(arm)
        assert carrier not in events.things
        for k, thing in enumerate(events.things):
            assert (events.inside[:, k] == hits.of(thing)[:, 0].any(axis=-1)).all()
        some += int(events.inside.sum())
    assert some > 20


def tumble() -> tuple[sy.Scene, list[sy.Trigger]]:
    """Things that fall, roll and come to rest; triggers that stand, are carried and lie just under the floor."""
    rng = np.random.default_rng(5)
    scene = sy.Scene()
    scene.add(sy.Ground(friction=0.5))
    scene.add(sy.Collisions(friction=0.5))
    shapes = [sy.Box((0.2, 0.3, 0.15)), sy.Capsule(0.15, 0.3), sy.Sphere(0.25)]
    for k in range(6):
        scene.add(
            sy.Body(
                position=(1.0 * k - 2.5, 1.0, 0.3 * (-1) ** k),
                velocity=tuple(rng.uniform(-1.5, 1.5, 3)),
                angular_velocity=tuple(rng.uniform(-4, 4, 3)),
                parts=shapes[k % 3],
            )
        )
    cell = sy.Box((0.5, 0.5, 0.5))
    floor = sy.Box((9, 1, 9))
    triggers = [
        *(scene.add(sy.Trigger(floor, place=(0, -1 - depth, 0))) for depth in (0, 1e-6, 1e-3)),
        *(scene.add(sy.Trigger(cell, place=(x, 0.3, 0.2))) for x in (-2.0, -0.5, 1.0)),
        scene.add(sy.Trigger(sy.Sphere(0.8), place=(0.1, 0, 0), body=scene.bodies[1])),
        scene.add(sy.Trigger(sy.Capsule(0.4, 0.5), place=(0, 0.3, 0), body=scene.bodies[3])),
    ]
    return scene, triggers


def test_of_what_is_slow_a_trigger_sees_what_it_did_by_ends_of_steps() -> None:
    """Bit for bit what overlaps at the ends of the steps tell, until the first fall asleep."""
    scene, triggers = tumble()
    world = sy.World(scene, worlds=8)
    world.bodies.velocity[:] *= np.linspace(-1, 1, 8)[:, None, None]
    before = {id(t): np.zeros((8, len(t.watched(scene))), dtype=bool) for t in triggers}
    entries = {key: 0 * value for key, value in before.items()}
    exits = {key: 0 * value for key, value in before.items()}
    for _ in range(360):
        world.step()
        for trigger in triggers:
            things, key = trigger.watched(scene), id(trigger)
            place, turn = np.array(trigger.place), np.array(trigger.orientation)
            if trigger.body is not None:
                k = scene.bodies.index(trigger.body)
                turn = world.bodies.orientation[:, k, None]
                place = world.bodies.position[:, k, None] + (rotation_matrix(turn) @ place)
            hits = world.queries.overlap(trigger.shape, place, orientation=turn, only=things)
            now = np.stack([hits.of(thing)[:, 0].any(axis=1) for thing in things], axis=1)
            events, was = world.events(trigger), before[key]
            np.testing.assert_array_equal(events.inside, now)
            np.testing.assert_array_equal(events.entered, now & ~was)
            np.testing.assert_array_equal(events.stayed, now & was)
            np.testing.assert_array_equal(events.left, was & ~now)
            entries[key], exits[key] = entries[key] + (now & ~was), exits[key] + (was & ~now)
            np.testing.assert_array_equal(events.entries, entries[key])
            np.testing.assert_array_equal(events.exits, exits[key])
            before[key] = now
    assert world.bodies.asleep.any()
    assert sum(count.sum() for count in exits.values()) > 30


def test_worlds_reset_and_snapshots_take_triggers_along() -> None:
    scene = sy.Scene()
    scene.add(sy.Particle(position=(0, 1, 0), mass=1.0, radius=0.1))
    gate = scene.add(sy.Trigger(sy.Sphere(0.5), place=(0, 1, 0)))
    world = sy.World(scene, worlds=2)
    world.step(10)
    kept = world.snapshot()
    world.step(60)
    assert not world.events(gate).inside.any() and (world.events(gate).exits == 1).all()
    world.reset(np.array([True, False]))
    assert world.events(gate).entries[:, 0].tolist() == [0, 1]
    world.restore(kept)
    assert world.events(gate).inside.all()


def test_a_trigger_changes_no_motion() -> None:
    positions = []
    for watched in (False, True):
        scene = sy.scenes.bridge()
        if watched:
            scene.add(sy.Trigger(sy.Sphere(3.0), only=scene.particles[:2]))
        world = sy.World(scene)
        world.step(50)
        positions.append(world.particles.position.copy())
    np.testing.assert_array_equal(*positions)


def test_bad_triggers_are_refused() -> None:
    with pytest.raises(TypeError, match="Sphere, Box or Capsule"):
        sy.Trigger(3.0)
    with pytest.raises(ValueError, match="orientation"):
        sy.Trigger(sy.Sphere(1.0), orientation=(0, 0, 0, 0))
    with pytest.raises(TypeError, match="body is 3"):
        sy.Trigger(sy.Sphere(1.0), body=3)
    with pytest.raises(TypeError, match="only has 3"):
        sy.Trigger(sy.Sphere(1.0), only=[3])
    with pytest.raises(ValueError, match="without parts"):
        sy.Trigger(sy.Sphere(1.0), only=[sy.Body(position=(0, 0, 0), mass=1.0, inertia=(1, 1, 1))])
    scene = sy.Scene()
    other = sy.Particle(position=(0, 0, 0), mass=1.0)
    with pytest.raises(ValueError, match="not in this scene"):
        scene.add(sy.Trigger(sy.Sphere(1.0), only=[other]))
    scene.add(other)
    world = sy.World(scene)
    with pytest.raises(KeyError, match="no Trigger"):
        world.events(sy.Trigger(sy.Sphere(1.0)))


def test_a_body_without_parts_is_nothing_to_see() -> None:
    scene = sy.Scene()
    scene.add(sy.Body(position=(0, 0, 0), mass=1.0, inertia=(1, 1, 1)))
    ball = scene.add(sy.Particle(position=(0, 0, 0), mass=1.0))
    gate = scene.add(sy.Trigger(sy.Sphere(1.0)))
    world = sy.World(scene)
    world.step()
    assert world.events(gate).things == (ball,) and world.events(gate).inside.all()
