"""Ids, entry points and episode lengths. Strings only, so that specs serialise and importing stays light."""

from gymnasium.envs.registration import register, registry

# Id, module, class prefix, episode length [control steps], return that counts as solved.
ENVIRONMENTS = (
    ("steelyard/Platform-v0", "platform", "Platform", 500, 425.0),
    ("steelyard/Ballistic-v0", "ballistic", "Ballistic", 600, 8.5),
    ("steelyard/Bridge-v0", "bridge", "Bridge", 1000, 800.0),
)


def register_all() -> None:
    """Register every environment once, however often this is called."""
    for env_id, module, name, steps, threshold in ENVIRONMENTS:
        if env_id not in registry:
            register(
                env_id,
                entry_point=f"steelyard_envs.{module}:{name}Env",
                vector_entry_point=f"steelyard_envs.{module}:{name}VectorEnv",
                max_episode_steps=steps,
                reward_threshold=threshold,
            )
