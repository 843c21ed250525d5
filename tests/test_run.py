"""The parts that a Config names, put together."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import keras
import pytest

import keras_pendulum as kp
from keras_pendulum.network import Origin
from keras_pendulum.run import make_optimizer


@pytest.mark.parametrize(
    ("name", "kind", "decay"),
    [("adam", keras.optimizers.Adam, None), ("adamw", keras.optimizers.AdamW, 0.03)],
)
@pytest.mark.parametrize("clip", [None, 100.0])
def test_the_optimizer_has_the_settings_numbers(
    name: str, kind: Any, decay: float | None, clip: float | None
) -> None:
    numbers: dict[str, Any] = {
        "learning_rate": 0.25,
        "optimizer_epsilon": 0.5,
        "weight_decay": 0.03,
    }
    config = kp.preset("original", optimizer=name, gradient_clip=clip, **numbers)
    optimizer: Any = make_optimizer(config)
    assert type(optimizer) is kind
    assert (float(optimizer.learning_rate), optimizer.epsilon) == (0.25, 0.5)
    assert (optimizer.weight_decay, optimizer.clipvalue) == (decay, clip)
    assert optimizer.amsgrad == (name == "adamw")


@pytest.mark.parametrize(("name", "gravity"), [("swingup", 10.0), ("cartpole-original", None)])
def test_a_trained_network_knows_the_run_that_it_comes_from(
    name: str, gravity: float | None
) -> None:
    config = kp.preset(name, episodes=1, hidden_units=(8,), seed=6)
    settings = json.dumps(asdict(config))
    found = kp.train_dqn(config).network.origin
    assert found == Origin(config.environment, gravity, name, 6, settings)


@pytest.mark.parametrize(("ours", "theirs"), [("tanh", "relu"), ("relu", "tanh")])
def test_initial_weights_of_another_activation_are_refused(ours: str, theirs: str) -> None:
    config = kp.preset("original", episodes=1, hidden_units=(8,), activation=ours)
    with pytest.raises(kp.ConfigError, match=f"activation is {theirs}, the settings say {ours}"):
        kp.train_dqn(config, init=kp.DQN((8,), activation=theirs))
