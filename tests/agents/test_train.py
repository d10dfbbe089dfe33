"""Training, from the command line to the files."""

import csv
import json

import imageio.v2 as imageio
import numpy as np
import pytest
import yaml

from steelyard_agents import curve, demo, evaluate, sweep, train
from steelyard_agents.make import make_vec_env
from steelyard_agents.policies import TrainedPolicy
from tests.agents import toy_envs

toy_envs.register()

SETTINGS = """
SteelyardTest/Point-v0:
  n_timesteps: 1600
  n_envs: 20
  normalize: true
  n_steps: 16
  batch_size: 160
  n_epochs: 4
  gamma: 0.9
  learning_rate: lin_1e-2
  policy_kwargs: "dict(net_arch=[8])"
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    controllers = {toy_envs.POINT_ID: toy_envs.PointController()}
    monkeypatch.setattr(evaluate, "load_controller", controllers.get)
    (tmp_path / "settings.yml").write_text(SETTINGS)
    return tmp_path


def run(*more, env=toy_envs.POINT_ID):
    train.main([env, "--settings", "settings.yml", "--no-progress", *more])


def test_everything_is_written(here, capsys):
    run("--seed", "3", "--env-kwargs", "gain=0.25")
    folder = here / "runs/SteelyardTest-Point-v0/ppo-seed3"
    record = json.loads((folder / "results.json").read_text())
    names = {path.name for path in folder.iterdir()}
    assert set(record["files"].values()) == {
        "model.zip",
        "settings.yml",
        "curve.png",
        "curve.csv",
        "video.mp4",
    }
    assert names >= set(record["files"].values()) | {"vecnormalize.pkl"}

    assert record["command"] == (
        "python -m steelyard_agents.train SteelyardTest/Point-v0 --settings settings.yml "
        "--no-progress --seed 3 --env-kwargs gain=0.25"
    )
    assert set(record["versions"]) >= {"python", "numpy", "gymnasium", "torch"}
    assert record["machine"]["cores"] >= 1 and record["wall_time_s"] > 0
    assert record["timesteps"] == 1600 and record["seed"] == 3
    assert record["env_kwargs"] == {"gain": 0.25}
    assert set(record["scores"]) == {"random", "controller", "trained"}
    assert record["scores"]["controller"]["success_rate"] == 1.0
    assert not record["stopped_by_time_limit"]

    saved = yaml.safe_load((folder / "settings.yml").read_text())[toy_envs.POINT_ID]
    assert saved["n_steps"] == 16 and saved["env_kwargs"] == {"gain": 0.25}

    frames = imageio.mimread(folder / "video.mp4")
    assert 1 <= len(frames) <= 10
    assert frames[0].min() < 100 < frames[0].max()
    assert "trained" in capsys.readouterr().out


def test_the_curve_holds_every_episode(here):
    run()
    folder = here / "runs/SteelyardTest-Point-v0/ppo-seed0"
    with (folder / "curve.csv").open() as file:
        points = list(csv.DictReader(file))
    steps = sum(int(point["episodes"]) * float(point["length_mean"]) for point in points)
    # All steps but those of the 20 episodes, at most 10 steps long, that had not ended.
    assert 1600 - 20 * 10 < steps <= 1600
    assert all(-10.0 <= float(point["return_mean"]) <= 10.0 for point in points)
    assert all(0.0 <= float(point["success_rate"]) <= 1.0 for point in points)
    times = [float(point["wall_time"]) for point in points]
    assert times == sorted(times)
    assert imageio.imread(folder / "curve.png").std() > 10


def test_the_saved_policy_scores_what_the_record_says(here):
    """The normaliser is part of the policy: without it the score would be another."""
    run()
    folder = here / "runs/SteelyardTest-Point-v0/ppo-seed0"
    record = json.loads((folder / "results.json").read_text())
    evaluate.main([str(folder)])
    again = json.loads((folder / "evaluation.json").read_text())
    assert again["score"] == record["scores"]["trained"]
    assert (again["env"], again["policy"]) == (toy_envs.POINT_ID, str(folder))

    policy = TrainedPolicy.load(folder, algo="ppo")
    normalizer = policy._normalizer
    obs = np.linspace(-0.9, 0.9, 7, dtype=np.float32)[:, None]
    raw = TrainedPolicy(policy._model, None)
    expected = (obs - normalizer.obs_rms.mean) / np.sqrt(normalizer.obs_rms.var + 1e-8)
    np.testing.assert_allclose(policy(obs), raw(expected.astype(np.float32)), rtol=1e-5)
    assert np.abs(policy(obs) - raw(obs)).max() > 0.01


def test_the_same_seed_gives_the_same_agent_and_another_seed_another(here):
    run("--output", "a")
    run("--output", "b")
    run("--output", "c", "--seed", "1")
    obs = np.linspace(-0.9, 0.9, 7, dtype=np.float32)[:, None]
    actions = [TrainedPolicy.load(here / name, algo="ppo")(obs) for name in "abc"]
    np.testing.assert_array_equal(actions[0], actions[1])
    assert (actions[0] != actions[2]).any()


def test_a_policy_can_act_by_samples_and_draws_the_same_again(here):
    settings = here / "settings.yml"
    settings.write_text(settings.read_text() + "  deterministic: false\n")
    run()
    folder = here / "runs/SteelyardTest-Point-v0/ppo-seed0"
    obs = np.linspace(-0.9, 0.9, 7, dtype=np.float32)[:, None]
    sampled = TrainedPolicy.load(folder, algo="ppo")
    actions = []
    for _ in range(2):
        sampled.reset(7)
        actions.append([sampled(obs), sampled(obs)])
    np.testing.assert_array_equal(actions[0], actions[1])
    assert (actions[0][0] != actions[0][1]).any()
    likely = TrainedPolicy.load(folder, algo="ppo", deterministic=True)
    np.testing.assert_array_equal(likely(obs), likely(obs))
    evaluate.main([str(folder)])
    again = json.loads((folder / "evaluation.json").read_text())
    assert again["score"] == json.loads((folder / "results.json").read_text())["scores"]["trained"]


def test_no_run_is_overwritten(here):
    for _ in range(3):
        run("--timesteps", "320", "--output", "here")
    assert {path.name for path in here.iterdir()} >= {"here", "here-2", "here-3"}


def test_time_limit_stops_training_and_is_recorded(here):
    run("--time-limit", "0", "--output", "short")
    record = json.loads((here / "short/results.json").read_text())
    assert record["stopped_by_time_limit"] and record["timesteps"] == 20


def test_environment_without_settings_asks_for_timesteps(here, capsys):
    with pytest.raises(SystemExit):
        train.main(["CartPole-v1", "--algo", "a2c"])
    assert "--timesteps" in capsys.readouterr().err
    assert not (here / "runs").exists()


def test_episodes_too_long_for_the_training_leave_no_curve(here):
    train.main(["Pendulum-v1", "--algo", "a2c", "--timesteps", "10", "--output", "p"])
    record = json.loads((here / "p/results.json").read_text())
    assert "curve" not in record["files"] and "video" in record["files"]
    assert record["scores"]["trained"]["success_rate"] is None


@pytest.mark.training
@pytest.mark.parametrize("algo", ["sac", "td3", "a2c", "dqn"])
def test_other_algorithms(here, algo):
    env = "CartPole-v1" if algo == "dqn" else toy_envs.POINT_ID
    noise = "  noise_type: normal\n  noise_std: 0.1\n" if algo == "td3" else ""
    (here / "other.yml").write_text(f"{env}:\n  n_timesteps: 400\n  n_envs: 4\n{noise}")
    train.main([env, "--algo", algo, "--settings", "other.yml", "--no-progress", "--output", algo])
    record = json.loads((here / algo / "results.json").read_text())
    assert record["algo"] == algo and record["scores"]["trained"]["episodes"] == 100


def test_training_learns(here):
    run("--timesteps", "20000", "--output", "learnt")
    scores = json.loads((here / "learnt/results.json").read_text())["scores"]
    assert scores["trained"]["success_rate"] == 1.0
    assert scores["trained"]["return_mean"] > 0.9 * scores["controller"]["return_mean"]


def test_a_sweep_can_be_scored_again(here):
    arguments = [toy_envs.POINT_ID, "--settings", "settings.yml", "--seeds", "2", "--no-progress"]
    sweep.main([*arguments, "--output", "first.json"])
    sweep.main([*arguments, "--output", "again.json", "--rescore"])
    first, again = (json.loads((here / name).read_text()) for name in ("first.json", "again.json"))
    assert again["runs"] == first["runs"]
    assert again["aggregate"] == first["aggregate"]


def test_sweep(here, capsys):
    sweep.main([toy_envs.POINT_ID, "--settings", "settings.yml", "--seeds", "2", "--no-progress"])
    record = json.loads((here / "agents/results/SteelyardTest-Point-v0-ppo.json").read_text())
    assert [run["seed"] for run in record["runs"]] == [0, 1]
    scores = [run["score"]["return_mean"] for run in record["runs"]]
    aggregate = record["aggregate"]
    assert aggregate["return_iqm"] == pytest.approx(np.mean(scores))
    assert aggregate["return_interval"] == pytest.approx(sorted(scores))
    controller = record["baselines"]["controller"]["return_mean"]
    assert aggregate["ratio_to_controller"] == pytest.approx(np.mean(scores) / controller)
    assert record["command"].startswith("python -m steelyard_agents.sweep")
    assert "IQM" in capsys.readouterr().out


@pytest.mark.parametrize("controller", [{}, {"controller": {"return_mean": -1.0}}])
def test_sweep_gives_no_ratio_that_means_nothing(controller):
    runs = [{"score": {"return_mean": value}} for value in (1.0, 2.0, 3.0)]
    aggregate = sweep.aggregate(runs, controller)
    assert aggregate["ratio_to_controller"] is None and aggregate["return_iqm"] == 2.0


def test_demo(here, monkeypatch, capsys):
    """The demo on the toy: what it prints is what a newcomer sees."""
    monkeypatch.setattr(demo, "ENV_ID", toy_envs.POINT_ID)
    configured = train.configured
    monkeypatch.setattr(
        demo,
        "configured",
        lambda algo, env_id: configured(algo, env_id, file=here / "settings.yml"),
    )
    demo.main([])
    shown = capsys.readouterr().out
    for words in ("random", "hand-written", "trained", "Curve: ", "Video: ", "Model: "):
        assert words in shown
    assert (here / "runs/SteelyardTest-Point-v0/demo/results.json").exists()


def test_smoothing_weighs_points_by_their_episodes():
    values, weights = np.array([0.0, 1.0, 2.0, 3.0]), np.ones(4)
    np.testing.assert_allclose(curve.smooth(values, weights), values)  # too few to smooth
    values = np.random.default_rng(0).normal(size=100)
    weights = np.random.default_rng(1).integers(1, 9, size=100)
    smooth = curve.smooth(values, weights)
    window = slice(45, 56)  # 5 points on each side of point 50
    assert smooth[50] == pytest.approx(np.average(values[window], weights=weights[window]))
    assert smooth[0] == pytest.approx(np.average(values[:6], weights=weights[:6]))


def test_the_adapter_serves_training_with_fresh_seeds():
    """Two rows of training never share a random stream."""
    first = make_vec_env(toy_envs.POINT_ID, 64, seed=0).reset()
    assert np.unique(first).size == 64
