"""The preset `cartpole-original` and the notebooks' program in PyTorch (torch_cartpole.py)."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch
import torch_agent
import torch_cartpole
from numpy.typing import NDArray

from benchmarks.recorded_runs.cartpole import RECORDING, recorded_episodes, repeated_episodes
from benchmarks.recorded_runs.recording import load_recording
from keras_pendulum.config.presets import preset
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.random_streams import RandomStreams
from keras_pendulum.dqn.replay_buffer import ReplayBuffer
from keras_pendulum.train.run import make_run

torch.set_num_threads(1)  # the order of a sum, and so its rounding, depends on the threads

CONFIG = preset("cartpole-original")


def test_settings_are_those_of_the_preset() -> None:
    names = ("replay_capacity", "batch_size", "discount", "gradient_clip", "learning_rate", "tau")
    for name in (*names, "epsilon_start", "epsilon_min", "epsilon_decay_steps"):
        assert getattr(CONFIG, name) == getattr(torch_cartpole, name.upper())


def random_replay(seed: int) -> tuple[ReplayBuffer, RandomStreams]:
    """Returns 2000 transitions of random actions, about one in 20 terminated, and the streams."""
    env = gymnasium.make("CartPole-v1")
    streams = RandomStreams(seed)
    replay = ReplayBuffer(CONFIG.replay_capacity, observation_size=4)
    observation, _ = env.reset(seed=seed)
    while len(replay) < 2000:
        action = int(streams.exploration.randint(2))
        next_observation, reward, terminated, truncated, _ = env.step(action)
        replay.add(observation, action, float(reward), next_observation, terminated)
        observation = next_observation
        if terminated or truncated:
            observation, _ = env.reset()
    return replay, streams


def learn_both(seed: int) -> tuple[Agent, torch_cartpole.Agent]:
    """Makes the same 500 updates with both agents; returns both."""
    replay, streams = random_replay(seed)
    agent = make_run(preset("cartpole-original", seed=seed)).agent
    twin = torch_cartpole.Agent(agent.online.get_weights(), torch_cartpole.keras_epsilon)
    batches = replay.sample(CONFIG.batch_size, streams.replay, 500)  # [500, 128, ...]
    tensors = map(torch.from_numpy, batches)
    twin_losses = [
        twin.gradient_step(torch_agent.Transitions(*batch)) for batch in zip(*tensors, strict=True)
    ]
    np.testing.assert_allclose(agent.update(batches), twin_losses, rtol=0, atol=5e-5)
    return agent, twin


def differences(agent: Agent, twin: torch_cartpole.Agent) -> NDArray[np.float32]:
    """Returns the absolute difference of every weight, of both networks."""
    pairs = [
        *zip(agent.online.get_weights(), torch_agent.to_keras(twin.online), strict=True),
        *zip(agent.target.get_weights(), torch_agent.to_keras(twin.target), strict=True),
    ]
    return np.concatenate([abs(ours - theirs).ravel() for ours, theirs in pairs])


def test_500_updates_give_the_same_weights() -> None:
    # With this seed no activation is so close to ReLU's corner that rounding decides its side.
    agent, twin = learn_both(1)
    # Measured: 3.4e-5; the weights move by 0.07.
    assert differences(agent, twin).max() < 1e-4


def test_rounding_at_the_corner_of_relu_changes_few_weights_and_no_value() -> None:
    # With 11 of 16 seeds some unit is barely active. Its weights have almost no gradient, AdamW
    # scales that up to a whole step, and one sample beyond the corner makes the difference.
    agent, twin = learn_both(9)
    different = differences(agent, twin) > 1e-4
    assert 0 < different.mean() < 0.01
    observations = random_replay(9)[0].transitions().observation  # [2000, 4]
    with torch.no_grad():
        q_values = twin.online(torch.from_numpy(observations)).numpy()
    # Measured: 1.8e-4, of values up to 2.8.
    np.testing.assert_allclose(agent.online(observations), q_values, rtol=0, atol=1e-3)


def test_recorded_run_of_torch_is_repeated_action_by_action() -> None:
    recorded = load_recording(RECORDING)
    expected = recorded_episodes(recorded)
    repeated = repeated_episodes(recorded)
    for episode in range(10):  # benchmarks/recorded_runs/cartpole.py counts all equal episodes: 91
        np.testing.assert_array_equal(next(repeated), expected[episode], f"episode {episode}")
    assert sum(map(len, expected[:10])) > 150  # updates begin after 128 steps


def test_program_repeats_its_recorded_run() -> None:
    recorded = load_recording(RECORDING)
    initial = [recorded[f"initial_weight_{i}"] for i in range(6)]
    agent = torch_cartpole.Agent(initial, torch_cartpole.keras_epsilon)
    episodes = torch_cartpole.train_episodes(agent, int(recorded["seed"]), 10)
    for actions, expected in zip(episodes, recorded_episodes(recorded), strict=False):
        np.testing.assert_array_equal(actions, expected)


def test_initial_weights_have_the_spread_of_torch() -> None:
    online = DQN((128, 128), 2, observation_size=4, initial_weights=CONFIG.initial_weights)
    torch.manual_seed(0)
    for ours, theirs in zip(
        online.get_weights(), torch_agent.to_keras(torch_cartpole.network()), strict=True
    ):
        assert ours.shape == theirs.shape
        assert abs(ours).max() == pytest.approx(abs(theirs).max(), rel=0.3)
        assert ours.std() == pytest.approx(theirs.std(), rel=0.5)
