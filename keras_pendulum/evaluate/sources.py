"""The policy that an object or a file stands for."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from numpy.typing import ArrayLike

from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UnknownLayersError, UserError, one_line
from keras_pendulum.evaluate.answers import is_instance
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.q_policies import DQNPolicy, QPolicy
from keras_pendulum.evaluate.torque_policies import FunctionPolicy, PredictPolicy, has_predict
from keras_pendulum.storage.find_weights import find_weights
from keras_pendulum.storage.load_weights import load_weights

_EXPECTED = (
    "expected a DQN, a Policy, a path, a Keras model, kp.q_function(...), a function from an "
    "observation to a torque, or an object with predict(observation, deterministic=True), act, "
    "choose_action, select_action or get_action"
)
_METHODS = ("act", "choose_action", "select_action", "get_action", "predict")


def load_policy(source: DQN | str | os.PathLike[str], activation: str | None = None) -> Policy:
    """Returns the greedy policy of a network.

    Args:
        source: the path or shipped name of a weights file, a run folder, or a DQN.
        activation: of a file that records none, see `load_weights`.

    Raises WeightsError as `load_weights` does, and UserError when a weight is not finite.

    >>> policy = kp.load_policy("reference")
    >>> policy([-1.0, 0.0, 0.0]).shape  # hanging at rest; a torque in N·m
    (1,)
    """
    return DQNPolicy(source if isinstance(source, DQN) else load_weights(source, activation))


def as_policy(
    source: Any,
    torques: ArrayLike | None = None,
    name: str | None = None,
    environment: str | None = None,
) -> Policy:
    """Returns the policy that an object stands for.

    Args:
        source: a `DQN`, or the path or shipped name of its file; a Keras model from observations
            [B, D] to Q-values [B, A], or its `.keras` file; a `q_function`; a function from an
            observation [D] to a torque in N·m, or to an action of CartPole; an object with
            Stable-Baselines3's `predict`, or with such a function as its `act`, `choose_action`,
            `select_action` or `get_action`; a Policy.
        torques: N·m, what the outputs or indices stand for, -2 to 2; None takes
            `linspace(-2, 2, A)`.
        name: of the policy; None takes that of the source.
        environment: Gymnasium's name; None takes the recorded one, else CartPole-v1 for an agent
            that takes four numbers, else Pendulum-v1.

    Raises TypeError for another object, ConfigError for wrong torques or another environment,
    WeightsError for a wrong file, and UserError for a Keras model without weights or with other
    outputs.
    """
    policy = _policy_of(source, torques, name)
    return policy if environment is None else policy.with_environment(environment)


def _policy_of(source: Any, torques: ArrayLike | None, name: str | None) -> Policy:
    if isinstance(source, (str, os.PathLike)):
        return _policy_of(load_keras_file(source), torques, os.fspath(source))
    if isinstance(source, DQN):
        source = DQNPolicy(source, name)
    if isinstance(source, Policy):
        return source if torques is None else source.with_torques(torques)
    if isinstance(source, keras.Model) or is_instance(source, "tf_keras", "Model"):
        if not source.built:
            raise UserError("the Keras model has no weights yet: build it or load them first")
        shape = getattr(source, "input_shape", None)
        sizes = {len(task.observation_names): name for name, task in TASKS.items()}
        if isinstance(shape, tuple) and shape[-1] not in (None, *sizes):
            needed = " and ".join(f"{size} of {task}" for size, task in sizes.items())
            raise UserError(
                f"the Keras model takes inputs of the shape {shape}; an observation has the "
                f"numbers {needed}"
            )
        call = _compiled(partial(source, training=False), source)
        if isinstance(shape, tuple) and len(shape) == 3 and shape[1] == 1:  # such as keras-rl's
            return QPolicy(lambda x: call(x[:, np.newaxis]), torques, name or source.name)
        return QPolicy(call, torques, name or source.name)
    if isinstance(source, type):
        raise TypeError(
            one_line(f"agent is the class {source.__name__}: make an object of it; {_EXPECTED}")
        )
    if has_predict(source):
        return PredictPolicy(source, torques)
    for method in _METHODS:
        if callable(getattr(source, method, None)):
            return FunctionPolicy(getattr(source, method), torques)
    if is_instance(source, "torch.nn", "Module"):
        raise TypeError(
            "agent is a PyTorch module; give kp.q_function(module, torques=...), or of an actor a "
            "function from an observation to a torque"
        )
    if not callable(source):
        raise TypeError(one_line(f"agent is {source!r}; {_EXPECTED}"))
    return FunctionPolicy(source, torques)


def _compiled(call: Callable[[Any], Any], model: Any) -> Callable[[Any], Any]:
    """Returns the call of a model as one of TensorFlow's graph, which takes a tenth of the time.

    The `call` of a class of the user's own may do what a graph cannot, so it stays as it is.
    """
    if not type(model).__module__.startswith(("keras.", "tf_keras.")):
        return call
    if isinstance(model, keras.Model) and keras.backend.backend() != "tensorflow":
        return call
    return tf.function(call, autograph=False, reduce_retracing=True)


def load_keras_file(
    path: str | os.PathLike[str], activation: str | None = None
) -> DQN | keras.Model:
    """Returns the network in a file.

    A chain of Dense layers is read by `load_weights`, with the same arguments and errors. A whole
    model with other layers is read by `load_keras_model`, which raises WeightsError for layers that
    Keras cannot load safely.
    """
    try:
        return load_weights(path, activation)
    except UnknownLayersError:
        from keras_pendulum.storage.keras_models import load_keras_model

        return load_keras_model(find_weights(path))
