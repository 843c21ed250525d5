"""Tests that a network is told which equation it obeys, by the exact solution of each equation."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
from conftest import DATA
from fixed_points import DISCOUNT, GRAVITY, TORQUES, fixed_point, right
from recorded_runs import record_run

import keras_pendulum as kp
from keras_pendulum.diagnosis import equation_rules, policy_rules
from keras_pendulum.diagnosis.backup import Agreement, Backup
from keras_pendulum.diagnosis.constant_futures import constant_futures
from keras_pendulum.diagnosis.equation import Equation
from keras_pendulum.diagnosis.findings import find
from keras_pendulum.diagnosis.policy_rules import followed_policy
from keras_pendulum.diagnosis.target_equations import TARGETS as WRONG_TARGETS
from keras_pendulum.diagnosis.target_equations import ZERO_OTHERS

LAST = len(TORQUES) - 1
UNTRAINED = np.random.RandomState(3).normal(size=(3, 5)) * 0.1


def diagnose(q_values: Callable[[Any], Any], **options: Any) -> kp.Diagnosis:
    declared = {"gravity": GRAVITY, "discount": DISCOUNT, **options}
    return kp.diagnose(kp.q_function(q_values, TORQUES, "a student's"), **declared)


def first(diagnosis: kp.Diagnosis) -> str:
    """Returns the first finding; of an agent that plays well, the first note."""
    found = [*diagnosis.findings, *diagnosis.notes]
    return found[0].title if found else "no finding"


TARGETS: dict[str, Any] = {
    "wrong-target (mean-next)": lambda r, following, own: r + 0.9 * following.mean(axis=2),
    "wrong-target (min-next)": lambda r, following, own: r + 0.9 * following.min(axis=2),
    "wrong-target (same-action-next)": lambda r, following, own: (
        r + 0.9 * np.diagonal(following, axis1=1, axis2=2)
    ),
    "wrong-target (negative-next)": lambda r, following, own: r - 0.9 * following.max(axis=2),
    "wrong-target (same-state)": lambda r, following, own: r + 0.9 * own.max(axis=1, keepdims=True),
    "wrong-loss (zero-others)": lambda r, following, own: right(r, following, own) / len(TORQUES),
    "wrong-loss (same-target)": lambda r, following, own: (
        right(r, following, own).mean(axis=1, keepdims=True) + 0 * r
    ),
    "no-bootstrapping": lambda r, following, own: r,
    "wrong-target (batch-max)": lambda r, following, own: r - 2.5,
    "reward-sign": lambda r, following, own: right(-r, following, own),
    "reward-scale": lambda r, following, own: right(0.01 * r, following, own),
    "other-discount": lambda r, following, own: r + 0.5 * following.max(axis=2),
}


@pytest.mark.parametrize("finding", TARGETS)
def test_solution_of_a_wrong_equation_is_named(finding: str) -> None:
    diagnosis = diagnose(fixed_point(TARGETS[finding]))
    assert first(diagnosis) == finding
    assert "the values satisfy " in diagnosis.summary()


@pytest.mark.parametrize(("action", "word"), [(0, "first"), (LAST, "last")])
def test_value_of_one_next_action_is_named_with_it(action: int, word: str) -> None:
    def target(r: Any, following: Any, own: Any) -> Any:
        return r + DISCOUNT * following[:, :, action]

    diagnosis = diagnose(fixed_point(target))
    assert first(diagnosis) == "wrong-target (fixed-action-next)"
    assert f"Q(s′, {word} action) to " in diagnosis.verdict


def test_solution_of_the_right_equation_has_no_finding() -> None:
    diagnosis = diagnose(fixed_point(right))
    assert diagnosis.findings == []
    assert diagnosis.measurement.right_agreement.error < 0.03


@pytest.mark.parametrize("steps", [3, 8])
def test_values_of_actions_that_last_have_no_fault(steps: int) -> None:
    """A program with a frame skip is right, but the agent here acts anew at each step."""
    found = find(diagnose(fixed_point(right, steps=steps)).measurement)
    assert [each.title for each in found] == ["not-converged (lasting-actions)"]
    assert f", and with actions that last for {steps} steps to " in found[0].evidence
    assert found[0].remedy.startswith("That is not a fault.")


def test_record_of_actions_that_last_refutes_a_wrong_target() -> None:
    steps = count()
    act = lambda observation: TORQUES[next(steps) // 4 * 3 % 5]  # noqa: E731
    run = record_run(act, epsilon=lambda done: 0, gravity=GRAVITY)
    values = fixed_point(TARGETS["wrong-target (mean-next)"])
    found = find(diagnose(values, record=run).measurement)
    assert [each.title for each in found] == ["not-converged (lasting-actions)"]


@pytest.mark.parametrize(("discount", "assumed"), [(0.5, 0.5), (0.89, 0.9), (0.95, 0.95)])
def test_undeclared_discount_is_that_of_the_values(discount: float, assumed: float) -> None:
    values = fixed_point(lambda r, following, own: r + discount * following.max(axis=2))
    diagnosis = diagnose(values, discount=None)
    assert diagnosis.measurement.discount == assumed
    assert first(diagnosis) == "no finding"
    note = f"Its values fit {assumed:g} better than 0.9, so this was assumed: declare"
    assert (note in "".join(diagnosis.assumptions)) == (assumed != 0.9)
    assert first(diagnose(values, discount=0.7)) == "other-discount"  # it is not as declared


def test_discount_that_the_values_do_not_show_is_the_usual_one() -> None:
    diagnosis = diagnose(fixed_point(TARGETS["wrong-target (mean-next)"]), discount=None)
    assert first(diagnosis) == "wrong-target (mean-next)"
    assert "records no discount. 0.9 was assumed" in diagnosis.assumptions[-1]


@pytest.mark.parametrize("is_training", [True, False])
def test_dropout_that_is_still_on_is_said(is_training: bool) -> None:
    """Its values differ at each call, and so do the findings."""
    random, values = np.random.RandomState(0), fixed_point(right)

    def q_values(observations: Any) -> Any:
        noise = random.normal(size=(len(observations), LAST + 1))
        return values(observations) * (1 + 0.1 * is_training * noise)

    said = "".join(diagnose(q_values).assumptions)
    assert ("gives two values for one observation: is dropout still on?" in said) == is_training


@pytest.mark.parametrize(("size", "constant"), [(1 / 8.1, 1.0), (1.0, 8.0), (1 / 16.27, 1.0)])
def test_constant_that_is_added_to_the_rewards_is_named(size: float, constant: float) -> None:
    values = fixed_point(lambda r, following, own: right(size * r + constant, following, own))
    diagnosis = diagnose(values)
    (note,) = diagnosis.notes
    assert note.title == "reward-scale"
    found = re.search(r"satisfy (\S+)·r [+] (\S+) [+] γ·max", note.evidence)
    assert found is not None
    assert [float(each) for each in found.groups()] == pytest.approx([size, constant], rel=0.02)
    assert "changes no decision" in note.explanation
    worse = diagnose(lambda o: values(o * np.array([1, 1, 0.5])))  # it plays badly
    assert first(worse) != "wrong-target (index-for-value)"


@pytest.mark.parametrize("sweeps", [2, 5, 10, 20, 40])
def test_right_program_that_has_not_converged_is_not_blamed(sweeps: int) -> None:
    assert first(diagnose(fixed_point(right, sweeps))) in ("not-converged", "no finding")


def relu(values: Any) -> Any:
    return np.maximum(values, 0)


def silu(values: Any) -> Any:
    return values / (1 + np.exp(-values))


def short_training(name: str, activation: Callable[[Any], Any], torques: int | None) -> Any:
    """Returns the agent of a network that another program has made."""
    with np.load(DATA / "short_trainings.npz") as arrays:
        count = sum(each.rpartition("_")[0] == name for each in arrays.files)
        weights = [arrays[f"{name}_{place}"].astype(np.float32) for place in range(count)]

    def q_values(observations: Any) -> Any:
        for weight, bias in zip(weights[:-2:2], weights[1:-2:2], strict=True):
            observations = activation(observations @ weight + bias)
        return observations @ weights[-2] + weights[-1]

    actions = None if torques is None else np.linspace(-2, 2, torques)
    return kp.q_function(q_values, actions, "a student's")


@pytest.mark.parametrize(
    ("name", "torques", "discount"), [("three", 3, 0.9), ("five", 5, 0.95), ("eleven", 11, 0.9)]
)
def test_short_training_is_not_taken_for_another_gravity(
    name: str, torques: int, discount: float
) -> None:
    """Its values are too smooth: they satisfy the equation with g = 1 to 5 better than their own.

    The networks have made 1900 to 2800 updates.
    """
    diagnosis = kp.diagnose(short_training(name, relu, torques), gravity=10.0, discount=discount)
    assert first(diagnosis) in ("not-converged", "no finding")
    equation, right = diagnosis.measurement.agreements[0], diagnosis.measurement.right_agreement
    assert equation[1].name == "other-gravity" and equation[0].error < 0.75 * right.error


@pytest.mark.parametrize(
    ("name", "activation", "torques", "declared"),
    [
        ("constant", np.tanh, 11, {"gravity": 10.0, "discount": 0.98}),
        ("mean", relu, 11, {"gravity": 10.0, "discount": 0.95}),
        # With targets of three steps.
        ("several_steps", relu, 9, {"gravity": 1.0, "discount": 0.98, "reward_scale": 1 / 16.2736}),
        ("few_copies", relu, 3, {"gravity": 1.0, "discount": 0.98, "reward_scale": 1 / 8}),
        ("chance", relu, 9, {"gravity": 1.0, "discount": 0.99}),
        ("output", relu, 41, {"gravity": 10.0, "discount": 0.99, "reward_scale": 0.1}),
        ("hundred_updates", np.tanh, 11, {"gravity": 10.0, "discount": 0.985}),
        ("few_updates", np.tanh, 11, {"gravity": 10.0, "discount": 0.985}),
        ("near_outputs", relu, 5, {"gravity": 10.0, "discount": 0.97}),
        ("no_target_network", relu, 5, {"gravity": 10.0, "discount": 0.97}),
        # Its γ is 0.98. With 0.9, the values fit the lowest of the next values.
        ("undeclared", relu, 5, {"gravity": 10.0}),
        ("pole", silu, None, {"environment": "CartPole-v1", "discount": 0.95}),
        ("second_pole", relu, None, {"environment": "CartPole-v1", "discount": 0.99}),
    ],
)
def test_short_training_gets_the_name_of_no_part_that_is_right(
    name: str, activation: Callable[[Any], Any], torques: int | None, declared: dict[str, Any]
) -> None:
    """Its values are nearly the same everywhere, or near another equation, or a little above r."""
    diagnosis = kp.diagnose(short_training(name, activation, torques), **declared)
    assert first(diagnosis) in ("not-converged", "no finding")


def test_target_network_of_a_program_that_never_copies_it_is_named() -> None:
    """The program multiplies the rewards by 0.02, so its first values are 50 times as large."""
    agent = short_training("frozen", relu, 11)
    diagnosis = kp.diagnose(agent, gravity=10.0, discount=0.985, reward_scale=0.02)
    assert first(diagnosis) == "wrong-target (frozen-target)"
    assert "the values satisfy r + a number above 0 that the next state sets" in diagnosis.verdict


@pytest.mark.parametrize("sweeps", [2, 3, 5, 8])
@pytest.mark.parametrize("discount", [0.95, 0.98])
def test_values_of_a_few_steps_are_not_those_of_a_lower_discount(
    sweeps: int, discount: float
) -> None:
    """So are the values where the target network is copied seldom: once for each of the sweeps."""

    def target(r: Any, following: Any, own: Any) -> Any:
        return r + discount * following.max(axis=2)

    diagnosis = diagnose(fixed_point(target, sweeps), discount=discount)
    assert first(diagnosis) in ("not-converged", "no finding")
    if diagnosis.findings:
        assert f"the values are the rewards of {sweeps} steps to " in diagnosis.verdict
    lower = diagnose(fixed_point(lambda r, n, own: r + 0.7 * n.max(axis=2)), discount=discount)
    assert first(lower) == "other-discount"


@pytest.mark.parametrize("sweeps", [5, 10, 20])
def test_wrong_sign_of_the_rewards_is_named_before_the_values_have_converged(sweeps: int) -> None:
    assert first(diagnose(fixed_point(TARGETS["reward-sign"], sweeps))) == "reward-sign"


def test_values_that_grow_without_bound_are_not_those_of_large_rewards() -> None:
    values = fixed_point(right)
    assert first(diagnose(lambda o: 100 * values(o))) == "reward-scale"
    assert first(diagnose(lambda o: 1e5 * np.sin(40 * o @ UNTRAINED) - 1e6)) == "broken-network"


def rough(
    target: Callable[..., Any], size: float, waves: int, seed: int = 0
) -> Callable[[Any], Any]:
    """Returns the values of a target with an error that differs from state to state."""
    values, directions = fixed_point(target), np.random.RandomState(seed).normal(size=(3, 5))
    return lambda o: values(o) + size * np.sin(waves * o @ directions)


@pytest.mark.parametrize("waves", [4, 8])
@pytest.mark.parametrize(
    ("finding", "target"),
    [
        ("wrong-target (mean-next)", TARGETS["wrong-target (mean-next)"]),
        ("wrong-target (min-next)", TARGETS["wrong-target (min-next)"]),
        ("wrong-target (fixed-action-next)", lambda r, next_q, own: r + 0.9 * next_q[:, :, LAST]),
    ],
)
def test_ten_steps_show_the_target_where_one_step_does_not(
    finding: str, target: Callable[..., Any], waves: int
) -> None:
    diagnosis = diagnose(rough(target, 3, waves))
    assert first(diagnosis) == finding
    assert "over 10 steps, the values satisfy r + γ·" in diagnosis.verdict


def test_mean_of_the_next_values_must_fit_one_step_best_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    diagnosis = diagnose(rough(TARGETS["wrong-target (mean-next)"], 3, 4))
    m = diagnosis.measurement
    assert followed_policy(m) is not None
    last = "r + γ·Q(s′, last action)"
    errors = m.equation_errors | {last: 0.9 * m.equation_errors["r + γ·mean Q(s′, ·)"]}
    monkeypatch.setitem(m.__dict__, "equation_errors", errors)
    assert followed_policy(m) is None


@pytest.mark.parametrize(("position", "variant"), [(1.0, "mean-next"), (1.7, "min-next")])
def test_values_beyond_those_of_the_mean_are_of_another_target(
    position: float, variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the lowest next value are as far beyond the mean as the mean is from the highest."""
    m = diagnose(rough(TARGETS["wrong-target (min-next)"], 3, 4)).measurement
    agreements = [
        (own._replace(position=position if each.variant == "mean-next" else 1.0), each)
        for own, each in m.agreements
    ]
    errors = m.equation_errors | {"r + γ·mean Q(s′, ·)": 0.01}  # so it fits best
    monkeypatch.setitem(m.__dict__, "agreements", agreements)
    monkeypatch.setitem(m.__dict__, "equation_errors", errors)
    finding = followed_policy(m)
    assert finding is not None and finding.variant == variant
    assert ("they are lower than both" in finding.evidence) is (variant == "min-next")


