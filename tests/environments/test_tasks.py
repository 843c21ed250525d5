"""The two tasks: their properties are Gymnasium's, and the settings reach the environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import PassiveEnvChecker

from keras_pendulum.environments.actions import make_actions
from keras_pendulum.environments.tasks import (
    STEPS_PER_EPISODE,
    TASKS,
    make_environment,
    pendulum_starts,
)

GRAVITY = {"Pendulum-v1": 1.0, "CartPole-v1": None}


def episode(env: gymnasium.Env[Any, Any], action: Any) -> list[tuple[Any, ...]]:
    """Returns the steps of one episode with the same action at each step."""
    env.reset(seed=0)
    steps = [env.step(action)]
    while not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(action))
    return steps


@pytest.mark.parametrize("name", TASKS)
def test_properties_of_a_task_are_those_of_gymnasium(name: str) -> None:
    task = TASKS[name]
    env = gymnasium.make(name)
    assert env.spec is not None
    assert env.spec.max_episode_steps == task.steps_per_episode
    assert env.observation_space.shape == (task.observation_size,)
    simulation: Any = env.unwrapped
    if task.has_torque:
        assert isinstance(env.action_space, gymnasium.spaces.Box)
        assert simulation.dt == task.seconds_per_step
    else:
        assert isinstance(env.action_space, gymnasium.spaces.Discrete)
        assert env.action_space.n == task.action_count
        assert simulation.tau == task.seconds_per_step


def test_pendulum_is_truncated_and_never_terminates() -> None:
    steps = episode(make_environment("Pendulum-v1", 1.0), np.array([2.0]))
    assert len(steps) == STEPS_PER_EPISODE == TASKS["Pendulum-v1"].steps_per_episode
    assert not any(step[2] for step in steps)
    assert TASKS["Pendulum-v1"].never_terminates


def test_cartpole_terminates_and_pays_1_for_each_step() -> None:
    task = TASKS["CartPole-v1"]
    steps = episode(make_environment("CartPole-v1", None), 0)
    assert len(steps) < 20
    assert steps[-1][2]
    assert {step[1] for step in steps} == {1.0}
    assert not task.never_terminates
    assert task.optimal_return == task.steps_per_episode


@pytest.mark.parametrize(("name", "steps"), [("Pendulum-v1", 7), ("CartPole-v1", 3)])
def test_steps_truncate_an_episode(name: str, steps: int) -> None:
    env = make_environment(name, GRAVITY[name], steps=steps)
    truncated = [step[3] for step in episode(env, make_actions(name, 41).to_env_action(0))]
    assert truncated == [False] * (steps - 1) + [True]


def test_gravity_is_that_of_the_pendulum() -> None:
    simulation: Any = make_environment("Pendulum-v1", 2.5).unwrapped
    assert simulation.g == 2.5


@pytest.mark.parametrize("name", TASKS)
def test_environment_has_no_checker(name: str) -> None:
    env: Any = make_environment(name, GRAVITY[name])
    while isinstance(env, gymnasium.Wrapper):
        assert not isinstance(env, PassiveEnvChecker)
        env = env.env


def test_pendulum_starts_are_the_states_after_reset() -> None:
    starts = pendulum_starts([5, 0, 5])
    assert starts.shape == (3, 2)
    assert starts.dtype == np.float64
    for (angle, speed), seed in zip(starts, [5, 0, 5], strict=True):
        observation, _ = gymnasium.make("Pendulum-v1").reset(seed=seed)
        np.testing.assert_allclose(observation, [np.cos(angle), np.sin(angle), speed], rtol=1e-6)
    assert (starts[0] == starts[2]).all()
    assert (starts[0] != starts[1]).all()


def test_pendulum_starts_of_no_seeds_are_empty() -> None:
    assert pendulum_starts([]).shape == (0, 2)
