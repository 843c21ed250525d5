from __future__ import annotations

import numpy as np
import pytest

import keras_pendulum as kp
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
    action = agent.select_action(observation, epsilon=0.3)
    assert asked == ([41] if explores else [])
    greedy = int(agent.online(observation[np.newaxis]).numpy().argmax())
    assert action == (7 if explores else greedy)
