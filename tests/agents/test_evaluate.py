"""Evaluation counts what it says it counts."""

import json

import numpy as np
import pytest

from steelyard_agents import evaluate, policies
from steelyard_agents.make import make_vec_env
from tests.agents import toy_envs

toy_envs.register()


class StandStill:
    """Never moves: the point stays where it starts until time runs out."""

    def reset(self, num_envs):
        self.resets = getattr(self, "resets", 0) + 1

    def __call__(self, obs):
        return np.zeros((len(obs), 1))


class RunAway:
    """Runs off on the side it starts on, at a time that depends on the start."""

    def reset(self, num_envs):
        pass

    def __call__(self, obs):
        return np.where(obs > 0, 0.2, -0.2)


@pytest.fixture
def controller(monkeypatch):
    monkeypatch.setattr(
        evaluate, "load_controller", lambda env_id: toy_envs.PointController(), raising=True
    )


def starts(count, seed):
    return np.array([np.random.default_rng(seed + row).uniform(-0.9, 0.9) for row in range(count)])


def test_returns_are_those_of_the_episodes_seeds():
    policy = StandStill()
    scored = evaluate.evaluate(policy, toy_envs.POINT_ID, episodes=20, seed=40)
    # The adapter sums float64 rewards; ten equal terms.
    np.testing.assert_allclose(scored.returns, 10 * (1 - starts(20, 40) ** 2), rtol=1e-14)
    assert (scored.lengths == 10).all() and scored.successes.all()
    assert policy.resets == 1


def test_short_episodes_are_not_counted_twice():
    """Lengths differ by row, so rows begin second episodes before the slowest row is done."""
    scored = evaluate.evaluate(RunAway(), toy_envs.POINT_ID, episodes=50, seed=7)
    steps_to_the_end = np.ceil((1.0 - np.abs(starts(50, 7))) / 0.06)
    assert len(set(steps_to_the_end)) > 4
    np.testing.assert_array_equal(scored.lengths, np.minimum(steps_to_the_end, 10))
    np.testing.assert_array_equal(scored.successes, steps_to_the_end > 10)


def test_more_episodes_begin_with_the_same_ones():
    few = evaluate.evaluate(RunAway(), toy_envs.POINT_ID, episodes=5, seed=7)
    many = evaluate.evaluate(RunAway(), toy_envs.POINT_ID, episodes=50, seed=7)
    np.testing.assert_array_equal(few.returns, many.returns[:5])


def test_single_environments_are_scored_likewise():
    """CartPole pushed to one side for ever falls after 8 to 10 steps, with a reward of 1 each."""

    class Push(StandStill):
        def __call__(self, obs):
            return np.ones(len(obs))

    scored = evaluate.evaluate(Push(), "CartPole-v1", episodes=12)
    np.testing.assert_array_equal(scored.returns, scored.lengths)
    assert set(scored.lengths) <= {8, 9, 10}
    assert scored.successes is None


@pytest.mark.parametrize("env_id", ["CartPole-v1", toy_envs.POINT_ID])
def test_random_policy_is_random_and_reproducible(env_id):
    policy = evaluate.random_policy(env_id)
    space = make_vec_env(env_id, 1).action_space
    drawn = []
    for _ in range(2):
        policy.reset(300)
        actions = policy(None)
        assert actions.shape[0] == 300 and space.contains(actions[0])
        drawn.append(actions)
    np.testing.assert_array_equal(drawn[0], drawn[1])
    middle = 0.5 if env_id == "CartPole-v1" else 0.0
    # The mean of 300 draws from a range of width 1 (or 2) has a deviation of .03; five of them.
    assert abs(drawn[0].mean() - middle) < 0.17
    assert (policy(None) != drawn[0]).any()


def test_baselines(controller):
    scores = evaluate.baselines(toy_envs.POINT_ID, episodes=40)
    assert list(scores) == ["random", "controller"]
    assert scores["controller"]["success_rate"] == 1.0
    assert scores["random"]["return_mean"] < scores["controller"]["return_mean"]


def test_environment_without_controller(monkeypatch):
    monkeypatch.setattr(evaluate, "load_controller", lambda env_id: None)
    assert list(evaluate.baselines("CartPole-v1", episodes=3)) == ["random"]


def test_command_line_writes_a_record(controller, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = ["controller", "--env", toy_envs.POINT_ID, "--episodes", "8", "--env-kwargs"]
    evaluate.main([*command, "gain=0.2"])
    record = json.loads((tmp_path / "runs/SteelyardTest-Point-v0/controller.json").read_text())
    assert record["score"]["episodes"] == 8 and record["score"]["physics_errors"] == 0
    assert record["env_kwargs"] == {"gain": 0.2}
    assert record["command"].startswith("python -m steelyard_agents.evaluate controller --env")
    assert "mean return" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["random"], "--env"),
        (["nowhere"], "nowhere holds no finished training run"),
        (["random", "--env", "Nothing-v0"], "Nothing"),
        (["random", "--env", "CartPole-v1", "--env-kwargs", "gain"], "KEY=VALUE"),
        (["random", "--env", "CartPole-v1", "--episodes", "0"], "num_envs is 0"),
    ],
)
def test_command_line_says_what_is_wrong(command, message, capsys):
    with pytest.raises(SystemExit):
        evaluate.main(command)
    assert message in capsys.readouterr().err


def test_missing_controller_is_none(monkeypatch):
    def load(env_id):
        raise KeyError(env_id)

    controllers = pytest.importorskip("steelyard_agents.controllers")
    monkeypatch.setattr(controllers, "load", load)
    assert policies.load_controller("CartPole-v1") is None
