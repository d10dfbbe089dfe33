"""Gymnasium's vector wrappers around native vector environments do as around its own."""

import functools

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers

from tests.envs.environments import IDS, LIMIT, assert_same, native, singles, some_actions

WRAPPERS = {
    "RecordEpisodeStatistics": wrappers.RecordEpisodeStatistics,
    "NormalizeObservation": wrappers.NormalizeObservation,
    "NormalizeReward": wrappers.NormalizeReward,
    "ClipReward": functools.partial(wrappers.ClipReward, min_reward=-0.1, max_reward=0.5),
    "ClipAction": wrappers.ClipAction,
    "RescaleAction": functools.partial(wrappers.RescaleAction, min_action=0.0, max_action=2.0),
    "RescaleObservation": functools.partial(
        wrappers.RescaleObservation, min_obs=np.float32(-1.0), max_obs=np.float32(1.0)
    ),
    "FlattenObservation": wrappers.FlattenObservation,
    "DtypeObservation": functools.partial(wrappers.DtypeObservation, dtype=np.float64),
    "DictInfoToList": wrappers.DictInfoToList,
}


# Gymnasium refuses to wrap environments that reset otherwise.
NOT_SAME_STEP = {AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED}
ONLY = {
    "NormalizeObservation": {AutoresetMode.NEXT_STEP},
    "RescaleObservation": NOT_SAME_STEP,
    "FlattenObservation": NOT_SAME_STEP,
    "DtypeObservation": NOT_SAME_STEP,
}
WRAPPED = [
    (name, mode) for name in WRAPPERS for mode in AutoresetMode if mode in ONLY.get(name, {mode})
]


@pytest.mark.filterwarnings("ignore:.*precision lowered.*:UserWarning")
@pytest.mark.filterwarnings("ignore:overflow encountered in cast:RuntimeWarning")
@pytest.mark.parametrize(("wrapper", "mode"), WRAPPED)
@pytest.mark.parametrize("env_id", IDS)
def test_gymnasiums_wrappers_work(env_id, mode, wrapper):
    mine = WRAPPERS[wrapper](native(env_id, 5, mode))
    its = WRAPPERS[wrapper](singles(env_id, 5, mode))
    assert_same(mine.reset(seed=1), its.reset(seed=1))
    statistics = 0
    for action in some_actions(env_id, 3 * LIMIT, rows=5):
        seen, wanted = mine.step(action), its.step(action)
        if "episode" in seen[4]:
            statistics += 1
            assert (seen[4]["episode"].pop("t") >= 0.0).all()
            wanted[4]["episode"].pop("t")
        assert_same(seen, wanted)
        ended = seen[2] | seen[3]
        if mode is AutoresetMode.DISABLED and ended.any():
            begun = [env.reset(options={"reset_mask": ended.copy()}) for env in (mine, its)]
            assert_same(*begun)
    assert (statistics >= 2) == (wrapper == "RecordEpisodeStatistics")
