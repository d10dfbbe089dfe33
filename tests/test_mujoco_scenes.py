"""The benchmark scenes in MuJoCo against the references."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.references import equilibrium, projectile, rigid_motion
from benchmarks.scenes import artillery, bridge, bridge_mass, tumbling_platform

mujoco = pytest.importorskip("mujoco")

from benchmarks.peers import mujoco_scenes  # noqa: E402 - it imports mujoco at once


def platform_error(dt: float, solref: tuple[float, float] | None) -> float:
    scene = tumbling_platform()
    model, data = mujoco_scenes.build(scene, dt=dt, solref=solref)
    mujoco.mj_step(model, data, nstep=round(2.0 / dt))
    exact, _ = rigid_motion(scene, [2.0])
    return float(np.linalg.norm(mujoco_scenes.positions(data) - exact[0], axis=1).max())


def test_build_starts_from_the_scene() -> None:
    scene = bridge(mass=bridge_mass(x=2.5, z=0.5))
    model, data = mujoco_scenes.build(scene, dt=0.01)
    np.testing.assert_array_equal(mujoco_scenes.positions(data), scene.position)
    np.testing.assert_array_equal(model.body_mass[1:], scene.mass)
    assert (model.neq, model.ntendon, model.nv) == (6, 28, 36)
    assert model.opt.timestep == 0.01
    platform = tumbling_platform()
    _, spinning = mujoco_scenes.build(platform, dt=0.01)
    np.testing.assert_array_equal(mujoco_scenes.velocities(spinning), platform.velocity)


def test_platform_converges_at_second_order_when_the_links_stiffen_with_the_step() -> None:
    coarse = platform_error(0.005, mujoco_scenes.tight_solref(0.005))
    fine = platform_error(0.0025, mujoco_scenes.tight_solref(0.0025))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    # The links of the defaults stay soft: a smaller step does not help them.
    assert platform_error(0.0025, None) > 0.05


@pytest.mark.parametrize("load", [0.0, 10.0])
def test_bridge_hangs_near_its_statics(load: float) -> None:
    scene = bridge(mass=bridge_mass(x=2.0, z=0.0, load=load))
    model, data = mujoco_scenes.build(scene, dt=0.01)
    mujoco.mj_step(model, data, nstep=12_000)
    height = mujoco_scenes.positions(data)[:, 1]
    # The soft links give: 0.8 mm bare, 0.9 mm loaded.
    np.testing.assert_allclose(height, equilibrium(scene).position[:, 1], rtol=0, atol=1e-3)


# Semi-implicit Euler falls behind by g dt t / 2 = 0.3 m, a little less under damping.
@pytest.mark.parametrize(("integrator", "tolerance"), [("Euler", 0.3), ("RK4", 1e-12)])
def test_artillery_flight(integrator: mujoco_scenes.Integrator, tolerance: float) -> None:
    scene = artillery()
    model, data = mujoco_scenes.build(scene, dt=0.01, integrator=integrator)
    mujoco.mj_step(model, data, nstep=300)
    exact, _ = projectile(
        scene.position[0],
        scene.velocity[0],
        acceleration=scene.gravity,
        damping=scene.damping,
        time=3.0,
    )
    np.testing.assert_allclose(mujoco_scenes.positions(data)[0], exact, rtol=0, atol=tolerance)


def test_set_mass_equals_a_scene_built_with_the_mass() -> None:
    mass = bridge_mass(x=3.2, z=0.7)
    moved, _ = mujoco_scenes.build(bridge(), dt=0.01)
    mujoco_scenes.set_mass(moved, bridge(), mass)
    built, _ = mujoco_scenes.build(bridge(mass=mass), dt=0.01)
    np.testing.assert_array_equal(moved.body_mass, built.body_mass)
    np.testing.assert_allclose(moved.dof_damping, built.dof_damping, rtol=1e-15)
    np.testing.assert_allclose(moved.dof_M0, built.dof_M0, rtol=1e-15)


def test_ground_holds_a_particle_that_slides_until_friction_stops_it() -> None:
    scene = artillery()
    scene = type(scene)(
        position=np.zeros((1, 3)), velocity=np.array([[1.0, 0.0, 0.0]]), mass=np.array([1.0])
    )
    model, data = mujoco_scenes.build(scene, dt=0.001, ground_friction=0.5)
    mujoco.mj_step(model, data, nstep=1000)
    place = mujoco_scenes.positions(data)[0]
    # v^2 / (2 mu g), up to what the soft contact gives.
    assert place[0] == pytest.approx(1.0 / (2 * 0.5 * 9.81), rel=0.05)
    assert place[1] == pytest.approx(0.0, abs=1e-3)
