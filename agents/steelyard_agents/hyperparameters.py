"""Read training settings written in the format of rl-baselines3-zoo.

A settings file maps environment ids to hyperparameters:

    steelyard/Platform-v0:
      n_timesteps: !!float 2e6
      n_envs: 256
      policy: 'MlpPolicy'
      normalize: true
      learning_rate: lin_3e-4
      policy_kwargs: "dict(net_arch=[64, 64], activation_fn=nn.Tanh)"

`n_timesteps`, `n_envs`, `normalize`, `env_kwargs`, `noise_type` and `noise_std` are read here, and
`deterministic` (true unless set), which says whether the trained policy acts by its most likely actions
or by samples; all other keys are arguments of the algorithm.
"""

import ast
import inspect
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import stable_baselines3
import torch
import yaml
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import (
    ActionNoise,
    NormalActionNoise,
    OrnsteinUhlenbeckActionNoise,
)
from stable_baselines3.common.utils import LinearSchedule

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {
    name: getattr(stable_baselines3, name.upper())
    for name in ("a2c", "ddpg", "dqn", "ppo", "sac", "td3")
}

SETTINGS_FOLDER = Path(__file__).parent / "settings"

NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}


@dataclass(frozen=True)
class Hyperparameters:
    """How to train one algorithm on one environment.

    Attributes:
        timesteps: Environment steps to train for, over all rows; None if not set.
        n_envs: Number of rows of the vector environment.
        normalize: Arguments of `VecNormalize`; None for no normalisation.
        env_kwargs: Arguments of the environment.
        algorithm: Arguments of the algorithm, `policy` among them.
        noise: Kind and standard deviation of the action noise; None for none.
        deterministic: Whether the trained policy takes its most likely actions or samples them.
        source: The settings as read, for the record; empty if there were none.
    """

    timesteps: int | None = None
    n_envs: int = 1
    normalize: dict[str, Any] | None = None
    env_kwargs: dict[str, Any] = field(default_factory=dict)
    algorithm: dict[str, Any] = field(default_factory=dict)
    noise: tuple[str, float] | None = None
    deterministic: bool = True
    source: dict[str, Any] = field(default_factory=dict)

    def action_noise(self, actions: int) -> ActionNoise | None:
        """Return the exploration noise for `actions` continuous actions."""
        if self.noise is None:
            return None
        kind, std = self.noise
        return NOISES[kind](np.zeros(actions), np.full(actions, std))


def read(algo: str, env_id: str, *, file: Path | None = None) -> Hyperparameters:
    """Read the settings of `algo` for `env_id` from `file`, or from those that come along.

    Without `file`, an environment that has no settings gets stable-baselines3's own defaults: its
    `source` is empty then. With `file`, the environment must be in it.

    Raises:
        ValueError: `algo` is unknown, `file` has no such environment, or a setting is not valid.
    """
    if algo not in ALGORITHMS:
        raise ValueError(f"no algorithm {algo!r}; choose from {', '.join(ALGORITHMS)}")
    path = file or SETTINGS_FOLDER / f"{algo}.yml"
    known = yaml.safe_load(path.read_text()) if file or path.exists() else None
    known = known or {}
    name = env_id.rpartition(":")[2]
    if file and name not in known:
        raise ValueError(f"{file} has no settings for {name!r}, only for {sorted(known)}")
    return parse(algo, known.get(name, {}))


def parse(algo: str, source: dict[str, Any]) -> Hyperparameters:
    """Turn settings as read from YAML into values that stable-baselines3 takes.

    Raises:
        ValueError: A key or a value is not valid.
    """
    values = {key: _value(key, value) for key, value in source.items()}
    timesteps = values.pop("n_timesteps", None)
    n_envs = int(values.pop("n_envs", 1))
    if min(n_envs, 1 if timesteps is None else timesteps) < 1:
        raise ValueError(f"n_envs is {n_envs}, n_timesteps {timesteps}: each must be at least 1")
    normalize = _normalize(values.pop("normalize", False))
    env_kwargs = values.pop("env_kwargs", None) or {}
    noise = _noise(values.pop("noise_type", None), values.pop("noise_std", 0.0))
    deterministic = bool(values.pop("deterministic", True))
    accepted = inspect.signature(ALGORITHMS[algo].__init__).parameters
    for key in values:
        if key not in accepted:
            raise ValueError(
                f"unknown setting {key!r} for {algo}: neither a setting of training "
                "(n_timesteps, n_envs, normalize, env_kwargs, noise_type, noise_std, deterministic) "
                f"nor an argument of {algo.upper()}"
            )
    if normalize is not None:
        # Normalised rewards are scaled by the discounted return, with the algorithm's discount.
        normalize.setdefault("gamma", values.get("gamma", accepted["gamma"].default))
    # Networks of this size are slower on an accelerator than on the processor.
    algorithm = {"policy": "MlpPolicy", "device": "cpu"} | values
    return Hyperparameters(
        timesteps=None if timesteps is None else int(timesteps),
        n_envs=n_envs,
        normalize=normalize,
        env_kwargs=dict(env_kwargs),
        algorithm=algorithm,
        noise=noise,
        deterministic=deterministic,
        source=dict(source),
    )


def _value(key: str, value: Any) -> Any:
    """Read one setting: numbers that YAML took for text, schedules, and `dict(...)`."""
    if not isinstance(value, str):
        return value
    try:
        if value.startswith("lin_"):
            return LinearSchedule(float(value.removeprefix("lin_")), 0.0, 1.0)
        if value.startswith("dict("):
            return _expression(ast.parse(value, mode="eval").body)
    except (SyntaxError, ValueError) as error:
        raise ValueError(f"cannot read setting {key}: {value!r}: {error}") from error
    try:
        return float(value)  # YAML 1.1 takes 3e-4, without a point, for text
    except ValueError:
        return value


def _expression(node: ast.expr) -> Any:
    """Evaluate an expression of `dict(...)`, lists, literals and `nn.Activation`, and no other."""
    match node:
        case ast.Call(func=ast.Name(id="dict"), args=[], keywords=keywords):
            return {str(word.arg): _expression(word.value) for word in keywords if word.arg}
        case ast.Dict(keys=keys, values=values):
            return {
                _expression(key): _expression(value)
                for key, value in zip(keys, values, strict=True)
                if key is not None
            }
        case ast.List(elts=elements):
            return [_expression(element) for element in elements]
        case ast.Tuple(elts=elements):
            return tuple(_expression(element) for element in elements)
        case ast.Attribute(value=ast.Name(id="nn"), attr=name):
            activation = getattr(torch.nn.modules.activation, name, None)
            if isinstance(activation, type) and issubclass(activation, torch.nn.Module):
                return activation
            raise ValueError(f"nn.{name} is not an activation of torch.nn")
        case _:
            try:
                return ast.literal_eval(node)
            except ValueError:
                raise ValueError(
                    f"{ast.unparse(node)!r} is not allowed; use dict(...), lists, tuples, "
                    "numbers, text, True, False, None and nn.<Activation>"
                ) from None


def _normalize(value: Any) -> dict[str, Any] | None:
    """Read `normalize`: true, false, or the arguments of VecNormalize."""
    if isinstance(value, dict):
        return dict(value)
    if isinstance(value, bool):
        return {} if value else None
    raise ValueError(f'normalize is {value!r}; it must be true, false, or "dict(...)"')


def _noise(kind: str | None, std: float) -> tuple[str, float] | None:
    if kind is None:
        return None
    if kind not in NOISES:
        raise ValueError(f"noise_type is {kind!r}; choose from {', '.join(NOISES)}")
    return kind, float(std)
