"""Bridge: it starts at rest in its statics, winches and load keep their limits, and rules are as said."""

import gymnasium as gym
import numpy as np
import pytest

import steelyard as sy
from benchmarks import environment_error
from steelyard_agents.controllers.bridge import BridgeController
from steelyard_envs import bridge_kernels as kernels
from steelyard_envs.bridge import BridgeTask, settle
from tests.envs.environments import some_actions

G, LOAD = 9.81, 10.0
DT = 1.0 / 50.0
LENGTHS = [3.0, 3.5, 4.0, 4.0, 3.5, 3.0]


def make(rows, **kwargs):
    kwargs = {"autoreset_mode": "Disabled", **kwargs}
    return gym.make_vec("steelyard/Bridge-v0", rows, **kwargs)


def cables(env):
    return env.task.world.scene.of(sy.CableConstraint)


def lengths(env):
    """Lengths of the support cables [m], shape (rows, 12)."""
    return np.stack([env.task.world[cable].length for cable in cables(env)], axis=1)


def rows_of(env, first, count=1):
    values = env.task.values[first : first + count, : env.num_envs].T.copy()
    return values[:, 0] if count == 1 else values


def still(env):
    """Let no wind blow and no load set out."""
    env.task.settings[kernels.WIND] = 0.0
    env.task.values[[kernels.GUST_X, kernels.GUST_Z]] = 0.0
    env.task.values[kernels.LEG_END] = 1e9
    env.task.settings[kernels.DRIFT] = 0.0


# Statics


def test_the_bare_bridge_settles_in_its_statics():
    world = settle(sy.scenes.bridge(winches=True), np.array([LENGTHS]))
    height = world.particles.position[0, :, 1]
    # Heights by pair, from the equations of statics solved to 4e-14.
    wanted = [3.154078348949, 2.545803446869, 2.007820144332]
    wanted = np.repeat([*wanted, *wanted[::-1]], 2)
    np.testing.assert_allclose(height, wanted, atol=1e-11)
    assert not world.particles.velocity.any()


def test_the_loaded_bridge_settles_in_its_statics_with_the_right_tension():
    world = settle(sy.scenes.bridge(load=LOAD, place=(2.0, 0.0), winches=True), np.array([LENGTHS]))
    wanted = [
        3.125115103065, 3.159341487003, 2.531096935264, 2.551098014095, 2.000987704247,
        2.017464253755, 2.009398198292, 2.010907372938, 2.559441372551, 2.545686972317,
        3.186882661512, 3.150940107271,
    ]  # fmt: skip
    np.testing.assert_allclose(world.particles.position[0, :12, 1], wanted, atol=1e-9)
    cable = world.scene.of(sy.CableConstraint)[4]
    force = 2.0 * world[cable].multiplier[0] * world[cable].length[0] / world.method.dt**2
    # 106.603154 has six decimals; the heights above are known 1e-9 and the force is 1e3 N/m of them.
    assert force == pytest.approx(106.603154, abs=2e-6)


@pytest.mark.parametrize("method", ["rattle", "symplectic_euler"])
@pytest.mark.parametrize("difficulty", [1, 2, 3])
def test_an_episode_starts_at_rest(difficulty, method):
    env = make(64, difficulty=difficulty, method=method)
    env.reset(seed=0)
    still(env)
    particles = env.task.world.particles
    assert not particles.velocity.any()
    start, tension = particles.position.copy(), rows_of(env, kernels.TENSION, 6)
    starts = len(np.unique(start[:, 0, 1]))
    assert starts == 1 if difficulty == 1 else 8 < starts <= 16
    for _ in range(50):
        env.step(np.zeros((64, 6), np.float32))
    # The solver's tolerance of 1e-8 m lets speeds of 1e-8 m / dt = 5e-7 m/s through.
    assert np.abs(particles.velocity).max() < 1e-6
    np.testing.assert_allclose(particles.position, start, atol=1e-6)
    np.testing.assert_allclose(rows_of(env, kernels.TENSION, 6), tension, atol=1e-2)


