from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.backend import keep_to_one_thread
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.replay import Transitions
from keras_pendulum.run import Run

OBSERVATION = np.array([1, 0, 0], np.float32)


def small_run() -> tuple[Run, Transitions]:
    """A run that has learned nothing yet, and batches [2, 2] for it."""
    run = Run(kp.preset("reference", hidden_units=(8,)))
    random = np.random.RandomState(0)
    for _ in range(4):
        run.replay.add(random.randn(3), 1, -1.0, random.randn(3), False)
    return run, run.replay.at([[0, 1], [2, 3]])


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
    action, explored = agent.select_action(OBSERVATION, epsilon=0.3)
    assert asked == ([41] if explores else [])
    greedy = int(agent.online(OBSERVATION[np.newaxis]).numpy().argmax())
    assert (action, explored) == (7 if explores else greedy, explores)
    assert agent.select_action(OBSERVATION, 0.3, known=3) == (7 if explores else 3, explores)


def test_after_an_update_it_acts_on_the_new_weights_and_keeps_them_until_the_next() -> None:
    run, batches = small_run()
    run.agent.update(batches)
    acting = run.agent.policy()
    values = GreedyPolicy(run.agent.online).q_values(OBSERVATION)
    np.testing.assert_array_equal(acting.q_values(OBSERVATION), values)
    run.agent.update(batches)
    np.testing.assert_array_equal(acting.q_values(OBSERVATION), values)
    assert (run.agent.policy().q_values(OBSERVATION) != values).any()


@pytest.mark.parametrize("threads", [1, 2])
def test_it_acts_on_the_old_weights_until_an_update_that_it_began_is_finished(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "environ", {**os.environ, "TF_NUM_INTEROP_THREADS": "2"})
    if threads == 1:
        keep_to_one_thread()
    run, batches = small_run()
    acting = run.agent.policy()
    finish = run.agent.begin_update(batches)
    assert run.agent.policy() is acting
    losses = finish()
    assert len(run.agent._thread._threads) == threads - 1
    twin, _ = small_run()
    np.testing.assert_array_equal(losses, twin.agent.update(batches))
    ours, theirs = (each.agent.policy().q_values(OBSERVATION) for each in (run, twin))
    np.testing.assert_array_equal(ours, theirs)
    assert (ours != acting.q_values(OBSERVATION)).any()


def test_a_fresh_agent_too_acts_on_the_old_weights_until_its_first_update_is_finished(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("TF_NUM_INTEROP_THREADS", raising=False)  # else no thread would learn
    run, batches = small_run()
    before = GreedyPolicy(run.agent.online).q_values(OBSERVATION)

    def submit(call: Callable[[], Any]) -> Future[Any]:
        """As if the thread were done before anybody acts."""
        done: Future[Any] = Future()
        done.set_result(call())
        return done

    monkeypatch.setattr(run.agent._thread, "submit", submit)
    finish = run.agent.begin_update(batches)
    assert (GreedyPolicy(run.agent.online).q_values(OBSERVATION) != before).any()
    np.testing.assert_array_equal(run.agent.policy().q_values(OBSERVATION), before)
    finish()
    assert (run.agent.policy().q_values(OBSERVATION) != before).any()


def test_it_acts_on_the_weights_that_it_is_set_to() -> None:
    run, batches = small_run()
    values = run.agent.policy().q_values(OBSERVATION)
    state = run.agent.get_state()
    run.agent.update(batches)
    assert (run.agent.policy().q_values(OBSERVATION) != values).any()
    run.agent.set_state(*state)
    np.testing.assert_array_equal(run.agent.policy().q_values(OBSERVATION), values)


def test_what_fails_in_an_update_that_it_began_is_raised_where_it_is_finished(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run, batches = small_run()

    def fail(batch: Transitions) -> None:
        raise ValueError("no update today")

    monkeypatch.setattr(run.agent, "learn", fail)
    finish = run.agent.begin_update(batches)
    with pytest.raises(ValueError, match="no update today"):
        finish()


def test_freed_memory_is_given_back_after_compiling_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[None] = []
    monkeypatch.setattr("keras_pendulum.agent.give_back_freed_memory", lambda: given.append(None))
    run = Run(kp.preset("reference", hidden_units=(8,)))
    run.replay.add([1, 0, 0], 1, -1.0, [1, 0, 0], False)
    for positions in ([[0]], [[0]], [[0], [0]]):  # two shapes
        run.agent.update(run.replay.at(positions))
    assert len(given) == 2
