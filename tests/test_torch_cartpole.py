"""The preset `cartpole-original` and the notebooks' program in PyTorch (torch_cartpole.py)."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import torch
import torch_cartpole
from numpy.typing import NDArray

from benchmarks.recorded_cartpole import RECORD, recorded_episodes, repeated_episodes
from keras_pendulum.agent import Agent
from keras_pendulum.presets import preset
from keras_pendulum.q_learning import huber
from keras_pendulum.randomness import RandomSource
from keras_pendulum.replay import ReplayBuffer, Transitions
from keras_pendulum.run import make_agent

torch.set_num_threads(1)  # two threads would share a sum differently from one run to the next

CONFIG = preset("cartpole-original")


def random_memory(seed: int) -> tuple[ReplayBuffer, RandomSource]:
    """2000 transitions of random play, one in 20 or so terminated."""
    env = gymnasium.make("CartPole-v1")
    random = RandomSource(seed)
    memory = ReplayBuffer(CONFIG.replay_capacity, observation_size=4)
    observation, _ = env.reset(seed=seed)
    while len(memory) < 2000:
        action = random.action(2)
        following, reward, terminated, truncated, _ = env.step(action)
        memory.add(observation, action, float(reward), following, terminated)
        observation = following
        if terminated or truncated:
            observation, _ = env.reset()
    return memory, random


def learn_both(seed: int, updates: int) -> Iterator[tuple[Agent, torch_cartpole.Learner]]:
    """The Keras agent and its PyTorch twin after each of `updates` from the same batches."""
    memory, random = random_memory(seed)
    agent = make_agent(preset("cartpole-original", seed=seed), random)
    twin = torch_cartpole.Learner(agent.online.get_weights(), torch_cartpole.keras_epsilon)
    for _ in range(updates):
        positions = random.batch_positions(len(memory), CONFIG.batch_size)
        batch = memory.at([positions])  # [1, 128, ...]
        (loss,) = agent.update(batch)
        twin_loss = twin.update(torch_batch(batch))
        assert loss == pytest.approx(twin_loss, abs=5e-5)
        yield agent, twin


def torch_batch(batch: Transitions) -> torch_cartpole.Batch:
    return torch_cartpole.Batch(*(torch.from_numpy(field[0]) for field in batch))


def gaps(agent: Agent, twin: torch_cartpole.Learner) -> NDArray[np.float32]:
    """The difference of every weight, of both networks."""
    pairs = [
        *zip(agent.online.get_weights(), torch_cartpole.to_keras(twin.policy), strict=True),
        *zip(agent.target.get_weights(), torch_cartpole.to_keras(twin.target), strict=True),
    ]
    return np.concatenate([abs(ours - theirs).ravel() for ours, theirs in pairs])


# Where no activation comes so near to ReLU's corner that a last digit decides on which side it is.
@pytest.mark.parametrize("seed", [1, 3, 13])
def test_500_updates_give_the_same_weights(seed: int) -> None:
    *_, (agent, twin) = learn_both(seed, 500)
    # Measured: 3.4e-5, 4.1e-5, 5.4e-5; the weights move by 0.07.
    assert gaps(agent, twin).max() < 1e-4


def test_a_last_digit_at_the_corner_of_relu_moves_few_weights_and_no_value() -> None:
    # With 11 of 16 seeds some unit is barely active. Its weights have hardly a gradient, AdamW
    # scales that up to a whole step, and one sample beyond the corner makes the difference.
    *_, (agent, twin) = learn_both(9, 500)
    different = gaps(agent, twin) > 1e-4
    assert 0 < different.mean() < 0.01
    observation = random_memory(9)[0].at(np.arange(2000)).observation
    with torch.no_grad():
        q_values = twin.policy(torch.from_numpy(observation)).numpy()
    # Measured: 1.8e-4, of values up to 2.8.
    np.testing.assert_allclose(agent.online(observation), q_values, rtol=0, atol=1e-3)


def test_with_torchs_own_place_of_epsilon_the_weights_part() -> None:
    memory, random = random_memory(3)
    agent = make_agent(preset("cartpole-original", seed=3), random)
    twin = torch_cartpole.Learner(agent.online.get_weights())
    for _ in range(100):
        batch = memory.at([random.batch_positions(len(memory), 128)])
        agent.update(batch)
        twin.update(torch_batch(batch))
    assert gaps(agent, twin).max() > 1e-4


def test_the_recorded_run_of_torch_is_repeated_action_by_action() -> None:
    with np.load(RECORD) as arrays:
        recorded = dict(arrays)
    expected = recorded_episodes(recorded)
    ours = repeated_episodes(recorded)
    for episode in range(10):  # python -m benchmarks.recorded_cartpole: 91 here
        np.testing.assert_array_equal(next(ours), expected[episode], f"episode {episode}")
    assert sum(map(len, expected[:10])) > 150  # updates come after 128


def test_the_initial_weights_are_spread_like_torchs() -> None:
    agent = make_agent(CONFIG, RandomSource(0))
    torch.manual_seed(0)
    for ours, theirs in zip(
        agent.online.get_weights(),
        torch_cartpole.to_keras(torch_cartpole.network()),
        strict=True,
    ):
        assert ours.shape == theirs.shape
        assert abs(ours).max() == pytest.approx(abs(theirs).max(), rel=0.3)
        assert ours.std() == pytest.approx(theirs.std(), rel=0.5)


def test_huber_is_torchs_and_the_sum_done_by_hand() -> None:
    q = np.array([[0.5, 9], [9, 3.0], [9, -2]], np.float32)
    action = np.array([0, 1, 1], np.int32)
    target = np.array([0, 0, -3.5], np.float32)
    by_hand = (0.5 * 0.5**2 + (3 - 0.5) + (1.5 - 0.5)) / 3
    assert float(huber(q, action, target)) == pytest.approx(by_hand)
    taken = torch.tensor([0.5, 3, -2])
    theirs = torch.nn.functional.smooth_l1_loss(taken, torch.from_numpy(target))
    assert theirs.item() == pytest.approx(by_hand)
