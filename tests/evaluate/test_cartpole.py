"""Agents of CartPole that record no task, and the falls that a score reports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import keras
import numpy as np
import pytest
import torch
from conftest import Command

import keras_pendulum as kp
from keras_pendulum.evaluate.sources import as_policy

CARTPOLE = "CartPole-v1"


def balance(observation: Any) -> int:
    """Balances the pole from every start."""
    return int(observation[2] + 0.5 * observation[3] > 0)


def values(observations: Any) -> Any:
    """Returns Q-values [B, 2] of `balance`."""
    push = observations[:, 2] + 0.5 * observations[:, 3]
    return np.stack([-push, push], axis=1)


def module() -> torch.nn.Module:
    net = torch.nn.Linear(4, 2)
    with torch.no_grad():
        net.bias.zero_()
        net.weight[:] = torch.tensor([[0, 0, -1, -0.5], [0, 0, 1, 0.5]])
    return net


def keras_model(*shape: int) -> keras.Model:
    layers = [keras.layers.Flatten()] if len(shape) > 1 else []
    model = keras.Sequential([keras.Input(shape), *layers, keras.layers.Dense(2)])
    model.set_weights([np.array([[0, 0], [0, 0], [-1, 1], [-0.5, 0.5]]), np.zeros(2)])
    return model


class Stable:
    """Has the spaces and the `predict` of Stable-Baselines3."""

    observation_space = gymnasium.make(CARTPOLE).observation_space
    action_space = gymnasium.make(CARTPOLE).action_space

    def predict(self, observation: Any, state: Any = None, deterministic: bool = True) -> Any:
        return np.array([balance(each) for each in np.atleast_2d(observation)]), state


AGENTS: dict[str, Callable[[], Any]] = {
    "PyTorch": lambda: kp.q_function(module()),
    "function of values": lambda: kp.q_function(lambda o: values(o[:, :4])[:, :2]),
    "Keras": lambda: keras_model(4),
    "Keras with a row": lambda: keras_model(1, 4),
    "Stable-Baselines3": Stable,
}
AGENTS_THAT_SHOW_NO_TASK: dict[str, Callable[[], Any]] = {
    "function": lambda: balance,
    "int64": lambda: lambda observation: np.int64(balance(observation)),
    "act": lambda: SimpleNamespace(act=balance),
    "select_action": lambda: SimpleNamespace(select_action=lambda o: np.array([balance(o)])),
    "values of any size": lambda: kp.q_function(lambda o: values(np.pad(o, ((0, 0), (0, 1))))),
}


@pytest.mark.parametrize("name", [*AGENTS, *AGENTS_THAT_SHOW_NO_TASK])
def test_agent_that_takes_four_numbers_or_is_declared_is_one_of_cartpole(name: str) -> None:
    environment = None if name in AGENTS else CARTPOLE
    agent = (AGENTS | AGENTS_THAT_SHOW_NO_TASK)[name]()
    score = kp.evaluate_policy(agent, 3, environment=environment)
    assert score.environment == CARTPOLE
    assert score.returns.tolist() == score.optimal_returns.tolist() == [500] * 3


def test_weights_of_keras_with_four_inputs_are_those_of_cartpole(tmp_path: Path) -> None:
    path = tmp_path / "model.weights.h5"
    model = keras.Sequential([keras.Input((4,)), keras.layers.Dense(8), keras.layers.Dense(2)])
    model.save_weights(path)
    network = kp.load_weights(path, "linear")
    assert network(np.zeros((1, 4), np.float32)).shape == (1, 2)
    assert kp.evaluate_policy(network, 2).environment == CARTPOLE


def test_file_of_a_keras_model_with_other_layers_is_one_of_cartpole(tmp_path: Path) -> None:
    path = tmp_path / "model.keras"
    layers = [keras.layers.Dense(8), keras.layers.LayerNormalization(), keras.layers.Dense(2)]
    keras.Sequential([keras.Input((4,)), *layers]).save(path)
    assert kp.evaluate_policy(path, 2).environment == CARTPOLE
    assert as_policy(path).name == str(path)


def test_cartpole_has_no_gravity_not_even_0() -> None:
    values = kp.evaluate_policy(keras_model(4), 1).as_json()
    assert (values["environment"], values["gravity"]) == (CARTPOLE, None)
    with pytest.raises(kp.ConfigError, match=r"^gravity belongs to Pendulum-v1; CartPole-v1 has"):
        kp.evaluate_policy(keras_model(4), 1, gravity=0.0)


@pytest.mark.parametrize("outputs", [3, 5])
def test_other_number_of_outputs_is_named(outputs: int) -> None:
    model = keras.Sequential([keras.Input((4,)), keras.layers.Dense(outputs)])
    with pytest.raises(kp.UserError, match=rf"shape \[2, {outputs}\]; expected .*\[2, 2\]"):
        kp.evaluate_policy(model, 2)


def test_episodes_of_different_lengths_are_played_side_by_side() -> None:
    def clumsy(observations: Any) -> Any:  # falls, from each start after another number of steps
        return values(observations) * np.sign(1.2 - np.abs(observations[:, :1]) - 1.15)

    together = kp.evaluate_policy(kp.q_function(lambda o: clumsy(o[:, :4])), 20)
    policy = kp.q_function(lambda o: clumsy(o[:, :4]))
    policy.one_by_one = True
    assert together.returns.tolist() == kp.evaluate_policy(policy, 20).returns.tolist()
    assert len(set(together.returns)) > 3


@pytest.mark.parametrize(
    ("agent", "environment", "message"),
    [
        ("cartpole", "Pendulum-v1", r"is an agent of CartPole-v1, not of Pendulum-v1$"),
        ("reference", CARTPOLE, r"is an agent of Pendulum-v1, not of CartPole-v1$"),
        ("reference", "Acrobot-v1", "expected Pendulum-v1 or CartPole-v1$"),
        (kp.DQN((8,)), CARTPOLE, r"DQN takes 3 numbers; CartPole-v1 has 4$"),
        (kp.q_function(module()), "Pendulum-v1", r"is an agent of CartPole-v1, not of"),
        (
            kp.q_function(lambda o: o[:, :2], torques=[-1, 1]),
            CARTPOLE,
            "has torques, which belong to Pendulum-v1$",
        ),
    ],
)
def test_environment_that_an_agent_cannot_have_is_refused(
    agent: Any, environment: str, message: str
) -> None:
    with pytest.raises(kp.ConfigError, match=message):
        kp.evaluate_policy(agent, 1, environment=environment)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (2, r"^episode 0, step 0: the agent returned the index 2; expected an integer from 0 to 1"),
        (0.5, "expected an integer from 0 to 1"),
        ([0, 1], "expected an integer from 0 to 1"),
    ],
)
def test_answer_that_is_no_push_is_refused(answer: Any, message: str) -> None:
    with pytest.raises(kp.UserError, match=message):
        kp.evaluate_policy(lambda observation: answer, 1, environment=CARTPOLE)


def test_score_says_from_where_the_optimum_would_not_have_fallen() -> None:
    score = kp.evaluate_policy(lambda observation: 1, 10, environment=CARTPOLE)
    assert score.fallen == len(score.falls) == 10
    for fall in score.falls:
        assert 1 <= fall.steps_before <= 8 and fall.observation[0] > -0.1
    line = score.summary().splitlines()[-1]
    assert line.startswith("The pole fell in 10 of 10 episodes. The optimum would still balance it")
    assert f"with seed {score.falls[0].seed}, at x = " in line
    assert score.as_json()["fallen"] == 10
    json.dumps(score.as_json())


def test_pole_that_never_fell_is_not_mentioned() -> None:
    score = kp.evaluate_policy("cartpole", 3)
    assert score.falls == [] and "fallen" not in score.as_json()
    assert "fell" not in score.summary()


def test_command_takes_the_environment(in_process: Command, tmp_path: Path) -> None:
    code = tmp_path / "mine.py"
    code.write_text("def act(o):\n    return int(o[2] + 0.5 * o[3] > 0)\n")
    words = ["evaluate", f"{code}:act", "--episodes", "2"]
    done = in_process(*words, "--environment", CARTPOLE)
    assert done.returncode == 0 and "CartPole-v1: mean return 500.00" in done.stdout
    wrong = in_process(*words, "--environment", "CartPole")
    assert wrong.returncode == 2 and "invalid choice: 'CartPole'" in wrong.stderr
