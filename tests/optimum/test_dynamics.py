from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from keras_pendulum.optimum.dynamics import simulate_return, step_all_torques

TORQUES = np.linspace(-2, 2, 41)  # N·m


def pendulum(gravity: float) -> Any:
    return gymnasium.make("Pendulum-v1", g=gravity, disable_env_checker=True).unwrapped


@pytest.mark.parametrize("gravity", [1.0, 10.0])
def test_step_with_each_torque_equals_gymnasiums(gravity: float) -> None:
    states = np.array([(0.5, -0.3), (3.1, 7.9), (-2.0, -8.0), (9.0, 1.0)])
    results = np.stack(step_all_torques(gravity, *states.T), axis=-1)  # [N, A, 3]: reward, θ, θ̇
    env = pendulum(gravity)
    for state, results_of_state in zip(states, results, strict=True):
        for torque, result in zip(TORQUES, results_of_state, strict=True):
            env.state, env.last_u = state, None
            reward = env.step(np.array([torque]))[1]
            np.testing.assert_allclose(result, [reward, *env.state], rtol=1e-12)


def test_simulated_return_is_gymnasiums_for_the_chosen_torques() -> None:
    starts = np.array([(0.5, -0.3), (3.1, 0.9)])
    indices = np.array([[0, 40], [20, 3], [7, 7]])  # [steps, N]
    env = pendulum(10.0)
    expected = []
    for start, column in zip(starts, indices.T, strict=True):
        env.state, env.last_u = start, None
        expected.append(sum(env.step(TORQUES[[index]])[1] for index in column))
    returns = simulate_return(lambda step, *_: indices[step], 3, 10.0, starts)
    np.testing.assert_allclose(returns, expected, rtol=1e-12)
