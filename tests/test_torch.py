"""The Keras agent and its PyTorch version (torch_agent.py) say the same, number by number.

Each bound stands beside what was measured. Most of the gap comes from Adam's bias corrections:
Keras rounds them to float32, PyTorch keeps them in float64: up to 1e-5 of a step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
import torch
import torch_agent
from conftest import Recorded
from numpy.typing import NDArray

from keras_pendulum.config import Config
from keras_pendulum.network import DQN
from keras_pendulum.presets import preset
from keras_pendulum.q_learning import mean_squared_error, td_target
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer, Transitions
from keras_pendulum.run import make_agent

torch.set_num_threads(1)  # two threads would share a sum differently from one run to the next

Weights = list[NDArray[np.float32]]


def torch_batch(batch: Transitions) -> torch_agent.Batch:
    return torch_agent.Batch(*map(torch.from_numpy, batch))


def twin_agent(config: Config, weights: Weights) -> torch_agent.Agent:
    """The PyTorch agent of the same settings."""
    learning_rate = torch_agent.constant_rate(config.learning_rate)
    if config.learning_rate_schedule == "cosine":
        learning_rate = torch_agent.cosine_rate(config.learning_rate, config.total_updates)
    update_target = {
        "none": None,
        "soft": torch_agent.soft_update(config.target_blend),
        "hard": torch_agent.hard_update(config.target_period),
    }[config.target_update]
    double_q = config.bootstrap == "double"
    return torch_agent.Agent(
        weights, config.discount, learning_rate, update_target, double_q=double_q
    )


def gap(ours: Iterable[NDArray[Any]], theirs: Iterable[NDArray[Any]]) -> float:
    """The largest difference between two lists of weights."""
    return float(np.max([abs(a - b).max() for a, b in zip(ours, theirs, strict=True)]))


def recorded_weights(recorded: Recorded, when: str) -> Weights:
    return [recorded[f"{when}_weight_{index}"] for index in range(8)]


@pytest.mark.parametrize(
    ("config", "terminated_share"),
    [
        (preset("original", seed=1), 0.0),
        (preset("reference", seed=1), 0.1),
        # Period 7, so that the 10 updates between comparisons end at every phase of it; 48
        # episodes make 210 updates, so that the cosine nearly reaches 0 within the 200.
        (preset(target_update="hard", target_period=7, episodes=48, seed=1), 0.1),
        (preset(bootstrap="double", target_blend=0.01, seed=1), 0.1),
    ],
    ids=["original", "reference", "hard target", "double"],
)
def test_200_updates_give_the_same_losses_and_weights(
    config: Config, terminated_share: float, recorded_memory: ReplayBuffer
) -> None:
    random = np.random.default_rng(1)
    batches = recorded_memory.at(random.integers(len(recorded_memory), size=(20, 10, 32)))
    # The pendulum never terminates, so some transitions are made to.
    terminated = random.random(batches.terminated.shape) < terminated_share
    batches = batches._replace(terminated=terminated)
    agent = make_agent(config, RandomSource(config.seed))
    twin = twin_agent(config, agent.online.get_weights())
    for call in range(20):
        episode = Transitions(*(field[call] for field in batches))  # [10, 32, ...]
        losses = agent.update(episode)
        twin_losses = [
            twin.update(torch_batch(Transitions(*(field[k] for field in episode))))
            for k in range(10)
        ]
        # Measured: at most 2.7e-6 in the losses and 6.8e-6 in the weights, which move by 0.1.
        np.testing.assert_allclose(twin_losses, losses, rtol=0, atol=1e-5)
        assert gap(torch_agent.to_keras(twin.online), agent.online.get_weights()) < 2e-5
        assert gap(torch_agent.to_keras(twin.target), agent.target.get_weights()) < 2e-5


def learn_recorded_batches(
    recorded: Recorded,
    recorded_memory: ReplayBuffer,
    epsilon: Callable[[int], float] = torch_agent.keras_epsilon,
) -> tuple[list[float], Weights]:
    """Losses [459] and final weights of the recorded run's updates, made in PyTorch."""
    initial = recorded_weights(recorded, "initial")
    agent = torch_agent.Agent(initial, 0.9, torch_agent.constant_rate(1e-3), epsilon=epsilon)
    losses = [agent.update(torch_batch(recorded_memory.at(steps))) for steps in recorded["batch"]]
    return losses, torch_agent.to_keras(agent.online)


def test_torch_follows_the_recorded_run_of_the_original(
    recorded: Recorded, recorded_memory: ReplayBuffer
) -> None:
    losses, weights = learn_recorded_batches(recorded, recorded_memory)
    # Measured: 8.0e-6 in the losses (0.006 to 1.03), 2.4e-5 in the weights, which move by 0.2.
    np.testing.assert_allclose(losses, recorded["loss"], rtol=0, atol=2.5e-5)
    assert gap(weights, recorded_weights(recorded, "final")) < 5e-5


