"""Machine code on disk is used only for the sources it was made from."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import steelyard

PACKAGE = Path(steelyard.__file__).parent
SOURCES = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))


def load(path: Path) -> ModuleType:
    """A fresh copy of the module at ``path``, apart from the one in use."""
    spec = importlib.util.spec_from_file_location("copied_kernel", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sample(x: float) -> float:
    """A function outside the engine, so that only the engine's part of its stamp varies here."""
    return x


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """The package's sources at another place."""
    target = tmp_path / "steelyard"
    shutil.copytree(PACKAGE, target, ignore=shutil.ignore_patterns("__pycache__"))
    return target


def stamp(package: Path) -> object:
    """The stamp that a package gives to a function of another folder."""
    return load(package / "kernel.py").source_stamp(sample)


def test_the_same_sources_have_the_same_stamp(copied: Path) -> None:
    assert stamp(copied) == stamp(copied) == stamp(PACKAGE)


def test_every_edit_changes_the_stamp(copied: Path) -> None:
    assert len(SOURCES) > 40
    seen = {stamp(copied)}
    for source in SOURCES:
        with (copied / source).open("a") as file:
            file.write("# edited\n")
        seen.add(stamp(copied))
    assert len(seen) == len(SOURCES) + 1


def test_a_file_that_comes_goes_or_moves_changes_the_stamp(copied: Path) -> None:
    seen = [stamp(copied)]
    (copied / "forces" / "magnet.py").write_text("")
    seen.append(stamp(copied))
    (copied / "forces" / "magnet.py").rename(copied / "forces" / "magnetism.py")
    seen.append(stamp(copied))
    (copied / "forces" / "magnetism.py").unlink()
    (copied / "forces" / "drag.py").unlink()
    seen.append(stamp(copied))
    assert len(set(map(str, seen))) == 4


def test_a_kernel_outside_the_engine_is_stamped_with_its_own_folder_too(tmp_path: Path) -> None:
    def own() -> object:
        # A fresh copy, since a process reads a folder's sources once.
        return load(PACKAGE / "kernel.py").source_stamp(load(tmp_path / "task.py").reward)

    (tmp_path / "task.py").write_text("def reward(x):\n    return x\n")
    first = own()
    assert first == own()
    (tmp_path / "neighbour.py").write_text("")
    assert own() != first


PRINT = """
from outer import outer
print(outer(1.0))
print(f"cache_hits={dict(outer.stats.cache_hits)}, cache_misses={dict(outer.stats.cache_misses)}")
"""


def run(folder: Path) -> str:
    """What a fresh process prints that calls ``outer``, a user's kernel on those of ``small``."""
    environment = os.environ | {
        "PYTHONPATH": f"{folder}{os.pathsep}{folder / 'user'}",
        "NUMBA_CACHE_DIR": str(folder / "cache"),
    }
    done = subprocess.run(
        [sys.executable, "-c", PRINT],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_machine_code_of_an_edited_callee_does_not_run(tmp_path: Path) -> None:
    """Numba alone looks at the file of the caller, and would go on with the old callee."""
    package = tmp_path / "small"
    package.mkdir()
    shutil.copy(PACKAGE / "kernel.py", package)
    (package / "__init__.py").write_text("")
    inner = "from small.kernel import kernel\n\n@kernel\ndef inner(x):\n    return x + {}\n"
    (package / "inner.py").write_text(inner.format(1.0))
    user = tmp_path / "user"
    user.mkdir()
    (user / "outer.py").write_text(
        "from small.kernel import kernel\nfrom small.inner import inner\n\n"
        "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n"
    )
    first = run(tmp_path)
    assert first.startswith("20.0")
    assert "cache_hits={}" in first
    again = run(tmp_path)
    assert again.startswith("20.0")
    assert "cache_misses={}" in again
    (package / "inner.py").write_text(inner.format(2.0))
    assert run(tmp_path).startswith("30.0")
