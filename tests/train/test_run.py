"""The parts of a run, made from its Config."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf

import keras_pendulum as kp
from keras_pendulum.dqn.losses import huber, mean_squared_error
from keras_pendulum.dqn.target_network import double_q_learning, q_learning
from keras_pendulum.environments.actions import Actions, TorqueGrid, TruncatingTorqueGrid
from keras_pendulum.train.run import make_optimizer, make_run

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("name", "double_q", "actions", "loss", "rule", "observation_size"),
    [
        ("swingup", True, TorqueGrid, mean_squared_error, double_q_learning, 3),
        ("walkthrough", False, TruncatingTorqueGrid, mean_squared_error, q_learning, 3),
        ("cartpole", False, Actions, huber, q_learning, 4),
    ],
)
def test_run_has_the_parts_of_its_settings(
    name: str, double_q: bool, actions: type, loss: object, rule: object, observation_size: int
) -> None:
    sizes = {"hidden_units": (8, 4), "max_episode_steps": 7, "replay_capacity": 300}
    config = kp.preset(name, seed=5, double_q=double_q, **sizes)
    run = make_run(config)
    assert run.config == config
    assert type(run.actions) is actions
    assert run.agent.online.hidden_units == (8, 4)
    assert run.agent.online.action_count == run.actions.count
    assert run.agent.online.observation_size == observation_size
    assert (run.agent.loss, run.agent.discount) == (loss, config.discount)
    assert run.agent.target_rule is rule
    if config.gravity is not None:
        assert run.env.get_wrapper_attr("g") == config.gravity
    assert run.agent.rng is run.streams.exploration
    assert (run.replay.capacity, len(run.replay)) == (300, 0)
    assert run.env.get_wrapper_attr("_max_episode_steps") == 7
    assert run.env.render_mode is None
    assert run.history == []


@pytest.mark.parametrize(
    ("settings", "values"),
    [
        ({"target_update": "none"}, [8, 8]),
        ({"target_update": "hard", "target_period": 2}, [0, 8]),
        ({"target_update": "soft", "tau": 0.25}, [2, 3.5]),
    ],
)
def test_target_network_follows_the_rule_of_the_settings(
    settings: dict[str, Any], values: list[float]
) -> None:
    agent = make_run(kp.preset("reference", hidden_units=(8,), **settings)).agent
    assert (agent.target is agent.online) == (settings["target_update"] == "none")
    np.testing.assert_equal(agent.target.get_weights(), agent.online.get_weights())
    for network, value in ((agent.target, 0.0), (agent.online, 8.0)):
        network.set_weights([np.full(array.shape, value) for array in network.get_weights()])
    for step, value in enumerate(values, start=1):
        agent.update_target(agent.online, agent.target, tf.constant(step))
        assert {float(array.flat[0]) for array in agent.target.get_weights()} == {value}


@pytest.mark.parametrize(
    ("settings", "values"),
    [
        ({"epsilon_decay": 0.5}, [0.4, 0.1]),
        ({"epsilon_schedule": "steps", "epsilon_decay_steps": 7}, [0.8, 0.1 + 0.7 / math.e]),
    ],
)
def test_epsilon_follows_the_schedule_of_the_settings(
    settings: dict[str, Any], values: list[float]
) -> None:
    settings = {"epsilon_start": 0.8, "epsilon_min": 0.1, **settings}
    epsilon = make_run(kp.preset("reference", hidden_units=(8,), **settings)).epsilon
    assert [epsilon(0, 0), epsilon(3, 7)] == pytest.approx(values)


@pytest.mark.parametrize(
    ("name", "kind", "decay"),
    [("adam", keras.optimizers.Adam, None), ("adamw", keras.optimizers.AdamW, 0.03)],
)
@pytest.mark.parametrize("clip", [None, 100.0])
def test_optimizer_has_the_numbers_of_the_settings(
    name: str, kind: Any, decay: float | None, clip: float | None
) -> None:
    numbers: dict[str, Any] = {"learning_rate": 0.25, "optimizer_epsilon": 0.5}
    if decay is not None:
        numbers["weight_decay"] = decay
    config = kp.preset("original", optimizer=name, gradient_clip=clip, **numbers)
    optimizer: Any = make_optimizer(config)
    assert type(optimizer) is kind
    assert (float(optimizer.learning_rate), optimizer.epsilon) == (0.25, 0.5)
    assert (optimizer.weight_decay, optimizer.clipvalue) == (decay, clip)
    assert optimizer.amsgrad == (name == "adamw")


@pytest.mark.parametrize("updates", [1, 4])
def test_optimizer_averages_over_the_updates_of_the_settings(updates: int) -> None:
    optimizer: Any = make_optimizer(kp.preset("reference", average_updates=updates))
    assert (optimizer.use_ema, optimizer.ema_momentum) == (updates > 1, 1 - 1 / updates)
    assert optimizer.ema_overwrite_frequency is None


@pytest.mark.parametrize(
    ("schedule", "lowest", "rates"),
    [
        ("cosine", 0.0, [1e-3, 0.5e-3, 0, 0]),
        ("cosine", 2e-4, [1e-3, 0.6e-3, 2e-4, 2e-4]),
        ("constant", 0.0, [1e-3] * 4),
    ],
)
def test_learning_rate_follows_its_schedule(
    schedule: str, lowest: float, rates: list[float]
) -> None:
    config = kp.preset(
        "reference",
        episodes=44,
        updates_per_episode=30,
        learning_rate_schedule=schedule,
        learning_rate_min=lowest,
    )
    assert config.total_updates == 90
    run = make_run(config)
    found = []
    for updates in (0, 45, 90, 91):
        run.agent.optimizer.iterations.assign(updates)
        found.append(float(run.agent.optimizer.learning_rate))
    np.testing.assert_allclose(found, rates, atol=1e-10)


def test_run_without_updates_has_a_learning_rate() -> None:
    run = make_run(kp.preset("reference", episodes=3))
    assert run.config.total_updates == 0
    assert float(run.agent.optimizer.learning_rate) == pytest.approx(1e-3)


@pytest.mark.parametrize(("name", "gravity"), [("swingup", 10.0), ("cartpole-original", None)])
def test_network_records_the_run_that_it_comes_from(name: str, gravity: float | None) -> None:
    config = kp.preset(name, hidden_units=(8,), seed=6)
    settings = json.dumps(asdict(config))
    found = make_run(config).agent.online.metadata
    physics = {} if gravity is None else {"gravity": gravity}
    assert found == {
        "environment": config.environment,
        **physics,
        "preset": name,
        "seed": 6,
        "config": settings,
    }


def test_another_seed_gives_other_initial_weights() -> None:
    first, second = (
        make_run(kp.preset("original", seed=seed, hidden_units=(8,))).agent for seed in (0, 1)
    )
    assert (first.online.get_weights()[0] != second.online.get_weights()[0]).all()


def test_initial_network_replaces_the_seeded_weights() -> None:
    initial = kp.DQN((8,), seed=77)
    agent = make_run(kp.preset("reference", hidden_units=(8,)), initial).agent
    assert agent.online is not initial
    assert agent.online.metadata["preset"] == "reference"
    for network in (agent.online, agent.target):
        np.testing.assert_equal(network.get_weights(), initial.get_weights())
    observation = np.array([1, 0, 0], np.float32)
    q = initial(observation[np.newaxis]).numpy()[0]
    np.testing.assert_allclose(agent.policy.q_values(observation), q, atol=1e-6)


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        (kp.DQN((8,)), "has hidden_units (8,), the settings say (512, 256, 128)"),
        (kp.DQN((512, 256, 128), 5), "has action_count 5, the settings say 41"),
        (kp.DQN((512, 256, 128), activation="relu"), "has activation relu, the settings say tanh"),
        (
            kp.DQN((8,), 2, observation_size=4, metadata={"environment": "CartPole-v1"}),
            "has environment CartPole-v1, the settings say Pendulum-v1",
        ),
    ],
)
def test_initial_network_of_another_shape_is_refused(initial: kp.DQN, message: str) -> None:
    with pytest.raises(kp.ConfigError, match=re.escape(f"the initial network {message}")):
        make_run(kp.preset("original"), initial)