@pytest.mark.parametrize("method", ["rattle", "symplectic_euler", "gauss_seidel"])
@pytest.mark.parametrize("physics_rate", [50, 200])
def test_at_rest_the_tensions_carry_the_weight(method, physics_rate):
    env = make(8, method=method, physics_rate=physics_rate)
    observation, _ = env.reset(seed=1)
    position = env.task.world.particles.position
    anchors = np.array([cable.anchor for cable in cables(env)])
    # Both cables of a pair are equally steep, as the start is symmetric across.
    rise = (anchors[:, 1] - position[:, :12, 1]) / lengths(env)
    carried = (rows_of(env, kernels.TENSION, 6) * rise[:, ::2]).sum(axis=1)
    np.testing.assert_allclose(carried, G * (12.0 + LOAD), rtol=1e-9)
    pushed = rows_of(env, kernels.CONTACT, 3)
    np.testing.assert_allclose(pushed, np.tile([0.0, G * LOAD, 0.0], (8, 1)), atol=1e-7)
    np.testing.assert_allclose(
        observation[:, 24:30] * kernels.STALL, rows_of(env, kernels.TENSION, 6), rtol=1e-6
    )


@pytest.mark.parametrize("physics_rate", [50, 200])
def test_sensors_follow_within_a_tenth_of_a_second(physics_rate):
    env = make(4, physics_rate=physics_rate)
    env.reset(seed=1)
    still(env)
    truth = rows_of(env, kernels.TENSION, 6)
    env.task.values[kernels.TENSION : kernels.TENSION + 6] = 0.0
    env.task.values[kernels.CONTACT : kernels.CONTACT + 3] = 0.0
    for _ in range(5):
        env.step(np.zeros((4, 6), np.float32))
    follows = 1.0 - np.exp(-1.0)
    np.testing.assert_allclose(rows_of(env, kernels.TENSION, 6), follows * truth, rtol=1e-6)
    pushed = rows_of(env, kernels.CONTACT, 3)
    np.testing.assert_allclose(pushed[:, 1], follows * G * LOAD, rtol=1e-6)


# Winches


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_winches_keep_their_speed_acceleration_and_length(sign):
    env = make(1, difficulty=1)
    env.reset(seed=0)
    still(env)
    # The unloaded pairs, where no tension holds a winch back.
    free = [6, 8, 10]
    seen = [lengths(env)[0]]
    for _ in range(400):
        env.step(np.full((1, 6), sign, np.float32))
        seen.append(lengths(env)[0])
    seen = np.array(seen)
    np.testing.assert_array_equal(seen[:, ::2], seen[:, 1::2])
    speed = np.diff(seen, axis=0)[:, free] / DT
    assert np.abs(speed).max() == pytest.approx(kernels.SPEED, rel=1e-9)
    change = np.diff(speed, axis=0) / DT
    assert np.abs(change).max() <= kernels.WINCH_ACCELERATION * (1.0 + 1e-9)
    assert seen.min() >= kernels.SHORT and seen.max() <= kernels.LONG
    bound = kernels.SHORT if sign > 0.0 else kernels.LONG
    np.testing.assert_allclose(seen[-1, free], bound, atol=1e-3)
    speeds = np.sign(speed[np.abs(speed) > 1e-12])
    assert (speeds == -sign).all(), "a cable must not swing about its limit"


def test_winches_follow_their_motor_line():
    """Rates over whole episodes, computed anew from the tensions seen before each step."""
    env = make(32)
    env.reset(seed=0)
    actions = some_actions("steelyard/Bridge-v0", 600, rows=32, hold=40)
    rate = np.zeros((32, 6))
    beyond = hauling = 0
    for action in actions:
        tension, length = rows_of(env, kernels.TENSION, 6), lengths(env)[:, ::2]
        env.step(action)
        most = kernels.WINCH_ACCELERATION * DT
        wanted = rate + np.clip(-kernels.SPEED * action.astype(float) - rate, -most, most)
        line = np.minimum((tension - kernels.STALL) / kernels.SLOPE, kernels.SPEED)
        beyond += (tension > kernels.STALL + 1.0).sum()
        hauling += ((tension < kernels.STALL) & (line > wanted)).sum()
        wanted = np.maximum(wanted, line)
        wanted = np.maximum(wanted, (kernels.SHORT - length) / (10.0 * DT))
        wanted = np.minimum(wanted, (kernels.LONG - length) / (10.0 * DT))
        moved = length + 0.5 * (rate + wanted) * DT
        np.testing.assert_allclose(lengths(env)[:, ::2], moved, atol=1e-12)
        rate = wanted
    assert beyond > 500 and hauling > 500


def test_a_pair_under_the_load_pays_out_whatever_is_asked():
    env = make(1, difficulty=1)
    env.reset(seed=0)
    still(env)
    env.task.values[kernels.LEG_END] = 0.0
    haul = np.ones((1, 6), np.float32)
    passed = False
    for _ in range(600):
        before, tension = lengths(env)[0, 2], rows_of(env, kernels.TENSION + 1)[0]
        env.step(haul)
        if tension > kernels.STALL + 2.0 and rows_of(env, kernels.WINCH + 1)[0] > 0.0:
            passed = True
            assert abs(rows_of(env, kernels.PLACE)[0] - 1.0) < 0.5
            assert lengths(env)[0, 2] > before
    assert passed


