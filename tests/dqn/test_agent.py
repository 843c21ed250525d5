"""The agent: its actions and its gradient steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf
from small_agents import OBSERVATION, assert_weights, make_agent, random_batches

from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.losses import huber, mean_squared_error
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import (
    TargetRule,
    double_q_learning,
    no_update,
    q_learning,
    soft_update,
)


def one_transition(action: int, reward: float, terminated: bool) -> Transitions:
    """Returns one batch of one transition [1, 1] between equal observations."""
    observation = np.array([[[1, 2, 0]]], np.float32)
    return Transitions(
        observation,
        np.array([[action]], np.int32),
        np.array([[reward]], np.float32),
        observation,
        np.array([[terminated]]),
    )


def linear_agent(**settings: Any) -> Agent:
    """Returns an agent with Q(s, 0) = 1 and Q(s, 1) = 0 for every s, and the step size 0.1."""
    network = DQN((), 2)
    network.set_weights([np.zeros((3, 2)), np.array([1, 0])])
    return make_agent(
        network,
        optimizer=keras.optimizers.SGD(0.1),
        update_target=no_update,
        discount=0.5,
        **settings,
    )


@pytest.mark.parametrize(("draw", "explores"), [(0.29, True), (0.3, True), (0.31, False)])
def test_agent_explores_when_the_draw_is_at_most_epsilon(
    draw: float, explores: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []

    class Draws:
        def random_sample(self) -> float:
            return draw

        def randint(self, count: int) -> int:
            counts.append(count)
            return 7

    agent = make_agent()
    monkeypatch.setattr(agent, "rng", Draws())
    greedy = int(agent.online(OBSERVATION[np.newaxis]).numpy().argmax())
    assert greedy != 7
    assert agent.select_action(OBSERVATION, epsilon=0.3) == (7 if explores else greedy)
    assert counts == ([41] if explores else [])


def test_actions_are_drawn_as_in_the_recorded_run() -> None:
    agent = make_agent(seed=1)
    greedy = agent.policy.action(OBSERVATION)
    legacy = np.random.RandomState(1)
    expected = [legacy.choice(41) if legacy.rand() <= 0.5 else greedy for _ in range(100)]
    assert [agent.select_action(OBSERVATION, 0.5) for _ in range(100)] == expected


@pytest.mark.parametrize(
    ("loss", "reward", "terminated", "value", "slope"),
    [
        # Q - target is 0 + 3. The mean is over two outputs, so the slope is 2 * 3 / 2.
        (mean_squared_error, -3, True, 3**2 / 2, 3.0),
        # The target is -1 + 0.5 * max(1, 0), and the value that it bootstraps from stays.
        (mean_squared_error, -1, False, 0.5**2 / 2, 0.5),
        (huber, -3, True, 3 - 0.5, 1.0),
    ],
)
def test_gradient_step_is_that_computed_by_hand(
    loss: Callable[..., tf.Tensor], reward: float, terminated: bool, value: float, slope: float
) -> None:
    agent = linear_agent(loss=loss)
    (found,) = agent.update(one_transition(1, reward, terminated))
    assert found == pytest.approx(value)
    kernel, bias = agent.online.get_weights()
    step = 0.1 * slope
    np.testing.assert_allclose(kernel, [[0, -step], [0, -2 * step], [0, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(bias, [1, -step], rtol=1e-6)


@pytest.mark.parametrize(("rule", "next_value"), [(q_learning, 5.0), (double_q_learning, 2.0)])
def test_target_network_values_the_next_observation(rule: TargetRule, next_value: float) -> None:
    agent = linear_agent(target_rule=rule)
    agent.target = agent.online.clone()
    agent.target.set_weights([np.zeros((3, 2)), np.array([2, 5])])  # the online choice is action 0
    (loss,) = agent.update(one_transition(action=1, reward=-1, terminated=False))
    assert loss == pytest.approx((-1 + 0.5 * next_value) ** 2 / 2)


@pytest.mark.parametrize("tau", [0.0, 0.25])  # with 0, the optimizer alone could change the target
def test_soft_update_follows_each_gradient_step(tau: float) -> None:
    agent = make_agent(update_target=partial(soft_update, tau))
    expected = agent.target.get_weights()
    for _ in range(3):
        agent.update(random_batches(1))
        pairs = zip(agent.online.get_weights(), expected, strict=True)
        expected = [tau * ours + (1 - tau) * theirs for ours, theirs in pairs]
        assert_weights(agent.target.get_weights(), expected, rtol=3e-7, atol=1e-8)


def test_update_makes_one_gradient_step_for_each_batch() -> None:
    together, one_by_one = make_agent(), make_agent()
    batches = random_batches(5)
    losses = together.update(batches)
    assert losses.shape == (5,)
    single = [
        one_by_one.update(Transitions(*(field[k : k + 1] for field in batches)))[0]
        for k in range(5)
    ]
    np.testing.assert_allclose(losses, single, rtol=1e-5)
    assert int(together.optimizer.iterations) == 5
    states = together.get_state(), one_by_one.get_state()
    for group in states[0]:
        ours, theirs = (list(state[group].values()) for state in states)
        assert_weights(ours, theirs, rtol=1e-4, atol=1e-6)


def test_update_is_compiled_once_for_each_shape() -> None:
    traces = []

    def loss(*batch: tf.Tensor) -> tf.Tensor:
        traces.append(batch)
        return mean_squared_error(*batch)

    agent = make_agent(loss=loss)
    for batches, is_compiled in [(2, False), (2, True), (3, False), (2, True), (3, True)]:
        before = len(traces)
        assert agent.is_compiled(random_batches(batches)) == is_compiled
        agent.update(random_batches(batches))
        assert (len(traces) == before) == is_compiled


def test_update_makes_the_agent_act_on_the_new_weights() -> None:
    agent = make_agent(optimizer=keras.optimizers.Adam(0.5))
    old_policy = agent.policy
    old_q = old_policy.q_values(OBSERVATION)
    for seed in range(3):
        agent.update(random_batches(2, seed=seed))
        new_q = greedy_policy(agent.online).q_values(OBSERVATION)
        np.testing.assert_array_equal(agent.policy.q_values(OBSERVATION), new_q)
        assert (new_q != old_q).all()
        assert agent.select_action(OBSERVATION, 0.0) == new_q.argmax()
    np.testing.assert_array_equal(old_policy.q_values(OBSERVATION), old_q)
