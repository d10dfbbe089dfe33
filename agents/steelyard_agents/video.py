"""Film a policy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np

from steelyard_agents.make import make_env
from steelyard_agents.policies import Policy


def record_video(
    path: Path,
    policy: Policy,
    env_id: str,
    *,
    seed: int,
    env_kwargs: Mapping[str, Any] | None = None,
) -> int:
    """Film one episode as an MP4 at the environment's own speed; return the number of frames.

    Args:
        path: File to write.
        policy: Any policy.
        env_id: As for `make.find_spec`; the environment must render `rgb_array`.
        seed: Seed of the episode.
        env_kwargs: Arguments of the environment.
    """
    env = make_env(env_id, env_kwargs=env_kwargs, render_mode="rgb_array")
    fps = env.metadata.get("render_fps", 30)
    frames = 0
    try:
        obs, _ = env.reset(seed=seed)
        policy.reset(1)
        # The codec halves the colour planes, so each side must be even.
        writer: Any
        with imageio.get_writer(path, fps=fps, macro_block_size=2) as writer:
            done = False
            while not done:
                action = np.asarray(policy(_batch_of_one(obs)), dtype=env.action_space.dtype)[0]
                obs, _, terminated, truncated, _ = env.step(action)
                writer.append_data(np.asarray(env.render()))
                frames += 1
                done = terminated or truncated
    finally:
        env.close()
    return frames


def _batch_of_one(obs: Any) -> Any:
    if isinstance(obs, dict):
        return {key: np.asarray(value)[None] for key, value in obs.items()}
    return np.asarray(obs)[None]
