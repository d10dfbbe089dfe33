"""What the environments' docstrings say is what the environments do."""

import inspect
import re

import gymnasium as gym
import pytest
from gymnasium.envs.registration import load_env_creator

from tests.envs.environments import IDS, task_class

SECTIONS = [
    "Description", "Action Space", "Observation Space", "Rewards", "Starting State",
    "Episode End", "Arguments", "Physics", "Baselines", "Version History",
]  # fmt: skip


def sections(env_id):
    """Text of each section, by its heading `## ...`."""
    text = "\n" + inspect.getdoc(load_env_creator(gym.spec(env_id).entry_point))
    parts = [part.partition("\n") for part in text.split("\n## ")[1:]]
    return {heading.strip(): body for heading, _, body in parts}


def table(text):
    """Rows of a Markdown table, by column."""
    lines = [line.strip() for line in text.splitlines() if line.strip().startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len(cells) > 2, f"no table in {text!r}"
    assert set("".join(cells[1])) <= set("-:"), "the second line must be a ruler"
    return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


@pytest.mark.parametrize("env_id", IDS)
def test_sections(env_id):
    found = sections(env_id)
    assert list(found) == SECTIONS
    assert all(text.strip() for text in found.values())
    # Step, measured error and scores are figures.
    assert all(re.search(r"\d", found[heading]) for heading in ("Physics", "Baselines"))


@pytest.mark.parametrize("env_id", IDS)
def test_observation_table(env_id):
    rows, truth = table(sections(env_id)["Observation Space"]), task_class(env_id).observation_table
    assert list(rows[0]) == ["Num", "Observation", "Min", "Max", "Unit"]
    assert [row["Num"] for row in rows] == [str(index) for index in range(len(truth))]
    for row, (name, low, high, unit) in zip(rows, truth, strict=True):
        assert row["Observation"] == name
        assert (float(row["Min"]), float(row["Max"])) == (low, high)
        assert row["Unit"] == (unit or "-")


@pytest.mark.parametrize("env_id", IDS)
def test_action_table(env_id):
    rows, names = table(sections(env_id)["Action Space"]), task_class(env_id).action_table
    assert list(rows[0]) == ["Num", "Action", "Min", "Max", "Unit"]
    assert [row["Num"] for row in rows] == [str(index) for index in range(len(names))]
    for row, name in zip(rows, names, strict=True):
        assert row["Action"] == name
        # What the bounds stand for may follow them: "1 (3 m/s)".
        assert [float(row[end].split()[0]) for end in ("Min", "Max")] == [-1.0, 1.0]
        assert row["Unit"]


@pytest.mark.parametrize("env_id", IDS)
def test_spaces_in_words(env_id):
    found, task = sections(env_id), task_class(env_id)
    for name, size in (("Action", len(task.action_table)),
                       ("Observation", len(task.observation_table))):  # fmt: skip
        assert "Box" in found[f"{name} Space"]
        assert f"({size},)" in found[f"{name} Space"]


@pytest.mark.parametrize("env_id", IDS)
def test_every_reward_term_is_explained(env_id):
    text = sections(env_id)["Rewards"]
    assert not [term for term in task_class(env_id).terms if f"reward_{term}" not in text]


@pytest.mark.parametrize("env_id", IDS)
def test_every_argument_and_choice_is_named(env_id):
    text, task = sections(env_id)["Arguments"], task_class(env_id)
    names = ["difficulty", "method", "physics_rate", "control_rate", "render_mode"]
    assert not [name for name in names if f"`{name}`" not in text]
    assert not [method for method in task.methods if f'"{method}"' not in text]
    rates = task.default_physics_rate, task.default_control_rate
    assert not [rate for rate in rates if f"{rate:g}" not in text]


@pytest.mark.parametrize("env_id", IDS)
def test_episode_length_and_version(env_id):
    found, spec = sections(env_id), gym.spec(env_id)
    assert str(spec.max_episode_steps) in found["Episode End"]
    assert "is_success" in found["Episode End"]
    assert f"v{spec.version}" in found["Version History"]
