"""Triggers against what passes through within one step: many small steps of a motion against one large one."""

from __future__ import annotations

import numpy as np
import pytest

import steelyard as sy

_SHAPES = {
    "sphere": sy.Sphere(0.4),
    "box": sy.Box((0.3, 0.5, 0.2)),
    "capsule": sy.Capsule(0.2, 0.4),
}


def larger(shape: object, by: float) -> object:
    """A shape that holds all places within a distance of another."""
    if isinstance(shape, sy.Sphere):
        return sy.Sphere(shape.radius + by)
    if isinstance(shape, sy.Capsule):
        return sy.Capsule(shape.radius + by, shape.half_length)
    assert isinstance(shape, sy.Box)
    return sy.Box(tuple(half + by for half in shape.half_size))


def stepped(scene: sy.Scene, *, dt: float, worlds: int = 1) -> sy.World:
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), dt=dt))


def test_a_shot_enters_and_leaves_within_a_step_and_tells_when() -> None:
    """A ball of 0.1 m at 120 m/s through a wall of 0.2 m: in after (1 - 0.2) m of the 2 m of a step."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(-1, 0, 0), velocity=(120, 0, 0), mass=1.0, radius=0.1))
    scene.add(sy.Particle(position=(-1, 3, 0), velocity=(120, 0, 0), mass=1.0, radius=0.1))
    wall = scene.add(sy.Trigger(sy.Box((0.1, 1, 1))))
    world = stepped(scene, dt=1 / 60)
    assert np.isnan(world.events(wall).entry_time).all()
    world.step()
    events = world.events(wall)
    for seen in (events.entered, events.left):
        assert seen.tolist() == [[True, False]]
    assert not events.inside.any() and not events.stayed.any()
    assert events.entries.tolist() == events.exits.tolist() == [[1, 0]]
    assert events.entry_time[0, 0] == pytest.approx(0.8 / 120, rel=1e-8)
    world.step()
    events = world.events(wall)
    assert not events.entered.any() and not events.left.any()
    assert events.entries.tolist() == events.exits.tolist() == [[1, 0]]
    assert events.entry_time[0, 0] == pytest.approx(0.8 / 120, rel=1e-8)


def shot(volume: object, thing: str) -> sy.Scene:
    """A thing that flies by a trigger; a body is as hard to turn about all axes, so that it turns evenly."""
    scene = sy.Scene(gravity=(0, 0, 0))
    if thing == "particle":
        scene.add(sy.Particle(position=(0, 0, 0), mass=1.0))
    else:
        scene.add(sy.Body(position=(0, 0, 0), parts=_SHAPES[thing], mass=1.0, inertia=(1, 1, 1)))
    scene.add(sy.Trigger(volume, place=(0.2, -0.1, 0.3), orientation=(0.8, 0.3, -0.4, 0.1)))
    return scene


def send(world: sy.World, spin: float) -> None:
    """Let the thing of every world start at another side, 5 m away, and within 1 s pass near the middle."""
    rng = np.random.default_rng(11)
    start = rng.normal(size=(world.worlds, 3))
    start *= 5.0 / np.linalg.norm(start, axis=1, keepdims=True)
    end = rng.uniform(-1.4, 1.4, size=start.shape) - start
    group = world.bodies if world.scene.bodies else world.particles
    group.position[:, 0] = start
    group.velocity[:, 0] = end - start
    if world.scene.bodies:
        turn = rng.normal(size=(world.worlds, 4))
        world.bodies.orientation[:, 0] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
        axis = rng.normal(size=start.shape)
        axis *= spin / np.linalg.norm(axis, axis=1, keepdims=True)
        world.bodies.angular_velocity = axis[:, None]


@pytest.mark.parametrize("spin", [0.0, 2.5])
@pytest.mark.parametrize("thing", ["particle", *_SHAPES])
@pytest.mark.parametrize("trigger", _SHAPES)
def test_one_step_sees_what_many_small_ones_do(trigger: str, thing: str, spin: float) -> None:
    """Within 1 s, in 400 steps; what those miss is in a volume that is larger by what half a step moves at most."""
    if thing == "particle" and spin:
        pytest.skip("A particle does not turn.")
    worlds, count = 96, 400
    # At most 2 (5 + 1.4 sqrt(3) / 2) m/s, and the spin at 0.62 m from the centre.
    reach = (12.5 + 0.62 * spin) / (2 * count)
    seen = []
    for volume, steps in (
        (_SHAPES[trigger], 1),
        (_SHAPES[trigger], count),
        (larger(_SHAPES[trigger], reach), count),
    ):
        world = stepped(shot(volume, thing), dt=1.0 / steps, worlds=worlds)
        send(world, spin)
        world.step(steps)
        seen.append(world.events(world.scene.of(sy.Trigger)[0]))
    one, many, wide = seen
    assert not one.inside.any() and (one.entered == one.left).all()
    assert (one.entries == one.entered).all() and (one.exits == one.left).all()
    passed, small = one.entered, many.entries > 0
    assert 8 < small.sum() < worlds
    assert (passed >= small).all() and (passed <= (wide.entries > 0)).all()
    np.testing.assert_allclose(one.entry_time[small], many.entry_time[small], atol=1e-7)


def test_a_trigger_that_a_body_carries_sees_what_it_passes_over() -> None:
    """A body flies by a thing that stands still, a body flies along with it, and one meets it half-way."""
    scene = sy.Scene(gravity=(0, 0, 0))
    carrier = scene.add(
        sy.Body(position=(-5, 0, 0), velocity=(10, 0, 0), parts=sy.Sphere(0.1), mass=1.0)
    )
    still = scene.add(sy.Particle(position=(0, 1, 0), mass=1.0))
    along = scene.add(sy.Particle(position=(-5, -1, 0), velocity=(10, 0, 0), mass=1.0))
    towards = scene.add(sy.Particle(position=(6, 1, 0), velocity=(-10, 0, 0), mass=1.0))
    eye = scene.add(sy.Trigger(sy.Sphere(0.5), place=(0, 1, 0), body=carrier))
    world = stepped(scene, dt=1.0)
    world.step()
    events = world.events(eye)
    assert events.things == (still, along, towards)
    assert events.entered[0].tolist() == events.left[0].tolist() == [True, False, True]
    np.testing.assert_allclose(events.entry_time[0], [4.5 / 10, np.nan, 10.5 / 20], rtol=1e-8)


def test_what_turns_with_a_trigger_does_not_come_into_it() -> None:
    """A spoke and a long trigger beside it turn by 1.2 rad a step, and are never nearer than they were."""
    scene = sy.Scene(gravity=(0, 0, 0))
    spokes = [sy.Part(shape=sy.Box((0.5, 0.02, 0.02)), offset=(side, 0, 0)) for side in (-1.0, 1.0)]
    for z in (0.0, 0.2):
        scene.add(sy.Body(position=(0, 0, z), angular_velocity=(0, 0, 1.2), parts=spokes, mass=1.0))
    gap, blade = scene.bodies
    slot = scene.add(
        sy.Trigger(sy.Box((0.5, 0.02, 0.02)), place=(1, 0.05, 0.2), body=gap, only=[blade])
    )
    world = stepped(scene, dt=1.0)
    world.step(20)
    assert world.events(slot).entries.sum() == 0


def test_a_blade_that_only_turns_sweeps() -> None:
    """Its centre stays; a quarter turn in a step carries its lower end through a ball half-way."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(
        sy.Body(
            position=(0, 0, 0),
            angular_velocity=(0, 0, np.pi / 2),
            parts=sy.Capsule(0.05, 1.0),
            mass=1.0,
            inertia=(1, 1, 1),
        )
    )
    ball = scene.add(sy.Trigger(sy.Sphere(0.1), place=(0.6, -0.6, 0)))
    world = stepped(scene, dt=1.0)
    world.step()
    events = world.events(ball)
    assert events.entered.all() and events.left.all() and not events.inside.any()
    # It touches when its axis is 0.15 m from the ball's centre.
    angle = np.pi / 4 - np.arcsin(0.15 / np.hypot(0.6, 0.6))
    assert events.entry_time[0, 0] == pytest.approx(angle / (np.pi / 2), rel=1e-7)


