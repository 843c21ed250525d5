from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from keras_pendulum.actions import make_actions
from keras_pendulum.environment import make_environment, snapshot


@pytest.mark.parametrize(
    ("name", "gravity", "steps"), [("Pendulum-v1", 1.0, 30), ("CartPole-v1", None, None)]
)
def test_from_a_snapshot_the_same_steps_come_again(
    name: str, gravity: float | None, steps: int | None
) -> None:
    env = make_environment(name, gravity, steps=steps)
    actions = make_actions(name, 41)

    def to_the_end() -> list[Any]:
        met: list[Any] = []
        over = False
        while not over:
            met.append(env.step(actions.control(len(met) % 3 % 2)))
            over = met[-1][2] or met[-1][3]
        return met

    env.reset(seed=0)
    for _ in range(3):
        env.step(actions.control(1))
    go_back = snapshot(env)
    first = to_the_end()
    for _ in range(2):  # twice from one snapshot
        go_back()
        again = to_the_end()
        assert len(first) == len(again) > 3
        for ours, theirs in zip(again, first, strict=True):
            np.testing.assert_array_equal(ours[0], theirs[0])
            assert ours[1:4] == theirs[1:4]
    if steps is not None:
        assert len(first) == steps - 3  # the steps to the truncation are counted anew, too