@pytest.mark.parametrize(("clear", "named"), [(0.6, True), (0.1, False)])
def test_one_of_two_targets_that_fit_alike_is_named_where_the_right_one_fits_far_worse(
    clear: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    lowest, last = "r + γ·min Q(s′, ·)", "r + γ·Q(s′, last action)"
    m = diagnose(rough(TARGETS["wrong-target (min-next)"], 3, 4)).measurement
    finding = followed_policy(m)
    assert finding is not None and finding.long_errors is not None
    one_step, steps = m.equation_errors, finding.long_errors
    alike = 1.01 * one_step[lowest] * steps[lowest] / steps[last]
    monkeypatch.setitem(m.__dict__, "equation_errors", one_step | {last: alike})
    positions = [(own._replace(position=1.0), each) for own, each in m.agreements]
    monkeypatch.setitem(m.__dict__, "agreements", positions)
    monkeypatch.setattr(policy_rules, "_CLEAR_SHARE", clear)
    assert (followed_policy(m) is not None) is named


@pytest.mark.parametrize(("waves", "seed"), [(2, 0), (2, 1), (4, 0), (8, 0)])
@pytest.mark.parametrize("size", [0.5, 1, 2, 4])
def test_right_values_with_an_error_are_not_blamed(size: float, waves: int, seed: int) -> None:
    assert first(diagnose(rough(right, size, waves, seed))) in ("not-converged", "no finding")


@pytest.mark.parametrize(
    ("changes", "explains"),
    [
        ({}, True),
        ({"error": 0.19}, False),  # hardly less than that of the right equation
        ({"position": 0.4}, False),
        ({"correlation": 0.1}, False),
    ],
)
def test_equation_needs_a_margin(changes: dict[str, float], explains: bool) -> None:
    equation = Equation("wrong-target", "", "", lambda b: b.right)
    own, best = Agreement(0.1, 0.9, 1.0, 1.0), Agreement(0.2, 0.5, 1.0, 0.0)
    assert equation.explains(own._replace(**changes), best) is explains


@pytest.mark.parametrize(("mean", "explains"), [(-30.0, True), (30.0, False)])
def test_positive_values_are_of_no_other_task_of_the_pendulum(mean: float, explains: bool) -> None:
    equation = Equation("observation-map", "", "", lambda b: b.right, change={})
    own, best = Agreement(0.1, 0.9, 1.0, 0.0, mean), Agreement(0.2, 0.5, 1.0, 0.0)
    assert equation.explains(own, best) is explains


@pytest.mark.parametrize(
    ("advantages", "correlation", "explains"),
    [(0.2, 0.1, True), (0.5, 0.1, False), (0.2, -0.6, False)],
)
def test_equation_without_advantages_needs_flat_values(
    advantages: float, correlation: float, explains: bool
) -> None:
    equation = Equation("wrong-loss", "", "", lambda b: b.right, flat=0.4)
    own = Agreement(0.1, 0.0, advantages, 1.0)
    assert equation.explains(own, Agreement(0.2, correlation, 1.0, 0.0)) is explains


@pytest.mark.parametrize(("correlation", "explains"), [(0.5, True), (0.0, True), (-0.6, False)])
def test_share_of_the_right_targets_does_not_turn_the_advantages(
    correlation: float, explains: bool
) -> None:
    own, best = Agreement(0.3, correlation, 1, 0.96), Agreement(3.6, correlation, 1.0, 0.0)
    assert ZERO_OTHERS.explains(own, best) is explains


@pytest.mark.parametrize(
    ("own", "right", "explains"),
    [(0.99, 0.2, True), (0.85, 0.2, False), (0.99, 0.9, False)],
)
def test_advantages_show_an_equation_of_cartpole_that_fits_roughly(
    own: float, right: float, explains: bool
) -> None:
    equation = Equation("wrong-target", "same-action-next", "", lambda b: b.right)
    best = Agreement(1.3, right, 1.0, 0.0)
    assert equation.explains(Agreement(0.3, own, 1.0, 1.0), best, ends=True) is explains


@pytest.mark.parametrize(("error", "explains"), [(0.16, True), (0.3, False), (0.19, False)])
def test_next_value_of_the_action_before_fits_far_better(error: float, explains: bool) -> None:
    equation = next(each for each in WRONG_TARGETS if each.variant == "same-action-next")
    best = Agreement(0.7 if error < 0.19 else 0.4, 0.3, 1.0, 0.0)  # early values fit both alike
    assert equation.explains(Agreement(error, 0.94, 1.0, 1.0), best) is explains


@pytest.mark.parametrize(
    ("finding", "mean", "size", "waves"),
    [
        ("no-bootstrapping", -0.2, 0.4, 50),
        ("no-bootstrapping", 0.2, 0.4, 50),
        ("wrong-target (index-for-value)", 2.5, 1.2, 7),
        ("wrong-target (index-for-value)", 1.1, 0.7, 7),
        ("not-converged", 11, 2, 7),  # above every index
    ],
)
def test_what_is_added_to_the_rewards_shows_the_target(
    finding: str, mean: float, size: float, waves: int
) -> None:
    values = fixed_point(TARGETS["no-bootstrapping"])
    diagnosis = diagnose(lambda o: values(o) + mean + size * np.sin(waves * o @ UNTRAINED))
    assert first(diagnosis) == finding


@pytest.mark.parametrize("size", [1.0, 1.6])
@pytest.mark.parametrize("scale", [1, 0.1, 0.02])
def test_target_network_that_is_never_copied_is_named_also_with_small_rewards(
    scale: float, size: float
) -> None:
    values = fixed_point(TARGETS["no-bootstrapping"])

    def q_values(o: Any) -> Any:
        return scale * values(o) + size * (0.4 + 0.9 * (o @ UNTRAINED).max(axis=1)[:, None])

    assert first(diagnose(q_values, reward_scale=scale)) == "wrong-target (frozen-target)"


@pytest.mark.parametrize(("level", "shown"), [(0.0, True), (1000.0, False)])
def test_values_above_zero_are_not_those_of_smaller_rewards(
    level: float, shown: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Backup, "reward_factor", 0.03)  # the one that fits best
    values = fixed_point(right)
    diagnosis = diagnose(lambda o: values(o) + level)
    formulas = [each.formula for _, each in diagnosis.measurement.agreements]
    assert ("0.03·r + γ·max Q(s′, ·)" in formulas) is shown


def named_futures(added: Any, next_q: Any, seen: Any) -> set[str]:
    """Returns the names of the equations that Q - r = `added` [N, A] shows."""
    reward = np.random.RandomState(1).uniform(-16, 0, added.shape)
    goes_on = np.ones(added.shape, bool)
    backup = Backup(reward + added, reward, next_q, 0.9, seen.astype(np.float32), goes_on)
    found = list(constant_futures(backup))
    assert all(each.offset for each in found)  # so actions that last are no excuse
    return {each.variant or each.name for each in found}


def some_observations(count: int) -> Any:
    random = np.random.RandomState(2)
    angle, speed = random.uniform(-np.pi, np.pi, count), random.uniform(-8, 8, count)
    return np.column_stack([np.cos(angle), np.sin(angle), speed])


@pytest.mark.parametrize(("spread", "variant"), [(0.3, "frozen-target"), (0.6, "index-for-value")])
def test_index_of_three_differs_more_than_the_values_of_a_network_that_has_not_learned(
    spread: float, variant: str
) -> None:
    seen = some_observations(600)
    added = 0.9 + spread * 2**0.5 * seen[:, 1].reshape(200, 3)
    next_q = np.random.RandomState(0).normal(size=(200, 3, 3))
    named = named_futures(added, next_q, seen)
    assert named & {"frozen-target", "index-for-value"} == {variant}


@pytest.mark.parametrize(
    ("slope", "noise", "shown"),
    [(-0.9, 0, True), (-0.6, 0, True), (-1.3, 0.5, True), (-0.3, 0, False), (-0.9, 2, False)],
)
def test_subtracted_values_are_shown_before_they_have_converged(
    slope: float, noise: float, shown: bool
) -> None:
    """They alternate from update to update, so their own equation is satisfied badly at first."""
    random = np.random.RandomState(0)
    next_q = random.normal(-5, 2, (200, 1, 1)) + np.zeros((1, 5, 5))
    added = slope * next_q.max(axis=2) + noise * random.normal(size=(200, 5))
    named = named_futures(added, next_q, some_observations(1000))
    assert named == {"negative-next"} if shown else "negative-next" not in named


def test_index_in_place_of_the_value_is_named() -> None:
    values = fixed_point(TARGETS["no-bootstrapping"])
    learned = fixed_point(right)
    share = 0.0

    def q_values(o: Any) -> Any:
        advantages = learned(o) - learned(o).mean(axis=1, keepdims=True)
        return values(o) + 2 + 1.5 * np.sin(7 * o @ UNTRAINED) + share * advantages

    assert first(diagnose(q_values)) == "wrong-target (index-for-value)"
    share = 0.5  # an index teaches no action, so a network that has learned some adds none
    assert first(diagnose(q_values)) == "not-converged"


@pytest.mark.parametrize("obeys", [True, False])
def test_index_is_seen_where_what_is_added_is_rough(obeys: bool) -> None:
    random = np.random.RandomState(0)
    next_q = random.normal(size=(200, 21, 21))
    index = next_q.argmax(axis=2)
    added = 0.9 * (index if obeys else random.permutation(index)) + random.normal(size=index.shape)
    named = named_futures(added, next_q, some_observations(index.size))
    assert ("index-for-value" in named) is obeys


@pytest.mark.parametrize(("second", "named"), [(0.2, True), (0.11, False)])
def test_observation_that_fits_by_chance_is_not_named(
    second: float, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of many observations, those that fit by chance fit about as well as each other."""
    values = fixed_point(right)
    m = diagnose(lambda o: values(o[:, [1, 0, 2]])).measurement
    found = equation_rules.obeyed_equation(m)
    assert found is not None and found.equation.name == "observation-map"
    own = found.agreement._replace(error=0.1)
    other = replace(found.equation, label="another one")
    agreements = [(own, found.equation), (own._replace(error=second), other)]
    monkeypatch.setitem(m.__dict__, "agreements", agreements)
    assert (equation_rules.obeyed_equation(m) is not None) is named


@pytest.mark.parametrize(
    ("variant", "head"),
    [
        ("softmax", lambda q: np.exp(q) / np.exp(q).sum(axis=1, keepdims=True)),
        ("log-softmax", lambda q: q - np.log(np.exp(q).sum(axis=1, keepdims=True))),
        ("tanh", np.tanh),
        ("sigmoid", lambda q: 1 / (1 + np.exp(-q))),
        ("relu", lambda q: np.maximum(q, 0)),
    ],
)
def test_bounded_head_is_named(variant: str, head: Callable[[Any], Any]) -> None:
    values = fixed_point(right)
    assert first(diagnose(lambda o: head(values(o)))) == f"bounded-output ({variant})"


def test_mean_of_the_batch_in_all_states_is_named() -> None:
    values = fixed_point(right)
    diagnosis = diagnose(lambda o: -60 + 0.002 * values(o))
    assert first(diagnosis) == "wrong-loss (batch-broadcast)"


@pytest.mark.parametrize(
    ("finding", "change"),
    [
        ("observation-map", lambda q, o: q(o[:, [1, 0, 2]])),
        ("observation-map", lambda q, o: q(o * np.array([1, 1, -1]))),
        ("observation-map", lambda q, o: q(o * np.array([1, 1, 180 / np.pi]))),
        ("torque-map", lambda q, o: q(o)[:, ::-1]),
    ],
)
def test_changed_observation_or_output_is_named_and_repaired(finding: str, change: Any) -> None:
    diagnosis = diagnose(lambda o: change(fixed_point(right), o))
    assert first(diagnosis) == finding
    assert diagnosis.findings[0].repair is not None and diagnosis.findings[0].repair.regret < 100


def test_other_gravity_is_named_with_it() -> None:
    diagnosis = diagnose(fixed_point(right), gravity=1.0)
    assert first(diagnosis) == "other-gravity"
    assert "g = 10" in diagnosis.summary()


def test_declared_scale_of_the_rewards_is_no_fault() -> None:
    values = fixed_point(TARGETS["reward-scale"])
    assert first(diagnose(values, reward_scale=0.01)) == "no finding"


@pytest.mark.parametrize("kind", ["function", "network"])
def test_values_that_are_not_numbers_are_a_broken_network(kind: str) -> None:
    network = kp.DQN((4,), action_count=5)
    network.set_weights([np.nan * array for array in network.get_weights()])
    agent = network if kind == "network" else kp.q_function(lambda o: np.full((len(o), 5), np.nan))
    diagnosis = kp.diagnose(agent)
    assert first(diagnosis) == "broken-network"
    assert "not finite" in diagnosis.summary()