def test_winches_move_the_same_at_every_physics_rate():
    played = []
    for physics_rate in (50, 400):
        env = make(4, difficulty=1, physics_rate=physics_rate)
        env.reset(seed=0)
        still(env)
        for action in some_actions("steelyard/Bridge-v0", 60, rows=4):
            env.step(action)
        played.append(lengths(env)[:, 6:])
    np.testing.assert_allclose(*played, atol=1e-12)


# The load


@pytest.mark.parametrize("difficulty", [1, 2, 3])
def test_the_load_crosses_in_time_and_within_its_limits(difficulty):
    env = make(512, difficulty=difficulty)
    observation, _ = env.reset(seed=0)
    controller, seen = BridgeController(), []
    for _ in range(1000):
        observation, *_ = env.step(controller(observation))
        seen.append(rows_of(env, kernels.PLACE, 3))
    place, across, speed = np.array(seen).transpose(2, 0, 1)
    time = DT * np.arange(1, 1001)
    assert place.min() >= kernels.START and (place[-1] == kernels.END).all()
    sets_out = time[(place > kernels.START).argmax(axis=0)]
    # A leg that begins at 2 to 4 s, and at most haste from 6 s on where the first legs are pauses.
    assert 2.0 < sets_out.min() < 2.1
    assert sets_out.max() < 4.1 if difficulty == 1 else 4.1 < sets_out.max() < 6.1
    assert time[(place == kernels.END).argmax(axis=0)].min() > 10.0
    assert time[(place == kernels.END).argmax(axis=0)].max() <= 19.5
    for row, step in enumerate((place == kernels.END).argmax(axis=0)):
        assert (place[step:, row] == kernels.END).all()
    change = np.abs(np.diff(speed, axis=0))
    assert change.max() == pytest.approx(kernels.ACCELERATION * DT, rel=1e-9)
    assert speed.max() * kernels.SPACING < 2.0
    # At the very end what is left of a step is cut off: half of the step's change of speed.
    moved = 0.5 * (speed[1:] + speed[:-1]) * DT
    np.testing.assert_allclose(np.diff(place, axis=0), moved, atol=0.5 * 0.008 * DT)
    assert (speed.min() < -0.05) == (difficulty == 3)
    crossing = (place > kernels.START + 0.1) & (place < kernels.END - 0.1)
    stops = ((np.abs(speed) < 1e-9) & crossing).any(axis=0).mean()
    assert (stops > 0.3) == (difficulty > 1)
    strays = np.abs(across - 0.5).max()
    assert strays == 0.0 if difficulty == 1 else 0.15 < strays <= (0.2, 0.35)[difficulty - 2]


def test_the_rider_is_where_the_schedule_says():
    env = make(16, difficulty=3)
    env.reset(seed=2)
    world = env.task.world
    rider = world.scene.of(sy.Rider)[0]
    controller, observation = BridgeController(), env.task.observations
    for _ in range(700):
        env.step(controller(observation))
        weights = world[rider].weights
        np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
        assert weights.min() > -1e-12 and ((weights > 1e-12).sum(axis=1) <= 6).all()
        # The mean over the footprint keeps what is linear along the deck.
        along = (weights[:, ::2] + weights[:, 1::2]) @ np.arange(6.0)
        np.testing.assert_allclose(along, rows_of(env, kernels.PLACE), atol=1e-9)
        across = weights[:, 1::2].sum(axis=1)
        np.testing.assert_allclose(across, rows_of(env, kernels.ACROSS), atol=1e-9)


def test_a_step_moves_the_rider_at_constant_acceleration():
    """Its rates at the end of a step are nearly those from which the next one starts: no blow."""
    env = make(16, difficulty=3)
    env.reset(seed=2)
    rider = env.task.world.scene.of(sy.Rider)[0]
    controller, observation = BridgeController(), env.task.observations
    jumps, speeds = [], []
    for _ in range(700):
        before = env.task.world[rider].rates.copy()
        weights = env.task.world[rider].weights.copy()
        env.step(controller(observation))
        accelerations = env.task.world[rider].accelerations
        began = env.task.world[rider].rates - DT * accelerations
        jumps.append(np.abs(began - before).max())
        speeds.append(np.abs(env.task.world[rider].weights - weights).max() / DT)
    assert max(speeds) > 0.3
    assert max(jumps) < 0.02


