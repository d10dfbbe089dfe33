"""Bridge: keep a suspended deck level and quiet while a load crosses it in the wind."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, ClassVar

import numpy as np

import steelyard as sy
from steelyard_envs import bridge_kernels as kernels
from steelyard_envs.bridge_kernels import LONG, PAIRS, SHORT, START
from steelyard_envs.bridge_picture import (
    draw_cables,
    draw_deck,
    draw_level,
    draw_load,
    draw_towers,
    draw_wind,
)
from steelyard_envs.single import TaskEnv
from steelyard_envs.task import Array, Task
from steelyard_envs.vector import TaskVectorEnv

LOAD = 10.0  # [kg]
SENSOR_TIME = 0.1  # in which a sensor follows a change of force [s]
STARTS = 16  # settled bridges to start from
SETTLE_RATE, SETTLE_STEPS, SETTLE_DAMPING = 50.0, 2000, 0.1


def settle(scene: sy.Scene, lengths: Array) -> sy.World:
    """Bridges at rest, by stepping them with strong damping.

    Args:
        scene: a bridge with winches.
        lengths: of the cables of each pair [m], shape (worlds, pairs).
    """
    method = sy.Method(sy.Rattle(), sy.Direct(), dt=1.0 / SETTLE_RATE)
    world = sy.World(scene, worlds=len(lengths), method=method)
    world.particles.damping = SETTLE_DAMPING
    for k, cable in enumerate(scene.of(sy.CableConstraint)):
        world[cable].length = lengths[:, k // 2]
    world.step(SETTLE_STEPS)
    world.particles.velocity[:] = 0.0
    return world


@cache
def _starts(method: sy.Method, spread: float) -> Array:
    """States of STARTS settled bridges for worlds of ``method``, shape (state rows, STARTS)."""
    scene = _scene()
    cables = scene.of(sy.CableConstraint)
    streams = np.stack([np.arange(STARTS), np.zeros(STARTS)]).astype(np.uint64)
    usual = [cable.max_length for cable in cables[::2]]
    lengths = np.array(
        [
            [length + sy.uniform_between(streams, w, -spread, spread) for length in usual]
            for w in range(STARTS)
        ]
    )
    settled = settle(scene, lengths)
    world = sy.World(scene, worlds=STARTS, method=method)
    world.particles.position[:] = settled.particles.position
    weight = _force(settled.method) / _force(method)
    for cable in cables:
        world[cable].length = settled[cable].length
    for thing in scene.of(sy.Cable, sy.CableConstraint, sy.Rod, sy.Rider):
        world[thing].multiplier = weight * settled[thing].multiplier
    return world.state[:, :STARTS].copy()


def _scene() -> sy.Scene:
    return sy.scenes.bridge(load=LOAD, place=(START, 0.5), winches=True)


def _force(method: sy.Method) -> float:
    """Force over a position stage's impulse [1/s^2]: it moves by half of h^2, or by all of it."""
    return (2.0 if isinstance(method.integrator, sy.Rattle) else 1.0) / method.dt**2


