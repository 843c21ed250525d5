"""The two tasks: their properties are Gymnasium's, and the settings reach the environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import PassiveEnvChecker

from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS, make_task
from keras_pendulum.errors import ConfigError

EXAMPLES = (Pendulum(), CartPole())  # one of each


def episode(env: gymnasium.Env[Any, Any], action: Any) -> list[tuple[Any, ...]]:
    """Returns the steps of one episode with the same action at each step."""
    env.reset(seed=0)
    steps = [env.step(action)]
    while not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(action))
    return steps


def test_there_is_an_example_of_each_task() -> None:
    assert [type(task) for task in EXAMPLES] == list(TASKS.values())


@pytest.mark.parametrize("task", EXAMPLES)
def test_properties_of_a_task_are_those_of_gymnasium(task: Task) -> None:
    env = gymnasium.make(task.environment)
    assert env.spec is not None
    assert env.spec.max_episode_steps == task.steps_per_episode
    assert env.observation_space.shape == (task.observation_size,)
    assert all(env.action_space.contains(a) for a in task.actions().values.astype(np.float32)) or (
        env.action_space == gymnasium.spaces.Discrete(task.actions().count)
    )
    simulation: Any = env.unwrapped
    assert task.seconds_per_step == getattr(simulation, "dt", getattr(simulation, "tau", None))


def test_pendulum_is_truncated_and_never_terminates() -> None:
    steps = episode(Pendulum().make_env(), np.array([2.0]))
    assert len(steps) == STEPS_PER_EPISODE == Pendulum.steps_per_episode
    assert not any(step[2] for step in steps)
    assert Pendulum.never_terminates


def test_cartpole_terminates_and_pays_1_for_each_step() -> None:
    task = CartPole()
    steps = episode(task.make_env(), 0)
    assert len(steps) < 20
    assert steps[-1][2]
    assert {step[1] for step in steps} == {1.0}
    assert not task.never_terminates


@pytest.mark.parametrize(("task", "steps"), [(Pendulum(), 7), (CartPole(), 3)])
def test_steps_truncate_an_episode(task: Task, steps: int) -> None:
    env = task.make_env(steps=steps)
    truncated = [step[3] for step in episode(env, task.actions().to_env_action(0))]
    assert truncated == [False] * (steps - 1) + [True]


def test_gravity_is_that_of_the_pendulum() -> None:
    task = make_task("Pendulum-v1", {"gravity": 2.5, "seed": 3})
    simulation: Any = task.make_env().unwrapped
    assert simulation.g == task.gravity == 2.5
    assert (task.name, CartPole().name) == ("Pendulum-v1, g = 2.5", "CartPole-v1")
    assert task.with_gravity(0).gravity == 0
    with pytest.raises(ConfigError, match=r"^gravity belongs to Pendulum-v1; CartPole-v1 has none"):
        CartPole().with_gravity(1.0)


@pytest.mark.parametrize("gravity", [-1.0, 100.1, float("nan"), float("inf"), "x", None])
def test_gravity_out_of_range_is_refused(gravity: Any) -> None:
    with pytest.raises(ConfigError, match=r"^gravity is .* number from 0 to 100"):
        Pendulum(gravity)


@pytest.mark.parametrize("task", EXAMPLES)
def test_environment_has_no_checker(task: Task) -> None:
    env: Any = task.make_env()
    while isinstance(env, gymnasium.Wrapper):
        assert not isinstance(env, PassiveEnvChecker)
        env = env.env


def test_pendulum_starts_are_the_states_after_reset() -> None:
    starts = Pendulum().starts([5, 0, 5])
    assert starts.shape == (3, 2)
    assert starts.dtype == np.float64
    for (angle, speed), seed in zip(starts, [5, 0, 5], strict=True):
        observation, _ = gymnasium.make("Pendulum-v1").reset(seed=seed)
        np.testing.assert_allclose(observation, [np.cos(angle), np.sin(angle), speed], rtol=1e-6)
    assert (starts[0] == starts[2]).all()
    assert (starts[0] != starts[1]).all()
