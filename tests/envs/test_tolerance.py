"""Environments that are asked for a tolerance instead of a method."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import steelyard_envs  # noqa: F401
from steelyard_envs.ballistic import BallisticTask
from steelyard_envs.bridge import BridgeTask
from steelyard_envs.platform import PlatformTask

TASKS = {
    "steelyard/Platform-v0": PlatformTask,
    "steelyard/Bridge-v0": BridgeTask,
    "steelyard/Ballistic-v0": BallisticTask,
}


@pytest.mark.parametrize("env_id", TASKS)
def test_the_default_is_the_cheapest_that_was_measured(env_id: str) -> None:
    task = TASKS[env_id]
    default = next(
        row for row in task.measured if row[:2] == (task.methods[0], task.default_physics_rate)
    )
    assert default[3] == min(row[3] for row in task.measured) == 1.0
    assert task.physics_for(default[2]) == default[:2]


@pytest.mark.parametrize("env_id", TASKS)
def test_what_was_measured_can_be_run(env_id: str) -> None:
    for method, rate, error, cost in TASKS[env_id].measured:
        assert method in TASKS[env_id].methods
        assert error > 0.0 and cost >= 1.0
        task = TASKS[env_id](1, method=method, physics_rate=rate)
        assert task.world.method.dt == pytest.approx(1.0 / rate)


def test_a_tighter_tolerance_takes_smaller_steps() -> None:
    rates = [PlatformTask.physics_for(tolerance)[1] for tolerance in (1e-2, 5e-4, 1e-5)]
    assert rates == [50.0, 100.0, 800.0]
    env = gym.make("steelyard/Platform-v0", tolerance=5e-4)
    assert env.unwrapped.task.substeps == 2
    env.reset(seed=0)
    observation, *_ = env.step(env.action_space.sample())
    assert np.isfinite(observation).all()


def test_other_control_rates_round_up() -> None:
    task = PlatformTask(1, tolerance=5e-4, control_rate=30.0)
    assert (task.physics_rate, task.substeps) == (120.0, 4)


def test_what_was_not_measured_is_refused_with_the_best_there_is() -> None:
    with pytest.raises(
        ValueError, match=r"1e-09 m; the least error .* 2.9e-06 m, of 'rattle' at 1600"
    ):
        PlatformTask(1, tolerance=1e-9)
    with pytest.raises(ValueError, match="beside a method or a physics rate"):
        PlatformTask(1, tolerance=1e-3, method="rattle")
    with pytest.raises(ValueError, match="tolerance is nan"):
        PlatformTask(1, tolerance=float("nan"))


@pytest.mark.parametrize("env_id", TASKS)
def test_docstrings_state_what_was_measured(env_id: str) -> None:
    text = gym.spec(env_id).entry_point
    module, name = text.split(":")
    doc = getattr(__import__(module, fromlist=[name]), name).__doc__
    assert "`tolerance`" in doc
    assert "TABLE" not in doc
    for method, rate, error, _ in TASKS[env_id].measured[:6]:
        if method in ("rattle",):
            digits = f"{error:.1e}".replace("e-0", "e-")
            assert digits in doc and f"{rate:g}" in doc, (method, rate)