class BridgeTask(Task):
    """Scene and kernels of Bridge; see ``BridgeEnv``."""

    observation_table: ClassVar = (
        *((f"height of pair {k} above the level", -2.0, 2.0, "m") for k in range(PAIRS)),
        *((f"vertical speed of pair {k}", -5.0, 5.0, "m/s") for k in range(PAIRS)),
        *((f"roll: sine of the slope across at pair {k}", -1.0, 1.0, "") for k in range(PAIRS)),
        *((f"length of the cables of pair {k}", SHORT, LONG, "m") for k in range(PAIRS)),
        *((f"tension of pair {k} over the stall", 0.0, 5.0, "") for k in range(PAIRS)),
        ("place of the load along the deck", -3.8, 3.8, "m"),
        ("place of the load across the deck", -1.0, 1.0, "m"),
        ("speed of the load along the deck", -2.0, 2.0, "m/s"),
        ("speed of the load across the deck", -0.5, 0.5, "m/s"),
        ("height of the load above the level", -2.0, 2.0, "m"),
        ("slope along under the load", -1.0, 1.0, ""),
        ("slope across under the load", -1.0, 1.0, ""),
    )
    action_table: ClassVar = tuple(f"speed of the winches of pair {k}" for k in range(PAIRS))
    terms: ClassVar = ("level", "quiet", "effort", "fall")
    methods: ClassVar = ("rattle", "symplectic_euler", "gauss_seidel")
    default_physics_rate: ClassVar = 50.0
    # python -m benchmarks.environment_error steelyard/Bridge-v0 --rates 50 100 200 400 800 1600 --reference 6400
    # --seconds 1 --rows 32 --difficulty 1 --amplitude 0.3
    measured: ClassVar = (
        ("rattle", 50.0, 6.3e-5, 1.0),
        ("rattle", 100.0, 3.3e-5, 1.4),
        ("rattle", 200.0, 1.8e-5, 3.0),
        ("rattle", 400.0, 1.1e-5, 5.8),
        ("rattle", 800.0, 6.3e-6, 10.0),
        ("rattle", 1600.0, 5.2e-6, 17.0),
        ("gauss_seidel", 50.0, 5.0e-5, 4.3),
        ("symplectic_euler", 50.0, 2.7e-3, 1.4),
    )
    value_rows: ClassVar = kernels.ROWS

    def build(self) -> sy.World:
        """Twelve nodes, their cables, winches and rods, and the load."""
        integrator = sy.SymplecticEuler() if self.method == "symplectic_euler" else sy.Rattle()
        solver = (
            sy.GaussSeidel(passes=60)
            if self.method == "gauss_seidel"
            else sy.Direct(tolerance=1e-8)
        )
        method = sy.Method(integrator, solver, dt=1.0 / self.physics_rate)
        scene = _scene()
        self._everyone = np.ones(self.num_envs, dtype=np.bool_)
        self._anchors = np.array([cable.anchor for cable in scene.of(sy.CableConstraint)])
        self._starts = _starts(method, (0.0, 0.1, 0.1)[self.difficulty - 1])
        return sy.World(scene, worlds=self.num_envs, method=method)

    def level_settings(self) -> tuple[float, ...]:
        """Force per multiplier, sensor's share, wind [N], drift, chances to pause and turn."""
        share = 1.0 - math.exp(-1.0 / (self.physics_rate * SENSOR_TIME))
        level = ((1.5, 0.0, 0.0, 0.0), (3.0, 0.2, 0.3, 0.0), (5.0, 0.35, 0.3, 0.25))
        return _force(self.world.method), share, *level[self.difficulty - 1]

    def rows(self) -> tuple[int, ...]:
        """Rows of the state that the kernels touch."""
        row = self.world.row
        scene = self.world.scene
        rider = scene.of(sy.Rider)[0]
        return (
            row("particles", "position"),
            row("particles", "velocity"),
            row(rider, "weights"),
            row(rider, "rates"),
            row(rider, "accelerations"),
            row(rider, "multiplier"),
            row("particles", "nonfinite"),
            *(
                row(cable, name)
                for name in ("length", "rate", "acceleration", "multiplier")
                for cable in scene.of(sy.CableConstraint)
            ),
        )

    def start(self, mask: Array) -> None:
        """A settled bridge with the load at the start of its way."""
        kernels.begin(
            mask, self.values, self.streams, self.settings, self.layout, self._starts,
            self.world.state,
        )  # fmt: skip
        kernels.observe(mask, self.values, self.layout, self.world.state, self.observations)

    def step(self, actions: Array) -> int:
        """One control step of all worlds."""
        ended: int = kernels.step(
            actions, self._everyone, self.values, self.streams, self.settings, self.layout,
            self.observations, self.rewards, self.flags, self.world.state, self.world.launch, self.substeps,
        )  # fmt: skip
        return ended

    @property
    def camera(self) -> dict[str, Any]:
        """From the front, a little to the side and above."""
        return {
            "target": (0.0, 3.05, 0.0), "distance": 21.0, "azimuth": 24.0, "elevation": 9.0,
            "field_of_view": 30.0,
        }  # fmt: skip

    def drawing(self, index: int) -> sy.draw.Drawing:
        """Deck, cables, towers, load, level, wind and a panel."""
        values, position = self.values[:, index], self.world.particles.position[index]
        near, far = position[0:-1:2], position[1::2]
        observation = self.observations[index]
        drawing = sy.draw.Drawing()
        draw_towers(drawing)
        draw_level(drawing, values[kernels.HEIGHT])
        draw_deck(drawing, near, far)
        pulls = np.repeat(observation[24:30], 2)
        draw_cables(drawing, position[:-1], self._anchors, pulls)
        frame = (self.values, self.layout, self.world.state, index)
        along, across = np.array([kernels.deck(*frame, c) for c in range(3)]).T
        draw_load(drawing, position[-1], along, across)
        time = values[kernels.ELAPSED] / self.control_rate
        strength = kernels.gust_strength(self.values, index, time)
        wind = strength * values[[kernels.GUST_X, kernels.GUST_Z]]
        draw_wind(drawing, 2.0 * values[kernels.GUST_PLACE] - 5.0, wind)
        error = math.sqrt(np.mean(np.square(observation[:PAIRS], dtype=np.float64)))
        drawing.text("time", value=f"{time:.2f} s")
        drawing.text("off the level", value=f"{error:.2f} m")
        drawing.text("heaviest pull", value=f"{kernels.STALL * pulls.max():.0f} N")
        drawing.text("gust", value=f"{math.hypot(*wind):.1f} N")
        return drawing


