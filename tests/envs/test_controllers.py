"""Tasks are neither trivial nor impossible: chance fails, a few lines of control theory succeed."""

import gymnasium as gym
import numpy as np
import pytest

from steelyard_agents import controllers
from steelyard_agents.evaluate import evaluate, random_policy
from tests.envs.environments import IDS, task_class


def middle(env_id):
    levels = task_class(env_id).levels
    return {"difficulty": levels[len(levels) // 2]}


@pytest.mark.parametrize("env_id", IDS)
def test_a_random_policy_fails(env_id):
    policy = random_policy(env_id)
    scored = evaluate(policy, env_id, episodes=50, env_kwargs=middle(env_id))
    assert scored.successes.mean() < 0.1
    assert scored.returns.mean() < gym.spec(env_id).reward_threshold
    assert scored.physics_errors == 0


@pytest.mark.parametrize("env_id", IDS)
def test_doing_nothing_fails(env_id):
    class Idle:
        def reset(self, num_envs):
            self.shape = num_envs, len(task_class(env_id).action_table)

        def __call__(self, obs):
            return np.zeros(self.shape, np.float32)

    scored = evaluate(Idle(), env_id, episodes=50, env_kwargs=middle(env_id))
    assert scored.successes.mean() < 0.1


@pytest.mark.parametrize("env_id", IDS)
def test_the_hand_written_controller_succeeds(env_id):
    controller = controllers.load(env_id)
    scored = evaluate(controller, env_id, episodes=100, env_kwargs=middle(env_id))
    assert scored.successes.sum() >= 95
    assert scored.physics_errors == 0
    assert (scored.lengths <= gym.spec(env_id).max_episode_steps).all()


@pytest.mark.parametrize("env_id", IDS)
def test_every_reward_term_can_be_had(env_id):
    """By chance or by skill each term is now and then something else than 0."""
    envs = gym.make_vec(env_id, 20, autoreset_mode="SameStep", **middle(env_id))
    seen = {f"reward_{term}": set() for term in task_class(env_id).terms}
    for policy in (random_policy(env_id), controllers.load(env_id)):
        observation, _ = envs.reset(seed=0)
        policy.reset(20)
        for _ in range(gym.spec(env_id).max_episode_steps):
            observation, _, _, _, info = envs.step(policy(observation))
            for term, values in seen.items():
                values.update(info[term].tolist(), info.get("final_info", info)[term].tolist())
    assert not [term for term, values in seen.items() if values == {0.0}]


@pytest.mark.parametrize("env_id", IDS)
def test_levels_grow_harder(env_id):
    """Within chance: 20 episodes of each level on the same seeds, an episode's worth of slack."""
    means = []
    for level in task_class(env_id).levels:
        controller = controllers.load(env_id)
        scored = evaluate(controller, env_id, episodes=20, env_kwargs={"difficulty": level})
        means.append(scored.returns.mean())
    assert means[0] > means[-1]


@pytest.mark.parametrize("env_id", IDS)
def test_controllers_see_observations_only_and_forget_at_reset(env_id):
    envs = gym.make_vec(env_id, 5)
    controller = controllers.load(env_id)
    played = []
    for _ in range(2):
        observation, _ = envs.reset(seed=0)
        controller.reset(5)
        actions = []
        for _ in range(60):
            kept = observation.copy()
            actions.append(np.array(controller(observation)))
            np.testing.assert_array_equal(observation, kept)
            assert actions[-1].shape == envs.action_space.shape
            observation, *_ = envs.step(actions[-1])
        played.append(np.array(actions))
    np.testing.assert_array_equal(*played)
