"""Native vector environments against Gymnasium's vector environment of single ones, bit for bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from tests.envs.environments import (
    IDS,
    LIMIT,
    assert_same,
    native,
    singles,
    some_actions,
    specialisations,
    task_class,
)


def step_both(mine, its, action):
    """One step of both, which must agree; resets what has ended where nothing else does."""
    seen = mine.step(action)
    assert_same(seen, its.step(action))
    ended = seen[2] | seen[3]
    if mine.metadata["autoreset_mode"] is AutoresetMode.DISABLED and ended.any():
        # Some wrappers take the mask out of the options that they are given.
        begun = [env.reset(options={"reset_mask": ended.copy()}) for env in (mine, its)]
        assert_same(*begun)
    return seen


@pytest.mark.parametrize("rows", [1, 3, 8, 9, 33])
@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_every_row_is_a_single_environment(env_id, mode, rows):
    mine, its = native(env_id, rows, mode), singles(env_id, rows, mode)
    assert_same(mine.reset(seed=100), its.reset(seed=100))
    endings = np.zeros(rows, int)
    for action in some_actions(env_id, 5 * LIMIT, rows=rows, seed=rows):
        _, _, terminated, truncated, _ = step_both(mine, its, action)
        endings += terminated | truncated
    assert (endings >= 3).all()
    assert_same(mine.reset(), its.reset())
    step_both(mine, its, mine.action_space.sample())


@pytest.mark.parametrize("env_id", IDS)
def test_every_row_is_a_single_environment_at_every_level_and_method(env_id):
    task = task_class(env_id)
    variants = [{"difficulty": level} for level in task.levels]
    variants += [{"method": method} for method in task.methods]
    variants += [{"physics_rate": 4 * task.default_physics_rate}, {"control_rate": 25}]
    for kwargs in variants:
        mine = native(env_id, 9, AutoresetMode.SAME_STEP, **kwargs)
        its = singles(env_id, 9, AutoresetMode.SAME_STEP, **kwargs)
        assert_same(mine.reset(seed=7), its.reset(seed=7))
        for action in some_actions(env_id, 2 * LIMIT, rows=9):
            step_both(mine, its, action)


@pytest.mark.parametrize("env_id", IDS)
def test_episodes_are_the_same_in_every_autoreset_mode(env_id):
    """The step that NEXT_STEP spends on a reset draws no random numbers, whatever was due in it."""
    starts = {}
    for mode in AutoresetMode:
        envs = native(env_id, 400, mode, difficulty=1)
        starts[mode] = [[row] for row in envs.reset(seed=0)[0]]
        rest, begins = np.zeros(envs.action_space.shape, np.float32), np.zeros(400, bool)
        for _ in range(5 * (LIMIT + 1)):
            observation, _, terminated, truncated, _ = envs.step(rest)
            ended = terminated | truncated
            if mode is AutoresetMode.DISABLED and ended.any():
                observation, _ = envs.reset(options={"reset_mask": ended})
            for row in np.flatnonzero(begins if mode is AutoresetMode.NEXT_STEP else ended):
                starts[mode][row].append(observation[row])
            begins = ended
    for rows in zip(*starts.values(), strict=True):
        episodes = [row[:5] for row in rows]
        assert len(episodes[0]) == 5
        np.testing.assert_array_equal(episodes[0], episodes[1])
        np.testing.assert_array_equal(episodes[0], episodes[2])


@pytest.mark.parametrize("env_id", IDS)
def test_whole_episodes(env_id):
    """With the registered time limit, and a policy that lets most episodes live long."""
    limit = gym.spec(env_id).max_episode_steps
    mine = native(env_id, 3, AutoresetMode.SAME_STEP, max_episode_steps=limit, difficulty=1)
    its = singles(env_id, 3, AutoresetMode.SAME_STEP, max_episode_steps=None, difficulty=1)
    assert_same(mine.reset(seed=0), its.reset(seed=0))
    for action in 0.1 * some_actions(env_id, limit + 10, rows=3):
        step_both(mine, its, action.astype(np.float32))


@pytest.mark.parametrize("env_id", IDS)
def test_make_vec_hands_the_registered_time_limit_on(env_id):
    limit = gym.spec(env_id).max_episode_steps
    envs = gym.make_vec(env_id, 2, autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=0)
    endings = [envs.step(np.zeros(envs.action_space.shape))[3] for _ in range(limit)]
    assert not np.any(endings[:-1])
    assert np.all(endings[-1])


@pytest.mark.parametrize("env_id", IDS)
def test_without_a_time_limit_nothing_is_truncated(env_id):
    envs = native(env_id, 2, AutoresetMode.DISABLED, max_episode_steps=None)
    envs.reset(seed=0)
    for _ in range(gym.spec(env_id).max_episode_steps + 100):
        assert not envs.step(np.zeros(envs.action_space.shape))[3].any()


@pytest.mark.parametrize("env_id", IDS)
def test_seeds_by_list(env_id):
    mine, its = native(env_id, 4), singles(env_id, 4)
    for seeds in ([5, 2**40, 0, 2**64 - 1], [None, 3, None, 3], [None] * 4):
        # The first resets leave streams that None goes on with.
        assert_same(mine.reset(seed=seeds), its.reset(seed=seeds))
    for action in some_actions(env_id, 60, rows=4):
        step_both(mine, its, action)
    seen = mine.reset(seed=np.array([1, 2, 3, 4]))
    assert_same(seen, its.reset(seed=[1, 2, 3, 4]))
    assert_same(mine.reset(seed=np.int64(1)), its.reset(seed=1))


@pytest.mark.parametrize("env_id", IDS)
def test_rows_without_a_seed_are_all_different(env_id):
    starts = [native(env_id, 50).reset()[0], native(env_id, 50).reset(seed=[None] * 50)[0]]
    starts.append(native(env_id, 3).reset(seed=[1, None, None])[0])
    rows = np.concatenate(starts)
    assert len(np.unique(rows, axis=0)) == len(rows)


@pytest.mark.parametrize("env_id", IDS)
def test_seeds_are_refused_where_they_cannot_be_meant(env_id):
    envs = native(env_id, 3)
    with pytest.raises(ValueError, match=r"2 seeds.*3 rows"):
        envs.reset(seed=[1, 2])
    with pytest.raises(ValueError, match=r"-4.*0 or more"):
        envs.reset(seed=[1, -4, 2])
    with pytest.raises(gym.error.Error, match="-1"):
        envs.reset(seed=-1)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_some_rows_can_be_reset_at_any_time(env_id, mode):
    mine, its = native(env_id, 9, mode), singles(env_id, 9, mode)
    assert_same(mine.reset(seed=0), its.reset(seed=0))
    chosen = np.random.default_rng(0)
    for step, action in enumerate(some_actions(env_id, 150, rows=9)):
        _, _, terminated, truncated, _ = step_both(mine, its, action)
        # Also rows that have just ended: they must not begin anew once more.
        if step % 7 == 3 or (terminated | truncated).any():
            mask = chosen.random(9) < 0.4
            mask[0] = True
            seed = [None, 900 + step][step % 2]
            begun = [e.reset(seed=seed, options={"reset_mask": mask.copy()}) for e in (mine, its)]
            assert_same(*begun)


@pytest.mark.parametrize("env_id", IDS)
def test_reset_masks_are_checked(env_id):
    envs = native(env_id, 3)
    some = {"reset_mask": np.array([True, False, True])}
    with pytest.raises(gym.error.ResetNeeded, match="Reset all rows first"):
        envs.reset(options=some)
    start = envs.reset(seed=0)[0]
    for mask in (np.ones(4, bool), np.ones((3, 1), bool), np.ones(3, int), [True, True]):
        with pytest.raises(ValueError, match=r"reset_mask has shape.*it must be \(3,\) bool"):
            envs.reset(options={"reset_mask": mask})
    observation, _ = envs.reset(options={"reset_mask": np.zeros(3, bool)})
    np.testing.assert_array_equal(observation, start)
    observation, _ = envs.reset(options=some)
    assert (observation != start).any(axis=1).tolist() == [True, False, True]
    assert some.keys() == {"reset_mask"}, "what is handed in is left alone"


@pytest.mark.parametrize("env_id", IDS)
def test_finished_rows_go_on_until_they_are_reset_when_autoreset_is_disabled(env_id):
    envs = native(env_id, 3, AutoresetMode.DISABLED, max_episode_steps=5)
    envs.reset(seed=0)
    rest = np.zeros(envs.action_space.shape, np.float32)
    limits = [envs.step(rest)[3].all() for _ in range(8)]
    assert limits == [False] * 4 + [True] * 4
    observation = envs.reset(options={"reset_mask": np.array([True, False, False])})[0]
    assert envs.step(rest)[3].tolist() == [False, True, True]
    assert observation in envs.observation_space


@pytest.mark.parametrize("mode", [*AutoresetMode, *(mode.value for mode in AutoresetMode)])
@pytest.mark.parametrize("env_id", IDS)
def test_autoreset_mode_is_told(env_id, mode):
    envs = native(env_id, 2, mode)
    assert envs.autoreset_mode is AutoresetMode(mode)
    assert envs.metadata["autoreset_mode"] is AutoresetMode(mode)
    assert "autoreset_mode" not in type(envs).metadata
    with pytest.raises(ValueError, match="whenever"):
        native(env_id, 2, "whenever")


@pytest.mark.parametrize("env_id", IDS)
def test_spaces(env_id):
    envs, single = native(env_id, 5), gym.make(env_id)
    assert envs.num_envs == 5
    assert envs.single_observation_space == single.observation_space
    assert envs.single_action_space == single.action_space
    assert envs.observation_space == batch_space(single.observation_space, 5)
    assert envs.action_space == batch_space(single.action_space, 5)
    envs.reset(seed=0)
    observation, reward, terminated, truncated, _ = envs.step(envs.action_space.sample())
    assert observation in envs.observation_space
    assert (reward.dtype, reward.shape) == (np.float64, (5,))
    assert (terminated.dtype, truncated.dtype) == (np.bool_, np.bool_)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_nothing_returned_is_written_again_or_shared(env_id, mode):
    envs = native(env_id, 9, mode, max_episode_steps=5)
    kept = list(arrays(envs.reset(seed=0)))
    for action in some_actions(env_id, 12, rows=9):
        kept += arrays(envs.step(action))
    copies = [array.copy() for array in kept]
    for action in some_actions(env_id, 12, rows=9, seed=1):
        envs.step(action)
    for array, copied in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copied)
        assert array.flags.writeable
    for index, array in enumerate(kept):
        assert not any(np.shares_memory(array, other) for other in kept[:index])


def arrays(value):
    """All arrays of numbers in what an environment returns."""
    if isinstance(value, dict):
        value = tuple(value.values())
    if isinstance(value, tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        for part in value:
            yield from arrays(part)
    elif isinstance(value, np.ndarray):
        yield value


@pytest.mark.parametrize("env_id", IDS)
def test_actions_of_another_shape_are_refused(env_id):
    envs = native(env_id, 3)
    envs.reset(seed=0)
    rows, count = envs.action_space.shape
    for shape in [(), (count,), (rows - 1, count), (rows, count + 1), (count, rows, 1), (1, count)]:
        if shape != (rows, count):
            with pytest.raises(ValueError) as caught:
                envs.step(np.zeros(shape, np.float32))
            assert str(shape) in str(caught.value) and str((rows, count)) in str(caught.value)


@pytest.mark.parametrize("env_id", IDS)
def test_stepping_before_the_first_reset_is_refused(env_id):
    envs = native(env_id, 3)
    with pytest.raises(gym.error.ResetNeeded, match=r"[Cc]all reset"):
        envs.step(envs.action_space.sample())


@pytest.mark.parametrize("env_id", IDS)
def test_inputs_of_any_layout_are_the_same_and_compile_nothing(env_id):
    envs = native(env_id, 9, AutoresetMode.DISABLED)
    actions = np.sign(some_actions(env_id, 30, rows=9)).astype(np.float32)
    mask = np.arange(9) % 2 == 0

    def play(convert):
        begun = [envs.reset(seed=3)]
        seen = [envs.step(convert(action)) for action in actions]
        begun.append(envs.reset(options={"reset_mask": convert(mask)}))
        return seen, begun

    def frozen(array):
        array = array.copy()
        array.flags.writeable = False
        return array

    wanted, before = play(np.copy), specialisations()
    for convert in (
        frozen,
        lambda array: np.repeat(array, 3, axis=0)[::3],
        np.asfortranarray,
        lambda array: array.tolist(),
        lambda array: array if array.dtype == bool else array.astype(int),
    ):
        assert_same(play(convert), wanted)
    assert specialisations() == before


@pytest.mark.parametrize("env_id", IDS)
def test_pictures_of_every_row(env_id):
    mine = native(env_id, 3, render_mode="rgb_array")
    its = singles(env_id, 3, render_mode="rgb_array")
    mine.reset(seed=0), its.reset(seed=0)
    for action in some_actions(env_id, 3, rows=3):
        mine.step(action), its.step(action)
    frames, wanted = mine.render(), its.render()
    assert isinstance(frames, tuple)
    assert_same(frames, wanted)
    assert any((frames[0] != other).any() for other in frames[1:])
    assert mine.metadata["render_fps"] == round(mine.task.control_rate)
    for envs in (mine, its):
        envs.close()
        envs.close()
    assert mine.closed


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("env_id", IDS)
def test_a_window_shows_the_first_row_and_changes_nothing(env_id, mode):
    pygame = pytest.importorskip("pygame")
    shown, hidden = native(env_id, 3, mode, render_mode="human"), native(env_id, 3, mode)
    assert_same(shown.reset(seed=0), hidden.reset(seed=0))
    before = pygame.surfarray.array3d(pygame.display.get_surface())
    for action in some_actions(env_id, 5, rows=3):
        assert_same(shown.step(action), hidden.step(action))
        assert shown.render() is None
    # Stepping alone must have painted the window: nobody calls render in this mode.
    shown.step(action)
    assert (pygame.surfarray.array3d(pygame.display.get_surface()) != before).any()
    shown.close()
    shown.close()


@pytest.mark.parametrize("env_id", IDS)
def test_without_a_render_mode_there_is_no_picture(env_id):
    envs = native(env_id, 2)
    envs.reset(seed=0)
    with pytest.warns(UserWarning, match="rgb_array"):
        assert envs.render() is None
    envs.close()
