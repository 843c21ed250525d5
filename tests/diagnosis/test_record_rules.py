"""Tests of the rules that compare an agent with the record of its run."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from exact_agent import NOISE, PENDULUM, exact_values, measure

from keras_pendulum.config.config import Config
from keras_pendulum.diagnosis.acting_rules import observation_map, torque_map
from keras_pendulum.diagnosis.findings import find
from keras_pendulum.diagnosis.run_record import RunRecord
from keras_pendulum.diagnosis.states import Episodes
from keras_pendulum.diagnosis.training_rules import overestimation, stored_rewards
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.optimum.dynamics import TORQUES, step_all_torques

OTHER_NOISE = np.random.RandomState(1).normal(size=(3, 41))


def untrained(observations: Any) -> Any:
    """Returns Q-values that show no torque: only the stored actions can."""
    return np.sin(observations @ NOISE)


def record_of(q_values: Any, **settings: Any) -> RunRecord:
    """Returns the record of a greedy run of the pendulum with g = 1 from random states."""
    states = np.random.RandomState(0).uniform((-np.pi, -8), (np.pi, 8), (600, 2))
    observations = PENDULUM.observe(states)
    actions = q_values(observations).argmax(axis=1).astype(np.int32)
    rows = np.arange(len(actions))
    reward, theta, speed = step_all_torques(1.0, states[:, 0], states[:, 1], TORQUES)
    following = np.stack([theta[rows, actions], speed[rows, actions]], axis=1)
    replay = Transitions(
        observations,
        actions,
        reward[rows, actions],
        PENDULUM.observe(following),
        np.zeros(600, bool),
    )
    return RunRecord(replace(Config(), **settings), [], replay)


@pytest.mark.parametrize(
    "order",
    [np.arange(41)[::-1], np.roll(np.arange(41), 20), np.random.RandomState(3).permutation(41)],
)
def test_stored_actions_show_the_order_of_the_outputs(order: Any) -> None:
    found = measure(lambda o: untrained(o)[:, order], record_of(untrained))
    finding = torque_map(found)
    assert finding is not None and finding.evidence.endswith("in its place 1.00")
    assert finding.repair is not None
    assert finding.repair.regret == pytest.approx(measure(untrained).regret, rel=0.1)
    assert observation_map(found) is None


@pytest.mark.parametrize("signs", [(1, 1, -1), (-1, 1, 1), (1, -1, 1)])
def test_stored_actions_show_the_changed_observation(signs: Any) -> None:
    found = measure(lambda o: untrained(o * np.array(signs)), record_of(untrained))
    finding = observation_map(found)
    assert finding is not None and finding.evidence.endswith("1.00")
    assert torque_map(found) is None


@pytest.mark.parametrize("q_values", [untrained, lambda o: np.sin(o @ OTHER_NOISE)])
def test_agent_that_acts_as_its_run_or_as_no_map_of_it_has_no_map(q_values: Any) -> None:
    found = measure(q_values, record_of(untrained))
    assert torque_map(found) is None and observation_map(found) is None


def test_stored_actions_refute_a_torque_map() -> None:
    def reversed_values(observations: Any) -> Any:
        return exact_values(observations)[:, ::-1]

    assert torque_map(measure(reversed_values)) is not None
    assert torque_map(measure(reversed_values, record_of(reversed_values))) is None


def test_rewards_of_the_stored_states_are_no_bootstrapping() -> None:
    record = record_of(untrained)
    seen = record.replay.observation[:, 2] > 0.5
    replay = Transitions(*(array[seen] for array in record.replay))

    def rewards(observations: Any) -> Any:  # wrong where the run has never been
        wrong = 20 * np.sin(9 * observations @ NOISE) * (observations[:, 2:] < 0)
        return exact_values(observations, discount=0.0) + wrong

    finding = stored_rewards(measure(rewards, replace(record, replay=replay)))
    assert finding is not None and finding.name == "no-bootstrapping"
    assert stored_rewards(measure(rewards)) is None
    assert stored_rewards(measure(exact_values, record)) is None


def test_uncollected_values_without_a_target_network_are_overestimation() -> None:
    weak = measure(exact_values, share=0.0)
    assert weak.excess == pytest.approx(0, abs=0.01) and weak.value_overestimate > 0.2
    without = record_of(exact_values, target_update="none")
    assert overestimation(measure(exact_values, without, share=0.0)) is not None
    assert overestimation(measure(exact_values, record_of(exact_values), share=0.0)) is None
    assert overestimation(weak) is None
    assert overestimation(measure(exact_values, without)) is None


def test_torque_map_explains_values_that_the_policy_does_not_collect() -> None:
    record = record_of(exact_values, target_update="none")
    found = measure(lambda o: exact_values(o)[:, ::-1], record)
    assert overestimation(found) is not None
    names = [finding.name for finding in find(found)]
    assert "torque-map" in names and "overestimation" not in names


def test_returns_to_go_are_the_discounted_sums_of_the_rest() -> None:
    rewards = np.array([[1.0, 0], [2, 0], [4, 8]])
    episodes = Episodes(np.zeros((3, 2, 2)), rewards, np.ones((3, 2), bool))
    assert episodes.returns_to_go(0.5).tolist() == [[3, 2], [4, 4], [4, 8]]
    assert rewards[0, 0] == 1
