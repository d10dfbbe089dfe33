"""What a policy scored: episodes of an evaluation, and seeds of an experiment."""

from dataclasses import dataclass
from typing import Any

import numpy as np


def interquartile_mean(scores: np.ndarray) -> float:
    """Return the mean of the middle half of `scores`, shape (n,) or more, taken over all entries.

    A quarter of the entries, rounded down, is cut off at each end: less swayed by outliers than
    the mean, less noisy than the median. Source: Agarwal et al. 2021, "Deep reinforcement learning
    at the edge of the statistical precipice", section 4.3.
    """
    ordered = np.sort(np.ravel(scores))
    cut = ordered.size // 4
    return float(ordered[cut : ordered.size - cut].mean())


def bootstrap_interval(
    scores: np.ndarray, *, confidence: float = 0.95, resamples: int = 10_000, seed: int = 0
) -> tuple[float, float]:
    """Return the stratified bootstrap percentile interval of the interquartile mean.

    Seeds are drawn with replacement within each task, and never across tasks, so that every
    resample holds every task equally often. Source: Agarwal et al. 2021, section 4.1.

    Args:
        scores: One score per seed and task, shape (seeds, tasks).
        confidence: Probability that the interval is to cover.
        resamples: Number of resamples.
        seed: Seed of the resampling, so that the interval can be reproduced.
    """
    random = np.random.default_rng(seed)
    seeds, tasks = scores.shape
    drawn = random.integers(seeds, size=(resamples, seeds, tasks))
    resampled = scores[drawn, np.arange(tasks)].reshape(resamples, -1)
    cut = seeds * tasks // 4
    means = np.sort(resampled, axis=1)[:, cut : seeds * tasks - cut].mean(axis=1)
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return float(low), float(high)


@dataclass(frozen=True)
class Evaluation:
    """The episodes of one evaluation, one entry each.

    Attributes:
        returns: Sum of the rewards, shape (episodes,).
        lengths: Number of steps, shape (episodes,).
        successes: `is_success` of the final info, shape (episodes,), bool; None where the
            environment does not report it.
        physics_errors: Number of episodes that the environment ended because its physics failed.
    """

    returns: np.ndarray
    lengths: np.ndarray
    successes: np.ndarray | None
    physics_errors: int

    def summary(self) -> dict[str, Any]:
        """Return the figures that are reported, in plain Python values."""
        success_rate = None if self.successes is None else float(self.successes.mean())
        return {
            "episodes": int(self.returns.size),
            "return_mean": float(self.returns.mean()),
            "return_std": float(self.returns.std()),
            "return_iqm": interquartile_mean(self.returns),
            "return_min": float(self.returns.min()),
            "return_max": float(self.returns.max()),
            "success_rate": success_rate,
            "length_mean": float(self.lengths.mean()),
            "length_min": int(self.lengths.min()),
            "length_max": int(self.lengths.max()),
            "physics_errors": self.physics_errors,
        }
