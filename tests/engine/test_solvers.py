"""One contract for every solver, on the same scenes: rods hold, cables only pull, momentum stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

import steelyard as sy
from benchmarks.references import pendulum
from benchmarks.scenes import bridge, bridge_mass, tumbling_platform
from tests.engine.builders import METHODS, RESOLVED, STAGED, Array, from_particle_scene, method

# An exact solver's residual is its tolerance; the sweeps' what 60 passes leave on these scenes;
# the source's resolver leaves what the last contacts resolved did to the others.
RESIDUAL = {"Direct": 1e-12, "GaussSeidel": 1e-4, "WorstFirst": 0.1}


def residual_limit(name: str) -> float:
    return RESIDUAL[name.split("-")[1]]


def hanging_chain(links: int = 4) -> sy.Scene:
    """Rods in a row from the origin, released level; the particles grow heavier outwards."""
    scene = sy.Scene()
    chain = [
        scene.add(sy.Particle(position=(0.5 * (k + 1), 0.0, 0.0), mass=1.0 + k))
        for k in range(links)
    ]
    scene.add(sy.RodConstraint(chain[0], (0.0, 0.0, 0.0)))
    for a, b in pairwise(chain):
        scene.add(sy.Rod(a, b))
    return scene


def swung(scene: sy.Scene, name: str, *, dt: float, seconds: float) -> sy.World:
    world = sy.World(scene, method=method(name, dt=dt))
    world.step(round(seconds / dt))
    return world


# Convergence


@pytest.mark.parametrize("name", METHODS)
def test_pendulum_converges_to_its_closed_form_with_the_order_claimed(name: str) -> None:
    scene = sy.Scene()
    bob = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(bob, (0.0, 0.0, 0.0)))
    angle, _ = pendulum([1.0], length=1.0)
    exact = [np.sin(angle[0]), -np.cos(angle[0]), 0.0]
    error = []
    for dt in (1 / 400, 1 / 800):
        world = swung(scene, name, dt=dt, seconds=1.0)
        assert np.abs(world.residual).max() < 1e-11
        error.append(np.abs(world.particles.position[0, 0] - exact).max())
    # The next term of the error changes the ratio by less than 2 % at these steps.
    assert error[0] / error[1] == pytest.approx(2.0 ** world.method.integrator.order(), rel=0.02)


@pytest.mark.parametrize("name", STAGED)
def test_chain_converges_with_the_order_claimed(name: str) -> None:
    ends = []
    for dt in (1 / 400, 1 / 800, 1 / 1600):
        world = swung(hanging_chain(), name, dt=dt, seconds=0.5)
        assert np.abs(world.residual).max() < 1e-8
        assert world.health[0] == 0
        ends.append(world.particles.position[0].copy())
    change = [np.abs(a - b).max() for a, b in pairwise(ends)]
    assert change[0] / change[1] == pytest.approx(2.0 ** world.method.integrator.order(), rel=0.02)


def test_gauss_seidel_approaches_direct_sweep_by_sweep() -> None:
    # On a chain of n each sweep leaves the share cos^2(pi / 2n) of the error, and more with the heavy end.
    exact = swung(hanging_chain(), "Rattle-Direct", dt=0.01, seconds=0.5)
    apart, left = [], []
    for passes in (5, 20, 80, 320):
        solver = sy.GaussSeidel(passes=passes)
        world = sy.World(hanging_chain(), method=sy.Method(sy.Rattle(), solver, dt=0.01))
        world.step(50)
        apart.append(np.abs(world.particles.position - exact.particles.position).max())
        left.append(np.abs(world.residual).max())
    assert all(b < 0.5 * a for a, b in pairwise(apart))
    assert all(b < 0.5 * a for a, b in pairwise(left[:-1]))
    assert apart[-1] < 1e-10


# Rods


@pytest.mark.parametrize("name", METHODS)
def test_free_structure_keeps_its_momentum_and_its_shape(name: str) -> None:
    world = sy.World(from_particle_scene(tumbling_platform()), method=method(name, dt=0.01))
    momentum, spin = world.momentum.copy(), world.angular_momentum.copy()
    for _ in range(10):
        world.step(10)
        assert np.abs(world.residual).max() <= residual_limit(name)
        np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-11)
        if name in STAGED:
            # Impulses along rods turn nothing; the resolver's corrections of places do.
            np.testing.assert_allclose(world.angular_momentum, spin, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", METHODS)
def test_free_structure_falls_as_one(name: str) -> None:
    scene = from_particle_scene(replace(tumbling_platform(), gravity=(0.3, -9.81, 0.0)))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(50)
    # Every method steps the velocity of free fall exactly.
    np.testing.assert_allclose(world.momentum, [[16 * 0.15, -16 * 4.905, 0.0]], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", METHODS)
def test_a_rod_pushes_its_ends_apart_with_opposite_impulses(name: str) -> None:
    # Two particles forced together along their rod: it lets neither gain on the other, and what one gains
    # in momentum the other loses.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(1.0, 0.0, 0.0), velocity=(-2.0, 0.0, 0.0), mass=3.0))
    scene.add(sy.Rod(a, b))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(2)
    np.testing.assert_allclose(
        world.particles.velocity[0], [[-1.25, 0.0, 0.0], [-1.25, 0.0, 0.0]], rtol=0, atol=1e-9
    )
    assert np.abs(world.residual).max() < 1e-11


@pytest.mark.parametrize("name", METHODS)
def test_a_rod_to_an_immovable_particle_is_a_rod_to_a_point(name: str) -> None:
    positions = []
    for immovable in (True, False):
        scene = sy.Scene()
        p = scene.add(sy.Particle(position=(1.0, 0.5, 0.2), velocity=(0.0, 0.0, 1.0)))
        if immovable:
            end = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), inverse_mass=0.0))
            scene.add(sy.Rod(p, end))
        else:
            scene.add(sy.RodConstraint(p, (0.0, 0.0, 0.0)))
        world = swung(scene, name, dt=0.01, seconds=0.5)
        positions.append(world.particles.position[0, 0].copy())
        if immovable:
            np.testing.assert_array_equal(world.particles.position[0, 1], 0.0)
    np.testing.assert_allclose(positions[0], positions[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", STAGED)
def test_redundant_rods_change_nothing(name: str) -> None:
    # Of the platform's 15 rods 12 hold it; with the three between the outer corners left out, the
    # same motion follows.
    source = replace(tumbling_platform(), gravity=(0.0, -9.81, 0.0))
    isostatic = [rod for rod in source.rods if set(rod[:2]) not in ({0, 5}, {1, 2}, {2, 5})]
    worlds = []
    for rods in (source.rods, tuple(isostatic)):
        scene = from_particle_scene(replace(source, rods=rods))
        integrator, solver = STAGED[name]
        if isinstance(solver, sy.GaussSeidel):
            solver = sy.GaussSeidel(passes=600)
        world = sy.World(scene, method=sy.Method(integrator, solver, dt=0.01))
        world.step(50)
        worlds.append(world)
    assert len(isostatic) == 12
    a, b = (world.particles.position for world in worlds)
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    assert np.abs(worlds[1].residual).max() < 1e-9


def test_world_says_which_rods_the_others_imply() -> None:
    world = sy.World(from_particle_scene(tumbling_platform()))
    assert "3 rods implied by the others" in repr(world)


# Cables


@pytest.mark.parametrize("name", METHODS)
def test_a_slack_cable_does_nothing(name: str) -> None:
    bare, held = sy.Scene(), sy.Scene()
    for scene in (bare, held):
        p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(1.0, 2.0, 0.0), damping=0.9))
        if scene is held:
            scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 5.0, restitution=0.5))
    free, slack = (swung(scene, name, dt=0.01, seconds=0.5) for scene in (bare, held))
    # Only the rounding of v + 0 / dt may differ.
    np.testing.assert_allclose(slack.particles.position, free.particles.position, rtol=1e-14)
    np.testing.assert_allclose(slack.particles.velocity, free.particles.velocity, rtol=1e-14)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_a_cable_that_snaps_taut_rebounds_with_its_restitution(
    name: str, restitution: float
) -> None:
    # Newton's law of impact along the cable, the motion across it kept. The cable turns by 1.5 mrad in
    # the step, so the direction is checked as the cable lies when it snaps.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(0.95, 0.0, 0.0), velocity=(2.0, 0.0, 0.0), mass=3.0))
    scene.add(sy.Cable(a, b, 1.0, restitution=restitution))
    world = sy.World(scene, method=method(name, dt=0.01))
    world.step(6)
    velocity = world.particles.velocity[0, :, 0]
    # v' = v + (1 + e) m_r v_rel / m; m_r = 3/4 kg, v_rel = 3 m/s.
    impulse = (1.0 + restitution) * 0.75 * 3.0
    np.testing.assert_allclose(velocity, [-1.0 + impulse, 2.0 - impulse / 3.0], atol=1e-11)
    np.testing.assert_allclose(world.momentum, [[5.0, 0.0, 0.0]], atol=1e-12)
    assert np.linalg.norm(np.diff(world.particles.position[0], axis=0)) <= 1.0 + 1e-11


@pytest.mark.parametrize("name", STAGED)
def test_a_falling_weight_is_caught_by_its_cable_and_hangs(name: str) -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), mass=2.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 0.5))
    world = sy.World(scene, method=method(name, dt=0.01))
    for _ in range(100):
        world.step()
        assert world.residual[0, 0] <= 1e-12
    np.testing.assert_allclose(world.particles.position[0, 0], [0.0, -0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(world.particles.velocity[0, 0], 0.0, atol=1e-12)
    # The whole step's pull in symplectic Euler's one stage, half of it in RATTLE's first.
    share = 2.0 if isinstance(world.method.integrator, sy.Rattle) else 1.0
    tension = share * world[cable].multiplier[0] * 0.5 / 0.01**2
    # 1e-12 of the length is 2 m 1e-12 L / dt^2 = 2e-8 N.
    assert tension == pytest.approx(2.0 * 9.81, abs=1e-7)


@pytest.mark.parametrize("name", STAGED)
def test_cables_only_pull(name: str) -> None:
    # A bridge thrown about in every world in its own way: cables slacken and snap all the time.
    scene = from_particle_scene(bridge(), cable_restitution=0.3)
    cables = scene.of(sy.Cable, sy.CableConstraint)
    world = sy.World(scene, worlds=11, method=method(name, dt=0.01))
    rng = np.random.default_rng(0)
    world.particles.velocity[:] = 2.0 * rng.standard_normal(world.particles.velocity.shape)
    slack = taut = 0
    for _ in range(150):
        world.step()
        tension = np.stack([world[cable].multiplier for cable in cables], axis=1)
        assert tension.min() >= 0.0
        assert np.abs(world.residual).max() <= residual_limit(name)
        slack += (tension == 0.0).sum()
        taut += (tension > 0.0).sum()
    assert min(slack, taut) > 5000
    np.testing.assert_array_equal(world.health, 0)


def test_letting_one_cable_go_takes_up_another() -> None:
    # Turned back by its left cable with full restitution, the weight runs into the right one within
    # a step or two, at which the left one still carries the last step's tension.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(2.5, 0.3, 0.0)))
    for x in (-1.0, 1.0):
        scene.add(sy.CableConstraint(p, (x, 0.0, 0.0), 1.01, restitution=1.0))
    world = sy.World(scene, method=method("Rattle-Direct", dt=0.01))
    for _ in range(200):
        world.step()
        assert world.residual.max() <= 1e-12
    assert world.health[0] == 0


@pytest.mark.parametrize("name", STAGED)
def test_a_winch_hoists_at_its_rate(name: str) -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, -2.0, 0.0), mass=3.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 2.0, winch=True))
    world = sy.World(scene, worlds=2, method=method(name, dt=0.01))
    world[cable].rate = [-0.5, 0.25]
    world.step(100)
    np.testing.assert_allclose(world[cable].length, [1.5, 2.25], rtol=1e-13)
    expected = [[[0.0, -1.5, 0.0]], [[0.0, -2.25, 0.0]]]
    np.testing.assert_allclose(world.particles.position, expected, rtol=0, atol=5e-12)
    speed = [[[0.0, 0.5, 0.0]], [[0.0, -0.25, 0.0]]]
    np.testing.assert_allclose(world.particles.velocity, speed, rtol=0, atol=1e-9)


# The direct solver under a moving load

WORLDS = 17
DT = 0.01


def walk(time: float, worlds: int = WORLDS) -> tuple[Array, Array]:
    """Places of the loads along and across, each in [0, 1] and its own in every world."""
    phase = np.arange(worlds)
    along = 0.5 + 0.5 * np.sin(0.4 * time * (1.0 + phase / worlds) + phase)
    return along, 0.5 + 0.5 * np.sin(0.7 * time + 2.0 * phase)


def bridge_weights(time: float) -> Array:
    """Share of the load on each particle of the bridge, shape (worlds, 12)."""
    along, across = walk(time)
    places = zip((5.0 * along).tolist(), across.tolist(), strict=True)
    return np.array([bridge_mass(x=x, z=z, load=1.0) - 1.0 for x, z in places])


def platform_weights(time: float) -> Array:
    """Share of the load on each particle of the platform, shape (worlds, 6)."""
    x, z = walk(time)
    none = np.zeros(WORLDS)
    return np.stack(
        [none, none, (1 - x) * z, (1 - x) * (1 - z), x * z, x * (1 - z)],
        axis=1,
    )


def bridge_scene() -> sy.Scene:
    return from_particle_scene(bridge())


def platform_scene() -> sy.Scene:
    """The platform on frictional ground, damped as in the source: it stands, tilts and falls."""
    upright = tumbling_platform()
    source = replace(
        upright,
        velocity=np.zeros_like(upright.velocity),
        mass=np.ones(6),
        gravity=(0.0, -9.81, 0.0),
        damping=0.9,
    )
    scene = from_particle_scene(source)
    scene.add(sy.Ground(friction=0.8))
    return scene


CARRIERS = {
    "bridge": (bridge_scene, bridge_weights),
    "platform": (platform_scene, platform_weights),
}


@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("share", ["rider", "lumped"])
def test_direct_holds_every_link_under_a_moving_load(carrier: str, share: str) -> None:
    build: Callable[[], sy.Scene]
    build, weights = CARRIERS[carrier]
    scene = build()
    deck = scene.particles
    at = weights(0.0)
    if share == "rider":
        load = scene.add(sy.Particle(position=deck[0].position, mass=10.0, damping=0.9))
        rider = scene.add(sy.Rider(load, deck, at[0]))
    world = sy.World(scene, worlds=WORLDS, method=sy.Method(sy.Rattle(), sy.Direct(), dt=DT))
    if share == "rider":
        world[rider].weights = at
        world.particles.position[:, -1] = np.einsum(
            "wk,wkc->wc", at, world.particles.position[:, :-1]
        )
    worst = 0.0
    for step in range(1000):
        then = weights((step + 1) * DT)
        if share == "rider":
            world[rider].rates = (then - at) / DT
        else:
            world.particles.mass = 1.0 + 10.0 * at
        world.step()
        at = then
        worst = max(worst, np.abs(world.residual).max())
    assert worst <= 1e-10
    np.testing.assert_array_equal(world.health, 0)


# Settings and flags


def test_tolerance_bounds_the_residual() -> None:
    loose = sy.Method(sy.Rattle(), sy.Direct(tolerance=1e-5), dt=0.01)
    world = sy.World(hanging_chain(), method=loose)
    worst = 0.0
    for _ in range(100):
        world.step()
        worst = max(worst, np.abs(world.residual).max())
    assert 1e-9 < worst <= 1e-5
    assert world.health[0] == 0


def test_too_few_passes_are_flagged_until_reset() -> None:
    hasty = sy.Method(sy.Rattle(), sy.Direct(passes=1), dt=0.02)
    world = sy.World(hanging_chain(), worlds=3, method=hasty)
    world.particles.velocity[1] = 0.0
    world.step(20)
    np.testing.assert_array_equal(world.health, 2)
    world.reset(np.array([False, True, False]))
    np.testing.assert_array_equal(world.health, [2, 0, 2])


def test_a_broken_world_touches_no_other_and_recovers_by_reset() -> None:
    # World 0 and world 8 share a lane of the work arrays, one block apart.
    scene = sy.Scene()
    bob = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
    scene.add(sy.RodConstraint(bob, (0.0, 0.0, 0.0)))
    scene.add(sy.Ground(height=-0.5, friction=0.5))
    for name in METHODS:
        world = sy.World(scene, worlds=17, method=method(name, dt=0.01))
        world.particles.position[0] = np.nan
        world.step(2)
        world.step(2)
        assert np.isfinite(world.particles.position[1:]).all(), name
        np.testing.assert_array_equal(world.health, [1] + [0] * 16, err_msg=name)
        world.reset(np.arange(17) == 0)
        fresh = sy.World(scene, method=method(name, dt=0.01))
        world.step(3)
        fresh.step(3)
        np.testing.assert_array_equal(
            world.particles.position[0], fresh.particles.position[0], err_msg=name
        )
        np.testing.assert_array_equal(world.health, 0, err_msg=name)


@pytest.mark.parametrize("name", RESOLVED)
def test_worst_first_does_as_many_resolutions_as_asked(name: str) -> None:
    # One resolution for two overstretched cables: the faster one is made good, the other is left.
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    for z, speed in ((0.0, 1.0), (5.0, 2.0)):
        p = scene.add(sy.Particle(position=(1.0, 0.0, z), velocity=(speed, 0.0, 0.0)))
        scene.add(sy.CableConstraint(p, (0.0, 0.0, z), 1.0))
    integrator, _ = RESOLVED[name]
    once = sy.Method(integrator, sy.WorstFirst(iterations=1), dt=0.01)
    world = sy.World(scene, method=once)
    world.step()
    np.testing.assert_allclose(world.residual, [[0.01, 0.0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(world.particles.velocity[0, :, 0], [1.0, 0.0], atol=1e-15)


def test_random_masses_leave_every_pair_of_a_net_within_reach() -> None:
    # All pairs of five particles joined by cables a little longer than their distance: many ways to be
    # taut at once, and redundant when all are.
    rng = np.random.default_rng(3)
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    net = [scene.add(sy.Particle(position=x)) for x in rng.uniform(-0.5, 0.5, (5, 3))]
    for a, b in combinations(net, 2):
        reach = 1.02 * float(np.linalg.norm(np.subtract(a.position, b.position)))
        scene.add(sy.Cable(a, b, reach))
    world = sy.World(scene, worlds=16, method=method("Rattle-Direct", dt=0.01))
    world.particles.mass = rng.uniform(0.3, 3.0, (16, 5))
    world.particles.velocity[:] = rng.standard_normal((16, 5, 3))
    momentum = world.momentum.copy()
    for _ in range(100):
        world.step()
        assert world.residual.max() <= 1e-12
    np.testing.assert_array_equal(world.health, 0)
    np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-11)
