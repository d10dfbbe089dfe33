"""Ids: light to import, complete, serialisable, and clear about arguments that they do not know."""

import importlib
import inspect
import pickle
import pkgutil
import subprocess
import sys
import warnings

import gymnasium as gym
import pytest
from gymnasium.envs.registration import EnvSpec, load_env_creator, registry

import steelyard_envs
from steelyard_envs.registration import register_all
from steelyard_envs.single import TaskEnv
from steelyard_envs.vector import TaskVectorEnv
from tests.envs.environments import IDS, begin, task_class


def run(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_importing_imports_nothing_heavy():
    program = "import sys, steelyard_envs; print(*{name.split('.')[0] for name in sys.modules})"
    imported = set(run(program))
    assert {"gymnasium", "steelyard_envs"} <= imported
    assert not imported & {"numba", "llvmlite", "torch", "pygame", "steelyard", "matplotlib"}


def test_looking_ids_up_imports_nothing_heavy():
    program = (
        "import sys, gymnasium, steelyard_envs\n"
        f"for env_id in {IDS}: gymnasium.spec(env_id).to_json()\n"
        "print(*sys.modules)"
    )
    assert not {"numba", "torch", "pygame"} & set(run(program))


def test_module_in_the_id_imports_the_package():
    program = (
        "import gymnasium\n"
        f"for env_id in {IDS}:\n"
        "    env = gymnasium.make('steelyard_envs:' + env_id)\n"
        "    envs = gymnasium.make_vec('steelyard_envs:' + env_id, 2)\n"
        "    print(env.spec.id, type(envs).__name__)\n"
    )
    shown = run(program)
    assert shown[::2] == list(IDS)
    assert shown[1::2] == [gym.spec(env_id).vector_entry_point.partition(":")[2] for env_id in IDS]


def test_registering_again_changes_nothing():
    before = dict(registry)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        register_all()
        importlib.reload(steelyard_envs)
    assert all(registry[env_id] is spec for env_id, spec in before.items())
    assert registry.keys() == before.keys()


def test_every_environment_of_the_package_is_registered():
    found = set()
    for module in pkgutil.iter_modules(steelyard_envs.__path__):
        members = vars(importlib.import_module(f"steelyard_envs.{module.name}")).values()
        classes = filter(inspect.isclass, members)
        found |= {c for c in classes if issubclass(c, TaskEnv | TaskVectorEnv)}
    registered = set()
    for env_id in IDS:
        spec = gym.spec(env_id)
        registered |= {
            load_env_creator(spec.entry_point),
            load_env_creator(spec.vector_entry_point),
        }
    assert found - {TaskEnv, TaskVectorEnv} == registered


@pytest.mark.parametrize("env_id", IDS)
def test_every_field_is_set(env_id):
    spec = gym.spec(env_id)
    assert issubclass(load_env_creator(spec.entry_point), TaskEnv)
    assert issubclass(load_env_creator(spec.vector_entry_point), TaskVectorEnv)
    assert load_env_creator(spec.vector_entry_point).task_class is task_class(env_id)
    assert spec.max_episode_steps >= 100
    assert spec.reward_threshold > 0
    assert not spec.nondeterministic
    assert env_id.startswith("steelyard/") and spec.version == 0


@pytest.mark.parametrize("env_id", IDS)
def test_specs_survive_json_and_pickle_and_still_make(env_id):
    task = task_class(env_id)
    kwargs = {"difficulty": task.levels[-1], "method": task.methods[-1], "physics_rate": 200}
    spec = gym.make(env_id, **kwargs, max_episode_steps=70).spec
    for copy in (EnvSpec.from_json(spec.to_json()), pickle.loads(pickle.dumps(spec))):
        assert copy == spec
        env = gym.make(copy)
        assert env.unwrapped.task.difficulty == task.levels[-1]
        assert env.unwrapped.task.method == task.methods[-1]
        assert env.unwrapped.task.physics_rate == 200
        assert env.spec.max_episode_steps == 70
        begin(env)
    envs = gym.make_vec(env_id, 3, autoreset_mode="SameStep", **kwargs)
    copy = gym.make_vec(EnvSpec.from_json(envs.spec.to_json()), 3)
    assert copy.autoreset_mode is envs.autoreset_mode
    assert copy.task.method == task.methods[-1]


@pytest.mark.parametrize("env_id", IDS)
def test_native_vector_environment_is_what_make_vec_makes(env_id):
    spec = gym.spec(env_id)
    envs = gym.make_vec(env_id, 2)
    assert type(envs) is load_env_creator(spec.vector_entry_point)
    assert envs.spec.id == env_id


@pytest.mark.parametrize("vector", [False, True])
@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(
    ("kwargs", "value"),
    [
        ({"difficulty": 0}, "0"),
        ({"difficulty": "hard"}, "'hard'"),
        ({"method": "magic"}, "'magic'"),
        ({"method": ""}, "''"),
    ],
)
def test_unknown_choices_are_refused_with_what_there_is(env_id, vector, kwargs, value):
    task = task_class(env_id)
    (name,) = kwargs
    allowed = {"difficulty": task.levels, "method": task.methods}[name]
    with pytest.raises(ValueError) as caught:
        gym.make_vec(env_id, 2, **kwargs) if vector else gym.make(env_id, **kwargs)
    message = str(caught.value)
    assert task.__name__ in message and f"{name} is {value}" in message
    assert all(repr(choice) in message for choice in allowed)


@pytest.mark.parametrize("env_id", IDS)
def test_unknown_arguments_are_refused_by_name(env_id):
    with pytest.raises(TypeError, match="wings"):
        gym.make(env_id, wings=2)
    with pytest.raises(TypeError, match="wings"):
        gym.make_vec(env_id, 2, wings=2)


@pytest.mark.parametrize("env_id", IDS)
def test_unknown_render_modes_are_refused(env_id):
    for entry_point in (gym.spec(env_id).entry_point, gym.spec(env_id).vector_entry_point):
        with pytest.raises(ValueError, match=r"'ascii'.*'human'.*'rgb_array'"):
            load_env_creator(entry_point)(render_mode="ascii")


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("count", [0, -1, 2.5])
def test_number_of_environments_must_be_a_whole_one(env_id, count):
    with pytest.raises(ValueError, match=rf"num_envs is {count}.*at least 1"):
        gym.make_vec(env_id, count)


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize(
    ("physics", "control"),
    [
        (0, 50),
        (-50, 50),
        (50, 0),
        (50, -50),
        (float("nan"), 50),
        (50, float("nan")),
        (float("inf"), 50),
        (50, float("inf")),
        (25, 50),
        (75, 50),
        (50.001, 50),
    ],
)
def test_physics_takes_a_whole_number_of_steps_per_control_step(env_id, physics, control):
    with pytest.raises(ValueError) as caught:
        gym.make(env_id, physics_rate=physics, control_rate=control)
    message = str(caught.value)
    assert f"physics_rate is {float(physics)}" in message
    assert f"control_rate {float(control)}" in message
    assert "whole multiple" in message and "Use" in message


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("control", [10, 30, 50, 60, 240, 7.5])
def test_any_control_rate_finds_a_physics_rate(env_id, control):
    task = gym.make(env_id, control_rate=control).unwrapped.task
    assert task.physics_rate >= task.default_physics_rate
    assert task.physics_rate == task.substeps * control
    assert (task.substeps - 1) * control < task.default_physics_rate