# Wind


def test_a_gust_gives_its_impulse_to_the_nodes_near_its_place():
    task = BridgeTask(1, difficulty=3)
    everyone = np.ones(1, np.bool_)
    task.seed(everyone, np.array([3]))
    task.start(everyone)
    values = task.values
    begin, end = values[[kernels.GUST, kernels.GUST_END], 0]
    assert 0.2 <= begin <= 1.5 and 0.6 <= end - begin <= 2.0
    velocity = task.world.particles.velocity
    given = np.zeros((13, 3))
    steps = int(np.ceil(end / DT))
    for step in range(steps):
        values[kernels.ELAPSED] = step
        velocity[:] = 0.0
        kernels.blow(values, task.streams, task.settings, task.layout, task.world.state, 0)
        assert velocity.any() == (begin < step * DT < end)
        given += velocity[0]
    near = np.exp(-0.5 * (np.repeat(np.arange(6), 2) - values[kernels.GUST_PLACE, 0]) ** 2)
    # The mean of sin^2 is a half; a sum of DT over smooth bumps errs by far less than 1e-3.
    impulse = 0.5 * (end - begin) * near
    np.testing.assert_allclose(given[:12, 0], impulse * values[kernels.GUST_X, 0], rtol=2e-3)
    np.testing.assert_allclose(given[:12, 2], impulse * values[kernels.GUST_Z, 0], rtol=2e-3)
    assert not given[:, 1].any() and not given[12].any()


@pytest.mark.parametrize(("difficulty", "most"), [(1, 1.5), (2, 3.0), (3, 5.0)])
def test_gusts_are_as_strong_as_the_level_says(difficulty, most):
    env = make(2000, difficulty=difficulty)
    env.reset(seed=0)
    across, along = rows_of(env, kernels.GUST_Z), rows_of(env, kernels.GUST_X)
    assert 0.98 * most < np.abs(across).max() <= most
    assert 0.49 * most < np.abs(along).max() <= 0.5 * most
    assert abs(across.mean()) < 0.1 * most


# Falling


def frame(task):
    along, across = np.array(
        [kernels.deck(task.values, task.layout, task.world.state, 0, c) for c in range(3)]
    ).T
    normal = np.cross(across, along)
    return along / np.linalg.norm(along), normal / np.linalg.norm(normal)


def test_the_deck_under_the_load_is_the_mean_of_the_planks():
    env = make(1, difficulty=1)
    env.reset(seed=0)
    position = env.task.world.particles.position[0]
    along, normal = frame(env.task)
    # Half a plank from the end the footprint lies on the first plank alone.
    plank = position[2] - position[0]
    np.testing.assert_allclose(along, plank / np.linalg.norm(plank), atol=1e-12)
    assert normal[1] > 0.0 and abs(normal @ along) < 1e-12


@pytest.mark.parametrize(
    ("push", "pull", "falls"),
    [(98.1, 0.0, False), (98.1, 0.599, False), (98.1, 0.601, True), (-1.0, 0.0, True),
     (0.0, 0.0, True), (np.nan, 0.0, True)],
)  # fmt: skip
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_load_falls_when_its_force_leaves_the_friction_cone(push, pull, falls, sign):
    env = make(1, difficulty=1)
    env.reset(seed=0)
    task = env.task
    along, normal = frame(task)
    for tangent in (along, np.cross(along, normal)):
        force = push * normal + sign * pull * push * tangent
        task.values[kernels.CONTACT : kernels.CONTACT + 3, 0] = force
        assert kernels.slides(task.values, task.layout, task.world.state, 0) == falls


def test_the_load_slides_off_a_steep_deck():
    env = make(1, difficulty=1)
    env.reset(seed=0)
    still(env)
    action = np.array([[1.0, -1.0, -1.0, 0.0, 0.0, 0.0]], np.float32)
    steps = 0
    for _ in range(500):
        observation, _, terminated, _, info = env.step(action)
        steps += 1
        slope = -float(observation[0, 35])
        if terminated[0]:
            break
        # Slow motion: what the load needs of friction is the slope, but for a few degrees.
        assert slope < np.sin(np.arctan(kernels.FRICTION)) + 0.05
    assert terminated[0] and steps > 21
    assert slope == pytest.approx(np.sin(np.arctan(kernels.FRICTION)), abs=0.05)
    assert info["reward_fall"][0] == -50.0 and not info["is_success"][0]
    assert not info["physics_error"][0]


