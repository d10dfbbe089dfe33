"""Train an agent: `python -m steelyard_agents.train ENV --algo {ppo,sac,...}`."""

import argparse
import importlib.util
import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
import yaml
from gymnasium.spaces.utils import flatdim
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from steelyard_agents import curve, hyperparameters
from steelyard_agents.arguments import add_env_kwargs, parse_env_kwargs
from steelyard_agents.evaluate import EPISODES, SEED, baselines, evaluate
from steelyard_agents.make import make_vec_env
from steelyard_agents.policies import TrainedPolicy
from steelyard_agents.progress import ProgressCallback, progress_bar
from steelyard_agents.provenance import provenance, write_json
from steelyard_agents.runs import env_folder, new_folder
from steelyard_agents.tables import LABELS, score_table
from steelyard_agents.video import record_video


def train(
    env_id: str,
    settings: hyperparameters.Hyperparameters,
    *,
    algo: str,
    seed: int,
    folder: Path,
    origin: Mapping[str, Any],
    references: Mapping[str, Mapping[str, Any]] | None = None,
    time_limit: float | None = None,
    progress: bool = True,
    console: Console | None = None,
) -> tuple[Path, dict[str, Any]]:
    """Train one agent, score it, and leave everything about it in one new folder.

    Args:
        env_id: As for `make.find_spec`.
        settings: How to train; `settings.timesteps` must be set.
        algo: A key of `hyperparameters.ALGORITHMS`.
        seed: Seed of the model and of the environment's first row.
        folder: Where to; `folder-2`, `folder-3`, ... if it exists. `runs` says what it holds then.
        origin: Provenance, for the record.
        references: Scores to compare with, by name; None to measure `evaluate.baselines`.
        time_limit: Seconds after which training stops, finished or not; None for no limit.
        progress: Show a progress bar.
        console: Where to print.

    Returns:
        The folder, and the record that is also in its `results.json`.

    Raises:
        ValueError: `settings.timesteps` is not set.
    """
    if settings.timesteps is None:
        raise ValueError(
            f"there are no settings of {algo} for {env_id}, so say with --timesteps how long to "
            "train with the algorithm's own defaults, or give --settings FILE"
        )
    console = console or Console()
    if "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(min(2, os.cpu_count() or 1))  # more only wait, on networks this small

    # What there is to beat. The first run of an environment also compiles its kernels here.
    if references is None:
        with console.status("Scoring the baselines (a first run compiles the physics)"):
            references = baselines(env_id, env_kwargs=settings.env_kwargs)

    # The environment and the model.
    folder = new_folder(folder)
    env: VecEnv = make_vec_env(env_id, settings.n_envs, seed=seed, env_kwargs=settings.env_kwargs)
    if settings.normalize is not None:
        env = VecNormalize(env, **settings.normalize)
    arguments = dict(settings.algorithm)
    if settings.noise is not None:
        arguments["action_noise"] = settings.action_noise(flatdim(env.action_space))
    model = hyperparameters.ALGORITHMS[algo](env=env, seed=seed, **arguments)
    if importlib.util.find_spec("tensorboard"):
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))

    # Learn.
    console.print(
        f"{algo.upper()} learns [bold]{env_id}[/] with seed {seed}: {settings.timesteps:,} steps, "
        f"{settings.n_envs} environments side by side",
        highlight=False,
    )
    recorder = curve.LearningCurve()
    limit = WallClockLimit(time_limit)
    started = time.perf_counter()
    with progress_bar(console, visible=progress) as bar:
        shown = ProgressCallback(bar, algo.upper())
        model.learn(settings.timesteps, callback=[recorder, limit, shown])
    training_time = time.perf_counter() - started
    save(folder, model, env, env_id=env_id, settings=settings)
    env.close()

    # Score what was saved, not what is in memory: that is what others will load.
    policy = TrainedPolicy.load(folder, algo=algo)
    with console.status(f"Scoring {EPISODES} episodes"):
        trained = evaluate(policy, env_id, env_kwargs=settings.env_kwargs).summary()
    scores = {**references, "trained": trained}

    # Show.
    files = {"model": "model.zip", "settings": "settings.yml"}
    if recorder.points:
        files |= {"curve": "curve.png", "curve_data": "curve.csv"}
        curve.write_csv(folder / "curve.csv", recorder.points)
        title = f"{algo.upper()} on {env_id}, seed {seed}"
        levels = {LABELS[name]: score for name, score in references.items()}
        curve.draw(folder / "curve.png", recorder.points, title=title, references=levels)
    try:
        with console.status("Filming an episode"):
            record_video(
                folder / "video.mp4", policy, env_id, seed=SEED, env_kwargs=settings.env_kwargs
            )
        files["video"] = "video.mp4"
    except (ImportError, gym.error.DependencyNotInstalled) as error:
        console.print(f"No video: {error}", style="yellow")

    record = {
        "env": env_id,
        "env_kwargs": settings.env_kwargs,
        "algo": algo,
        "seed": seed,
        "timesteps": model.num_timesteps,
        "stopped_by_time_limit": limit.reached,
        "settings": settings.source,
        "wall_time_s": round(training_time, 2),
        "steps_per_second": round(model.num_timesteps / training_time),
        "scores": scores,
        "evaluation_seed": SEED,
        "files": files,
        **origin,
    }
    write_json(folder / "results.json", record)
    return folder, record