def test_torch_with_its_own_place_of_epsilon_does_not_follow(
    recorded: Recorded, recorded_memory: ReplayBuffer
) -> None:
    losses, weights = learn_recorded_batches(recorded, recorded_memory, epsilon=lambda step: 1e-7)
    # Measured: 6.9e-4 in the first 20 losses, 0.026 in the final weights.
    assert abs(losses - recorded["loss"])[:20].max() > 1e-4
    assert gap(weights, recorded_weights(recorded, "final")) > 1e-3


def test_keras_weights_in_torch_give_the_same_q_values(recorded: Recorded) -> None:
    weights = recorded_weights(recorded, "final")
    observations = recorded["probe_observations"]  # [64, 3]
    network = DQN()
    network.set_weights(weights)
    with torch.no_grad():
        q_values = torch_agent.from_keras(weights)(torch.from_numpy(observations)).numpy()
    np.testing.assert_allclose(q_values, network(observations), rtol=0, atol=1e-5)
    np.testing.assert_allclose(q_values, recorded["probe_q_values"], rtol=0, atol=1e-5)


def test_torch_weights_in_keras_give_the_same_q_values(recorded: Recorded) -> None:
    observations = recorded["probe_observations"]
    torch.manual_seed(0)
    twin = torch_agent.DQN((3, 512, 256, 128, 41))
    network = DQN()
    network.set_weights(torch_agent.to_keras(twin))
    with torch.no_grad():
        q_values = twin(torch.from_numpy(observations)).numpy()
    np.testing.assert_allclose(network(observations), q_values, rtol=0, atol=1e-5)


def test_weights_come_back_from_torch_bit_for_bit(recorded: Recorded) -> None:
    weights = recorded_weights(recorded, "final")
    for ours, theirs in zip(
        torch_agent.to_keras(torch_agent.from_keras(weights)), weights, strict=True
    ):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)


def test_target_and_loss_agree_with_torch_on_random_input() -> None:
    random = np.random.default_rng(0)
    q, next_q = random.normal(-20, 10, (2, 256, 41)).astype(np.float32)
    reward = random.uniform(-16, 0, 256).astype(np.float32)
    action = random.integers(41, size=256, dtype=np.int32)
    terminated = random.random(256) < 0.25
    target = td_target(reward, terminated, next_q, 0.9).numpy()
    twin_target = torch_agent.td_target(
        torch.from_numpy(reward), torch.from_numpy(terminated), torch.from_numpy(next_q), 0.9
    )
    np.testing.assert_allclose(twin_target, target, rtol=1e-6)
    loss = mean_squared_error(q, action, target).numpy()
    twin_loss = torch_agent.mean_squared_error(
        torch.from_numpy(q), torch.from_numpy(action), twin_target
    )
    np.testing.assert_allclose(twin_loss, loss, rtol=1e-6)


def test_target_and_loss_agree_with_a_sum_done_by_hand() -> None:
    reward = np.array([1, -2], np.float32)
    terminated = np.array([False, True])
    next_q = np.array([[1, 4, 2], [5, 6, 7]], np.float32)
    q = np.array([[0, 1, 2], [3, 4, 5]], np.float32)
    action = np.array([1, 0], np.int32)
    right_target = [1 + 0.5 * 4, -2]  # the second row terminated
    right_loss = ((3 - 1) ** 2 + (-2 - 3) ** 2) / 6  # over 2 rows of 3 outputs

    target = td_target(reward, terminated, next_q, 0.5)
    np.testing.assert_array_equal(target, right_target)
    assert float(mean_squared_error(q, action, target)) == pytest.approx(right_loss)

    outputs = torch.tensor(q, requires_grad=True)
    twin_target = torch_agent.td_target(
        torch.from_numpy(reward), torch.from_numpy(terminated), torch.from_numpy(next_q), 0.5
    )
    np.testing.assert_array_equal(twin_target, right_target)
    twin_loss = torch_agent.mean_squared_error(outputs, torch.from_numpy(action), twin_target)
    assert twin_loss.item() == pytest.approx(right_loss)
    (slope,) = torch.autograd.grad(twin_loss, outputs)
    np.testing.assert_allclose(slope, [[0, -4 / 6, 0], [10 / 6, 0, 0]], rtol=1e-6)


def test_cosine_rate_is_the_one_of_the_keras_optimizer() -> None:
    config = preset(hidden_units=(4,), episodes=44)
    optimizer = make_agent(config, RandomSource(0)).optimizer
    rate = torch_agent.cosine_rate(config.learning_rate, config.total_updates)
    for updates in (0, 1, 30, 45, 89, 90, 91, 200):  # 90 is the last
        optimizer.iterations.assign(updates)
        assert float(optimizer.learning_rate) == pytest.approx(rate(updates), abs=1e-9)
