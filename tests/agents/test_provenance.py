"""Records say where results come from."""

import json
import subprocess

import pytest

from steelyard_agents import provenance, runs


def git(folder, *arguments):
    identity = ["-c", "user.name=Test", "-c", "user.email=test@example.org"]
    command = ["git", *identity, *arguments]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A repository that holds the package's own source file."""
    package = tmp_path / "agents/steelyard_agents"
    package.mkdir(parents=True)
    source = package / "provenance.py"
    source.write_text("first\n")
    git(tmp_path, "init")
    monkeypatch.setattr(provenance, "__file__", str(source))
    return tmp_path, source


def test_commit(checkout):
    root, source = checkout
    assert provenance.commit() is None  # the file is not of this repository
    git(root, "add", ".")
    git(root, "commit", "-m", "first")
    commit = provenance.commit()
    assert len(commit) == 40
    (root / "agents/results").mkdir()
    (root / "agents/results/x.json").write_text("{}")
    assert provenance.commit() == commit
    source.write_text("second\n")
    assert provenance.commit() == f"{commit}-dirty"


def test_commit_is_none_outside_of_git(tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    assert provenance.commit() is None


def test_provenance_can_be_written_as_json(tmp_path):
    record = provenance.provenance("steelyard_agents.train", ["Env-v0", "--output", "two words"])
    assert record["command"] == "python -m steelyard_agents.train Env-v0 --output 'two words'"
    provenance.write_json(tmp_path / "deep/record.json", record)
    assert json.loads((tmp_path / "deep/record.json").read_text()) == record
    with pytest.raises(ValueError, match="not JSON compliant"):
        provenance.write_json(tmp_path / "bad.json", {"return": float("nan")})


def test_folders():
    assert str(runs.env_folder("module:steelyard/Platform-v0")) == "runs/steelyard-Platform-v0"
