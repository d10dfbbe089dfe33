"""Settings in the format of rl-baselines3-zoo."""

import inspect

import pytest
import torch
import yaml
from stable_baselines3.common.noise import NormalActionNoise

from steelyard_agents.hyperparameters import ALGORITHMS, SETTINGS_FOLDER, parse, read
from steelyard_agents.train import configured

ZOO_STYLE = """
Point-v0: &point
  n_timesteps: !!float 1e6
  n_envs: 8
  policy: 'MlpPolicy'
  normalize: "dict(norm_obs=True, norm_reward=False)"
  n_steps: 512
  gamma: 0.9
  learning_rate: lin_3e-4
  clip_range: lin_0.2
  ent_coef: 1e-3
  policy_kwargs: "dict(log_std_init=-2, ortho_init=False, activation_fn=nn.ReLU,
                       net_arch=dict(pi=[256, 128], vf=[64]))"
Line-v0:
  <<: *point
  env_kwargs: {gain: 0.5}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "ppo.yml"
    path.write_text(ZOO_STYLE)
    return path


def test_zoo_settings_are_understood(file):
    settings = read("ppo", "Point-v0", file=file)
    assert (settings.timesteps, settings.n_envs) == (1_000_000, 8)
    assert settings.normalize == {"norm_obs": True, "norm_reward": False, "gamma": 0.9}
    algorithm = settings.algorithm
    assert algorithm["n_steps"] == 512 and algorithm["ent_coef"] == 1e-3
    assert algorithm["learning_rate"](1.0) == 3e-4
    assert algorithm["learning_rate"](0.25) == pytest.approx(7.5e-5)
    assert algorithm["clip_range"](0.5) == pytest.approx(0.1)
    assert algorithm["policy_kwargs"] == {
        "log_std_init": -2,
        "ortho_init": False,
        "activation_fn": torch.nn.ReLU,
        "net_arch": {"pi": [256, 128], "vf": [64]},
    }
    assert settings.source == yaml.safe_load(ZOO_STYLE)["Point-v0"]


def test_yaml_merges_and_module_prefixes(file):
    settings = read("ppo", "somewhere:Line-v0", file=file)
    assert settings.env_kwargs == {"gain": 0.5} and settings.n_envs == 8


def test_command_line_comes_above_the_file(file):
    settings = configured(
        "ppo", "Line-v0", file=file, timesteps=77, n_envs=2, env_kwargs={"length": 3}
    )
    assert (settings.timesteps, settings.n_envs) == (77, 2)
    assert settings.env_kwargs == {"gain": 0.5, "length": 3}
    assert settings.source["n_timesteps"] == 77


def test_environment_without_settings_gets_the_defaults(file):
    settings = read("ppo", "Acrobot-v1")
    assert settings.source == {} and settings.timesteps is None
    assert settings.algorithm == {"policy": "MlpPolicy", "device": "cpu"}
    assert read("a2c", "Acrobot-v1").source == {}
    with pytest.raises(ValueError, match=r"Acrobot-v1.*\['Line-v0', 'Point-v0'\]"):
        read("ppo", "Acrobot-v1", file=file)


def test_action_noise():
    settings = parse("td3", {"noise_type": "normal", "noise_std": 0.1})
    noise = settings.action_noise(3)
    assert isinstance(noise, NormalActionNoise)
    assert noise().shape == (3,)
    assert parse("td3", {}).action_noise(3) is None


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ({"n_step": 5}, "unknown setting 'n_step'"),
        ({"learning_rate": "lin_fast"}, "learning_rate: 'lin_fast'"),
        ({"normalize": "maybe"}, "normalize is 'maybe'"),
        ({"noise_type": "pink"}, "noise_type is 'pink'"),
        ({"n_envs": 0}, "n_envs is 0"),
        ({"n_timesteps": -1}, "n_timesteps -1"),
        ({"policy_kwargs": "dict(net_arch=[64"}, "cannot read setting policy_kwargs"),
        ({"policy_kwargs": "dict(a=__import__('os').getcwd())"}, "is not allowed"),
        ({"policy_kwargs": "dict(a=nn.Linear)"}, "nn.Linear is not an activation"),
        ({"policy_kwargs": "dict(a=nn.modules)"}, "nn.modules is not an activation"),
        ({"policy_kwargs": "dict(a=open('x'))"}, "is not allowed"),
        ({"policy_kwargs": "dict([('a', 1)])"}, "is not allowed"),
    ],
)
def test_bad_settings_are_refused(source, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        parse("ppo", source)


def test_unknown_algorithm_is_refused():
    with pytest.raises(ValueError, match="no algorithm 'dreamer'; choose from a2c"):
        read("dreamer", "Point-v0")


@pytest.mark.parametrize("path", sorted(SETTINGS_FOLDER.glob("*.yml")), ids=lambda path: path.stem)
def test_the_settings_that_come_along_are_complete(path):
    accepted = inspect.signature(ALGORITHMS[path.stem].__init__).parameters
    names = set(yaml.safe_load(path.read_text()))
    assert names >= {f"steelyard/{name}-v0" for name in ("Platform", "Ballistic", "Bridge")}
    for name in names:
        settings = read(path.stem, name)
        assert settings.timesteps
        assert set(settings.algorithm) <= set(accepted)
        steps = settings.algorithm.get("n_steps")
        if steps:  # a last, smaller batch would weigh its samples more than the others
            assert steps * settings.n_envs % settings.algorithm["batch_size"] == 0
