"""Score a policy: `python -m steelyard_agents.evaluate RUN_FOLDER|random|controller --env ENV`."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console

from steelyard_agents.arguments import add_env_kwargs, parse_env_kwargs
from steelyard_agents.make import find_spec, make_vec_env
from steelyard_agents.policies import (
    Policy,
    RandomPolicy,
    TrainedPolicy,
    load_controller,
)
from steelyard_agents.provenance import provenance, write_json
from steelyard_agents.runs import env_folder, read_run
from steelyard_agents.scores import Evaluation
from steelyard_agents.tables import score_table

EPISODES = 100
# Far from the seeds of training, so that nothing is scored on starts it was trained on.
SEED = 1_000_000


def evaluate(
    policy: Policy,
    env_id: str,
    *,
    episodes: int = EPISODES,
    seed: int = SEED,
    env_kwargs: Mapping[str, Any] | None = None,
) -> Evaluation:
    """Run exactly `episodes` episodes, on fixed seeds, without favour to short ones.

    Each episode has a row of its own, episode i the seed `seed + i`, and only the first episode of
    each row counts. Taking the first episodes to finish out of fewer rows would count
    short episodes too often.

    Args:
        policy: Any policy; it sees the environment's own observations.
        env_id: As for `make.find_spec`. The environment must end its episodes.
        episodes: Number of episodes, at least 1.
        seed: Seed of the first episode.
        env_kwargs: Arguments of the environment.
    """
    env = make_vec_env(env_id, episodes, seed=seed, env_kwargs=env_kwargs)
    final: list[dict[str, Any]] = [{} for _ in range(episodes)]
    running = np.ones(episodes, dtype=bool)
    try:
        obs = env.reset()
        policy.reset(episodes)
        while running.any():
            actions = np.asarray(policy(obs), dtype=env.action_space.dtype)
            obs, _, dones, infos = env.step(actions)
            for row in np.flatnonzero(dones & running):
                final[row] = infos[row]
            running &= ~dones
    finally:
        env.close()
    successes = None
    if all("is_success" in info for info in final):
        successes = np.array([bool(info["is_success"]) for info in final])
    return Evaluation(
        returns=np.array([info["episode"]["r"] for info in final]),
        lengths=np.array([info["episode"]["l"] for info in final]),
        successes=successes,
        physics_errors=sum(bool(info.get("physics_error", False)) for info in final),
    )


def random_policy(env_id: str, *, env_kwargs: Mapping[str, Any] | None = None) -> RandomPolicy:
    """Return the random policy for `env_id`."""
    env = make_vec_env(env_id, 1, env_kwargs=env_kwargs)
    env.close()
    return RandomPolicy(env.action_space, seed=SEED)


def baselines(
    env_id: str,
    *,
    episodes: int = EPISODES,
    seed: int = SEED,
    env_kwargs: Mapping[str, Any] | None = None,
) -> dict[str, dict[str, Any]]:
    """Score what training is compared with: `random`, and `controller` if there is one."""
    policies: dict[str, Policy] = {"random": random_policy(env_id, env_kwargs=env_kwargs)}
    controller = load_controller(find_spec(env_id).id)
    if controller is not None:
        policies["controller"] = controller
    return {
        name: evaluate(
            policy, env_id, episodes=episodes, seed=seed, env_kwargs=env_kwargs
        ).summary()
        for name, policy in policies.items()
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    arguments = sys.argv[1:] if arguments is None else arguments
    module = "steelyard_agents.evaluate"
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=__doc__)
    parser.add_argument("policy", help="folder of a training run, 'random' or 'controller'")
    parser.add_argument("--env", help="environment id (default: the one trained on)")
    parser.add_argument("--episodes", type=int, default=EPISODES, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=SEED, help="first seed (default: %(default)s)")
    add_env_kwargs(parser)
    parser.add_argument("--output", type=Path, help="JSON file to write")
    options = parser.parse_args(arguments)
    try:
        record = _evaluate_named(options) | provenance(module, arguments)
    except (ValueError, gym.error.Error) as error:
        parser.error(str(error))
    output = options.output or _default_output(options.policy, record["env"])
    write_json(output, record)
    console = Console()
    title = f"{record['env']}, seeds {options.seed} to {options.seed + options.episodes - 1}"
    console.print(score_table(title, {options.policy: record["score"]}))
    console.print(f"Written to {output}", soft_wrap=True)


def _evaluate_named(options: argparse.Namespace) -> dict[str, Any]:
    """Evaluate the policy that the command line names and return the record."""
    name, env_id = options.policy, options.env
    env_kwargs = parse_env_kwargs(options.env_kwargs)
    policy: Policy | None
    if name in ("random", "controller"):
        if env_id is None:
            raise ValueError(f"say with --env on which environment to evaluate {name!r}")
        if name == "random":
            policy = random_policy(env_id, env_kwargs=env_kwargs)
        else:
            policy = load_controller(find_spec(env_id).id)
        if policy is None:
            raise ValueError(f"there is no hand-written controller for {env_id}")
    else:
        run = read_run(Path(name))
        env_id = env_id or run["env"]
        env_kwargs = env_kwargs or run["env_kwargs"]
        policy = TrainedPolicy.load(Path(name), algo=run["algo"])
    scored = evaluate(
        policy, env_id, episodes=options.episodes, seed=options.seed, env_kwargs=env_kwargs
    )
    return {
        "env": env_id,
        "env_kwargs": env_kwargs,
        "policy": name,
        "seed": options.seed,
        "score": scored.summary(),
    }


def _default_output(policy: str, env_id: str) -> Path:
    """Return where the record goes: into the run's folder, or beside the runs."""
    if policy in ("random", "controller"):
        return env_folder(env_id) / f"{policy}.json"
    return Path(policy) / "evaluation.json"


if __name__ == "__main__":
    main()
