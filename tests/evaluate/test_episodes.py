"""Episodes of any agent: side by side or one by one, and where a wrong answer was given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.evaluate import evaluation

NETWORK = kp.DQN((8,), 5, seed=3)


def asked(batches: list[tuple[int, ...]]) -> Any:
    """Returns the network as a function that notes the shapes of its observations."""
    policy = kp.load_policy(NETWORK)

    def values(observations: NDArray[np.float32]) -> NDArray[np.float32]:
        batches.append(observations.shape)
        return policy.q_values(observations)

    agent = kp.q_function(values)  # which asks once
    batches.clear()
    return agent


def test_many_episodes_are_made_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluation, "_SIDE_BY_SIDE", 3)
    batches: list[tuple[int, ...]] = []
    agent = asked(batches)
    score = kp.evaluate_policy(agent, 7, seed=5, gravity=1.0)
    assert batches == [(3, 3)] * 400 + [(1, 3)] * 200
    expected = kp.evaluate_policy(NETWORK, 7, seed=5, gravity=1.0)
    np.testing.assert_allclose(score.returns, expected.returns, rtol=1e-9)


def test_watched_episodes_are_made_one_by_one() -> None:
    batches: list[tuple[int, ...]] = []
    agent = asked(batches)
    steps: list[Any] = []
    score = kp.evaluate_policy(agent, 2, gravity=1.0, on_step=steps.append)
    assert batches == [(1, 3)] * 400
    assert len(steps) == 402
    np.testing.assert_allclose(
        score.returns, kp.evaluate_policy(NETWORK, 2, gravity=1.0).returns, rtol=1e-9
    )


def test_function_with_a_state_sees_one_episode_after_the_other() -> None:
    seen: list[NDArray[np.float32]] = []

    def act(observation: NDArray[np.float32]) -> float:
        seen.append(observation.copy())
        return 0.0

    kp.evaluate_policy(act, 2, gravity=1.0)
    speeds = np.array(seen)[:, 2]
    assert len(seen) == 400
    # The pendulum cannot jump within an episode: 0.75 rad/s² of gravity and 1.5 of torque a step.
    jumps = np.flatnonzero(np.abs(np.diff(speeds)) > 0.12)
    assert set(jumps.tolist()) <= {199}


@pytest.mark.parametrize("batched", [True, False])
def test_wrong_answer_is_reported_with_episode_and_step(
    batched: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evaluation, "_SIDE_BY_SIDE", 2)
    start = Pendulum().make_env().reset(seed=4)[0]
    calls = [0]

    def torque(observation: NDArray[np.float32]) -> float:
        calls[0] += 1
        return 2.5 if (observation == start).all() else 0.0

    def values(observations: NDArray[np.float32]) -> NDArray[Any]:
        wrong = (observations == start).all(axis=1)
        return np.where(wrong[:, np.newaxis], np.nan, [[0.0, 1.0, 0.0]])

    agent: Any = kp.q_function(values) if batched else torque
    problem = "a Q-value that is not finite" if batched else "the torque 2.5 N·m; expected .*"
    with pytest.raises(kp.UserError, match=rf"^episode 3, step 0: the agent returned {problem}$"):
        kp.evaluate_policy(agent, 5, seed=1, gravity=1.0)


def test_exception_of_the_agent_is_reported_with_its_place() -> None:
    count = [0]

    def act(observation: NDArray[np.float32]) -> float:
        count[0] += 1
        return 1 / (203 - count[0])

    problem = (
        r"^episode 1, step 2: the agent raised ZeroDivisionError: .*test_episodes\.py, line \d+"
    )
    with pytest.raises(kp.UserError, match=problem) as caught:
        kp.evaluate_policy(act, 2, gravity=1.0)
    assert caught.value.__cause__ is not None
