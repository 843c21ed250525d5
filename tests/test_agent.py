from __future__ import annotations

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.run import Run


@pytest.mark.parametrize(("draw", "explores"), [(0.29, True), (0.3, True), (0.31, False)])
def test_it_explores_when_the_draw_is_at_most_epsilon(
    draw: float, explores: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = Run(kp.preset("reference", hidden_units=(8,))).agent
    asked: list[int] = []

    def draw_action(count: int) -> int:
        asked.append(count)
        return 7

    monkeypatch.setattr(agent.random, "uniform", lambda: draw)
    monkeypatch.setattr(agent.random, "action", draw_action)
    observation = np.array([1, 0, 0], np.float32)
    action, explored = agent.select_action(observation, epsilon=0.3)
    assert asked == ([41] if explores else [])
    greedy = int(agent.online(observation[np.newaxis]).numpy().argmax())
    assert (action, explored) == (7 if explores else greedy, explores)
    assert agent.select_action(observation, 0.3, known=3) == (7 if explores else 3, explores)


def test_after_an_update_it_acts_on_the_new_weights_and_keeps_them_until_the_next() -> None:
    run = Run(kp.preset("reference", hidden_units=(8,)))
    random = np.random.RandomState(0)
    for _ in range(4):
        run.replay.add(random.randn(3), 1, -1.0, random.randn(3), False)
    batches = run.replay.at([[0, 1], [2, 3]])
    observation = np.array([1, 0, 0], np.float32)
    run.agent.update(batches)
    acting = run.agent.policy()
    values = GreedyPolicy(run.agent.online).q_values(observation)
    np.testing.assert_array_equal(acting.q_values(observation), values)
    run.agent.update(batches)
    np.testing.assert_array_equal(acting.q_values(observation), values)
    assert (run.agent.policy().q_values(observation) != values).any()


def test_freed_memory_is_given_back_after_compiling_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[None] = []
    monkeypatch.setattr("keras_pendulum.agent.give_back_freed_memory", lambda: given.append(None))
    run = Run(kp.preset("reference", hidden_units=(8,)))
    run.replay.add([1, 0, 0], 1, -1.0, [1, 0, 0], False)
    for positions in ([[0]], [[0]], [[0], [0]]):  # two shapes
        run.agent.update(run.replay.at(positions))
    assert len(given) == 2
