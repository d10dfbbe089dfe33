"""What every solver of bodies must do, whichever way it takes, and where each may be worse than the others."""

import math

import numpy as np
import pytest

import steelyard as sy

SOLVERS = {
    "proximal Newton": sy.ProximalNewton(rest_time=None),
    "Gauss-Seidel": sy.GaussSeidel(30),
    "worst first": sy.WorstFirst(),
    "soft step": sy.SoftStep(rest_time=None),
}
#: How far contacts of a metre's box may give way [m].
GIVES = {"soft step": 3e-3}


@pytest.fixture(params=SOLVERS, name="name")
def _name(request):
    return request.param


def world_of(scene, name, *, dt=1 / 120, worlds=1):
    return sy.World(scene, worlds=worlds, method=sy.Method(sy.Rattle(), SOLVERS[name], dt=dt))


def box(scene, x, y, z=0.0, half=0.5, **more):
    return scene.add(sy.Body(position=(x, y, z), parts=sy.Box((half, half, half)), **more))


def on_ground(scene, friction=0.6, restitution=0.0):
    scene.add(sy.Ground(friction=friction, restitution=restitution))
    if len(scene.bodies) > 1:
        scene.add(sy.Collisions(friction=friction, restitution=restitution))
    return scene


def test_a_box_that_falls_comes_to_lie(name):
    scene = sy.Scene()
    box(scene, 0, 1.5)
    world = world_of(on_ground(scene), name)
    world.step(360)
    give = GIVES.get(name, 2e-4)
    assert world.bodies.position[0, 0, 1] == pytest.approx(0.5, abs=give)
    assert np.abs(world.bodies.velocity).max() < 1e-3
    load = world.contacts.force_on(world.scene.bodies[0])[0]
    np.testing.assert_allclose(load, (0, 9810, 0), atol=9810 * 1e-2)
    assert world.health[0] == 0


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_ball_rebounds_as_restitution_says(name, restitution):
    scene = sy.Scene(gravity=(0, 0, 0))
    scene.add(sy.Body(position=(0, 1.0, 0), velocity=(0, -4, 0), parts=sy.Sphere(0.25)))
    world = world_of(on_ground(scene, restitution=restitution), name)
    world.step(60)
    assert world.bodies.velocity[0, 0, 1] == pytest.approx(4 * restitution, abs=1e-9)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_block_slides_beyond_the_angle_of_friction_alone(name, share):
    slope = math.radians(25)
    scene = sy.Scene(gravity=(9.81 * math.sin(slope), -9.81 * math.cos(slope), 0))
    box(scene, 0, 0.5)
    mu = share * math.tan(slope)
    world = world_of(on_ground(scene, friction=mu), name)
    world.step(120)
    way = 0.5 * 9.81 * max(math.sin(slope) - mu * math.cos(slope), 0.0)
    assert world.bodies.position[0, 0, 0] == pytest.approx(way, abs=0.02 * way + 5e-3)


def test_a_low_stack_stands(name):
    scene = sy.Scene()
    for i in range(4):
        box(scene, 0, 0.5 + i)
    world = world_of(on_ground(scene), name)
    world.step(600)
    place = world.bodies.position[0]
    assert np.abs(place[:, [0, 2]]).max() < 0.05
    np.testing.assert_allclose(place[:, 1], [0.5, 1.5, 2.5, 3.5], atol=4 * GIVES.get(name, 1e-3))


def test_momentum_is_kept(name):
    rng = np.random.default_rng(3)
    scene = sy.Scene(gravity=(0, 0, 0))
    for place in np.stack(np.meshgrid(*[np.arange(2) * 1.3] * 3), -1).reshape(-1, 3):
        box(
            scene,
            *place,
            velocity=tuple(-3 * (place - 0.65)),
            orientation=tuple(rng.normal(size=4)),
        )
    scene.add(sy.Collisions(friction=0.5, restitution=0.2))
    world = world_of(scene, name)
    linear, energy = world.momentum.copy(), world.energy[0]
    world.step(120)
    assert world.energy[0] < 0.95 * energy
    np.testing.assert_allclose(world.momentum, linear, atol=1e-9 * 8000 * 3)


