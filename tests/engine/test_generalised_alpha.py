"""Generalised-alpha with links: heavy ends at large steps, cables that snap, riders, restarts, refusals."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import steelyard as sy
from benchmarks.scenes import tumbling_platform
from tests.engine.builders import Array, from_particle_scene
from tests.engine.refusals import no_force, pair, refused

LINKS = 20
G = 9.81


def chain(ratio: float, *, cables: bool = False) -> sy.Scene:
    """Twenty links of 1 m let go level, 1 kg each, the last ``ratio`` kg."""
    scene = sy.Scene()
    some = [
        scene.add(sy.Particle(position=(k, 0, 0), mass=ratio if k == LINKS else 1.0))
        for k in range(1, LINKS + 1)
    ]
    if cables:
        scene.add(sy.CableConstraint(some[0], (0, 0, 0), 1.0))
    else:
        scene.add(sy.RodConstraint(some[0], (0, 0, 0)))
    for a, b in pairwise(some):
        scene.add(sy.Cable(a, b, 1.0) if cables else sy.Rod(a, b))
    return scene


def alpha(rho_inf: float = 0.5, *, dt: float = 1 / 60, **settings: Any) -> sy.Method:
    return sy.Method(sy.GeneralisedAlpha(rho_inf=rho_inf, **settings), dt=dt)


def tip(ratio: float, seconds: float) -> Array:
    """Where the end of the chain is, by the angles of its links below the level."""
    mass = np.array([1.0] * (LINKS - 1) + [ratio])
    beyond = np.cumsum(mass[::-1])[::-1]
    weight = beyond[np.maximum.outer(np.arange(LINKS), np.arange(LINKS))]

    def rate(_: float, state: Array) -> Array:
        angle, speed = state.reshape(2, LINKS)
        turn = angle[:, None] - angle
        right = G * beyond * np.cos(angle) - (weight * np.sin(turn)) @ speed**2
        return np.concatenate([speed, np.linalg.solve(weight * np.cos(turn), right)])

    start = np.zeros(2 * LINKS)
    done = solve_ivp(rate, (0.0, seconds), start, method="DOP853", rtol=1e-12, atol=1e-12)
    angle = done.y[:LINKS, -1]
    return np.array([np.cos(angle).sum(), -np.sin(angle).sum(), 0.0])


# Heavy ends


@pytest.mark.parametrize("cables", [False, True], ids=["rods", "cables"])
@pytest.mark.parametrize(("ratio", "rho_inf"), [(1e3, 0.55), (1e6, 0.0)])
def test_a_heavy_end_at_60_hz(ratio: float, rho_inf: float, cables: bool) -> None:
    world = sy.World(chain(ratio, cables=cables), method=alpha(rho_inf))
    start = world.energy[0]
    scale = ratio * G * LINKS
    for _ in range(600):
        world.step()
        assert np.abs(world.residual).max() <= 1e-12
        gain = (world.energy[0] - start) / scale
        assert -1e-3 <= gain <= 0.0
    assert world.health[0] == 0


def test_where_it_fails_and_where_others_do() -> None:
    """Just within, rho_inf .6 holds the chain; .8, and RATTLE at any step near, do not."""
    held = sy.World(chain(1e3), method=alpha(0.6))
    scale = 1e3 * G * LINKS
    held.step(600)
    assert held.health[0] == 0
    assert abs(held.energy[0]) < 1e-3 * scale
    rattle = sy.Method(sy.Rattle(), sy.Direct())
    for method in (alpha(0.8), rattle):
        lost = sy.World(chain(1e3), method=method)
        lost.step(600)
        assert lost.health[0] != 0 or abs(lost.energy[0]) > 0.1 * scale, method


def _shaken(rho_inf: float) -> tuple[sy.World, Array]:
    """Chains with heavy ends in 16 worlds, their particles shaken in space, after 10 s; and their energies at first."""
    world = sy.World(chain(1e3), worlds=16, method=alpha(rho_inf))
    rng = np.random.default_rng(0)
    kick = rng.standard_normal(world.particles.velocity.shape)
    world.particles.velocity[:] += 0.3 * np.linspace(0, 1, LINKS)[:, None] * kick
    world.step()
    start = world.energy.copy()
    world.step(599)
    return world, start


def test_shaken_in_space() -> None:
    world, start = _shaken(0.3)
    np.testing.assert_array_equal(world.health, 0)
    assert (world.energy < start).all()
    assert np.abs(world.residual).max() < 1e-12
    # A share of .55 suffices where the chain swings in a plane, and not here.
    world, start = _shaken(0.55)
    assert (world.health != 0).sum() > 4


@pytest.mark.slow
def test_second_order_where_the_end_swings() -> None:
    exact = tip(1e3, 1.0)
    errors = []
    for rate in (60, 120, 240):
        world = sy.World(chain(1e3), method=alpha(dt=1 / rate))
        world.step(rate)
        errors.append(np.linalg.norm(world.particles.position[0, -1] - exact))
    assert errors[0] < 2e-4
    for coarse, fine in pairwise(errors):
        # The next term changes the ratio by some 2 %.
        assert coarse / fine == pytest.approx(4.0, rel=0.05)


def test_a_bridge_under_ten_tonnes() -> None:
    world = sy.World(sy.scenes.bridge(load=1e4, place=(2.5, 0.5)), method=alpha())
    cables = world.scene.of(sy.Cable, sy.CableConstraint)
    taut = 0
    for step in range(600):
        world.step()
        pulls = np.array([world[cable].multiplier[0] for cable in cables])
        assert pulls.min() >= 0.0
        residual = np.abs(world.residual[0]).max()
        assert residual <= 1e-10
        taut += int((pulls > 0.0).sum())
        if step == 60:
            middle = world.energy[0]
    assert taut > 600 * 10
    assert world.energy[0] < middle
    assert world.health[0] == 0
    # It comes to rest: damping .9 a second, and what the impacts took.
    assert np.abs(world.particles.velocity).max() < 1e-6
    # And hangs as it must: the supports carry all weight.
    support = [c for c in world.scene.of(sy.CableConstraint)]
    lift = 0.0
    for cable in support:
        p = world.scene.particles.index(cable.particle)
        up = np.array(cable.anchor)[1] - world.particles.position[0, p, 1]
        lift += world[cable].multiplier[0] * up
    assert lift == pytest.approx((1e4 + 12.0) * G, rel=1e-8)


# Order, momentum and forces


SWUNG = np.array([[1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [2.0, 0.0, 0.5]])
THROWN = np.array([[0.0, 1.0, 2.0], [1.0, 1.0, -1.0], [0.0, 1.0, 0.0]])
MASS = np.array([2.0, 0.5, 1.0])


def _swing(method: sy.Method) -> sy.World:
    """A double pendulum in space with springs, drag, damping and water, thrown, after 1 s."""
    scene = sy.Scene()
    a, b, c = (
        scene.add(sy.Particle(position=x, velocity=v, mass=m, damping=d))
        for x, v, m, d in zip(SWUNG, THROWN, MASS.tolist(), (0.7, 1.0, 1.0), strict=True)
    )
    scene.add(sy.RodConstraint(a, (0, 0, 0)))
    scene.add(sy.Rod(a, b))
    scene.add(sy.Spring(b, c, 60.0, 1.0))
    scene.add(sy.AnchoredSpring(c, (2, 1, 0), 40.0, 0.5))
    scene.add(sy.Drag(linear=0.2, quadratic=0.1, wind=(1, 0, 1)))
    scene.add(sy.Buoyancy(b, surface=0.0, half_depth=3.0, volume=1e-3))
    world = sy.World(scene, method=method)
    world.step(round(1.0 / method.dt))
    return world


def _swung() -> tuple[Array, Array]:
    """The same, its links at the level of accelerations, by DOP853."""

    def spring(apart: Array, stiffness: float, rest: float) -> Array:
        length = np.linalg.norm(apart)
        return -stiffness * (length - rest) * apart / length

    def rate(_: float, state: Array) -> Array:
        x, v = state.reshape(2, 3, 3)
        force = MASS[:, None] * np.array([0.0, -G, 0.0])
        force[0] += 2.0 * np.log(0.7) * v[0]
        wind = v - np.array([1.0, 0.0, 1.0])
        force -= (0.2 + 0.1 * np.linalg.norm(wind, axis=1, keepdims=True)) * wind
        between = spring(x[1] - x[2], 60.0, 1.0)
        force[1] += between
        force[2] += spring(x[2] - np.array([2.0, 1.0, 0.0]), 40.0, 0.5) - between
        force[1, 1] += 9.81 * (3.0 - x[1, 1]) / 6.0
        jacobian = np.zeros((2, 3, 3))
        jacobian[0, 0], jacobian[1, 0], jacobian[1, 1] = x[0], x[0] - x[1], x[1] - x[0]
        rates = np.array([v[0] @ v[0], (v[0] - v[1]) @ (v[0] - v[1])])
        jacobian = jacobian.reshape(2, 9)
        inverse = np.repeat(1.0 / MASS, 3)
        matrix = (jacobian * inverse) @ jacobian.T
        pull = np.linalg.solve(matrix, jacobian @ (inverse * force.ravel()) + rates)
        return np.concatenate([v.ravel(), inverse * (force.ravel() - jacobian.T @ pull)])

    start = np.concatenate([SWUNG, THROWN]).ravel()
    end = solve_ivp(rate, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    x, v = end.reshape(2, 3, 3)
    return x, v


@pytest.mark.parametrize("rho_inf", [0.0, 0.5, 1.0])
def test_order_with_links_and_all_forces(rho_inf: float) -> None:
    x, v = _swung()
    errors = []
    for rate in (400, 800, 1600):
        world = _swing(alpha(rho_inf, dt=1 / rate))
        assert world.health[0] == 0
        apart = world.particles.position[0] - x, world.particles.velocity[0] - v
        errors.append([np.linalg.norm(apart[0]), np.linalg.norm(apart[1])])
    for coarse, fine in pairwise(errors):
        np.testing.assert_allclose(np.divide(coarse, fine), 4.0, rtol=0.06)


def test_a_free_structure_keeps_its_momentum_and_its_shape() -> None:
    world = sy.World(from_particle_scene(tumbling_platform()), method=alpha(dt=0.01))
    assert len(world.model.dropped) == 3
    momentum, spin, energy = world.momentum.copy(), world.angular_momentum.copy(), world.energy[0]
    for _ in range(10):
        world.step(20)
        assert np.abs(world.residual).max() <= 1e-12
        np.testing.assert_allclose(world.momentum, momentum, rtol=0, atol=1e-11)
    # Second order, and falling.
    np.testing.assert_allclose(world.angular_momentum, spin, rtol=2e-3)
    assert 0.998 * energy < world.energy[0] <= energy


def test_a_rider_goes_where_rattle_takes_it() -> None:
    ends = []
    for method in (alpha(dt=1e-3), alpha(dt=2e-3), sy.Method(sy.Rattle(), sy.Direct(), dt=1e-4)):
        scene = from_particle_scene(tumbling_platform())
        deck = scene.particles[2:6]
        place = np.mean([p.position for p in deck], axis=0)
        velocity = np.mean([p.velocity for p in deck], axis=0)
        load = scene.add(sy.Particle(position=place, velocity=velocity, mass=10.0))
        rider = scene.add(sy.Rider(load, deck))
        world = sy.World(scene, method=method)
        world[rider].accelerations = [0.4, -0.4, 0.2, -0.2]
        world.step(round(0.5 / method.dt))
        assert world.health[0] == 0
        ends.append(world.particles.position[0].copy())
    fine, coarse = (np.abs(end - ends[-1]).max() for end in ends[:2])
    assert coarse < 5e-5
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


# Cables


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("rho_inf", [0.0, 0.5])
def test_a_cable_that_snaps_taut_rebounds_with_its_restitution(
    rho_inf: float, restitution: float
) -> None:
    scene = sy.Scene(gravity=(0.0, 0.0, 0.0))
    a = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0), mass=1.0))
    b = scene.add(sy.Particle(position=(0.95, 0.0, 0.0), velocity=(2.0, 0.0, 0.0), mass=3.0))
    scene.add(sy.Cable(a, b, 1.0, restitution=restitution))
    world = sy.World(scene, method=alpha(rho_inf, dt=0.01))
    world.step(6)
    # v' = v + (1 + e) m_r v_rel / m; m_r = 3/4 kg, v_rel = 3 m/s.
    impulse = (1.0 + restitution) * 0.75 * 3.0
    velocity = world.particles.velocity[0, :, 0]
    np.testing.assert_allclose(velocity, [-1.0 + impulse, 2.0 - impulse / 3.0], atol=1e-11)
    np.testing.assert_allclose(world.momentum, [[5.0, 0.0, 0.0]], atol=1e-12)
    assert np.linalg.norm(np.diff(world.particles.position[0], axis=0)) <= 1.0 + 1e-11


def test_a_falling_weight_is_caught_by_its_cable_and_hangs() -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, 0.0, 0.0), mass=2.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 0.5))
    world = sy.World(scene, method=alpha(dt=0.01))
    for _ in range(100):
        world.step()
        assert world.residual[0, 0] <= 1e-12
    np.testing.assert_allclose(world.particles.position[0, 0], [0.0, -0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(world.particles.velocity[0, 0], 0.0, atol=1e-12)
    # The multiplier is the tension over the length.
    assert 0.5 * world[cable].multiplier[0] == pytest.approx(2.0 * G, rel=1e-9)


def test_cables_only_pull_and_never_add_energy() -> None:
    scene = sy.scenes.bridge()
    world = sy.World(scene, worlds=11, method=alpha())
    cables = scene.of(sy.Cable, sy.CableConstraint)
    rng = np.random.default_rng(0)
    world.step(60)
    world.particles.velocity[:] = 2.0 * rng.standard_normal(world.particles.velocity.shape)
    start = world.energy.copy()
    slack = taut = 0
    for _ in range(300):
        world.step()
        tension = np.stack([world[cable].multiplier for cable in cables], axis=1)
        assert tension.min() >= 0.0
        assert np.abs(world.residual).max() <= 1e-10
        assert (world.energy <= start).all()
        slack += (tension == 0.0).sum()
        taut += (tension > 0.0).sum()
    assert min(slack, taut) > 5000
    np.testing.assert_array_equal(world.health, 0)


def test_a_winch_hoists_at_its_rate() -> None:
    scene = sy.Scene()
    p = scene.add(sy.Particle(position=(0.0, -2.0, 0.0), mass=3.0))
    cable = scene.add(sy.CableConstraint(p, (0.0, 0.0, 0.0), 2.0, winch=True))
    world = sy.World(scene, worlds=2, method=alpha(dt=0.01))
    world[cable].rate = [-0.5, 0.25]
    world.step(100)
    np.testing.assert_allclose(world[cable].length, [1.5, 2.25], rtol=1e-13)
    expected = [[[0.0, -1.5, 0.0]], [[0.0, -2.25, 0.0]]]
    np.testing.assert_allclose(world.particles.position, expected, rtol=0, atol=5e-12)
    speed = [[[0.0, 0.5, 0.0]], [[0.0, -0.25, 0.0]]]
    np.testing.assert_allclose(world.particles.velocity, speed, rtol=0, atol=1e-9)


# Afresh


def test_assigned_velocities_start_the_motion_afresh() -> None:
    def bob() -> tuple[sy.Scene, sy.Particle]:
        scene = sy.Scene()
        p = scene.add(sy.Particle(position=(1.0, 0.0, 0.0)))
        scene.add(sy.RodConstraint(p, (0.0, 0.0, 0.0)))
        return scene, p

    scene, _ = bob()
    touched = sy.World(scene, method=alpha(dt=0.01))
    touched.step(30)
    x, v = touched.particles.position[0, 0].copy(), np.array([0.0, 0.0, 3.0])
    touched.particles.velocity[0, 0] = v
    touched.step(20)
    new, particle = bob()
    fresh = sy.World(new, method=alpha(dt=0.01))
    assert particle.movable
    fresh.particles.position[0, 0], fresh.particles.velocity[0, 0] = x, v
    fresh.step(20)
    # The multiplier that Newton's method starts from differs, so rounding does.
    np.testing.assert_allclose(
        touched.particles.position, fresh.particles.position, rtol=0, atol=1e-11
    )


def test_a_rod_added_in_flight_leaves_the_rest_as_it_was() -> None:
    scene = sy.Scene()
    a, b = (scene.add(sy.Particle(position=(k, 0, 0), velocity=(0, 0, k))) for k in (1.0, 2.0))
    scene.add(sy.RodConstraint(a, (0, 0, 0)))
    world = sy.World(scene, method=alpha(dt=0.01))
    world.step(10)
    world.add(sy.Rod(a, b))
    world.step(100)
    assert np.abs(world.residual).max() < 1e-12
    assert world.health[0] == 0


def test_a_restored_world_goes_on_bit_for_bit() -> None:
    world = sy.World(chain(1e3, cables=True), worlds=9, method=alpha())
    world.particles.velocity[:, 3, 2] = np.linspace(0.0, 1.0, 9)
    world.step(20)
    kept = world.snapshot()
    world.step(30)
    end = world.state.copy()
    world.restore(kept)
    world.step(30)
    np.testing.assert_array_equal(world.state, end)


def test_what_it_remembers() -> None:
    scene, a, b = pair()
    scene.add(sy.Rod(a, b))
    plain = sy.World(scene).bytes_per_world
    # A filtered acceleration for each particle, and a mark.
    world = sy.World(scene, method=alpha())
    assert world.bytes_per_world == plain + 8 * (3 * 2 + 1)


def test_too_few_passes_are_flagged() -> None:
    world = sy.World(chain(1e3), worlds=2, method=alpha(passes=2))
    world.particles.velocity[1, :, 1] = -1.0
    world.step(60)
    np.testing.assert_array_equal(world.health & 2, 2)


# Refusals


def test_what_it_refuses() -> None:
    scene, a, b = pair()
    scene.add(sy.Rod(a, b))
    for solver in (sy.Direct(), sy.GaussSeidel(), sy.WorstFirst()):
        with refused("GeneralisedAlpha", type(solver).__name__, "without a solver"):
            sy.World(scene, method=sy.Method(sy.GeneralisedAlpha(), solver))
    for thing in (sy.Ground(), sy.UserForce(no_force)):
        scene.add(thing)
        with refused("GeneralisedAlpha", type(thing).__name__, "Rattle()"):
            sy.World(scene, method=alpha())
        scene.remove(thing)
    sy.World(scene, method=alpha()).step()


@pytest.mark.parametrize("rho_inf", [-0.1, 1.1, float("nan"), "much"])
def test_a_share_out_of_its_limits(rho_inf: Any) -> None:
    with refused("GeneralisedAlpha", "rho_inf", repr(rho_inf)):
        sy.GeneralisedAlpha(rho_inf=rho_inf)
