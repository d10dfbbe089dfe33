"""Interquartile mean and its interval against values worked out by hand and by scipy."""

import numpy as np
import pytest
from scipy import stats

from steelyard_agents.scores import Evaluation, bootstrap_interval, interquartile_mean


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7, 8, 100])
def test_interquartile_mean_is_the_trimmed_mean_of_scipy(count):
    scores = np.random.default_rng(count).normal(size=count)
    assert interquartile_mean(scores) == pytest.approx(stats.trim_mean(scores, 0.25), rel=1e-13)


def test_interquartile_mean_by_hand():
    assert interquartile_mean(np.array([100.0, 2.0, -50.0, 4.0])) == 3.0
    assert interquartile_mean(np.array([[1.0, 9.0], [3.0, 5.0]])) == 4.0


def test_interval_covers_as_often_as_it_says():
    """200 experiments of 20 seeds: the true centre lies inside in about 95 % of them."""
    random = np.random.default_rng(0)
    inside = 0
    for _ in range(200):
        low, high = bootstrap_interval(random.normal(size=(20, 1)), resamples=400)
        inside += low < 0.0 < high
    # Percentile intervals of 20 samples cover a little less than they say (about 92 %); the
    # standard deviation of the count is 4.
    assert 172 <= inside <= 199


def test_interval_keeps_tasks_apart():
    """Two tasks without any spread: resampling across tasks would mix 0 and 100."""
    scores = np.tile([0.0, 100.0], (5, 1))
    assert bootstrap_interval(scores) == (50.0, 50.0)


def test_interval_is_reproducible_and_holds_the_mean():
    scores = np.array([[1.0], [2.0], [3.0], [4.0], [10.0]])
    low, high = bootstrap_interval(scores)
    assert (low, high) == bootstrap_interval(scores)
    assert 1.0 <= low < interquartile_mean(scores) < high <= 10.0


def test_summary():
    returns, lengths = np.array([1.0, 2.0, 3.0, 10.0]), np.array([5, 6, 7, 8])
    successes = np.array([True, False, True, True])
    summary = Evaluation(returns, lengths, successes, physics_errors=1).summary()
    assert summary["return_mean"] == 4.0
    assert summary["return_iqm"] == 2.5
    assert summary["return_std"] == pytest.approx(np.sqrt(12.5))
    assert summary["success_rate"] == 0.75
    assert (summary["length_mean"], summary["length_min"], summary["length_max"]) == (6.5, 5, 8)
    assert (summary["episodes"], summary["physics_errors"]) == (4, 1)
    assert Evaluation(returns, lengths, None, physics_errors=0).summary()["success_rate"] is None
