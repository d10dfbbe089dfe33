"""Platform: keep a deck on two feet level by moving a load over it."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import steelyard as sy
from steelyard_envs.clip import clip_lanes as clip
from steelyard_envs.single import TaskEnv
from steelyard_envs.task import PHYSICS_ERROR, SUCCESS, TERMINATED, TRUNCATED, Array, Task
from steelyard_envs.vector import TaskVectorEnv

#: Kernels take eight worlds at a time: one by one they took a fifth of a step.
lanes = sy.extension

LENGTH, WIDTH, LEFT = 7.0, 2.0, -3.0
# Along and across: fast across would lift a foot.
SPEED = (3.0, 1.5)
ACCELERATION = (8.0, 3.0)
FALLEN = math.sin(math.radians(25.0))
EPISODE = 500
LOAD, DECK_MASS = 10.0, 4.0
#: Time in which a small slope grows by e, sqrt(inertia / moment per slope), with the load at the balance [s].
TOPPLING_TIME = 0.62

# Of rods and contacts over the step cubed, as the error of one step: half of it changes no median error by 5 %.
_TOLERANCE = 2.5

# Worlds that are worth code of their own.
_MANY = 256

# Rows of ``values``.
_ALONG, _ACROSS, _SPEED_X, _SPEED_Z, _ELAPSED, _NEXT_PUSH = range(6)
# Entries of ``settings`` and ``layout``.
_DT, _LIMIT, _TILT, _PUSH, _PUSH_PAUSE = range(5)
_POSITION, _VELOCITY, _WEIGHTS, _RATES, _ACCELERATIONS, _NONFINITE = range(6)


@sy.inner
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
def _move(actions, values, first, axis, dt, share):
    """Speed up towards the commanded speed and move at constant acceleration; stop at the deck's edge.

    ``share`` is ``dt`` over the deck's size.
    """
    zero = lanes.splat(0.0)
    one = lanes.splat(1.0)
    wanted = lanes.splat(SPEED[axis]) * clip(lanes.load_column(actions, first, axis), -1.0, 1.0)
    change = ACCELERATION[axis] * dt
    old = lanes.load_row(values, _SPEED_X + axis, first)
    speed = old + clip(wanted - old, -change, change)
    place = lanes.fma(
        lanes.splat(0.5 * share), old + speed, lanes.load_row(values, _ALONG + axis, first)
    )
    beyond = (place < zero) | (place > one)
    lanes.store_row(values, _SPEED_X + axis, first, lanes.select(beyond, zero, speed))
    lanes.store_row(values, _ALONG + axis, first, clip(place, 0.0, 1.0))


@sy.inner
def _push(values, streams, settings, velocity, first, worlds):
    """Push the decks of the worlds whose time has come."""
    for w in range(first, min(first + lanes.LANES, worlds)):
        if values[_ELAPSED, w] >= values[_NEXT_PUSH, w]:
            pause = settings[_PUSH_PAUSE]
            values[_NEXT_PUSH, w] += math.ceil(pause * sy.uniform_between(streams, w, 0.5, 1.5))
            angle = 2.0 * math.pi * sy.uniform(streams, w)
            kick = settings[_PUSH] * sy.uniform(streams, w) / (LOAD + DECK_MASS)
            for p in range(2, 7):
                velocity[3 * p, w] += kick * math.cos(angle)
                velocity[3 * p + 2, w] += kick * math.sin(angle)


@sy.inner
def _control(actions, values, streams, settings, layout, state):
    """Move the load as commanded and push the deck when it is time."""
    dt = settings[_DT]
    weights = layout[_WEIGHTS]
    rates = layout[_RATES]
    accelerations = layout[_ACCELERATIONS]
    velocity = state[layout[_VELOCITY] :]
    one = lanes.splat(1.0)
    step = lanes.splat(dt)
    gain = lanes.splat(2.0 / (dt * dt))
    worlds = actions.shape[0]
    for first in range(0, worlds, lanes.LANES):
        u0 = lanes.load_row(values, _ALONG, first)
        v0 = lanes.load_row(values, _ACROSS, first)
        du = lanes.load_row(values, _SPEED_X, first) * lanes.splat(1.0 / LENGTH)
        dv = lanes.load_row(values, _SPEED_Z, first) * lanes.splat(1.0 / WIDTH)
        _move(actions, values, first, 0, dt, dt / LENGTH)
        _move(actions, values, first, 1, dt, dt / WIDTH)
        u1 = lanes.load_row(values, _ALONG, first)
        v1 = lanes.load_row(values, _ACROSS, first)
        # Corners are left back, left front, right back, right front.
        wanted = (one - u1) * (one - v1), (one - u1) * v1, u1 * (one - v1), u1 * v1
        starts = (
            -du * (one - v0) - (one - u0) * dv,
            (one - u0) * dv - du * v0,
            du * (one - v0) - u0 * dv,
            du * v0 + u0 * dv,
        )
        for k in range(4):
            rate = starts[k]
            lanes.store_row(state, rates + k, first, rate)
            change = wanted[k] - lanes.load_row(state, weights + k, first)
            lanes.store_row(state, accelerations + k, first, (change - rate * step) * gain)
        due = lanes.load_row(values, _ELAPSED, first) >= lanes.load_row(values, _NEXT_PUSH, first)
        if lanes.any_lane(due):
            _push(values, streams, settings, velocity, first, worlds)


@sy.inner
def _observe_block(first, position, velocity, values, state, observations):
    """Observations of a block of worlds; pitch and roll."""
    load = lanes.load_row
    # Corners are left back, left front, right back, right front.
    y00 = load(state, position + 7, first)
    y01 = load(state, position + 10, first)
    y10 = load(state, position + 13, first)
    y11 = load(state, position + 16, first)
    v00 = load(state, velocity + 7, first)
    v01 = load(state, velocity + 10, first)
    v10 = load(state, velocity + 13, first)
    v11 = load(state, velocity + 16, first)
    left = load(state, position + 8, first) + load(state, position + 11, first)
    right = load(state, position + 14, first) + load(state, position + 17, first)
    feet_x = load(state, position, first) + load(state, position + 3, first)
    feet_z = load(state, position + 2, first) + load(state, position + 5, first)
    half = lanes.splat(0.5)
    along = lanes.splat(0.5 / LENGTH)
    across = lanes.splat(0.5 / WIDTH)
    u = load(values, _ALONG, first)
    v = load(values, _ACROSS, first)
    pitch = clip((y10 + y11 - (y00 + y01)) * along, -1.0, 1.0)
    roll = clip((y01 + y11 - (y00 + y10)) * across, -1.0, 1.0)
    seen = (
        lanes.fma(lanes.splat(LENGTH), u, lanes.splat(LEFT)),
        lanes.splat(WIDTH) * (v - half),
        load(values, _SPEED_X, first),
        load(values, _SPEED_Z, first),
        pitch,
        roll,
        clip((v10 + v11 - (v00 + v01)) * along, -10.0, 10.0),
        clip((v01 + v11 - (v00 + v10)) * across, -10.0, 10.0),
        clip((right - left) * along, -1.0, 1.0),
        clip(load(state, position + 1, first), -1.0, 5.0),
        clip(load(state, position + 4, first), -1.0, 5.0),
        clip(half * feet_x, -5.0, 5.0),
        clip(half * feet_z, -5.0, 5.0),
    )
    lanes.store_columns(observations, first, seen)
    return pitch, roll


@sy.kernel
def _start(mask, values, streams, settings, layout, state, observations):
    """Begin an episode in the worlds of ``mask`` and observe them, and again those beside them."""
    _begin(mask, values, streams, settings, layout, state)
    worlds = mask.shape[0]
    for first in range(0, worlds, lanes.LANES):
        if mask[first : min(first + lanes.LANES, worlds)].any():
            _observe_block(first, layout[_POSITION], layout[_VELOCITY], values, state, observations)


@sy.inner
def _off_balance(state, position, velocity, first):
    """How far the extrapolated centre of mass of deck and load is from over the feet along x [m].

    The centre of mass x and its speed v, as x + v / w with w the rate at which the platform topples: what falls
    and what does not, whatever the deck's slope (Hof, Gazendam & Sinke 2005).
    """
    ahead = lanes.splat(TOPPLING_TIME)
    away = lanes.splat(0.0)
    for p in range(2, 7):
        share = LOAD if p == 6 else 0.25 * DECK_MASS
        speed = lanes.load_row(state, velocity + 3 * p, first)
        place = lanes.fma(ahead, speed, lanes.load_row(state, position + 3 * p, first))
        away = lanes.fma(lanes.splat(share / (LOAD + DECK_MASS)), place, away)
    feet = lanes.load_row(state, position, first) + lanes.load_row(state, position + 3, first)
    return away - lanes.splat(0.5) * feet


@sy.inner
def _judge(values, settings, layout, state, observations, rewards, flags):
    """Observations, rewards and flags after a step; the number of episodes that ended."""
    position = layout[_POSITION]
    velocity = layout[_VELOCITY]
    zero = lanes.splat(0.0)
    one = lanes.splat(1.0)
    half = lanes.splat(0.5)
    least = lanes.splat(FALLEN)
    limit = settings[_LIMIT] if settings[_LIMIT] > 0.0 else math.inf
    worlds = observations.shape[0]
    ended = 0
    for first in range(0, worlds, lanes.LANES):
        pitch, roll = _observe_block(first, position, velocity, values, state, observations)
        elapsed = lanes.load_row(values, _ELAPSED, first) + one
        lanes.store_row(values, _ELAPSED, first, elapsed)
        broken = lanes.load_row(state, layout[_NONFINITE], first) > zero
        fallen = broken | (lanes.absolute(pitch) > least) | (lanes.absolute(roll) > least)
        late = elapsed >= lanes.splat(limit)
        standing = lanes.select(fallen, zero, elapsed)
        slope = lanes.fma(pitch, pitch, roll * roll)
        level = half / lanes.fma(lanes.splat(100.0), slope, one)
        offset = lanes.splat(10.0) * _off_balance(state, position, velocity, first)
        balance = half / lanes.fma(offset, offset, one)
        level = lanes.select(broken, zero, level)
        balance = lanes.select(broken, zero, balance)
        speed_x = lanes.load_row(values, _SPEED_X, first)
        speed_z = lanes.load_row(values, _SPEED_Z, first)
        square = lanes.fma(speed_x, speed_x, speed_z * speed_z)
        effort = lanes.splat(-0.1 / (SPEED[0] * SPEED[0])) * square
        fall = lanes.select(fallen, lanes.splat(-10.0), zero)
        lanes.store_row(rewards, 0, first, level + balance + effort + fall)
        lanes.store_row(rewards, 1, first, level)
        lanes.store_row(rewards, 2, first, balance)
        lanes.store_row(rewards, 3, first, effort)
        lanes.store_row(rewards, 4, first, fall)
        lanes.store_row(flags, TERMINATED, first, fallen)
        lanes.store_row(flags, TRUNCATED, first, late)
        lanes.store_row(flags, SUCCESS, first, standing >= lanes.splat(float(EPISODE)))
        lanes.store_row(flags, PHYSICS_ERROR, first, broken)
        if lanes.any_lane(fallen | late):
            for w in range(first, min(first + lanes.LANES, worlds)):
                if flags[TERMINATED, w] or flags[TRUNCATED, w]:
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
    return _judge(values, settings, layout, state, observations, rewards, flags)


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
        ("rattle", 50.0, 6.5e-4, 1.0),
        ("rattle", 100.0, 2.0e-4, 1.3),
        ("rattle", 200.0, 1.1e-4, 1.8),
        ("rattle", 400.0, 2.6e-5, 3.2),
        ("rattle", 800.0, 6.9e-6, 5.8),
        ("rattle", 1600.0, 2.9e-6, 11.0),
        ("symplectic_euler", 50.0, 9.5e-3, 1.4),
        ("gauss_seidel", 50.0, 2.8e-2, 3.4),
    )
    value_rows: ClassVar = 6

    def build(self) -> sy.World:
        """Seven particles: feet, corners, load."""
        integrator = sy.SymplecticEuler() if self.method == "symplectic_euler" else sy.Rattle()
        solver = (
            sy.GaussSeidel(passes=30)
            if self.method == "gauss_seidel"
            else sy.Direct(tolerance=_TOLERANCE / self.physics_rate**3)
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
        _start(
            mask, self.values, self.streams, self.settings, self.layout, self.world.state,
            self.observations,
        )  # fmt: skip

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

    `tolerance` goes by the worst of the 32 worlds, against 6400 Hz: `"rattle"` holds 6.5e-4 m at 50 Hz (the default),
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
