import json
import re
from typing import Any

import numpy as np
import pytest
from exact_agent import NOISE, diagnose_values, exact_values, measure, untrained_outputs

from keras_pendulum.diagnosis.diagnose import diagnose_measurement
from keras_pendulum.diagnosis.diagnosis import Diagnosis
from keras_pendulum.diagnosis.faults import FAULTS
from keras_pendulum.diagnosis.findings import find
from keras_pendulum.environments.actions import TorqueActions
from keras_pendulum.optimum.dynamics import TORQUES


def first(diagnosis: Diagnosis) -> str:
    return diagnosis.findings[0].name if diagnosis.findings else "no finding"


def test_exact_values_give_no_finding() -> None:
    diagnosis = diagnose_values(exact_values)
    assert diagnosis.findings == diagnosis.notes == []
    assert diagnosis.summary().startswith("No finding: regret 0.")
    signals = diagnosis.as_json()["signals"]
    assert signals["value_slope"] == pytest.approx(1)
    assert signals["advantage_correlation"] == pytest.approx(1)


@pytest.mark.parametrize(
    ("fault", "q_values"),
    [
        ("torque-map", lambda o: np.roll(exact_values(o), 20, axis=1)),
        ("torque-map", lambda o: exact_values(o)[:, np.random.RandomState(3).permutation(41)]),
        ("observation-map", lambda o: exact_values(o * np.array([-1, 1, 1], np.float32))),
        ("untrained-outputs", untrained_outputs),
        ("not-converged", lambda o: np.tanh(o @ NOISE) + 0.01 * exact_values(o)),
        ("reward-scale", lambda o: 1e-6 * np.tanh(o @ NOISE) + 1e-5 * exact_values(o)[:, :1]),
        ("reward-scale", lambda o: -140 + 0.01 * np.tanh(o @ NOISE)),
        ("broken-network", lambda o: np.full((len(o), 41), np.nan)),
        ("broken-network", lambda o: np.full((len(o), 41), -3.0)),
        ("broken-network", lambda o: np.tile(-30 - np.arange(41) / 10, (len(o), 1))),  # all dead
        ("broken-network", lambda o: 1e12 * np.sin(50 * exact_values(o))),
        ("broken-network", lambda o: 1e4 * (np.sin(50 * exact_values(o)) - 0.3)),  # to both sides
        ("overestimation", lambda o: 1e12 * (2 + np.sin(50 * exact_values(o)))),
        ("overestimation", lambda o: exact_values(o) + 60 * np.abs(np.sin(3 * o @ NOISE))),
    ],
)
def test_each_change_of_the_exact_values_is_named_first(fault: str, q_values: Any) -> None:
    diagnosis = diagnose_values(q_values)
    assert first(diagnosis) == fault
    json.dumps(diagnosis.as_json(), allow_nan=False)


def test_right_values_need_more_training() -> None:
    diagnosis = diagnose_values(exact_values, share=0.4)
    assert diagnosis.findings == []
    assert re.fullmatch(
        r"No finding, but regret .*: .* from the discount, and .* satisfy the right equation "
        r"to \d+ %.* Train for longer, with a learning rate that falls\.",
        diagnosis.verdict,
    )


@pytest.mark.parametrize(
    ("note", "q_values"),
    [
        ("reward-scale: the values satisfy 5·r + γ·max", lambda o: 5 * exact_values(o)),
        (
            "torque-map: 41 outputs with 11 different values",
            lambda o: exact_values(o)[:, 20 + (np.arange(41) - 20) // 4],
        ),
    ],
)
def test_what_costs_little_is_a_note(note: str, q_values: Any) -> None:
    diagnosis = diagnose_values(q_values)
    assert diagnosis.findings == [] and len(diagnosis.notes) == 1
    assert f"Note, costs little: {note}" in diagnosis.summary()


def test_finding_whose_repair_makes_the_agent_worse_is_no_note() -> None:
    def shrunk(observations: Any) -> Any:  # the best torque stays the best
        q = exact_values(observations, gravity=10.0, discount=0.98)
        return 0.25 * q + 0.75 * q.mean(axis=1, keepdims=True)

    measured = measure(shrunk, gravity=10.0, discount=0.98)
    (finding,) = find(measured)
    assert (finding.name, finding.cost is not None and finding.cost < -100) == ("torque-map", True)
    diagnosis = diagnose_measurement(measured)
    assert diagnosis.findings == diagnosis.notes == []


def test_repair_shows_what_a_reversed_torque_map_costs() -> None:
    finding = diagnose_values(lambda o: exact_values(o)[:, ::-1]).findings[0]
    assert finding.name == "torque-map"
    assert finding.repair is not None and finding.cost is not None
    assert finding.repair.regret < 2 and finding.cost > 500


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_torques_that_are_all_small_are_named_where_larger_ones_play_better(share: float) -> None:
    measured = measure(exact_values, share=share)
    measured.policy.actions = TorqueActions(share * TORQUES)
    diagnosis = diagnose_measurement(measured)
    assert first(diagnosis) == "torque-map", diagnosis.verdict
    assert f"at most {2 * share:g} N·m" in diagnosis.summary()
    assert f"multiply by {1 / share:.2g}" in diagnosis.summary()
    # Values of random weights play no better with larger torques.
    measured = measure(lambda o: np.tanh(o @ NOISE), share=share)
    measured.policy.actions = TorqueActions(share * TORQUES)
    assert "torque-map" not in {finding.name for finding in find(measured)}


def test_bare_policy_is_diagnosed_by_repairs() -> None:
    diagnosis = diagnose_values(exact_values, share=-1.0, bare=True)
    assert first(diagnosis) == "torque-map"
    assert diagnosis.limits == ["without Q-values, faults of the training cannot be seen"]
    assert first(diagnose_values(exact_values, bare=True)) == "no finding"


def test_wrong_values_without_a_known_reason_are_not_converged() -> None:
    def guesses(observations: Any) -> Any:  # half of the states, with wrong signs of the torque
        q = exact_values(observations)
        return np.where(np.sin(20 * observations[:, :1]) > 0, q, q[:, ::-1])

    diagnosis = diagnose_values(guesses)
    assert first(diagnosis) == "not-converged"
    assert "run folder" in diagnosis.limits[0]


def test_every_fault_has_two_sentences_and_a_remedy() -> None:
    for fault in FAULTS.values():
        assert fault.explanation.count(". ") == 1 and fault.remedy.endswith(".")
        assert set(fault.explains) < set(FAULTS)
