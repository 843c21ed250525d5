"""Tests of agents that give no Q-values: only repairs can be tried."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fixed_points import DISCOUNT, GRAVITY, TORQUES, fixed_point, right

import keras_pendulum as kp
from keras_pendulum.diagnosis import diagnose as module


def greedy(observation: Any) -> float:
    """Returns the torque of a healthy network in N·m."""
    q = fixed_point(right)(np.atleast_2d(observation))
    return float(TORQUES[q.argmax(axis=1)][0])


def diagnose(agent: Any, **options: Any) -> kp.Diagnosis:
    return kp.diagnose(agent, gravity=GRAVITY, discount=DISCOUNT, **options)


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Takes every function for a slow one."""
    monkeypatch.setattr(module, "_STARTS_BY_SECONDS", ((np.inf, 4),))


@pytest.mark.usefixtures("few_starts")
@pytest.mark.parametrize(
    ("agent", "finding", "repair"),
    [
        (lambda o: -greedy(o), "torque-map", "torque reversed"),
        (lambda o: 0.4 * greedy(o), "torque-map", "double the torque"),
        (lambda o: greedy(o * np.array([1, 1, -1])), "observation-map", "observation ["),
    ],
)
def test_simple_repair_is_found(agent: Any, finding: str, repair: str) -> None:
    diagnosis = diagnose(agent)
    (found,) = diagnosis.findings
    assert found.name == finding
    assert found.repair is not None and found.repair.name.startswith(repair)
    assert found.repair.won > 0.5 * diagnosis.measurement.avoidable_regret


@pytest.mark.usefixtures("few_starts")
def test_small_torques_that_are_a_choice_are_not_doubled() -> None:
    def weak(observation: Any) -> float:
        torque = greedy(observation)
        return torque if abs(torque) > 1.9 and observation[0] < 0 else 0.4 * torque

    assert diagnose(weak).findings == []


def test_cart_that_drifts_is_not_a_cart_seen_reversed() -> None:
    """Half-trained policies drift, and stay on the track once the position is reversed."""
    weights = np.array([-1.0, 0.8, 8, 2])
    found = kp.diagnose(lambda o: int(o @ weights > 0), environment="CartPole-v1", discount=0.99)
    balances = kp.evaluate_policy(
        lambda o: int(o @ (weights * [-1, 1, 1, 1]) > 0), environment="CartPole-v1"
    )
    assert found.measurement.regret > 100 and balances.regret == 0
    assert not any("observation [-x" in each.evidence for each in found.findings)


@pytest.mark.usefixtures("few_starts")
def test_nothing_is_guessed_about_a_constant_torque() -> None:
    diagnosis = diagnose(lambda observation: 0.0)
    assert diagnosis.findings == []
    assert diagnosis.verdict.startswith("Undetermined: regret ")
    assert "it gives the same torque at all starts" in diagnosis.verdict
    assert "Train" not in diagnosis.summary()


@pytest.mark.usefixtures("few_starts")
def test_policy_with_a_state_plays_one_episode_after_the_other() -> None:
    class Repeats:
        """Chooses a torque at every second step only."""

        def __init__(self) -> None:
            self.calls, self.torque = 0, 0.0

        def __call__(self, observation: Any) -> float:
            if self.calls % 2 == 0:
                self.torque = greedy(observation)
            self.calls += 1
            return self.torque

    regret = diagnose(Repeats()).measurement.regret
    score = kp.evaluate_policy(Repeats(), 4, gravity=GRAVITY)
    assert regret == pytest.approx(score.regret, abs=0.5)


@pytest.mark.usefixtures("few_starts")
def test_slow_policy_plays_fewer_starts_and_reports_its_progress() -> None:
    shares: list[float] = []
    diagnosis = diagnose(lambda observation: 0.0, on_progress=shares.append)
    assert diagnosis.as_json()["starts"] == 4
    assert ", 4 starts; " in diagnosis.summary()
    assert shares == sorted(shares) and 0 < shares[0] < shares[-1] <= 1
