"""Platform: keep a deck on two feet level by moving a load over it."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

import steelyard as sy
from steelyard_envs.clip import clip
from steelyard_envs.single import TaskEnv
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED, Array, Task
from steelyard_envs.vector import TaskVectorEnv

LENGTH, WIDTH, LEFT = 7.0, 2.0, -3.0
# Along and across: fast across would lift a foot.
SPEED = (3.0, 1.5)
ACCELERATION = (8.0, 3.0)
FALLEN = math.sin(math.radians(25.0))
EPISODE = 500
LOAD, DECK_MASS = 10.0, 4.0
#: Time in which a small slope grows by e, sqrt(inertia / moment per slope), with the load at the balance [s].
TOPPLING_TIME = 0.62

# Of rods and contacts, times the step squared: a fifteenth of the step's own error or less.
_TOLERANCE = 0.025

# Worlds that are worth code of their own.
_MANY = 256

# Rows of ``values``.
_ALONG, _ACROSS, _SPEED_X, _SPEED_Z, _ELAPSED, _NEXT_PUSH = range(6)
# Entries of ``settings`` and ``layout``.
_DT, _LIMIT, _TILT, _PUSH, _PUSH_PAUSE = range(5)
_POSITION, _VELOCITY, _WEIGHTS, _RATES, _ACCELERATIONS, _NONFINITE = range(6)


@sy.kernel
def _begin(mask, values, streams, settings, layout, state):
    """Tilt a fresh platform about its feet and put the load near the balance."""
    for w in range(mask.shape[0]):
        if not mask[w]:
            continue
        tilt = sy.uniform_between(streams, w, -1.0, 1.0) * settings[_TILT]
        along = 0.4 + 0.02 * sy.uniform_between(streams, w, -1.0, 1.0)
        across = 0.5 + 0.1 * sy.uniform_between(streams, w, -1.0, 1.0)
        values[_ALONG, w] = along
        values[_ACROSS, w] = across
        values[_SPEED_X, w] = 0.0
        values[_SPEED_Z, w] = 0.0
        values[_ELAPSED, w] = 0.0
        pause = settings[_PUSH_PAUSE]
        values[_NEXT_PUSH, w] = math.ceil(pause * sy.uniform_between(streams, w, 0.5, 1.5))
        weights = layout[_WEIGHTS]
        state[weights, w] = (1.0 - along) * (1.0 - across)
        state[weights + 1, w] = (1.0 - along) * across
        state[weights + 2, w] = along * (1.0 - across)
        state[weights + 3, w] = along * across
        position = layout[_POSITION]
        for c in range(3):
            state[position + 18 + c, w] = 0.0
            for k in range(4):
                corner = state[position + 3 * (2 + k) + c, w]
                state[position + 18 + c, w] += state[weights + k, w] * corner
        cosine, sine = math.cos(tilt), math.sin(tilt)
        for p in range(7):
            x = state[position + 3 * p, w]
            y = state[position + 3 * p + 1, w]
            state[position + 3 * p, w] = cosine * x - sine * y
            state[position + 3 * p + 1, w] = sine * x + cosine * y


@sy.inner
def _towards(speed, wanted, change):
    """``speed`` moved to ``wanted`` by at most ``change``."""
    return speed + min(max(wanted - speed, -change), change)


@sy.inner
def _move(action, values, w, axis, dt, share):
    """Speed up towards the commanded speed and move at constant acceleration; stop at the deck's edge.

    ``share`` is ``dt`` over the deck's size.
    """
    wanted = SPEED[axis] * min(max(action, -1.0), 1.0) if action == action else 0.0
    old = values[_SPEED_X + axis, w]
    speed = _towards(old, wanted, ACCELERATION[axis] * dt)
    place = values[_ALONG + axis, w] + 0.5 * (old + speed) * share
    if place < 0.0 or place > 1.0:
        place = min(max(place, 0.0), 1.0)
        speed = 0.0
    values[_SPEED_X + axis, w] = speed
    values[_ALONG + axis, w] = place


@sy.inner
def _control(actions, values, streams, settings, layout, state):
    """Move the load as commanded and push the deck when it is time."""
    dt = settings[_DT]
    weights = state[layout[_WEIGHTS] :]
    rates = state[layout[_RATES] :]
    velocity = state[layout[_VELOCITY] :]
    accelerations = state[layout[_ACCELERATIONS] :]
    per_length, per_width = 1.0 / LENGTH, 1.0 / WIDTH
    gain = 2.0 / (dt * dt)
    for w in range(actions.shape[0]):
        u0, v0 = values[_ALONG, w], values[_ACROSS, w]
        du, dv = values[_SPEED_X, w] * per_length, values[_SPEED_Z, w] * per_width
        _move(actions[w, 0], values, w, 0, dt, dt * per_length)
        _move(actions[w, 1], values, w, 1, dt, dt * per_width)
        u1, v1 = values[_ALONG, w], values[_ACROSS, w]
        rate00 = -du * (1.0 - v0) - (1.0 - u0) * dv
        rate01 = -du * v0 + (1.0 - u0) * dv
        rate10 = du * (1.0 - v0) - u0 * dv
        rate11 = du * v0 + u0 * dv
        rates[0, w] = rate00
        rates[1, w] = rate01
        rates[2, w] = rate10
        rates[3, w] = rate11
        to00 = (1.0 - u1) * (1.0 - v1) - weights[0, w]
        to01 = (1.0 - u1) * v1 - weights[1, w]
        to10 = u1 * (1.0 - v1) - weights[2, w]
        to11 = u1 * v1 - weights[3, w]
        accelerations[0, w] = (to00 - rate00 * dt) * gain
        accelerations[1, w] = (to01 - rate01 * dt) * gain
        accelerations[2, w] = (to10 - rate10 * dt) * gain
        accelerations[3, w] = (to11 - rate11 * dt) * gain
        if values[_ELAPSED, w] >= values[_NEXT_PUSH, w]:
            pause = settings[_PUSH_PAUSE]
            values[_NEXT_PUSH, w] += math.ceil(pause * sy.uniform_between(streams, w, 0.5, 1.5))
            angle = 2.0 * math.pi * sy.uniform(streams, w)
            kick = settings[_PUSH] * sy.uniform(streams, w) / (LOAD + DECK_MASS)
            for p in range(2, 7):
                velocity[3 * p, w] += kick * math.cos(angle)
                velocity[3 * p + 2, w] += kick * math.sin(angle)


@sy.inner
def _observe_world(w, x, v, values, observations):
    """Observation of a world; ``x`` and ``v`` are rows of positions and velocities from the first on."""
    # Corners are left back, left front, right back, right front.
    left = x[7, w] + x[10, w]
    right = x[13, w] + x[16, w]
    back = x[7, w] + x[13, w]
    front = x[10, w] + x[16, w]
    rise = v[13, w] + v[16, w] - v[7, w] - v[10, w]
    lean = v[10, w] + v[16, w] - v[7, w] - v[13, w]
    turn = x[14, w] + x[17, w] - x[8, w] - x[11, w]
    along, across = 0.5 / LENGTH, 0.5 / WIDTH
    observations[w, 0] = LEFT + LENGTH * values[_ALONG, w]
    observations[w, 1] = WIDTH * (values[_ACROSS, w] - 0.5)
    observations[w, 2] = values[_SPEED_X, w]
    observations[w, 3] = values[_SPEED_Z, w]
    observations[w, 4] = clip((right - left) * along, -1.0, 1.0)
    observations[w, 5] = clip((front - back) * across, -1.0, 1.0)
    observations[w, 6] = clip(rise * along, -10.0, 10.0)
    observations[w, 7] = clip(lean * across, -10.0, 10.0)
    observations[w, 8] = clip(turn * along, -1.0, 1.0)
    observations[w, 9] = clip(x[1, w], -1.0, 5.0)
    observations[w, 10] = clip(x[4, w], -1.0, 5.0)
    observations[w, 11] = clip(0.5 * (x[0, w] + x[3, w]), -5.0, 5.0)
    observations[w, 12] = clip(0.5 * (x[2, w] + x[5, w]), -5.0, 5.0)


@sy.kernel
def _observe(mask, values, layout, state, observations):
    """Observations of the worlds of ``mask``."""
    x = state[layout[_POSITION] :]
    v = state[layout[_VELOCITY] :]
    for w in range(mask.shape[0]):
        if mask[w]:
            _observe_world(w, x, v, values, observations)


@sy.inner
def _off_balance(x, v, w):
    """How far the extrapolated centre of mass of deck and load is from over the feet along x [m].

    The centre of mass x and its speed v, as x + v / w with w the rate at which the platform topples: what falls
    and what does not, whatever the deck's slope (Hof, Gazendam & Sinke 2005).
    """
    load = LOAD / (LOAD + DECK_MASS)
    corner = 0.25 * DECK_MASS / (LOAD + DECK_MASS)
    place = x[6, w] + x[9, w] + x[12, w] + x[15, w]
    speed = v[6, w] + v[9, w] + v[12, w] + v[15, w]
    away = corner * (place + TOPPLING_TIME * speed) + load * (x[18, w] + TOPPLING_TIME * v[18, w])
    return away - 0.5 * (x[0, w] + x[3, w])


@sy.inner
def _judge(actions, values, settings, layout, state, observations, rewards, flags):
    """Observations, rewards and flags after a step; the number of episodes that ended."""
    x = state[layout[_POSITION] :]
    v = state[layout[_VELOCITY] :]
    nonfinite = state[layout[_NONFINITE] :]
    per_speed = 0.1 / (SPEED[0] * SPEED[0])
    ended = 0
    for w in range(actions.shape[0]):
        _observe_world(w, x, v, values, observations)
        values[_ELAPSED, w] += 1.0
        broken = nonfinite[0, w] > 0.0
        pitch = np.float64(observations[w, 4])
        roll = np.float64(observations[w, 5])
        fallen = broken or abs(pitch) > FALLEN or abs(roll) > FALLEN
        square = 100.0 * (pitch * pitch + roll * roll)
        speed = values[_SPEED_X, w] ** 2 + values[_SPEED_Z, w] ** 2
        level = 0.0 if broken else 0.5 / (1.0 + square)
        offset = 10.0 * _off_balance(x, v, w)
        balance = 0.0 if broken else 0.5 / (1.0 + offset * offset)
        effort = -per_speed * speed
        fall = -10.0 if fallen else 0.0
        rewards[1, w] = level
        rewards[2, w] = balance
        rewards[3, w] = effort
        rewards[4, w] = fall
        rewards[0, w] = level + balance + effort + fall
        elapsed = values[_ELAPSED, w]
        late = settings[_LIMIT] > 0.0 and elapsed >= settings[_LIMIT]
        flags[TERMINATED, w] = fallen
        flags[TRUNCATED, w] = late
        flags[SUCCESS, w] = elapsed >= EPISODE and not fallen
        flags[PHYSICS_ERROR, w] = broken
        if fallen or late:
            ended += 1
    return ended


@sy.kernel
def _step(
    actions, values, streams, settings, layout, observations, rewards, flags,
    state, launch, substeps,
):  # fmt: skip
    """A control step of all worlds: control, physics, observation, reward."""
    _control(actions, values, streams, settings, layout, state)
    sy.advance(launch, substeps)
    return _judge(actions, values, settings, layout, state, observations, rewards, flags)


class PlatformTask(Task):
    """Scene and kernels of Platform; see ``PlatformEnv``."""

    observation_table: ClassVar = (
        ("place of the load along the deck", -3.0, 4.0, "m"),
        ("place of the load across the deck", -1.0, 1.0, "m"),
        ("speed of the load along the deck", -3.0, 3.0, "m/s"),
        ("speed of the load across the deck", -1.5, 1.5, "m/s"),
        ("pitch: sine of the deck's slope along", -1.0, 1.0, ""),
        ("roll: sine of the deck's slope across", -1.0, 1.0, ""),
        ("rate of the pitch", -10.0, 10.0, "1/s"),
        ("rate of the roll", -10.0, 10.0, "1/s"),
        ("yaw: sine of the deck's turn", -1.0, 1.0, ""),
        ("height of the foot at z = 1", -1.0, 5.0, "m"),
        ("height of the foot at z = -1", -1.0, 5.0, "m"),
        ("place of the feet along x", -5.0, 5.0, "m"),
        ("place of the feet along z", -5.0, 5.0, "m"),
    )
    action_table: ClassVar = ("speed of the load along", "speed of the load across")
    terms: ClassVar = ("level", "balance", "effort", "fall")
    methods: ClassVar = ("rattle", "symplectic_euler", "gauss_seidel")
    default_physics_rate: ClassVar = 50.0
    # python -m benchmarks.environment_error steelyard/Platform-v0 --rates 50 100 200 400 800 1600 --reference 6400
    # --seconds 1 --rows 32 --difficulty 1
    measured: ClassVar = (
        ("rattle", 50.0, 6.6e-4, 1.0),
        ("rattle", 100.0, 2.0e-4, 1.7),
        ("rattle", 200.0, 1.1e-4, 2.3),
        ("rattle", 400.0, 2.6e-5, 3.0),
        ("rattle", 800.0, 6.9e-6, 6.3),
        ("rattle", 1600.0, 2.9e-6, 11.0),
        ("symplectic_euler", 50.0, 9.5e-3, 1.1),
        ("gauss_seidel", 50.0, 2.8e-2, 2.2),
    )
    value_rows: ClassVar = 6

    def build(self) -> sy.World:
        """Seven particles: feet, corners, load."""
        integrator = sy.SymplecticEuler() if self.method == "symplectic_euler" else sy.Rattle()
        solver = (
            sy.GaussSeidel(passes=30)
            if self.method == "gauss_seidel"
            else sy.Direct(tolerance=_TOLERANCE / self.physics_rate**2)
        )
        method = sy.Method(integrator, solver, dt=1.0 / self.physics_rate)
        scene = sy.scenes.platform(load=LOAD)
        self._rider = scene.of(sy.Rider)[0]
        special = self.num_envs >= _MANY
        return sy.World(scene, worlds=self.num_envs, method=method, special=special)

    def level_settings(self) -> tuple[float, ...]:
        """Start tilt [rad], impulse of a push [N s], mean pause between pushes [control steps]."""
        tilt, push = ((0.03, 0.0), (0.05, 6.0), (0.08, 10.0))[self.difficulty - 1]
        return tilt, push, 1.5 * self.control_rate

    def rows(self) -> tuple[int, ...]:
        """Rows of the state that the kernels touch."""
        row = self.world.row
        return (
            row("particles", "position"),
            row("particles", "velocity"),
            row(self._rider, "weights"),
            row(self._rider, "rates"),
            row(self._rider, "accelerations"),
            row("particles", "nonfinite"),
        )

    def start(self, mask: Array) -> None:
        """A fresh platform, tilted."""
        self.world.reset(mask)
        _begin(mask, self.values, self.streams, self.settings, self.layout, self.world.state)
        _observe(mask, self.values, self.layout, self.world.state, self.observations)

    def step(self, actions: Array) -> int:
        """One control step of all worlds."""
        ended: int = _step(
            actions, self.values, self.streams, self.settings, self.layout,
            self.observations, self.rewards, self.flags, self.world.state, self.world.launch, self.substeps,
        )  # fmt: skip
        return ended

    @property
    def camera(self) -> dict[str, Any]:
        """From the front, a little to the side and above."""
        return {
            "target": (0.5, 1.5, 0.0), "distance": 11.0, "azimuth": 22.0, "elevation": 14.0,
            "field_of_view": 50.0,
        }  # fmt: skip

    def drawing(self, index: int) -> sy.draw.Drawing:
        """Deck, struts, feet, load and a panel."""
        drawing = sy.draw.Drawing()
        position = self.world.particles.position[index]
        feet, corners, load = position[:2], position[2:6], position[6]
        for foot in feet:
            for corner in corners:
                drawing.line(foot, corner, width=0.06)
            drawing.circle(foot, 0.12)
        drawing.line(feet[0], feet[1], width=0.06)
        drawing.face(corners[[0, 1, 3, 2]], thickness=0.12)
        drawing.circle((load[0], load[1] + 0.35, load[2]), 0.3, color=(214, 92, 58))
        observation = self.observations[index]
        drawing.text("pitch", value=f"{math.degrees(math.asin(observation[4])):+.1f} deg")
        drawing.text("roll", value=f"{math.degrees(math.asin(observation[5])):+.1f} deg")
        drawing.text("time", value=f"{self.values[_ELAPSED, index] / self.control_rate:.2f} s")
        return drawing


class PlatformEnv(TaskEnv):
    """Keep a deck on two feet level by moving a load over it.

    ## Description
    A T-shaped platform of six particles of 1 kg, all joined by rods, stands on two feet on ground with
    friction (coefficient 0.8). A load of 10 kg rides on the deck, which spans 7 m by 2 m at a height of 2 m.
    With the load near 0.4 of the deck's length the platform balances, and is unstable there. The agent
    moves the load; random pushes disturb the deck.

    ## Action Space
    `Box(-1.0, 1.0, (2,), float32)`. Commanded speeds of the load; it accelerates towards them at no more
    than 8 m/s^2 along and 3 m/s^2 across the deck. Values out of range are clipped.

    | Num | Action | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | speed of the load along | -1 (-3 m/s) | 1 (3 m/s) | - |
    | 1 | speed of the load across | -1 (-1.5 m/s) | 1 (1.5 m/s) | - |

    ## Observation Space
    `Box` of shape `(13,)`, float32, clipped to these bounds:

    | Num | Observation | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | place of the load along the deck | -3 | 4 | m |
    | 1 | place of the load across the deck | -1 | 1 | m |
    | 2 | speed of the load along the deck | -3 | 3 | m/s |
    | 3 | speed of the load across the deck | -1.5 | 1.5 | m/s |
    | 4 | pitch: sine of the deck's slope along | -1 | 1 | - |
    | 5 | roll: sine of the deck's slope across | -1 | 1 | - |
    | 6 | rate of the pitch | -10 | 10 | 1/s |
    | 7 | rate of the roll | -10 | 10 | 1/s |
    | 8 | yaw: sine of the deck's turn | -1 | 1 | - |
    | 9 | height of the foot at z = 1 | -1 | 5 | m |
    | 10 | height of the foot at z = -1 | -1 | 5 | m |
    | 11 | place of the feet along x | -5 | 5 | m |
    | 12 | place of the feet along z | -5 | 5 | m |

    ## Rewards
    The sum of four terms, each in the info:
    - `reward_level`: 0.5 / (1 + (pitch^2 + roll^2) / 0.1^2), 0.5 on a level deck;
    - `reward_balance`: 0.5 / (1 + (x / 0.1 m)^2) with x the distance of the extrapolated centre of mass (place plus
      0.62 s times speed) of deck and load from over the feet. The deck answers the load the wrong way first;
      this does not, and so says at once where to go. Without it PPO learns to put off the fall and no more;
    - `reward_effort`: -0.1 (speed of the load / 3 m/s)^2;
    - `reward_fall`: -10 in the step in which it falls.

    ## Starting State
    The platform stands on both feet, tilted about them by up to 0.03, 0.05 or 0.08 rad at difficulty 1, 2
    or 3, the load at rest within 2 % of the deck's length of the balance and 10 % of its width of the middle.

    ## Episode End
    Terminated when the deck's slope along or across passes 25 degrees, or when the physics of this world
    is no longer finite (`physics_error` in the info). Truncated after 500 steps (10 s). `is_success` is True
    once the platform has stood for 500 steps.

    ## Arguments
    - `difficulty`: 1, 2 (default) or 3: start tilt as above; pushes of up to 0, 6 or 10 N s in a random
      direction, about every 1.5 s.
    - `method`: `"rattle"` (default), `"symplectic_euler"` or `"gauss_seidel"`.
    - `physics_rate`: physics steps per second, a multiple of the control rate; 50 by default.
    - `control_rate`: control steps per second; 50 by default.
    - `tolerance`: instead of a method and a physics rate, the cheapest pair that was measured to hold this error [m];
      see Physics.
    - `render_mode`: `"human"`, `"rgb_array"` or None.

    ## Physics
    One step of dt = 0.02 s per control step by default. The load is a particle held at its place on the
    deck with its full inertia, not a mass spread over the corners. Largest distance of any particle from
    `"rattle"` at 1600 Hz after 1 s of random actions at difficulty 1, median over 32 worlds:

    | method | 50 Hz | 100 Hz | 200 Hz |
    |---|---|---|---|
    | `"rattle"` | 1.5e-4 m | 3.9e-5 m | 9.8e-6 m |
    | `"symplectic_euler"` | 4.4e-3 m | 2.2e-3 m | 1.1e-3 m |
    | `"gauss_seidel"` | 4.8e-3 m | 2.4e-3 m | 1.1e-3 m |

    Command: `python -m benchmarks.environment_error steelyard/Platform-v0 --rates 50 100 200 --reference 1600
    --seconds 1 --rows 32 --difficulty 1`.

    `tolerance` goes by the worst of the 32 worlds, against 6400 Hz: `"rattle"` holds 6.6e-4 m at 50 Hz (the default),
    2.0e-4 at 100, 1.1e-4 at 200, 2.6e-5 at 400, 6.9e-6 at 800 and 2.9e-6 at 1600.

    ## Baselines
    Difficulty 2, 100 episodes from seed 1000000: random actions return 39 and never succeed; the
    linear-quadratic regulator of `steelyard_agents.controllers` returns 393 and succeeds in 100. Command:
    `python -m steelyard_agents.evaluate controller --env steelyard/Platform-v0 --episodes 100`.

    ## Version History
    - v0: first version.
    """

    task_class = PlatformTask


class PlatformVectorEnv(TaskVectorEnv):
    """Platform, many at once; see ``PlatformEnv``."""

    task_class = PlatformTask