def save(
    folder: Path,
    model: BaseAlgorithm,
    env: VecEnv,
    *,
    env_id: str,
    settings: hyperparameters.Hyperparameters,
) -> None:
    """Save the model, the statistics of its normaliser, and the settings behind them."""
    model.save(folder / "model.zip")
    if isinstance(env, VecNormalize):
        env.save(str(folder / "vecnormalize.pkl"))
    name = env_id.rpartition(":")[2]
    (folder / "settings.yml").write_text(yaml.safe_dump({name: settings.source}, sort_keys=False))


class WallClockLimit(BaseCallback):
    """Stop training after a number of seconds.

    Args:
        seconds: The limit; None for none.

    Attributes:
        reached: Whether the limit has stopped training.
    """

    def __init__(self, seconds: float | None) -> None:
        super().__init__()
        self._seconds = seconds
        self.reached = False

    def _on_training_start(self) -> None:
        self._start = time.perf_counter()

    def _on_step(self) -> bool:
        if self._seconds is not None:
            self.reached = time.perf_counter() - self._start > self._seconds
        return not self.reached


def configured(
    algo: str,
    env_id: str,
    *,
    file: Path | None = None,
    timesteps: int | None = None,
    n_envs: int | None = None,
    env_kwargs: Mapping[str, Any] | None = None,
) -> hyperparameters.Hyperparameters:
    """Read the settings, and put what the command line says above them."""
    settings = hyperparameters.read(algo, env_id, file=file)
    source = dict(settings.source)
    if timesteps is not None:
        source["n_timesteps"] = timesteps
    if n_envs is not None:
        source["n_envs"] = n_envs
    if env_kwargs:
        source["env_kwargs"] = settings.env_kwargs | dict(env_kwargs)
    return hyperparameters.parse(algo, source)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="python -m steelyard_agents.train", description=__doc__)
    parser.add_argument("env", help="environment id, as in steelyard/Platform-v0")
    parser.add_argument("--algo", default="ppo", choices=sorted(hyperparameters.ALGORITHMS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timesteps", type=int, help="default: as the settings say")
    parser.add_argument("--n-envs", type=int, help="default: as the settings say")
    parser.add_argument("--settings", type=Path, help="YAML file as in rl-baselines3-zoo")
    add_env_kwargs(parser)
    parser.add_argument("--time-limit", type=float, metavar="SECONDS", help="stop training then")
    parser.add_argument("--output", type=Path, help="folder (default: runs/ENV/ALGO-seedSEED)")
    parser.add_argument("--no-progress", action="store_true", help="show no progress bar")
    options = parser.parse_args(arguments)
    console = Console()
    try:
        settings = configured(
            options.algo,
            options.env,
            file=options.settings,
            timesteps=options.timesteps,
            n_envs=options.n_envs,
            env_kwargs=parse_env_kwargs(options.env_kwargs),
        )
        default = env_folder(options.env) / f"{options.algo}-seed{options.seed}"
        folder, record = train(
            options.env,
            settings,
            algo=options.algo,
            seed=options.seed,
            folder=options.output or default,
            origin=provenance("steelyard_agents.train", arguments),
            time_limit=options.time_limit,
            progress=not options.no_progress,
            console=console,
        )
    except (ValueError, gym.error.Error) as error:
        parser.error(str(error))
    console.print(score_table(options.env, record["scores"]))
    files = ", ".join(record["files"].values())
    console.print(f"Everything is in {folder}: {files}", soft_wrap=True)


if __name__ == "__main__":
    main()
