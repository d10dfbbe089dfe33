"""Watch an agent learn to balance a platform: `python -m steelyard_agents.demo`."""

import argparse
import sys
from collections.abc import Sequence

from rich.console import Console

from steelyard_agents.provenance import provenance
from steelyard_agents.runs import env_folder
from steelyard_agents.tables import score_table
from steelyard_agents.train import configured, train

ENV_ID = "steelyard/Platform-v0"
TIME_LIMIT = 120.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Train PPO on the platform, compare it with the baselines, and say where to look."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="python -m steelyard_agents.demo", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--time-limit",
        type=float,
        default=TIME_LIMIT,
        metavar="SECONDS",
        help="stop training then, finished or not (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    console = Console()
    settings = configured("ppo", ENV_ID)
    console.print(
        "A rider walks on a platform that stands on two feet and is pushed about. "
        f"{settings.n_envs} platforms learn side by side to keep it level."
    )
    folder, record = train(
        ENV_ID,
        settings,
        algo="ppo",
        seed=options.seed,
        folder=env_folder(ENV_ID) / "demo",
        origin=provenance("steelyard_agents.demo", arguments),
        time_limit=options.time_limit,
        console=console,
    )
    if record["stopped_by_time_limit"]:
        console.print(
            f"Training stopped at the time limit, after {record['timesteps']:,} of "
            f"{settings.timesteps:,} steps: --time-limit gives it longer.",
            style="yellow",
        )
    title = f"{ENV_ID} after {record['wall_time_s']:.0f} s of training"
    console.print(score_table(title, record["scores"]))
    for label, file in (("Curve", "curve"), ("Video", "video"), ("Model", "model")):
        if file in record["files"]:
            console.print(f"{label}: {folder / record['files'][file]}", soft_wrap=True)


if __name__ == "__main__":
    main()