class BridgeEnv(TaskEnv):
    """
    ## Description
    A deck of six node pairs, 1.9 m apart, hangs from a pair of cables per node pair, each pair on
    winches that turn together. A load of 10 kg, nearly the deck's own weight, crosses it on a
    schedule that is not known beforehand, while gusts set the deck swinging. At the start the deck
    sags by more than a metre. Bring it to a given level and keep it there, quiet, with the load on
    it. What makes it hard is that the winches are too weak for the load: a pair that carries all of
    it pulls them backwards, so it must be raised before the load comes and hauled back after.

    Axes: y is up, the deck runs along x from pair 0 to pair 5, z is across.

    ## Action Space
    `Box(-1.0, 1.0, (6,), float32)`. Values out of range are clipped, NaN counts as 0. Positive
    values haul in, so the pair rises.

    | Num | Action | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | speed of the winches of pair 0 | -1 | 1 | 0.4 m/s |
    | 1 | speed of the winches of pair 1 | -1 | 1 | 0.4 m/s |
    | 2 | speed of the winches of pair 2 | -1 | 1 | 0.4 m/s |
    | 3 | speed of the winches of pair 3 | -1 | 1 | 0.4 m/s |
    | 4 | speed of the winches of pair 4 | -1 | 1 | 0.4 m/s |
    | 5 | speed of the winches of pair 5 | -1 | 1 | 0.4 m/s |

    Speeds change by at most 2 m/s^2. Cables stay between 2.6 and 4.4 m: near an end of this range a
    winch slows down so that it covers a tenth of the rest in a control step. A motor has a line: a
    pair of cables of tension T is hauled in no faster than (90 N - T) / (100 N s/m), which is less
    than nothing beyond the stall of 90 N: there it pays out, at most at 0.4 m/s. T is smoothed over
    0.1 s. The load at a pair makes it about 106 N, the bare deck about 20 N.

    ## Observation Space
    `Box((37,), float32)`. A pair's height, speed and roll are those of the rod between its two
    nodes.

    | Num | Observation | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | height of pair 0 above the level | -2 | 2 | m |
    | 1 | height of pair 1 above the level | -2 | 2 | m |
    | 2 | height of pair 2 above the level | -2 | 2 | m |
    | 3 | height of pair 3 above the level | -2 | 2 | m |
    | 4 | height of pair 4 above the level | -2 | 2 | m |
    | 5 | height of pair 5 above the level | -2 | 2 | m |
    | 6 | vertical speed of pair 0 | -5 | 5 | m/s |
    | 7 | vertical speed of pair 1 | -5 | 5 | m/s |
    | 8 | vertical speed of pair 2 | -5 | 5 | m/s |
    | 9 | vertical speed of pair 3 | -5 | 5 | m/s |
    | 10 | vertical speed of pair 4 | -5 | 5 | m/s |
    | 11 | vertical speed of pair 5 | -5 | 5 | m/s |
    | 12 | roll: sine of the slope across at pair 0 | -1 | 1 | - |
    | 13 | roll: sine of the slope across at pair 1 | -1 | 1 | - |
    | 14 | roll: sine of the slope across at pair 2 | -1 | 1 | - |
    | 15 | roll: sine of the slope across at pair 3 | -1 | 1 | - |
    | 16 | roll: sine of the slope across at pair 4 | -1 | 1 | - |
    | 17 | roll: sine of the slope across at pair 5 | -1 | 1 | - |
    | 18 | length of the cables of pair 0 | 2.6 | 4.4 | m |
    | 19 | length of the cables of pair 1 | 2.6 | 4.4 | m |
    | 20 | length of the cables of pair 2 | 2.6 | 4.4 | m |
    | 21 | length of the cables of pair 3 | 2.6 | 4.4 | m |
    | 22 | length of the cables of pair 4 | 2.6 | 4.4 | m |
    | 23 | length of the cables of pair 5 | 2.6 | 4.4 | m |
    | 24 | tension of pair 0 over the stall | 0 | 5 | - |
    | 25 | tension of pair 1 over the stall | 0 | 5 | - |
    | 26 | tension of pair 2 over the stall | 0 | 5 | - |
    | 27 | tension of pair 3 over the stall | 0 | 5 | - |
    | 28 | tension of pair 4 over the stall | 0 | 5 | - |
    | 29 | tension of pair 5 over the stall | 0 | 5 | - |
    | 30 | place of the load along the deck | -3.8 | 3.8 | m |
    | 31 | place of the load across the deck | -1 | 1 | m |
    | 32 | speed of the load along the deck | -2 | 2 | m/s |
    | 33 | speed of the load across the deck | -0.5 | 0.5 | m/s |
    | 34 | height of the load above the level | -2 | 2 | m |
    | 35 | slope along under the load | -1 | 1 | - |
    | 36 | slope across under the load | -1 | 1 | - |

    ## Rewards
    The sum of
    - `reward_level`: the mean over pairs of 1 / (1 + (h / 0.15 m)^2), h a pair's height above the
      level;
    - `reward_quiet`: -0.1 min((v / 0.1 m/s)^2, 1), v the rms vertical speed of the pairs;
    - `reward_effort`: -0.05 times the mean square of the winches' speeds over 0.4 m/s;
    - `reward_fall`: -50 when the load falls.

    ## Starting State
    The bridge hangs at rest under the load, which stands half a plank from pair 0, amid the deck.
    Cable lengths are 3, 3.5, 4, 4, 3.5 and 3 m by pair, at levels 2 and 3 each changed by up to 0.1
    m: 16 such bridges are brought to rest once per process, and one is drawn. The level to hold is
    uniform in 2.4 to 2.6 m.

    The load sets out after 2 to 4 s for a place half a plank before pair 5. It goes in legs: it
    walks at 0.25 to 0.6 planks/s for 1 to 3 s, or pauses or turns back (0.2 to 0.4 planks/s) for
    0.5 to 1.5 s, speeds up by at most 0.4 planks/s^2 and makes haste to be there by 19.5 s; with each
    leg it heads for another place across. A gust lasts 0.6 to 2 s and the next follows 0.2 to 1.5 s
    later; it swells and fades, and is strongest (force on a node as below, half of it along x)
    around a random place, 1 plank wide.

    | `difficulty` | Gust across [N] | Load strays across by [m] | Leg is a pause | Leg turns back |
    |---|---|---|---|---|
    | 1 | up to 1.5 | 0 | never | never |
    | 2 | up to 3 | 0.4 | 3 in 10 | never |
    | 3 | up to 5 | 0.7 | 3 in 10 | 1 in 4 |

    ## Episode End
    Terminated when the load falls: the force of the deck on it, smoothed over 0.1 s, leaves the
    friction cone about the deck's normal, of coefficient 0.6. The load then slides off, or it has
    been thrown. A slope of 31 degrees suffices, or less with a jerk. Truncated after 1000 steps (20
    s; where `control_rate` is not 50, give `max_episode_steps`). `is_success` says that the load
    has arrived, is still on the deck, and that the rms of h was at most 0.1 m on its way.

    ## Arguments
    - `difficulty`: 1, 2 (default) or 3.
    - `method`: "rattle" (default), "symplectic_euler" or "gauss_seidel", see Physics.
    - `physics_rate`, `control_rate`: steps per second, 50 and 50 by default.
    - `tolerance`: instead of a method and a physics rate, the cheapest pair that was measured to hold this error [m];
      see Physics.
    - `render_mode`: None, "human" or "rgb_array".

    ## Physics
    Nodes of 1 kg, cables of 1.9 m between the pairs, rods of 2 m across, as in
    `steelyard.scenes.bridge`; the load is a rider whose weight is spread over half a plank.
    "rattle" is RATTLE with the direct solver, which holds rods and taut cables to 1e-8 of their
    length; "symplectic_euler" has the same solver, "gauss_seidel" is RATTLE with 60 sweeps. Within
    a control step load and winches move at constant acceleration, and a gust is an impulse at its
    start. The tension is that of the position stage; symplectic Euler sees only half of a mass's
    inertia there, so its motors err.

    Largest distance [m] of a particle from the default method at 3200 Hz within 2 s, median and
    95 % quantile of 64 rows at level 2, with random actions within 0.3 or 1 that are held for
    0.5 s: `python -m benchmarks.environment_error steelyard/Bridge-v0`, with `--amplitude 0.3`.
    The cost of a step is relative to the default's.

    | Method | Hz | Within 0.3 | Within 1 | Cost |
    |---|---|---|---|---|
    | `"rattle"` | 50 | 4.2e-5, 1.8e-4 | 1.1e-3, 1.4e-2 | 1.0 |
    | `"rattle"` | 100 | 1.1e-5, 4.7e-4 | 9.6e-4, 1.0e-2 | 1.6 |
    | `"rattle"` | 200 | 3.0e-6, 3.9e-4 | 6.3e-4, 1.1e-2 | 2.4 |
    | `"rattle"` | 400 | 7.8e-7, 3.5e-4 | 4.8e-4, 6.7e-3 | 4.2 |
    | `"symplectic_euler"` | 50 | 2.3e-4, 3.0e-3 | 8.8e-3, 2.1e-2 | 1.3 |
    | `"symplectic_euler"` | 400 | 4.9e-5, 2.9e-3 | 8.1e-3, 1.6e-2 | 9.4 |
    | `"gauss_seidel"` | 50 | 4.1e-5, 1.8e-4 | 7.8e-4, 1.3e-2 | 3.2 |
    | `"gauss_seidel"` | 400 | 9.0e-7, 3.3e-4 | 3.4e-4, 4.9e-3 | 20 |

    `tolerance` goes by the worst of 32 worlds after 1 s at level 1, actions within 0.3, against 6400 Hz: "rattle" holds
    6.3e-5 m at 50 Hz (the default), 3.3e-5 at 100, 1.8e-5 at 200, 1.1e-5 at 400, 6.3e-6 at 800 and 5.2e-6 at 1600.

    The larger actions haul neighbours apart until cables fall slack and snap taut again. Where a
    node goes then depends on the order of such impacts, so that higher rates gain little; while
    cables stay taut, 50 Hz holds 2e-4 m. It is therefore the default.

    ## Baselines
    100 episodes, seeds 1,000,000 to 1,000,099, `python -m steelyard_agents.evaluate controller
    --env steelyard/Bridge-v0` (or `random`): mean return, and successes.

    | `difficulty` | Random | Doing nothing | Controller |
    |---|---|---|---|
    | 1 | -74.0, 0 | -18.3, 0 | 885.8, 100 |
    | 2 | -77.8, 0 | -45.6, 0 | 853.5, 99 |
    | 3 | -82.0, 0 | -63.7, 0 | 750.2, 93 |

    ## Version History
    - v0: first version.
    """

    task_class = BridgeTask


class BridgeVectorEnv(TaskVectorEnv):
    """Bridge, many at once; see ``BridgeEnv``."""

    task_class = BridgeTask
