"""Position error and cost of an environment's physics rates and methods.

    python -m benchmarks.environment_error steelyard/Bridge-v0

Every method and rate gets the same seeds and the same actions. The reference is the environment's
default method at a much higher rate; give a rate of half of it to see how far that can be trusted.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.record import interleave

SEED = 2_000_000
HOLD = 0.5


def make(env_id: str, rows: int, **kwargs: Any) -> Any:
    """A native vector environment of ``rows`` worlds that never resets by itself."""
    return gym.make_vec(
        env_id,
        num_envs=rows,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        **kwargs,
    ).unwrapped


def action_sequence(env: Any, steps: int, amplitude: float) -> np.ndarray:
    """Random actions within +-``amplitude``, changed every HOLD seconds; (steps, rows, actions)."""
    rng = np.random.default_rng(SEED)
    held = max(round(HOLD * env.task.control_rate), 1)
    shape = (-(-steps // held), *env.action_space.shape)
    return np.repeat(rng.uniform(-amplitude, amplitude, shape), held, axis=0)[:steps].astype(
        np.float32
    )


def positions(env: Any, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Particle positions after every control step, and which rows were still running then.

    Returns:
        Positions [m], shape (steps, rows, particles, 3), and running, shape (steps, rows) bool.
    """
    env.reset(seed=SEED)
    running = np.ones(env.num_envs, dtype=bool)
    path, ran = [], []
    for action in actions:
        _, _, terminated, _, _ = env.step(action)
        running &= ~terminated
        path.append(env.task.world.particles.position.copy())
        ran.append(running.copy())
    return np.stack(path), np.stack(ran)


def compare(
    env_id: str,
    *,
    rates: Sequence[float],
    methods: Sequence[str],
    reference: float,
    seconds: float,
    rows: int,
    difficulty: int,
    amplitude: float,
    repeats: int = 5,
) -> list[tuple[str, float, np.ndarray, float]]:
    """Errors of methods and rates.

    A row counts until its episode ends, in the reference or in the run that is compared.

    Returns:
        For every method and rate: its name, the rate, the largest distance [m] of a particle from
        where the reference has it in each row, and the CPU time of a control step of one row [s].
    """
    truth = make(env_id, rows, difficulty=difficulty, physics_rate=reference)
    actions = action_sequence(truth, round(seconds * truth.task.control_rate), amplitude)
    exact, ran = positions(truth, actions)
    found = []
    runs: dict[str, Callable[[], object]] = {}
    for method in methods:
        for rate in rates:
            env = make(env_id, rows, difficulty=difficulty, method=method, physics_rate=rate)
            path, also = positions(env, actions)
            apart = np.linalg.norm(path - exact, axis=-1).max(axis=-1)
            found.append((method, rate, np.where(ran & also, apart, 0.0).max(axis=0)))
            runs[f"{method} {rate:g}"] = partial(positions, env, actions)
    times = interleave(runs, repeats=repeats)
    share = len(actions) * rows
    return [(*entry, time / share) for entry, time in zip(found, times.values(), strict=True)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.environment_error",
        description="Position error and cost of an environment's physics rates and methods.",
    )
    parser.add_argument("env", help="environment id, such as steelyard/Bridge-v0")
    parser.add_argument("--rates", type=float, nargs="+", default=[50, 100, 200, 400])
    parser.add_argument("--methods", nargs="+", help="default: all of the environment")
    parser.add_argument("--reference", type=float, default=3200, help="rate (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=2.0, help="default: %(default)s")
    parser.add_argument("--rows", type=int, default=64, help="default: %(default)s")
    parser.add_argument("--difficulty", type=int, default=2, help="default: %(default)s")
    parser.add_argument("--amplitude", type=float, default=1.0, help="of the actions, default: 1")
    options = parser.parse_args(arguments)
    importlib.import_module("steelyard_envs")
    known = make(options.env, 1).task.methods
    methods = options.methods or known
    results = compare(
        options.env,
        rates=options.rates,
        methods=methods,
        reference=options.reference,
        seconds=options.seconds,
        rows=options.rows,
        difficulty=options.difficulty,
        amplitude=options.amplitude,
    )
    print(
        f"{options.env}, difficulty {options.difficulty}, {options.rows} rows, "
        f"{options.seconds:g} s, random actions within {options.amplitude:g}:\n"
        f"largest distance of a particle [m] from {known[0]} at {options.reference:g} Hz"
    )
    print(f"{'method':<18}{'rate':>6}{'median':>11}{'95 %':>11}{'worst':>11}{'us a step':>11}")
    for method, rate, error, cost in results:
        shown = "".join(f"{np.quantile(error, part):>11.2e}" for part in (0.5, 0.95, 1.0))
        print(f"{method:<18}{rate:>6g}{shown}{1e6 * cost:>11.2f}")


if __name__ == "__main__":
    main()
