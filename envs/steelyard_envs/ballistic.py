"""Ballistic: lay a gun on a target, allow for its motion and the wind, and fire."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

import steelyard as sy
from steelyard_envs import ballistic_kernels as kernels
from steelyard_envs.ballistic_flight import (
    EVENT,
    FLYING,
    HIT,
    LIFE,
    MARK,
    MISS,
    MUZZLE,
    ROWS,
    TARGET,
    target_motion,
)
from steelyard_envs.ballistic_kernels import (
    AZIMUTH_MOST,
    ELEVATION_LEAST,
    ELEVATION_MOST,
    FLIGHT,
    RELOAD,
    SHOTS,
)
from steelyard_envs.ballistic_picture import draw_field, draw_gun, draw_mark, draw_shot, draw_target
from steelyard_envs.single import TaskEnv
from steelyard_envs.task import Array, Task
from steelyard_envs.vector import TaskVectorEnv

DAMPING = 0.8
WEAVE_TIME = 6.0  # period of the weave [s]


class BallisticTask(Task):
    """Scene of Ballistic, its levels and its picture; see ``BallisticEnv``.

    Args:
        num_envs: number of worlds.
        shot: kind of shot, a key of ``steelyard.scenes.SHOTS``.
        damping: share of its velocity relative to the air that a shot keeps per second, in (0, 1];
            None for the shot's own.
        **task: the other arguments of a task.

    Raises:
        ValueError: an argument out of range.
    """

    observation_table: ClassVar = (
        ("azimuth of the barrel", -AZIMUTH_MOST, AZIMUTH_MOST, "rad"),
        ("elevation of the barrel", ELEVATION_LEAST, ELEVATION_MOST, "rad"),
        ("time until reloaded", 0.0, RELOAD, "s"),
        ("shots left", 0.0, float(SHOTS), ""),
        ("range of the target", 0.0, 500.0, "m"),
        ("bearing of the target from the barrel", -3.0, 3.0, "rad"),
        ("height of the target", 0.0, 50.0, "m"),
        ("velocity of the target along", -50.0, 50.0, "m/s"),
        ("velocity of the target across", -50.0, 50.0, "m/s"),
        ("wind along", -20.0, 20.0, "m/s"),
        ("wind across", -20.0, 20.0, "m/s"),
        ("whether a shot flies", 0.0, 1.0, ""),
        ("shot from target along", -500.0, 500.0, "m"),
        ("shot from target across", -500.0, 500.0, "m"),
        ("shot from target up", -500.0, 500.0, "m"),
        ("velocity of the shot along", -150.0, 150.0, "m/s"),
        ("velocity of the shot across", -150.0, 150.0, "m/s"),
        ("velocity of the shot up", -150.0, 150.0, "m/s"),
        ("time in flight", 0.0, LIFE, "s"),
        ("last miss along", -500.0, 500.0, "m"),
        ("last miss across", -500.0, 500.0, "m"),
        ("last miss up", -500.0, 500.0, "m"),
    )
    action_table: ClassVar = ("azimuth rate", "elevation rate", "trigger")
    terms: ClassVar = ("hit", "near", "shot", "time")
    methods: ClassVar = ("closed_form", "rattle", "source")
    default_physics_rate: ClassVar = 50.0
    # pytest tests/envs/test_ballistic_flight.py -k measured -s
    measured: ClassVar = (
        ("closed_form", 50.0, 1e-12, 1.0),
        ("rattle", 50.0, 7.1e-4, 1.2),
        ("rattle", 200.0, 4.4e-5, 2.0),
        ("source", 50.0, 0.64, 1.1),
    )
    value_rows: ClassVar = FLIGHT + ROWS

    def __init__(
        self,
        num_envs: int,
        *,
        shot: str = "artillery",
        damping: float | None = DAMPING,
        **task: Any,
    ) -> None:
        name, kinds = type(self).__name__, sy.scenes.SHOTS
        if shot not in kinds:
            raise ValueError(f"{name}: shot is {shot!r}; it must be one of {', '.join(kinds)}.")
        self.shot = kinds[shot]
        self.damping = self.shot.damping if damping is None else float(damping)
        if not 0.0 < self.damping <= 1.0:
            raise ValueError(
                f"{name}: damping is {damping!r}; it must be in (0, 1]. Use 1 for no drag, None "
                "for the shot's own."
            )
        super().__init__(num_envs, **task)
        self._everyone = np.ones(num_envs, dtype=np.bool_)

    @property
    def flight(self) -> Array:
        """The rows of ``values`` that hold shot and target, see ``ballistic_flight``."""
        return self.values[FLIGHT:]

    def build(self) -> sy.World:
        """One particle per world: the shot in flight, at rest at the pivot while there is none."""
        integrator: Any = {
            "closed_form": sy.ClosedForm, "rattle": sy.Rattle, "source": sy.ExplicitEuler
        }[self.method]  # fmt: skip
        weight = (0.0, self.shot.acceleration, 0.0)
        scene = sy.Scene(gravity=weight)
        scene.add(
            sy.Particle(position=(0.0, MUZZLE, 0.0), mass=self.shot.mass, damping=self.damping)
        )
        method = sy.Method(integrator(), dt=1.0 / self.physics_rate)
        world = sy.World(scene, worlds=self.num_envs, method=method)
        # Every world gets an acceleration of its own: the rows of ``given``, written at each step.
        world.gravity = np.tile(weight, (self.num_envs, 1))
        return world

    def level_settings(self) -> tuple[float, ...]:
        """The entries ``RADIUS`` to ``RELOAD_STEPS`` of the kernels' settings."""
        speed = math.hypot(*self.shot.velocity)
        far = min(1.2 * speed, 60.0)
        radius, weave, wind, seen, moves = (
            (0.025, 0.0, 10.0, 1.0, 0.0),
            (0.02, 0.0, 20.0, 1.0, 1.0),
            (0.015, 0.03, 20.0, 0.0, 1.0),
        )[self.difficulty - 1]
        return (
            radius * far, weave * far, 2.0 * math.pi / WEAVE_TIME, wind, seen, moves, 0.5 * far,
            far, speed, self.shot.acceleration, -math.log(self.damping),
            math.ceil(RELOAD * self.control_rate - 1e-9),
        )  # fmt: skip

    def rows(self) -> tuple[int, ...]:
        """Rows of the state that the kernels touch."""
        row = self.world.row
        return (
            row("particles", "position"),
            row("particles", "velocity"),
            row("particles", "nonfinite"),
        )

    def start(self, mask: Array) -> None:
        """A new target, a new wind, a full magazine."""
        self.world.reset(mask)
        kernels.begin(mask, self.values, self.flight, self.streams, self.settings)
        kernels.observe(
            mask, self.values, self.flight, self.settings, self.layout, self.world.state,
            self.observations,
        )  # fmt: skip

    def step(self, actions: Array) -> int:
        """One control step of all worlds."""
        ended: int = kernels.step(
            actions, self._everyone, self.values, self.flight, self.settings, self.layout,
            self.observations, self.rewards, self.flags, self.world.state, self.world.given,
            self.world.launch, self.substeps,
        )  # fmt: skip
        return ended

    @property
    def camera(self) -> dict[str, Any]:
        """From behind the gun and above it, the nearer the shorter its range."""
        scale = max(self.settings[kernels.FAR] / 60.0, 0.4)
        return {
            "target": (0.0, 4.5 * scale, 14.0 * scale), "distance": 38.0 * scale, "azimuth": 187.0,
            "elevation": 11.0, "field_of_view": 44.0,
        }  # fmt: skip

    def drawing(self, index: int) -> sy.draw.Drawing:
        """Gun, target, shot with its trail, where the last one ended, the field and a panel."""
        values, flight = self.values[:, index], self.flight[:, index]
        dt, drag, radius = (self.settings[k] for k in (kernels.DT, kernels.DRAG, kernels.RADIUS))
        wind = values[[kernels.WIND_X, kernels.WIND_Z]]
        x, z, _, _ = target_motion(self.flight, index, self.settings[kernels.WEAVE_RATE], 0.0)
        since = (values[kernels.ELAPSED] - values[kernels.FIRED_AT]) * dt
        hit, miss = flight[EVENT] == HIT, np.linalg.norm(flight[MISS : MISS + 3])
        drawing = sy.draw.Drawing()
        draw_field(
            drawing, self.settings[kernels.FAR], wind, seen=self.settings[kernels.WIND_SEEN] > 0.0
        )
        draw_gun(drawing, values[kernels.AZIMUTH], values[kernels.ELEVATION])
        draw_target(drawing, (x, flight[TARGET + 1], z), radius)
        if flight[FLYING] > 0.0:
            pull = (drag * wind[0], self.shot.acceleration, drag * wind[1])
            particles = self.world.particles
            place, velocity = particles.position[index, 0], particles.velocity[index, 0]
            draw_shot(drawing, place, velocity, pull, drag, since, 0.35 * radius)
        elif hit or miss > 0.0:
            draw_mark(drawing, flight[MARK : MARK + 3], radius, hit=hit)
        drawing.text("time", value=f"{values[kernels.ELAPSED] * dt:.2f} s")
        drawing.text("shots left", value=f"{values[kernels.LEFT]:.0f} of {SHOTS}")
        drawing.text("reload", value=f"{max(RELOAD - since, 0.0):.1f} s")
        drawing.text("last miss", value="hit" if hit else f"{miss:.1f} m" if miss > 0.0 else "-")
        return drawing


