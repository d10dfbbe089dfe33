"""Folders of training runs: where they lie and what is in them.

runs/steelyard-Platform-v0/ppo-seed0/
    model.zip          the policy
    vecnormalize.pkl   the statistics of its normaliser, if it has one
    settings.yml       the settings it was trained with
    curve.csv, .png    the learning curve
    video.mp4          one episode of the trained policy
    tensorboard/       logs, if TensorBoard is installed
    results.json       scores, and the command, commit, machine and versions behind them
"""

import itertools
import json
from pathlib import Path
from typing import Any


def env_folder(env_id: str) -> Path:
    """Return the folder for everything about `env_id`, relative to the working directory."""
    return Path("runs") / file_name(env_id)


def file_name(env_id: str) -> str:
    """Return `env_id` in a form that can be part of a file's name."""
    return env_id.rpartition(":")[2].replace("/", "-")


def new_folder(folder: Path) -> Path:
    """Make `folder`, or where it exists the first free of `folder-2`, `folder-3`, ..."""
    names = itertools.chain([folder.name], (f"{folder.name}-{n}" for n in itertools.count(2)))
    for name in names:
        candidate = folder.with_name(name)
        try:
            candidate.mkdir(parents=True)
        except FileExistsError:
            continue
        return candidate
    raise AssertionError("the names do not end")


def read_run(run: Path) -> dict[str, Any]:
    """Read the record of the training run in the folder `run`.

    Raises:
        ValueError: The folder holds no finished run.
    """
    path = run / "results.json"
    if not path.exists():
        raise ValueError(
            f"{run} holds no finished training run (no results.json): give the folder that "
            "steelyard_agents.train wrote, 'random' or 'controller'"
        )
    return json.loads(path.read_text())
