"""The diagnosis of agents of CartPole, by their exact values with one thing changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.diagnosis.cartpole_motion import CartPoleMotion
from keras_pendulum.diagnosis.findings import find
from keras_pendulum.diagnosis.transition_rules import truncation_as_end
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.optimum.cartpole import CartPoleSolution
from keras_pendulum.optimum.cartpole_dynamics import has_fallen, step_forces

EXACT = CartPoleSolution(CartPole())
TABLE = EXACT.table(0.95)
FORCES = np.array([-10.0, 10.0])
WEIGHTS = np.array([[0.3, -0.4], [-0.5, 0.2], [2.0, 1.0], [0.7, -0.9]])  # of a hidden layer


def exact_values(observations: Any) -> Any:
    """Returns the exact Q-values [B, 2] for γ = 0.95."""
    return EXACT.exact_q(TABLE, 0.95, EXACT.states_of(observations), FORCES)


def values_with_zeros(observations: Any) -> Any:
    """Returns the fixed point [B, 2] of a loss that compares the output that did not act with zero.

    85 % of the stored actions push to the side to which the pole leans, which is too late.
    """

    def pushes(states: Any) -> Any:
        return (states[:, 2] > 0).astype(int)

    def value(states: Any) -> Any:
        total, factor, standing = np.zeros(len(states)), 0.85, ~has_fallen(states)
        for _ in range(40):
            total += factor * standing
            factor *= 0.85 * 0.95
            states = step_forces(states, FORCES[pushes(states)][:, None]).state[:, 0]
            standing &= ~has_fallen(states)
        return total

    states = EXACT.states_of(observations)
    following = step_forces(states, FORCES).state
    shares = np.where(np.arange(2) == pushes(states)[:, None], 0.85, 0.15)
    return shares * (1 + 0.95 * np.stack([value(following[:, i]) for i in range(2)], axis=1))


def constant_values(future: float, at_end: float = 0.0) -> Any:
    """Returns a function of Q-values [B, 2]: about the same future in all states.

    Where a step ends the episode, the value is 1 and a share of the future.
    """

    def values(observations: Any) -> Any:
        ended = step_forces(EXACT.states_of(observations), FORCES).terminated
        other = 1 + 0.05 * np.sin(2000 * observations[:, :2])
        return 1 + future * np.where(ended, at_end, other)

    return values


def frozen_values(mean: float, slope: float) -> Any:
    """Returns a function for Q-values [B, 2]: the reward and a line over the next state."""

    def values(observations: Any) -> Any:
        outcomes = step_forces(EXACT.states_of(observations), FORCES)
        return 1 + np.where(outcomes.terminated, 0, mean + slope * outcomes.state.sum(axis=2))

    return values


def values_of_lasting_pushes(observations: Any, steps: int = 3, discount: float = 0.9) -> Any:
    """Returns Q-values where each push lasts for some steps; later ones balance the pole."""
    outcomes = EXACT.lasting_outcomes(observations.astype(float), FORCES, steps)
    q, state, ended = outcomes.reward, outcomes.state.reshape(-1, 4), outcomes.terminated.ravel()
    for number in range(steps, 40 * steps):
        if number % steps == 0:
            force = 10 * np.sign(state @ [0.1, 0.4, 3.0, 1.0])[:, None]
        q = q + discount ** (number // steps) * ~ended.reshape(q.shape)
        step = EXACT.outcomes(state, force)
        state = np.where(ended[:, None], state, step.state[:, 0])
        ended = ended | step.terminated[:, 0]
    return q


def diagnose(values: Any, discount: float = 0.95, **options: Any) -> kp.Diagnosis:
    agent = kp.q_function(lambda o: values(o[:, :4]), name="agent")
    return kp.diagnose(agent, environment="CartPole-v1", discount=discount, **options)


def first(values: Any, **options: Any) -> str:
    found = diagnose(values, **options).findings
    return found[0].title if found else "no finding"


def test_values_of_pushes_that_last_are_no_overestimation() -> None:
    found = find(diagnose(values_of_lasting_pushes, discount=0.9).measurement)
    assert [each.title for each in found] == ["not-converged (lasting-actions)"]


@pytest.mark.parametrize(
    ("finding", "values"),
    [
        ("no finding", exact_values),
        ("torque-map", lambda o: exact_values(o)[:, ::-1]),
        ("observation-map", lambda o: exact_values(o[:, [2, 3, 0, 1]])),
        ("missing-end", lambda o: 20 + 0.001 * np.sin(o[:, :2])),
        ("missing-end", lambda o: 2e7 + 3e8 * o[:, [2, 2]] ** 2),
        ("overestimation", lambda o: 2e7 * np.cos(6 * o[:, 2:3]) + 1e6 * o[:, :2]),
        ("wrong-target (batch-max)", constant_values(3e4, at_end=0.7)),
        ("no-bootstrapping", lambda o: 1 + 0.001 * np.sin(o[:, :2])),
        ("wrong-loss (batch-broadcast)", lambda o: 9 + 0.001 * np.sin(o[:, :2])),
        ("wrong-target (batch-max or same-state)", constant_values(18.0)),
        ("wrong-target (negative-next)", lambda o: 0.52 + 0.05 * np.sin(o[:, :2])),
        ("wrong-target (index-for-value)", constant_values(0.8)),
        ("not-converged", constant_values(1.03)),  # more than γ · 1: the values of two steps
        ("wrong-target (frozen-target)", frozen_values(0.1, 0.05)),
        ("wrong-target (frozen-target)", frozen_values(0.0, 0.05)),
        ("wrong-target (frozen-target)", frozen_values(0.1, 0.4)),
        ("wrong-target (frozen-target)", constant_values(0.15)),
        ("wrong-target (index-for-value)", frozen_values(0.5, 0.4)),  # not small at 0
        ("wrong-loss (zero-others)", values_with_zeros),
        ("broken-network", lambda o: np.full((len(o), 2), np.nan)),
    ],
)
def test_changed_values_are_named(finding: str, values: Any) -> None:
    assert first(values) == finding


@pytest.mark.parametrize(("head", "least"), [("tanh", -1.0), ("sigmoid", 0.0)])
def test_bounded_head_is_named_and_small_values_are_not(head: str, least: float) -> None:
    def values(observations: Any) -> Any:
        shares = np.tanh(observations @ WEIGHTS)
        # Most outputs are at a bound, or few: hidden units with tanh have bounds, too.
        return least + (1 - least) * (0.5 + 0.5 * np.tanh(size * shares))

    size = 40.0
    assert first(values) == f"bounded-output ({head})"
    size = 1.5
    assert not first(values).startswith("bounded-output")


def test_rewards_of_nearly_no_size_have_no_sign() -> None:
    formulas = []
    for weights in (-WEIGHTS, WEIGHTS):
        found = diagnose(lambda o, own=weights: 0.02 * np.tanh(o @ own)).measurement
        formulas += [each.formula for _, each in found.agreements if each.name == "reward-scale"]
    assert formulas and not any(each.startswith("-") for each in formulas)


def transitions(episodes: int = 40) -> list[Any]:
    """Returns the steps of random play: s, a, r, s′, terminated."""
    random, rows = np.random.RandomState(0), []
    env = CartPole().make_env()
    for seed in range(episodes):
        observation, ended = env.reset(seed=seed)[0], False
        while not ended:
            action = random.randint(2)
            following, reward, ended, *_ = env.step(action)
            rows.append((observation, action, reward, following, ended))
            observation = following
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize(
    ("finding", "change"),
    [
        ("torque-map", lambda s, a, r, n, d: (s, 1 - a, r, n, d)),
        ("missing-end", lambda s, a, r, n, d: (s, a, r, n, np.zeros_like(d))),
        ("truncation-as-end", lambda s, a, r, n, d: (s, a, r, n, d | (np.arange(len(d)) == 5))),
        ("misaligned-transitions", lambda s, a, r, n, d: (s, a, r, np.roll(n, 1, axis=0), d)),
        ("reward-sign", lambda s, a, r, n, d: (s, a, -r, n, d)),
    ],
)
def test_transitions_show_the_mistake(finding: str, change: Any) -> None:
    def useless(observations: Any) -> Any:
        return 10 + 5 * np.sin(7 * observations[:, :2])

    assert finding in first(useless, transitions=change(*transitions()))
    assert finding not in first(useless, transitions=transitions())


def test_end_in_inexact_units_is_no_truncation() -> None:
    s, a, r, following, ended = transitions()
    scaled = [0.95 * s, a, r, 0.95 * following, ended]
    diagnosis = kp.diagnose("cartpole", transitions=scaled)
    assert truncation_as_end(diagnosis.measurement) is None


def test_penalty_for_the_fall_is_no_fault() -> None:
    s, a, r, following, ended = transitions()
    punished = [s, a, np.where(ended, -10.0, r), following, ended]
    assert first(exact_values, transitions=punished) == "no finding"
    notes = kp.diagnose("cartpole", transitions=punished).notes
    assert "other-reward" not in {each.name for each in notes}


def test_shipped_agent_has_no_finding() -> None:
    diagnosis = kp.diagnose("cartpole")
    assert diagnosis.findings == []
    assert diagnosis.as_json()["environment"] == "CartPole-v1"
    assert diagnosis.figure().axes


@pytest.mark.parametrize(
    ("slope", "accepted"),
    [(0.02, True), (0.0388, True), (0.079, True), (0.0083, False), (0.05, False)],
)
def test_wrapper_that_repeats_each_action_is_no_normalisation(slope: float, accepted: bool) -> None:
    """Of 2 and 4 steps, the speed changes a little on the way."""
    before = np.random.RandomState(0).normal(size=(500, 4))
    after = before + np.outer(before[:, 1], [slope, 0, 0, 0])
    assert (CartPoleMotion.wrong_observations(before, after) == "") is accepted


@pytest.mark.parametrize(("noise", "named"), [(3.0, True), (15.0, False)])
def test_grown_values_that_satisfy_no_equation_are_no_missing_end(
    noise: float, named: bool
) -> None:
    """They satisfy the one without ends to 34 % or to 102 %."""
    found = first(lambda o: 600 + noise * np.sin(3 * o @ WEIGHTS), discount=0.99)
    assert (found == "missing-end") is named