def test_what_is_put_elsewhere_passes_through_nothing() -> None:
    """By hand, by a reset and by a snapshot, on all of which the path would lead through the gate."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(-3, 0, 0), velocity=(0.6, 0, 0), mass=1.0))
    carrier = scene.add(sy.Body(position=(0, 5, 0), parts=sy.Sphere(0.1)))
    gates = [
        scene.add(sy.Trigger(sy.Sphere(0.5), only=scene.particles)),
        scene.add(sy.Trigger(sy.Sphere(0.5), body=carrier, only=scene.particles)),
    ]
    world = stepped(scene, dt=1 / 60, worlds=2)
    start = world.snapshot()

    def nothing_seen() -> bool:
        world.step()
        return all(world.events(gate).entries.sum() == 0 for gate in gates)

    assert nothing_seen()
    world.particles.position[0, 0] = (3, 0, 0)
    assert nothing_seen()
    world.bodies.position[0, 0] = (6, 0, 0)
    assert nothing_seen()
    world.reset(np.array([True, False]))
    assert nothing_seen()
    world.particles.position[:, 0] = (3, 0, 0)
    assert nothing_seen()
    world.restore(start)
    assert nothing_seen()
    # What is put into a gate and shot out of it was in it.
    world.particles.position[0, 0] = (0, 0, 0)
    world.particles.velocity[0, 0] = (100, 0, 0)
    world.step()
    events = world.events(gates[0])
    assert events.entries[:, 0].tolist() == events.exits[:, 0].tolist() == [1, 0]
    assert events.entry_time[0, 0] == pytest.approx(world.time[0] - 1 / 60)


def test_a_world_begun_anew_forgets_what_passed() -> None:
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(-1, 0, 0), velocity=(120, 0, 0), mass=1.0))
    gate = scene.add(sy.Trigger(sy.Sphere(0.5)))
    world = stepped(scene, dt=1 / 60, worlds=3)
    world.step()
    kept = world.snapshot()
    world.reset(np.array([False, True, False]))
    events = world.events(gate)
    assert events.entered[:, 0].tolist() == events.left[:, 0].tolist() == [True, False, True]
    assert np.isnan(events.entry_time[:, 0]).tolist() == [False, True, False]
    world.restore(kept)
    assert world.events(gate).entered.all() and world.events(gate).exits.all()


def test_worlds_that_are_not_finite_harm_no_other() -> None:
    """Neither a thing nor what carries a trigger; the other world sees what it would alone."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(-1, 0, 0), velocity=(120, 0, 0), mass=1.0))
    carrier = scene.add(sy.Body(position=(0, 0, 0), parts=sy.Box((0.1, 0.1, 0.1))))
    gates = [
        scene.add(sy.Trigger(sy.Box((0.3, 0.3, 0.3)), body=carrier)),
        scene.add(sy.Trigger(sy.Capsule(0.3, 0.2))),
    ]
    world = stepped(scene, dt=1 / 60, worlds=4)
    world.particles.position[0] = np.nan
    world.bodies.position[1] = np.inf
    world.bodies.orientation[2] = np.nan
    world.step(3)
    assert (world.events(gates[0]).entries[:, 0] == [0, 0, 0, 1]).all()
    assert (world.events(gates[1]).entries == [[0, 1], [1, 0], [1, 0], [1, 1]]).all()


