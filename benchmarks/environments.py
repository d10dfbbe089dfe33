"""Steps per second of the environments against Gymnasium's own CartPole, and the time to a start.

Actions are random and drawn beforehand; environments that end are reset, as in training. The
batched environments reset themselves; a single one is reset by its caller.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium

from benchmarks import record
from benchmarks.figures import Announce, Figure

STAGES = ("imports", "first step, compiling", "first step, cached", "batched", "single")
PLATFORM = "steelyard_envs:steelyard/Platform-v0"
STARTED = (
    PLATFORM,
    "steelyard_envs:steelyard/Ballistic-v0",
    "steelyard_envs:steelyard/Bridge-v0",
)
CARTPOLE = "CartPole-v1"
NUM_ENVS = 1024
UNWANTED = ("numba", "torch", "pygame")
#: Batches of random actions, drawn before the clock runs.
ACTIONS = 64

# Timed inside a fresh process, from before Gymnasium is imported.
FIRST_STEP = """
import json, sys, time
start = time.perf_counter()
import gymnasium
imported = time.perf_counter()
env = gymnasium.make(sys.argv[1])
made = time.perf_counter()
env.reset(seed=0)
reset = time.perf_counter()
env.step(env.action_space.sample())
end = time.perf_counter()
print(json.dumps({
    "import gymnasium": imported - start, "make": made - imported, "reset": reset - made,
    "first step": end - reset, "total": end - start,
}))
"""


def run(*, quick: bool, output: Path, announce: Announce) -> list[Figure]:
    """Measure and write environments.json to `output`.

    Args:
        quick: Few environments and steps, and no compiling from nothing.
        output: Folder of the results.
        announce: Called with each of `STAGES` as it begins.
    """
    announce("imports")
    heavy = heavy_imports("steelyard_envs")
    with tempfile.TemporaryDirectory() as folder:
        # A quick run takes the machine's own cache: an empty one costs half a minute for each id.
        announce("first step, compiling")
        empty = {name: {} if quick else first_step(name, _folder(folder, name)) for name in STARTED}
        announce("first step, cached")
        cached = {
            name: first_step(name, None if quick else _folder(folder, name)) for name in STARTED
        }
    announce("batched")
    batched = vector_rates(PLATFORM, CARTPOLE, num_envs=16 if quick else NUM_ENVS, quick=quick)
    announce("single")
    single = single_rates(PLATFORM, CARTPOLE, quick=quick)
    figures = [
        Figure(
            name=f"import steelyard_envs: imported of {', '.join(UNWANTED)}",
            measured=len(heavy),
            unit="modules",
            at_most=0,
        ),
        Figure(
            name=f"batched Platform over CartPole, {NUM_ENVS} envs: steps per second",
            measured=batched[PLATFORM] / batched[CARTPOLE],
            at_least=0.25,
        ),
        Figure(
            name="single Platform over CartPole: steps per second",
            measured=single[PLATFORM] / single[CARTPOLE],
            at_least=0.7,
        ),
        *_start_figures("compiled code cached", cached, limit=3.0),
    ]
    if not quick:
        figures += _start_figures("nothing cached", empty, limit=30.0)
    payload = {
        "quick": quick,
        "figures": [figure.record() for figure in figures],
        "heavy_imports": heavy,
        "first_step_seconds": {"cached": cached, "not cached": empty},
        "batched_steps_per_second": batched,
        "single_steps_per_second": single,
    }
    record.write("environments", payload, directory=output)
    return figures


def heavy_imports(package: str) -> list[str]:
    """Those of `UNWANTED` that importing a package brings in, in a fresh process."""
    program = (
        f"import sys, {package}; print(*[m for m in {UNWANTED!r} if m in sys.modules], sep='\\n')"
    )
    return _python(program).split()


def first_step(env_id: str, cache: Path | None) -> dict[str, float]:
    """Seconds of wall time to import, make, reset and step once in a fresh process.

    Args:
        env_id: What to make.
        cache: Folder of the compiled code; None for where it usually lies.
    """
    environment = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    seconds: dict[str, float] = json.loads(_python(FIRST_STEP, env_id, environment=environment))
    return seconds


def vector_rates(*env_ids: str, num_envs: int, quick: bool) -> dict[str, float]:
    """Environment steps per second of CPU time of vector environments, in turns."""
    steps = 10 if quick else 200
    timed = {}
    for env_id in env_ids:
        envs = gymnasium.make_vec(
            env_id, num_envs=num_envs, vectorization_mode="vector_entry_point"
        )
        timed[env_id] = _vector_stepper(envs, steps)
    return _rates(timed, steps * num_envs, quick=quick)


def single_rates(*env_ids: str, quick: bool) -> dict[str, float]:
    """Steps per second of CPU time of single environments with their wrappers, in turns."""
    steps = 100 if quick else 5000
    timed = {env_id: _single_stepper(gymnasium.make(env_id), steps) for env_id in env_ids}
    return _rates(timed, steps, quick=quick)


def _vector_stepper(envs: gymnasium.vector.VectorEnv, steps: int) -> Callable[[], None]:
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(ACTIONS)]

    def step() -> None:
        for k in range(steps):
            envs.step(actions[k % ACTIONS])

    return step


def _single_stepper(env: gymnasium.Env, steps: int) -> Callable[[], None]:
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(ACTIONS)]

    def step() -> None:
        for k in range(steps):
            _, _, terminated, truncated, _ = env.step(actions[k % ACTIONS])
            if terminated or truncated:
                env.reset()

    return step


def _rates(timed: Mapping[str, Callable[[], None]], steps: int, *, quick: bool) -> dict[str, float]:
    times = record.interleave(timed, repeats=1 if quick else 9)
    return {name: steps / seconds for name, seconds in times.items()}


def _start_figures(
    state: str, seconds: Mapping[str, Mapping[str, float]], *, limit: float
) -> list[Figure]:
    return [
        Figure(
            name=f"{name.rpartition('/')[2]}: make, reset and first step, {state}",
            measured=parts["total"],
            unit="s",
            at_most=limit,
        )
        for name, parts in seconds.items()
    ]


def _folder(parent: str, env_id: str) -> Path:
    """A folder of its own for each id, so that none finds what another has compiled."""
    return Path(parent) / env_id.rpartition("/")[2]


def _python(program: str, *arguments: str, environment: Mapping[str, Any] | None = None) -> str:
    """What a program prints in a fresh interpreter that finds the same packages."""
    paths = os.pathsep.join([str(record.ROOT), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "PYTHONPATH": paths, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(f"A fresh process failed:\n{done.stderr}")
    return done.stdout
