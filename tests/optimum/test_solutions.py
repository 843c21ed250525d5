"""The solution of each task: best and random returns."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.optimum.solutions import SOLUTIONS, solution


def test_every_task_has_a_solution() -> None:
    assert SOLUTIONS.keys() == TASKS.keys()


def test_random_return_is_the_published_one() -> None:
    # -909 at g = 1 over seeds 0 to 999; the mean over 100 of them differs by less than 10 %.
    assert solution(Pendulum()).random_return() == pytest.approx(-909, rel=0.1)


def test_random_return_equals_gymnasiums_for_the_same_torques() -> None:
    env, random = gymnasium.make("Pendulum-v1", g=10.0), np.random.RandomState(0)
    torques = np.linspace(-2, 2, 41)
    total = 0.0
    for seed in range(100):
        env.reset(seed=seed)
        for _ in range(7):
            total += float(env.step([random.choice(torques)])[1])
    assert solution(Pendulum(10.0)).random_return(7) == pytest.approx(total / 100, rel=1e-9)


def test_random_episodes_have_the_requested_number_of_steps() -> None:
    one_step = solution(Pendulum()).random_return(1)
    assert one_step == pytest.approx(-(np.pi**2 / 3 + 0.1 / 3 + 0.001 * 4 / 3), rel=0.2)
    assert solution(CartPole()).random_return(5) == 5  # no pole falls over within 5 steps


@pytest.mark.parametrize(
    ("preset", "steps", "optimum"),
    [
        ("reference", 200, -40.69),
        ("swingup", 40, -131.31),
        ("cartpole", 500, 500),
        ("cartpole", 60, 60),
        ("cartpole", 900, 900),
        ("reference", 201, np.nan),
    ],
)
def test_mean_best_return_is_that_of_episodes_of_the_given_length(
    preset: str, steps: int, optimum: float
) -> None:
    value = solution(kp.preset(preset).task).mean_best_return(steps)
    assert value == pytest.approx(optimum, abs=0.3 if steps == 200 else 0.01, nan_ok=True)


@pytest.mark.parametrize("task", [Pendulum(), CartPole()])
def test_outcomes_of_a_lasting_action_are_those_of_its_steps(task: Task) -> None:
    exact = solution(task)
    assert isinstance(exact, KnownDynamics)
    states, efforts = 2 * np.array(task.starts(range(20))), np.array([-2.0, 1.0])
    outcomes = exact.lasting_outcomes(states, efforts, 30)
    assert task.never_terminates or 0 < outcomes.terminated.sum() < 40
    for row, column in np.ndindex(20, 2):
        rewards: list[float] = []
        state, ended = states[[row]], False
        while len(rewards) < 30 and not ended:
            step = exact.outcomes(state, efforts[[column]])
            state, ended = step.state[:, 0], bool(step.terminated[0, 0])
            rewards.append(float(step.reward[0, 0]))
        assert outcomes.reward[row, column] == pytest.approx(sum(rewards))
        assert outcomes.state[row, column] == pytest.approx(state[0])
        assert outcomes.terminated[row, column] == ended