def test_a_step_of_several_parts_is_one_step() -> None:
    """A ball crosses in the second of ten parts, and another comes in: both are told of at the step's end."""
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Particle(position=(-1, 0, 0), velocity=(300, 0, 0), mass=1.0, radius=0.1))
    scene.add(sy.Particle(position=(-1, 0, 0), velocity=(60, 0, 0), mass=1.0, radius=0.1))
    gate = scene.add(sy.Trigger(sy.Sphere(0.3)))
    world = sy.World(scene, method=sy.Method(sy.SymplecticEuler(), sy.Xpbd(substeps=10), dt=1 / 60))
    world.step()
    events = world.events(gate)
    assert events.entered.all() and events.left[0].tolist() == [True, False]
    assert events.inside[0].tolist() == [False, True] and not events.stayed.any()
    np.testing.assert_allclose(events.entry_time[0], [0.6 / 300, 0.6 / 60], rtol=1e-7)
    world.step()
    events = world.events(gate)
    assert not events.entered.any() and events.left[0].tolist() == [False, True]


@pytest.mark.parametrize("planar", [False, True])
def test_worlds_see_alike_in_any_batch(planar: bool) -> None:
    scene = sy.Scene(gravity=(0, 0, 0), planar=planar)
    scene.add(sy.Particle(position=(-1, 0.1, 0), mass=1.0, radius=0.1))
    gate = scene.add(sy.Trigger(sy.Box((0.2, 0.3, 0.4)), orientation=(0.9, 0, 0, 0.3)))
    speeds = np.linspace(5, 200, 11)
    many = stepped(scene, dt=1 / 60, worlds=len(speeds))
    many.particles.velocity[:, 0, 0] = speeds
    many.step(6)
    seen = many.events(gate)
    for w, speed in enumerate(speeds):
        one = stepped(scene, dt=1 / 60)
        one.particles.velocity[:, 0, 0] = speed
        one.step(6)
        alone = one.events(gate)
        for name in ("inside", "entered", "left", "entries", "exits", "entry_time"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(seen, name)[w])
    assert 5 < seen.exits.sum() < 11
