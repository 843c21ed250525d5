"""The Keras agent and its PyTorch twin (torch_agent.py) compute the same numbers.

Each limit is next to what was measured. Most of the difference comes from Adam's bias corrections:
Keras rounds them to float32, PyTorch computes them in float64, which changes a step by up to 1e-5.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch
import torch_agent
from conftest import Recorded
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import preset
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.train.run import make_run

torch.set_num_threads(1)  # the order of a sum, and so its rounding, depends on the threads

Weights = list[NDArray[np.float32]]


def twin_agent(config: Config, weights: Weights) -> torch_agent.Agent:
    """Returns the PyTorch agent of the same settings."""
    learning_rate = torch_agent.constant_rate(config.learning_rate)
    if config.learning_rate_schedule == "cosine":
        learning_rate = torch_agent.cosine_rate(config.learning_rate, config.total_updates)
    updates: dict[str, torch_agent.TargetUpdate] = {
        "none": torch_agent.no_update,
        "soft": partial(torch_agent.soft_update, config.tau),
        "hard": partial(torch_agent.hard_update, config.target_period),
    }
    online = torch_agent.from_keras(weights)
    return torch_agent.Agent(
        online,
        online if config.target_update == "none" else torch_agent.from_keras(weights),
        torch_agent.double_q_learning if config.double_q else torch_agent.q_learning,
        updates[config.target_update],
        torch_agent.KerasAdam(online.parameters(), learning_rate),
        {"squared": torch_agent.mean_squared_error, "huber": torch_agent.huber}[config.loss],
        config.discount,
    )


def largest_difference(one: Iterable[NDArray[Any]], other: Iterable[NDArray[Any]]) -> float:
    return float(np.max([abs(a - b).max() for a, b in zip(one, other, strict=True)]))


@pytest.mark.parametrize(
    ("config", "terminated_share"),
    [
        (preset("original", seed=1), 0.0),
        (preset("reference", seed=1), 0.1),
        # Period 7, so that the 10 updates between comparisons end at every phase of it; 44
        # episodes make 120 updates, so that the cosine comes near 0 within the 100.
        (preset(target_update="hard", target_period=7, episodes=44, seed=1), 0.1),
        (preset(double_q=True, tau=0.01, loss="huber", seed=1), 0.1),
    ],
    ids=["original", "reference", "hard target", "double"],
)
def test_100_updates_give_the_same_losses_and_weights(
    config: Config, terminated_share: float, recorded_transitions: Transitions
) -> None:
    random = np.random.default_rng(1)
    steps = random.integers(len(recorded_transitions.action), size=(10, 10, 32))
    # The pendulum never terminates, so random transitions are marked as terminated.
    terminated = random.random(steps.shape) < terminated_share
    agent = make_run(config).agent
    twin = twin_agent(config, agent.online.get_weights())
    for call in range(10):
        batches = Transitions(*(field[steps[call]] for field in recorded_transitions))
        batches = batches._replace(terminated=terminated[call])  # [10, 32, ...]
        tensors = torch_agent.Transitions(*map(torch.from_numpy, batches))
        losses, twin_losses = agent.update(batches), twin.update(tensors)
        # Measured: 1.0e-6 in the losses, but 1.0e-5 in one of 2.9 with Huber's loss; and 5.5e-6
        # in the weights, which move by 0.1.
        np.testing.assert_allclose(twin_losses, losses, rtol=5e-6, atol=2e-6)
        for network, twin_network in ((agent.online, twin.online), (agent.target, twin.target)):
            twin_weights = torch_agent.to_keras(twin_network)
            assert largest_difference(twin_weights, network.get_weights()) < 2e-5


def test_torch_repeats_the_updates_of_the_recorded_run(
    recorded: Recorded, recorded_transitions: Transitions
) -> None:
    initial, final = (
        [recorded[f"{when}_weight_{index}"] for index in range(8)] for when in ("initial", "final")
    )
    network = torch_agent.from_keras(initial)
    agent = torch_agent.Agent(
        network,
        network,
        torch_agent.q_learning,
        torch_agent.no_update,
        torch_agent.KerasAdam(network.parameters(), torch_agent.constant_rate(1e-3)),
        torch_agent.mean_squared_error,
        discount=0.9,
    )
    batches = [torch.from_numpy(field[recorded["batch"]]) for field in recorded_transitions]
    losses = agent.update(torch_agent.Transitions(*batches))  # [459]
    # Measured: 8.0e-6 in the losses (0.006 to 1.03), 2.4e-5 in the weights, which move by 0.2.
    # With the ε of PyTorch's Adam they are 6.9e-4 in the first 20 losses and 0.026.
    np.testing.assert_allclose(losses, recorded["loss"], rtol=0, atol=2.5e-5)
    assert largest_difference(torch_agent.to_keras(network), final) < 5e-5
