"""One form for every agent that can be evaluated: observations in, torques out."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import keras
import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.dqn.network import DQN, Provenance
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.errors import ConfigError, UserError, one_line
from keras_pendulum.evaluate.answers import ActionError, name_of, torques_of
from keras_pendulum.evaluate.keras_files import load_keras_file
from keras_pendulum.evaluate.loaded_policy import Policy
from keras_pendulum.evaluate.q_functions import (
    QFunction,
    checked_grid,
    is_torch_module,
    q_function,
)
from keras_pendulum.evaluate.stable_baselines import Predictor, has_predict
from keras_pendulum.optimum.discounted import validate_discount

Observations = NDArray[np.float32]  # [B, 3]
Act = Callable[[Observations], NDArray[np.float64]]  # torques [B] in N·m
_EXPECTED = (
    "expected a DQN, a Policy, a path, a Keras model, kp.q_function(...), a function from an "
    "observation to a torque, or an object with predict(observation, deterministic=True)"
)


@dataclass(frozen=True)
class Agent:
    """An agent in the form that `evaluate_policy` and `diagnose` use.

    `act` raises ActionError for an answer that is no torque, with its row in the batch.
    """

    name: str
    act: Act  # for CartPole, the actions' indices [B]
    q_values: Callable[[Observations], NDArray[Any]] | None = None  # [B, A]
    torques: NDArray[np.float64] | None = None  # [A] N·m; None for continuous torque and CartPole
    provenance: Provenance | None = None  # the run, where it is known
    network: keras.Model | None = None  # a Keras network, where it is one
    discount: float | None = None  # γ that it learned with, where it is known
    batched: bool = True  # false: `act` calls the user's function once for each observation
    # One observation [D] to the action as the environment takes it, without checks.
    env_action: Callable[[NDArray[np.float32]], Any] | None = None

    def action(self, observation: NDArray[np.float32]) -> Any:
        """Returns the action for one observation [D], as the environment takes it."""
        if self.env_action is not None:
            return self.env_action(observation)
        return self.act(observation[np.newaxis])  # [1]

    @property
    def environment(self) -> str:
        """Gymnasium's name of the agent's environment."""
        return (self.provenance or Provenance()).environment


def as_agent(source: Any, torques: ArrayLike | None = None) -> Agent:
    """Returns the agent that an object stands for.

    Args:
        source: a `DQN`, its `Policy`, or the path or shipped name of its file; a Keras model from
            observations [B, 3] to Q-values [B, A], or its `.keras` file; a `q_function`; a function
            from an observation [3] to a torque in N·m; an object with Stable-Baselines3's
            `predict`; an Agent.
        torques: N·m, what the outputs or indices stand for, -2 to 2; None takes
            `linspace(-2, 2, A)`.

    Raises TypeError for another object, ConfigError for wrong torques, WeightsError for a wrong
    file, and UserError for a Keras model without weights or with other outputs.
    """
    name = None
    if isinstance(source, (str, os.PathLike)):
        name = os.fspath(source)
        source = load_keras_file(source)
    if isinstance(source, DQN):
        return _from_policy(Policy(source), source, name, torques)
    if isinstance(source, Policy):
        return _from_policy(source, None, None, torques)
    if _is_keras_model(source):
        return _from_keras(source, name, torques)
    if isinstance(source, (Agent, QFunction)):
        if torques is not None:
            raise ConfigError("torques are given, but the agent has torques of its own")
        return source if isinstance(source, Agent) else _from_q_function(source)
    if isinstance(source, type):
        raise TypeError(one_line(f"agent is the class {source.__name__}; {_EXPECTED}"))
    if has_predict(source):
        predictor = Predictor(source, torques)
        return Agent(
            name_of(source),
            predictor if predictor.batched else _one_by_one(predictor),
            predictor.q_values,
            predictor.torques,
            discount=predictor.discount,
            batched=predictor.batched,
        )
    if is_torch_module(source):
        raise TypeError("agent is a PyTorch module; give kp.q_function(module, torques=...)")
    if not callable(source):
        raise TypeError(one_line(f"agent is {source!r}; {_EXPECTED}"))
    if torques is not None:
        raise ConfigError("torques are given, but the agent is a function that returns torques")
    return Agent(name_of(source), _one_by_one(partial(torques_of, source)), batched=False)


def recorded_discount(provenance: Provenance) -> float | None:
    """Returns the discount in the recorded settings of a run; None where there is none."""
    try:
        return validate_discount(json.loads(provenance.config or "")["discount"])
    except (ValueError, LookupError, TypeError, RecursionError):
        return None


def _from_policy(
    policy: Policy, network: DQN | None, name: str | None, torques: ArrayLike | None
) -> Agent:
    """Returns the agent of a DQN or of its policy."""
    run, actions, greedy = policy.provenance, policy.actions, policy.greedy
    name, discount = name or run.preset or "DQN", recorded_discount(run)
    if isinstance(actions, TorqueGrid):
        grid = actions.torques if torques is None else checked_grid(torques, actions.count)

        def torque(observation: NDArray[np.float32]) -> NDArray[np.float64]:
            index = greedy.action(observation)
            return grid[index : index + 1]

        def act(observations: Observations) -> NDArray[np.float64]:
            return grid[greedy.q_values(observations).argmax(axis=1)]

        return Agent(name, act, greedy.q_values, grid, run, network, discount, env_action=torque)
    if torques is not None:
        raise ConfigError(f"torques belong to Pendulum-v1; {run.environment} has none")
    return Agent(
        name,
        lambda observations: greedy.q_values(observations).argmax(axis=1).astype(np.float64),
        greedy.q_values,
        None,
        run,
        network,
        discount,
        env_action=greedy.action,
    )


def _from_keras(model: Any, name: str | None, torques: ArrayLike | None) -> Agent:
    """Returns the agent of any other Keras model. Raises UserError when it has no weights yet."""
    if not model.built:
        raise UserError("the Keras model has no weights yet: build it or load them first")
    function = q_function(lambda values: model(values, training=False), torques, name or model.name)
    return _from_q_function(function, model)


def _from_q_function(function: QFunction, network: keras.Model | None = None) -> Agent:
    def act(observations: Observations) -> NDArray[np.float64]:
        return function.torques[function(observations).argmax(axis=1)]

    return Agent(function.name, act, function, function.torques, network=network)


def _is_keras_model(source: Any) -> bool:
    keras2 = sys.modules.get("tf_keras")
    return isinstance(source, keras.Model) or (
        keras2 is not None and isinstance(source, keras2.Model)
    )


def _one_by_one(choose: Callable[[NDArray[np.float32]], NDArray[np.float64]]) -> Act:
    """Returns `act` from a function of one observation [3]."""

    def act(observations: Observations) -> NDArray[np.float64]:
        torques = np.empty(len(observations))
        for row, observation in enumerate(observations):
            try:
                torques[row] = choose(observation)
            except ActionError as error:
                error.row = row
                raise
        return torques

    return act
