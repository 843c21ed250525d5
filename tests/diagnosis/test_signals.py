import numpy as np
import pytest
from exact_agent import exact_values, measure

import keras_pendulum as kp
from keras_pendulum.diagnosis import signals
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.evaluate.q_policies import DQNPolicy

EXACT = np.random.RandomState(0).normal(size=(200, 1)) * np.linspace(-2, 2, 41) - 5
TORQUES = np.linspace(-2, 2, 41)


def test_line_fit_recovers_slope_and_offset() -> None:
    fit = signals.line_fit(3 * EXACT + 2, EXACT)
    assert fit == pytest.approx((3, 2, 1))


def test_line_fit_of_a_constant_has_no_correlation() -> None:
    assert signals.line_fit(np.ones((5, 3)), EXACT[:5, :3]).correlation == 0
    assert signals.line_fit(EXACT, np.zeros_like(EXACT)).slope == 0


def test_advantages_leave_no_value_of_the_state() -> None:
    assert signals.advantages(EXACT + 7).mean(axis=1) == pytest.approx(0, abs=1e-12)
    assert signals.advantages(EXACT + 7) == pytest.approx(signals.advantages(EXACT))


def test_output_efforts_follow_a_permutation_and_a_scale() -> None:
    order = np.random.RandomState(1).permutation(41)
    found = signals.output_efforts(0.5 * EXACT[:, order], EXACT, TORQUES)
    assert found == pytest.approx(0.5 * TORQUES[order])


def test_output_outliers_mark_the_outputs_that_were_never_learned() -> None:
    noise = np.random.RandomState(2).normal(size=EXACT.shape) * 0.1
    learned = EXACT + noise
    learned[:, [4, 9]] += 20
    outliers = signals.output_outliers(learned, EXACT)
    assert set(np.flatnonzero(outliers > 14)) == {4, 9}
    assert signals.output_outliers(EXACT + noise, EXACT).max() < 7


def test_units_counts_saturated_and_dead_units() -> None:
    network = kp.DQN((4, 2), activation="tanh,relu")
    kernel, bias, *rest = network.get_weights()
    biases = np.array([9, -9, 0.5, 0], np.float32)  # two are saturated
    network.set_weights(
        [0 * kernel, bias + biases, 0 * rest[0], np.array([-1, 1], np.float32), *rest[2:]]
    )
    assert Measurement(DQNPolicy(network), Pendulum(), 0.9).stuck_units == (0.5, 0.5)
    assert measure(exact_values).stuck_units == (0, 0)
