"""Train several seeds: `python -m steelyard_agents.sweep ENV --seeds 5`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table

from steelyard_agents import hyperparameters
from steelyard_agents.arguments import add_env_kwargs, parse_env_kwargs
from steelyard_agents.evaluate import SEED, baselines, evaluate
from steelyard_agents.policies import TrainedPolicy
from steelyard_agents.provenance import provenance, write_json
from steelyard_agents.runs import env_folder, file_name, read_run
from steelyard_agents.scores import bootstrap_interval, interquartile_mean
from steelyard_agents.train import configured, train

CONFIDENCE = 0.95
RESAMPLES = 10_000


def aggregate(runs: Sequence[dict[str, Any]], references: dict[str, Any]) -> dict[str, Any]:
    """Return what the seeds scored together: the seed is the unit, its mean return the score.

    The ratio to the controller is None where there is no controller, or where its return is not
    positive and a ratio would mean nothing.
    """
    returns = np.array([run["score"]["return_mean"] for run in runs])
    low, high = bootstrap_interval(returns[:, None], confidence=CONFIDENCE, resamples=RESAMPLES)
    iqm = interquartile_mean(returns)
    controller = references.get("controller", {}).get("return_mean", 0.0)
    ratios = [float(value / controller) for value in (iqm, low, high)] if controller > 0 else None
    return {
        "seeds": len(runs),
        "return_iqm": iqm,
        "return_interval": [low, high],
        "return_min": float(returns.min()),
        "return_max": float(returns.max()),
        "ratio_to_controller": ratios[0] if ratios else None,
        "ratio_interval": ratios[1:] if ratios else None,
        "interval": f"{CONFIDENCE:.0%} stratified bootstrap over seeds, {RESAMPLES} resamples",
    }


def rescored(
    folder: Path, env_id: str, settings: hyperparameters.Hyperparameters
) -> dict[str, Any]:
    """Return the record of a run that has been trained, its score measured again."""
    run = read_run(folder)
    policy = TrainedPolicy.load(folder, algo=run["algo"], deterministic=settings.deterministic)
    run["scores"]["trained"] = evaluate(policy, env_id, env_kwargs=settings.env_kwargs).summary()
    return run


def seed_table(title: str, record: dict[str, Any]) -> Table:
    """Return a table with one row per seed, and the aggregate and the baselines below."""
    table = Table(title=title, title_style="bold", title_justify="left")
    table.add_column("seed")
    for heading in ("mean return", "success rate", "wall time"):
        table.add_column(heading, justify="right")
    for run in record["runs"]:
        _add_score(table, str(run["seed"]), run["score"], f"{run['wall_time_s']:.0f} s")
    table.add_section()
    both = record["aggregate"]
    low, high = both["return_interval"]
    table.add_row("IQM", f"{both['return_iqm']:.1f} ({low:.1f} to {high:.1f})", "", "")
    for name, score in record["baselines"].items():
        _add_score(table, name, score, "")
    return table


def _add_score(table: Table, name: str, score: dict[str, Any], wall_time: str) -> None:
    success = score["success_rate"]
    shown = "-" if success is None else f"{success:.0%}"
    table.add_row(name, f"{score['return_mean']:.1f}", shown, wall_time)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="python -m steelyard_agents.sweep", description=__doc__)
    parser.add_argument("env", help="environment id, as in steelyard/Platform-v0")
    parser.add_argument("--algo", default="ppo", choices=sorted(hyperparameters.ALGORITHMS))
    parser.add_argument("--seeds", type=int, default=5, help="how many (default: %(default)s)")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--timesteps", type=int, help="default: as the settings say")
    parser.add_argument("--n-envs", type=int, help="default: as the settings say")
    parser.add_argument("--settings", type=Path, help="YAML file as in rl-baselines3-zoo")
    add_env_kwargs(parser)
    parser.add_argument("--output", type=Path, help="default: agents/results/ENV-ALGO.json")
    parser.add_argument(
        "--rescore",
        action="store_true",
        help="train nothing: score the models that an earlier sweep left in runs",
    )
    parser.add_argument("--no-progress", action="store_true", help="show no progress bar")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error(f"--seeds is {options.seeds}, but must be at least 1")
    console = Console()
    origin = provenance("steelyard_agents.sweep", arguments)
    try:
        settings = configured(
            options.algo,
            options.env,
            file=options.settings,
            timesteps=options.timesteps,
            n_envs=options.n_envs,
            env_kwargs=parse_env_kwargs(options.env_kwargs),
        )
        references = baselines(options.env, env_kwargs=settings.env_kwargs)
        runs = []
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            folder = env_folder(options.env) / f"{options.algo}-seed{seed}"
            if options.rescore:
                run = rescored(folder, options.env, settings)
            else:
                _, run = train(
                    options.env,
                    settings,
                    algo=options.algo,
                    seed=seed,
                    folder=folder,
                    origin=origin,
                    references=references,
                    progress=not options.no_progress,
                    console=console,
                )
            kept = ("seed", "timesteps", "wall_time_s", "steps_per_second", "commit")
            runs.append({key: run[key] for key in kept} | {"score": run["scores"]["trained"]})
    except (ValueError, gym.error.Error) as error:
        parser.error(str(error))
    record = {
        "env": options.env,
        "env_kwargs": settings.env_kwargs,
        "algo": options.algo,
        "settings": settings.source,
        "evaluation_seed": SEED,
        "aggregate": aggregate(runs, references),
        "baselines": references,
        "runs": runs,
        **origin,
    }
    name = f"{file_name(options.env)}-{options.algo}.json"
    output = options.output or Path("agents/results") / name
    write_json(output, record)
    console.print(seed_table(f"{options.algo.upper()} on {options.env}", record))
    console.print(f"Written to {output}", soft_wrap=True)


if __name__ == "__main__":
    main()