def test_a_pendulum_on_a_joint_keeps_its_swing(name):
    scene = sy.Scene()
    arm = scene.add(sy.Body(position=(0.5, 0, 0), parts=sy.Box((0.5, 0.05, 0.05))))
    scene.add(sy.HingeJoint(a=arm))
    world = world_of(scene, name)
    energy = world.energy[0]
    lowest = 0.0
    for _ in range(240):
        world.step()
        lowest = min(lowest, world.bodies.position[0, 0, 1])
        assert world.joints.gap[0, 0] < 2e-2
    assert lowest == pytest.approx(-0.5, abs=0.02)
    # Of what it falls through, m g / 2.
    assert world.energy[0] == pytest.approx(energy, abs=0.15 * 10.0 * 9.81 * 0.5)


def test_tumbling_heaps_come_down_without_a_burst(name):
    gains = []
    for seed in range(8, 13):
        rng = np.random.default_rng(seed)
        scene = sy.Scene()
        for i in range(8):
            half = float(rng.uniform(0.2, 0.4))
            x = float(rng.uniform(-0.4, 0.4))
            box(scene, x, 1.0 + i, half=half, orientation=tuple(rng.normal(size=4)))
        world = world_of(on_ground(scene), name)
        energy = [world.energy[0]]
        for _ in range(480):
            world.step()
            energy.append(world.energy[0])
        gains.append(np.diff(energy).max() / energy[0])
        assert world.health[0] == 0
        assert world.bodies.position[0, :, 1].min() > 0.1
        assert np.abs(world.bodies.velocity).max() < 1.0
    assert np.median(gains) < 2e-3
    if name == "worst first" and max(gains) >= 1e-2:
        pytest.xfail(
            "mending the worst first gains some hundredths of a heap's energy now and then"
        )
    assert max(gains) < 1e-2


def test_worlds_do_not_depend_on_their_neighbours(name):
    scene = sy.Scene()
    for i in range(3):
        box(scene, 0.1 * i, 0.6 + 1.05 * i)
    scene = on_ground(scene)
    rng = np.random.default_rng(1)
    spin = rng.normal(size=(9, 3, 3))
    batch = world_of(scene, name, worlds=9)
    batch.bodies.angular_velocity = spin
    batch.step(60)
    for k in (0, 4, 8):
        single = world_of(scene, name)
        single.bodies.angular_velocity = spin[k]
        single.step(60)
        np.testing.assert_array_equal(single.bodies.position[0], batch.bodies.position[k])


def test_they_differ_where_they_are_known_to():
    """A top a hundred times as heavy: sweeps let it sink, the Newton method does not."""
    off = {}
    for name in SOLVERS:
        scene = sy.Scene()
        for i in range(5):
            part = sy.Part(shape=sy.Box((0.5, 0.5, 0.5)), density=1000.0 if i < 4 else 100_000.0)
            scene.add(sy.Body(position=(0, 0.5 + i, 0), parts=part))
        world = world_of(on_ground(scene), name)
        world.step(240)
        off[name] = abs(world.bodies.position[0, 4, 1] - 4.5)
    assert off["proximal Newton"] < 1e-6
    assert min(off[name] for name in SOLVERS if name != "proximal Newton") > 1e-4


def test_settings_that_cannot_be_are_refused():
    for given in ({"hertz": 0.0}, {"ratio": -1.0}, {"slop": 0.0}):
        with pytest.raises(ValueError, match=next(iter(given))):
            sy.SoftStep(**given)
    with pytest.raises(ValueError, match="substeps"):
        sy.Method(sy.Rattle(), sy.SoftStep(substeps=0))
