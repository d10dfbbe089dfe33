"""Bridge by hand: level every pair, and raise one before the load comes."""

import numpy as np

from steelyard_envs.bridge_kernels import PAIRS, SPACING, SPEED

GAIN, DAMPING = 10.0, 0.5  # speed per error of a pair's height [1/s], and against its own speed
LIFT = 0.1  # about what a pair sinks while the load passes [m]
AHEAD = 0.3  # time by which the lift runs ahead of the load [s]


class BridgeController:
    """Proportional-derivative control of each pair's height, fed forward with the load's place.

    Cables are taut, so a pair climbs as fast as its winches haul and the loop has one pole, at
    GAIN. What feedback cannot do is hold a pair under the load: statics ask 2 m g + share M g of
    its cables, up to 106 N, and its winches stall at 90 N. It is therefore raised while it still
    can be, with the square of its share, as it sinks only when the load is close.
    """

    def reset(self, num_envs: int) -> None:
        """Do nothing: the controller remembers nothing between steps."""

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Return a speed for the winches of each pair."""
        height, climb = obs[:, :PAIRS], obs[:, PAIRS : 2 * PAIRS]
        place = (obs[:, 30:31] + AHEAD * obs[:, 32:33]) / SPACING + 0.5 * (PAIRS - 1)
        share = np.clip(1.0 - np.abs(place - np.arange(PAIRS)), 0.0, 1.0)
        wanted = GAIN * (LIFT * share**2 - height) - DAMPING * climb
        return np.clip(wanted / SPEED, -1.0, 1.0).astype(np.float32)