class BallisticEnv(TaskEnv):
    """Lay a gun on a target, allow for its motion and the wind, and fire.

    ## Description
    A gun that turns and elevates at limited rates fires shots at a ball on a post. The target
    stands still, runs or weaves, and the wind drifts the shot. The gun holds six shots, of which
    one flies at a time; one hit wins. The aim must be right seconds before the outcome shows: the
    shot falls, slows, drifts, and must meet the target where it will be by then. Where the wind is
    hidden, only the flight and the miss of the last shot tell of it.

    Axes: y is up; the pivot of the barrel is at (0, 1.5, 0) m; azimuth 0 is +z, a quarter turn is
    +x.

    ## Action Space
    `Box(-1, 1, (3,), float32)`. Values out of range are clipped, NaN counts as 0.

    | Num | Action | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | azimuth rate | -1 | 1 | rad/s |
    | 1 | elevation rate | -1 | 1 | 0.5 rad/s |
    | 2 | trigger | -1 | 1 | fires above 0 |

    The barrel stops at azimuths of 1.5 rad to either side and at elevations of -0.25 and 1.4 rad. A
    shot leaves the pivot along the barrel as it was observed, before this step turns it. The
    trigger does nothing while a shot flies, for 1 s after the last shot, and with no shot left.

    ## Observation Space
    `Box((22,), float32)`. "Along" is the horizontal line of sight from gun to target, "across" is
    at right angles to it, towards growing azimuth; both turn with the target. Velocities are over
    the ground.

    | Num | Observation | Min | Max | Unit |
    |---|---|---|---|---|
    | 0 | azimuth of the barrel | -1.5 | 1.5 | rad |
    | 1 | elevation of the barrel | -0.25 | 1.4 | rad |
    | 2 | time until reloaded | 0 | 1 | s |
    | 3 | shots left | 0 | 6 | - |
    | 4 | range of the target | 0 | 500 | m |
    | 5 | bearing of the target from the barrel | -3 | 3 | rad |
    | 6 | height of the target | 0 | 50 | m |
    | 7 | velocity of the target along | -50 | 50 | m/s |
    | 8 | velocity of the target across | -50 | 50 | m/s |
    | 9 | wind along | -20 | 20 | m/s |
    | 10 | wind across | -20 | 20 | m/s |
    | 11 | whether a shot flies | 0 | 1 | - |
    | 12 | shot from target along | -500 | 500 | m |
    | 13 | shot from target across | -500 | 500 | m |
    | 14 | shot from target up | -500 | 500 | m |
    | 15 | velocity of the shot along | -150 | 150 | m/s |
    | 16 | velocity of the shot across | -150 | 150 | m/s |
    | 17 | velocity of the shot up | -150 | 150 | m/s |
    | 18 | time in flight | 0 | 5 | s |
    | 19 | last miss along | -500 | 500 | m |
    | 20 | last miss across | -500 | 500 | m |
    | 21 | last miss up | -500 | 500 | m |

    Observations 12 to 18 are 0 while no shot flies. The wind is 0 where it is hidden. The last miss
    is the way from the target's centre to the shot where it came closest in the last flight; for a
    shot that falls short that is where it comes down. It is 0 before the first flight has ended.
    Numbers beyond their bounds are clipped.

    ## Rewards
    The sum of
    - `reward_hit`: 5 for a hit;
    - `reward_near`: 5 times, when a shot ends, its closeness less that of the shot before it (0 for
      the first). Closeness is 1 for a hit, else 1 / (1 + miss / (far / 12)) with the least distance
      to the target's centre as miss and far as below: 5 m for artillery. An episode's sum is that
      of its last shot, so near misses on the way to a hit pay nothing;
    - `reward_shot`: -0.1 per shot;
    - `reward_time`: -0.25 per second.

    ## Starting State
    Uniformly random are the barrel's azimuth within 0.6 rad to either side and its elevation from 0
    to 0.5 rad; the wind's direction and its speed up to the most of the level; and the target's
    place: range from far / 2 to far with far = 1.2 s times the muzzle speed, at most 60 m; azimuth
    within 0.6 rad to either side; height of its centre from radius to radius + far / 10. A target
    that moves runs straight to another such place in 12 s.

    | `difficulty` | Radius of the target | Target | Wind |
    |---|---|---|---|
    | 1 | 0.025 far (artillery: 1.5 m) | at rest | up to 10 m/s, observed |
    | 2 | 0.02 far (1.2 m) | runs | up to 20 m/s, observed |
    | 3 | 0.015 far (0.9 m) | runs, weaving 0.03 far to either side in 6 s | up to 20 m/s, hidden |

    ## Episode End
    Terminated when a shot hits the target (then `is_success`), when the last shot has ended without
    a hit, or when the physics goes wrong (`physics_error`); truncated after 600 steps (12 s). A
    shot ends where it hits, on the ground, beyond 200 m, or after 5 s. Hits are decided on the
    swept path, from the least distance of the closed-form flight and the moving target within each
    step, never by looking at the steps' ends: a shot of 100 m/s (2 m a step) cannot pass through a
    target of any size.

    ## Arguments
    - `difficulty`: 1, 2 (default) or 3.
    - `shot`: "artillery" (default), "pistol", "fireball" or "laser": mass, muzzle speed and
      vertical acceleration of `steelyard.scenes.SHOTS`.
    - `damping`: share of its velocity relative to the air that a shot keeps per second, 0.8 by
      default; None for that of the kind of shot. With the artillery's 0.99 the strongest wind
      drifts a shot by 0.2 m in 1.5 s, so that it could be ignored; with 0.8 by 4.5 m.
    - `method`: "closed_form" (default), "rattle" or "source" (explicit Euler), see Physics.
    - `physics_rate`, `control_rate`: steps per second, 50 and 50 by default.
    - `tolerance`: instead of a method and a physics rate, the cheapest pair that was measured to hold this error [m];
      see Physics.
    - `render_mode`: None, "human" or "rgb_array".

    ## Physics
    dv/dt = a - c (v - wind) with c = -ln(damping): drag is linear in the velocity relative to the
    air, so the wind is a constant acceleration and flight has a closed form, which the default
    method takes. Greatest error of an artillery shot's place in 2.5 s of flight, against the closed
    form from the muzzle, by `pytest tests/envs/test_ballistic_flight.py -k measured -s`:

    | `method` | `physics_rate` | Error |
    |---|---|---|
    | closed_form | 50 | below 1e-12 m |
    | rattle | 50 | 7.1e-4 m |
    | rattle | 200 | 4.4e-5 m |
    | source | 50 | 0.64 m |
    | source | 200 | 0.16 m |

    `tolerance` goes by this table, which is why the closed form is the default.

    With every method the path within a step is the closed-form flight that leaves as the shot did
    and ends where the method put it.

    ## Baselines
    Mean return and successes in 100 episodes at the default difficulty, seeds 1,000,000 to
    1,000,099, by `python -m steelyard_agents.evaluate random|controller --env
    steelyard/Ballistic-v0`:

    | Policy | Return | Success |
    |---|---|---|
    | random | -1.3 | 2 % |
    | hand-written | 9.5 | 100 % |

    ## Version History
    - v0: first version.
    """

    task_class = BallisticTask


class BallisticVectorEnv(TaskVectorEnv):
    """Ballistic, many at once; see ``BallisticEnv``."""

    task_class = BallisticTask
