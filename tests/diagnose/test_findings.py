import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from exact_agent import coarse_value, exact_values, subject

from keras_pendulum.diagnose import comparisons, measurement
from keras_pendulum.diagnose.diagnosis import Diagnosis, diagnose_subject
from keras_pendulum.diagnose.evidence import Evidence
from keras_pendulum.diagnose.findings import RULES, find
from keras_pendulum.diagnose.subject import Subject
from keras_pendulum.diagnose.texts import TEXTS

NOISE = np.random.RandomState(0).normal(size=(3, 41))


@pytest.fixture(autouse=True)
def _coarse_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measurement, "discounted_value", coarse_value)
    monkeypatch.setattr(comparisons, "other_value", coarse_value)


def first(diagnosis: Diagnosis) -> str:
    return diagnosis.findings[0].name if diagnosis.findings else "no finding"


def of(q_values: Any) -> str:
    return first(diagnose_subject(subject(q_values)))


def rewards(observations: Any) -> Any:
    return exact_values(observations, discount=0.0)


def half(observations: Any) -> Any:
    return exact_values(observations, discount=0.5)


def with_outputs(*outputs: int) -> Any:
    def q_values(observations: Any) -> Any:
        q = 0.14 * exact_values(observations) - 1
        q[:, list(outputs)] = 0.3
        return q

    return q_values


def test_exact_values_give_no_finding() -> None:
    diagnosis = diagnose_subject(subject(exact_values))
    assert diagnosis.findings == diagnosis.notes == []
    assert diagnosis.summary().startswith("No finding: regret 0.")
    signals = diagnosis.as_json()["signals"]
    assert signals["value_slope"] == pytest.approx(1)
    assert signals["advantage_correlation"] == pytest.approx(1)


@pytest.mark.parametrize(
    ("fault", "q_values"),
    [
        ("torque-map", lambda o: exact_values(o)[:, ::-1]),
        ("torque-map", lambda o: np.roll(exact_values(o), 20, axis=1)),
        ("torque-map", lambda o: exact_values(o)[:, np.random.RandomState(3).permutation(41)]),
        ("observation-map", lambda o: exact_values(o * np.array([1, 1, -1], np.float32))),
        ("observation-map", lambda o: exact_values(o * np.array([-1, 1, 1], np.float32))),
        ("observation-map", lambda o: exact_values(o[:, [1, 0, 2]])),
        ("reward-sign", lambda o: -exact_values(o)),
        ("no-bootstrapping", rewards),
        ("misaligned-transitions", lambda o: 10 * rewards(o)),
        ("untrained-outputs", with_outputs(2, 4)),
        ("too-few-updates", lambda o: np.tanh(o @ NOISE) + 0.01 * exact_values(o)),
        ("reward-scale", lambda o: 1e-6 * np.tanh(o @ NOISE) + 1e-5 * exact_values(o)[:, :1]),
        ("broken-network", lambda o: np.full((len(o), 41), np.nan)),
        ("broken-network", lambda o: np.zeros((len(o), 41))),
        ("broken-network", lambda o: 1e12 * np.sin(50 * exact_values(o))),
        ("overestimation", lambda o: 1e12 * (2 + np.sin(50 * exact_values(o)))),
        ("overestimation", lambda o: exact_values(o) + 15 * np.abs(np.sin(3 * o @ NOISE))),
    ],
)
def test_each_change_of_the_exact_values_is_named_first(fault: str, q_values: Any) -> None:
    assert of(q_values) == fault


@pytest.mark.parametrize(
    ("share", "verdict"),
    [
        (0.5, r"No finding, but regret [\d.]+, where up to [\d.]+ is little: train for longer\."),
        (0.3, r"undetermined: .*"),
    ],
)
def test_right_values_need_more_training_unless_they_cost_much(share: float, verdict: str) -> None:
    exact = subject(exact_values)
    weak = replace(exact, act=lambda observations: share * exact.act(observations))
    assert re.fullmatch(verdict, diagnose_subject(weak).verdict)


def test_values_of_another_gravity_are_named_with_it() -> None:
    diagnosis = diagnose_subject(subject(exact_values, gravity=10.0))
    assert first(diagnosis) == "other-gravity"
    assert "g = " in diagnosis.findings[0].evidence


def test_values_of_another_discount_are_named() -> None:
    found = diagnose_subject(subject(half))
    assert "other-discount" in [each.name for each in (*found.findings, *found.notes)]


@pytest.mark.parametrize(
    ("fault", "q_values"),
    [
        ("reward-scale", lambda o: 5 * exact_values(o)),
        ("torque-map", lambda o: exact_values(o)[:, 20 + (np.arange(41) - 20) // 4]),
    ],
)
def test_what_costs_little_is_a_note(fault: str, q_values: Any) -> None:
    diagnosis = diagnose_subject(subject(q_values))
    assert diagnosis.findings == []
    assert [note.name for note in diagnosis.notes] == [fault]
    assert f"Note, costs little: {fault}" in diagnosis.summary()


def test_good_agent_has_no_note_whose_repair_makes_it_bad() -> None:
    def shrunk(observations: Any) -> Any:  # the best torque stays the best
        q = exact_values(observations, gravity=10.0, discount=0.98)
        return 0.25 * q + 0.75 * q.mean(axis=1, keepdims=True)

    agent = subject(shrunk, gravity=10.0, discount=0.98)
    (finding,) = find(Evidence(measurement.measure(agent), None))
    assert (finding.name, finding.cost is not None and finding.cost < -100) == ("torque-map", True)
    diagnosis = diagnose_subject(agent)
    assert diagnosis.findings == diagnosis.notes == []


def test_repair_shows_what_a_reversed_torque_map_costs() -> None:
    finding = diagnose_subject(subject(lambda o: exact_values(o)[:, ::-1])).findings[0]
    assert finding.repair is not None and finding.cost is not None
    assert finding.repair.regret < 2 and finding.cost > 500


def test_bare_policy_is_diagnosed_by_repairs() -> None:
    act = subject(exact_values).act
    reversed_torque = Subject("policy", 1.0, 0.9, lambda observations: -act(observations))
    diagnosis = diagnose_subject(reversed_torque)
    assert first(diagnosis) == "torque-map"
    assert diagnosis.limits == ["the agent has no Q-values, so only repairs could be tried"]
    assert first(diagnose_subject(Subject("policy", 1.0, 0.9, act))) == "no finding"


def test_wrong_values_without_a_known_reason_are_undetermined() -> None:
    def guesses(observations: Any) -> Any:  # half of the states, with wrong signs of the torque
        q = exact_values(observations)
        return np.where(np.sin(20 * observations[:, :1]) > 0, q, q[:, ::-1])

    diagnosis = diagnose_subject(subject(guesses))
    assert first(diagnosis) in ("undetermined", "misaligned-transitions")
    assert "run folder" in diagnosis.limits[0]


def test_every_rule_has_a_text() -> None:
    assert len(RULES) == len({rule.__name__ for rule in RULES})
    for text in TEXTS.values():
        assert text.explanation.count(". ") == 1 and text.remedy.endswith(".")