def test_the_load_is_thrown_by_a_deck_that_drops():
    env = make(1, difficulty=1)
    env.reset(seed=0)
    still(env)
    velocity = env.task.world.particles.velocity
    for _ in range(20):
        # Something pulls the deck down faster than the load can fall.
        velocity[0, :12, 1] -= 3.0
        _, _, terminated, _, info = env.step(np.zeros((1, 6), np.float32))
        env.task.world[cables(env)[0]].length[:] += 0.1
        for cable in cables(env):
            env.task.world[cable].length[:] += 0.1
        if terminated[0]:
            break
    assert terminated[0] and info["reward_fall"][0] == -50.0


# Rewards and success


def test_rewards_are_as_said():
    env = make(16)
    env.reset(seed=0)
    for action in some_actions("steelyard/Bridge-v0", 200, rows=16):
        observation, _, terminated, _, info = env.step(action)
        heights, climbs = observation[:, :6].astype(float), observation[:, 6:12].astype(float)
        level = (1.0 / (1.0 + (heights / 0.15) ** 2)).mean(axis=1)
        np.testing.assert_allclose(info["reward_level"], level)
        rush = np.sqrt((climbs**2).mean(axis=1))
        quiet = -0.1 * np.minimum((rush / 0.1) ** 2, 1.0)
        np.testing.assert_allclose(info["reward_quiet"], quiet, atol=1e-15)
        speeds = rows_of(env, kernels.WINCH, 6) / kernels.SPEED
        np.testing.assert_allclose(info["reward_effort"], -0.05 * (speeds**2).mean(axis=1))
        np.testing.assert_array_equal(info["reward_fall"], np.where(terminated, -50.0, 0.0))
    position = env.task.world.particles.position
    level = rows_of(env, kernels.HEIGHT)
    assert np.ptp(level) > 0.1 and (np.abs(level - 2.5) <= 0.1).all()
    mean = 0.5 * (position[:, :12:2, 1] + position[:, 1:12:2, 1])
    np.testing.assert_allclose(observation[:, :6], mean - level[:, None], atol=1e-6)
    roll = 0.5 * (position[:, 1:12:2, 1] - position[:, :12:2, 1])
    np.testing.assert_allclose(observation[:, 12:18], roll, atol=1e-6)


def test_success_is_arrival_on_a_deck_that_was_level():
    """Rows are held off the level by 0 to 0.2 m, and both sides of the limit are seen."""
    rows = 64
    env = make(rows, difficulty=1)
    observation, _ = env.reset(seed=0)
    offset = np.linspace(0.0, 0.2, rows)[:, None]
    controller = BridgeController()
    squares, counted = np.zeros(rows), np.zeros(rows)
    for _ in range(1000):
        shifted = observation.copy()
        shifted[:, :6] += offset
        observation, _, terminated, _, info = env.step(controller(shifted))
        assert not terminated.any()
        place = rows_of(env, kernels.PLACE)
        moving = (place > kernels.START) & (place < kernels.END)
        squares += np.where(moving, (observation[:, :6].astype(float) ** 2).mean(axis=1), 0.0)
        counted += moving
        assert not info["is_success"][place < kernels.END].any()
    level = np.sqrt(squares / counted) <= 0.1
    assert 10 < level.sum() < rows - 10
    np.testing.assert_array_equal(info["is_success"], level)


# Physics


@pytest.mark.parametrize("difficulty", [1, 2, 3])
def test_links_hold_throughout_a_controlled_episode(difficulty):
    env = make(8, difficulty=difficulty)
    observation, _ = env.reset(seed=5)
    controller = BridgeController()
    world = env.task.world
    rider = world.scene.of(sy.Rider)[0]
    for _ in range(1000):
        observation, _, _, _, _ = env.step(controller(observation))
        assert world.residual.max() <= 1e-8
        deck = np.einsum("wk,wkc->wc", world[rider].weights, world.particles.position[:, :12])
        assert np.abs(world.particles.position[:, 12] - deck).max() <= 1e-8
    assert not world.health.any()


def test_the_error_falls_fourfold_when_the_rate_doubles():
    """Winches, wind and load are second order together, while cables stay taut."""
    found = environment_error.compare(
        "steelyard/Bridge-v0", rates=(50, 100, 200), methods=("rattle",), reference=1600,
        seconds=1.0, rows=16, difficulty=2, amplitude=0.3, repeats=1,
    )  # fmt: skip
    middle = [np.median(error) for _, _, error, _ in found]
    assert middle[0] < 1e-4
    assert 3.0 < middle[0] / middle[1] < 5.0 and 3.0 < middle[1] / middle[2] < 5.0
