"""The exact values of CartPole: dynamics, tables and the optimal policy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.optimum import cartpole_values
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.cartpole_dynamics import FORCES, step_forces
from keras_pendulum.optimum.cartpole_values import (
    cartpole_q,
    cartpole_value,
    file_name,
    highest_value,
    solve_cartpole,
    value_at,
)

SHIPPED = (0.9, 0.95, 0.98, 0.99, 0.995, 1.0)
EXACT = CartPoleSolution(CartPole())


def visited(seed: int = 0, episodes: int = 40) -> NDArray[np.float64]:
    """Returns states of episodes in which half of the actions are those of the optimum."""
    random, table = np.random.RandomState(seed), EXACT.table(0.99)
    states = CartPole().starts(range(episodes))
    found = []
    for _ in range(100):
        forces = FORCES[random.randint(2, size=len(states))]
        best = EXACT.greedy_efforts(table, 0.99, states)
        forces = np.where(random.random_sample(len(states)) < 0.5, forces, best)
        outcomes = step_forces(states, forces[:, None])
        states = outcomes.state[~outcomes.terminated[:, 0], 0]
        found.append(states)
    return np.concatenate(found)


def test_step_is_gymnasiums_to_the_last_bit() -> None:
    env: Any = gymnasium.make("CartPole-v1").unwrapped
    random = np.random.RandomState(0)
    for seed in range(10):
        env.reset(seed=seed)
        state = CartPole().starts([seed])
        assert state.tolist() == [list(env.state)]
        ended = False
        while not ended:
            action = random.randint(2)
            observation, reward, ended, *_ = env.step(action)
            outcomes = step_forces(state, FORCES)
            state = outcomes.state[:, action]
            assert state.tolist() == [list(env.state)]
            assert outcomes.terminated[0, action] == ended
            assert outcomes.reward[0, action] == reward == 1
            assert EXACT.observe(state)[0].tolist() == observation.tolist()


@pytest.mark.parametrize("discount", SHIPPED)
def test_policy_of_a_shipped_table_balances_every_start(discount: float) -> None:
    assert (EXACT.discounted_returns(discount, range(200)) == 500).all()


def test_short_sight_costs_returns() -> None:
    assert EXACT.discounted_returns(0.0, range(20)).max() < 20
    assert EXACT.discounted_returns(0.5, range(20), steps=50).tolist() == [50] * 20


@pytest.mark.parametrize("discount", [0.9, 0.99])
def test_values_are_those_of_long_simulated_play(discount: float) -> None:
    table, states = EXACT.table(discount), visited()[:1000]
    values, factor, standing = value_at(table, discount, states), 1.0, np.ones(1000, bool)
    collected = np.zeros(1000)
    while factor > 1e-3:
        collected += factor * standing
        factor *= discount
        forces = EXACT.greedy_efforts(table, discount, states)
        outcomes = step_forces(states, forces[:, None])
        states, standing = outcomes.state[:, 0], standing & ~outcomes.terminated[:, 0]
    error = np.abs(values - collected) / highest_value(discount)
    assert np.median(error) < 0.005
    assert np.quantile(error, 0.95) < 0.02
    assert 0.5 < standing.mean() < 1  # some of the states are lost


@pytest.mark.parametrize("discount", SHIPPED)
def test_q_values_obey_the_optimality_equation(discount: float) -> None:
    table, states = EXACT.table(discount), visited()[:500]
    q = cartpole_q(table, discount, states)
    if discount == 1:  # a step further, an episode has a step less
        assert (q.max(axis=1) <= 500).all()
        return
    outcomes = step_forces(states, FORCES)
    following = cartpole_q(table, discount, outcomes.state.reshape(-1, 4)).max(axis=1)
    target = 1 + discount * np.where(outcomes.terminated, 0, following.reshape(-1, 2))
    error = np.abs(q - target) / highest_value(discount)
    assert np.quantile(error, 0.95) < 0.01


def test_mirrored_states_have_the_same_values() -> None:
    table, states = EXACT.table(0.99), visited()[:200]
    left, right = cartpole_q(table, 0.99, states).T
    mirrored_left, mirrored_right = cartpole_q(table, 0.99, -states).T
    assert left == pytest.approx(mirrored_right, abs=0.01)
    assert right == pytest.approx(mirrored_left, abs=0.01)


def test_shipped_tables_are_small_and_those_that_are_computed() -> None:
    folder = Path(cartpole_values.__file__).parent / "data"
    files = [folder / file_name(discount) for discount in SHIPPED]
    assert sum(file.stat().st_size for file in files) < 1.5e6
    computed = solve_cartpole(0.9)
    shipped = cartpole_value(0.9)
    assert np.abs(computed - shipped).max() < 0.01


def test_lost_states_are_told_from_those_that_the_optimum_balances() -> None:
    states = np.array([[0, 0, 0, 0], [0, 0, 0.15, 0.1], [0, 0, 0.2, 2], [2.39, 2.9, 0, 0]])
    assert EXACT.survives(states).tolist() == [True, True, False, False]
