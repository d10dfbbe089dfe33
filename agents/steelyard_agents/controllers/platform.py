"""Platform: a linear-quadratic regulator for the pitch, a spring and damper across the deck."""

import numpy as np

GRAVITY, STEP = 9.81, 0.02
LOAD, DECK_HEIGHT = 10.0, 2.0
SPEED = np.array([3.0, 1.5])
# Corners of 1 kg at x = -3 and x = 4, two each; the load near the balance adds its own inertia.
CORNER_MOMENT = 2.0 * -3.0 + 2.0 * 4.0
INERTIA = 2.0 * (9.0 + 4.0) + 2.0 * (16.0 + 4.0) + LOAD * DECK_HEIGHT**2
TOPPLING = GRAVITY * (4.0 + LOAD) * DECK_HEIGHT
BALANCE = -CORNER_MOMENT / LOAD


def _gains() -> np.ndarray:
    """Feedback of (pitch, its rate, place off balance, speed) on the load's acceleration.

    About the feet, with the load at x and moving at acceleration a along the deck:
    INERTIA pitch'' = TOPPLING pitch - GRAVITY LOAD (x - BALANCE) + LOAD DECK_HEIGHT a.
    """
    a = np.eye(4)
    a[0, 1] = a[2, 3] = STEP
    a[1, 0] = STEP * TOPPLING / INERTIA
    a[1, 2] = -STEP * GRAVITY * LOAD / INERTIA
    b = STEP * np.array([[0.0], [LOAD * DECK_HEIGHT / INERTIA], [0.0], [1.0]])
    cost = np.diag([300.0, 1.0, 5.0, 0.01])
    value = cost.copy()
    for _ in range(2000):  # Riccati iteration to the stationary regulator
        gain = np.linalg.solve(0.01 + b.T @ value @ b, b.T @ value @ a)
        value = cost + a.T @ value @ (a - b @ gain)
    return np.asarray(gain[0])


class PlatformController:
    """Moves the load against the tilt; see the module."""

    def __init__(self) -> None:
        self._gains = _gains()

    def reset(self, num_envs: int) -> None:
        """Nothing is remembered."""

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Commanded speeds over the greatest speed, shape (n, 2)."""
        place, across, speed, speed_across, pitch, _, rate = obs.T[:7].astype(np.float64)
        along = -self._gains @ np.stack([pitch, rate, place - BALANCE, speed])
        sideways = -4.0 * across - 4.0 * speed_across
        wanted = np.stack([speed + STEP * along, speed_across + STEP * sideways], axis=1)
        return np.clip(wanted / SPEED, -1.0, 1.0).astype(np.float32)
