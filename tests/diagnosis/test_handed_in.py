"""Tests of what people hand in beside their network: a record, and their replay buffer."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pytest
import torch
from exact_agent import (
    NOISE,
    PENDULUM,
    coarse_value,
    diagnose_values,
    exact_values,
    measure,
    untrained_outputs,
)
from gymnasium.wrappers import TransformAction, TransformReward
from recorded_runs import buffer_of, record_run, swing_up

import keras_pendulum as kp
from keras_pendulum.diagnosis import run_rules, training_rules, transition_rules
from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.findings import RULES, find, find_in_record
from keras_pendulum.diagnosis.played_steps import PlayedSteps
from keras_pendulum.diagnosis.record_sources import read_actions, transitions_of
from keras_pendulum.diagnosis.run_record import RunRecord, make_record
from keras_pendulum.diagnosis.stored_transitions import StoredRewards
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum import pendulum
from keras_pendulum.optimum.dynamics import TORQUES


class Row(NamedTuple):
    state: Any
    action: Any
    reward: Any
    next_state: Any
    done: Any


def turn_reward(env: Any) -> Any:
    return TransformReward(env, lambda reward: -float(reward))


@pytest.fixture(autouse=True)
def _coarse_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pendulum, "discounted_value", coarse_value)


@pytest.fixture(scope="module")
def run() -> Any:
    return record_run(episodes=30, steps=100)


def bad_values(observations: Any) -> Any:
    """Returns exact values with so much noise that the agent plays badly."""
    return exact_values(observations) + 8 * np.sin(9 * observations @ NOISE)


ROOMS = run_rules.__name__, transition_rules.__name__
RECORD_RULES = [rule for rule in RULES if rule.__module__ in ROOMS]


def record_of(record: Any = None, transitions: Any = None) -> RunRecord:
    """Returns what is handed in beside an agent of 41 torques."""
    found = make_record(record, transitions, TORQUES, PENDULUM)
    assert found is not None
    return found


def shown_by(transitions: Any) -> Finding:
    """Returns what the transitions of a bad agent prove."""
    measured = measure(bad_values, record_of(transitions=transitions))
    finding = transition_rules.stored_transitions(measured)
    assert finding is not None
    return finding


def first(record: Any = None, transitions: Any = None) -> str:
    """Returns what the record of a bad agent shows first."""
    measured = measure(bad_values, record_of(record, transitions))
    found = (rule(measured) for rule in [*RECORD_RULES, run_rules.unsteady_return])
    return next((finding.title for finding in found if finding is not None), "nothing")


LAYOUTS: dict[str, Callable[[Any], Any]] = {
    "arrays": lambda b: b,
    "list of arrays": list,
    "one more axis": lambda b: (b[0][:, None], b[1][:, None], b[2][:, None], b[3][:, None], b[4]),
    "two environments": lambda b: [
        np.stack([each[:1500], each[1500:]], axis=1) for each in map(np.asarray, b)
    ],
    "two environments, not full": lambda b: [
        np.concatenate([both, 0 * both[:200]])
        for both in (np.stack(np.split(np.asarray(each), 2), axis=1) for each in b)
    ],
    "columns [N, 3, 1]": lambda b: (b[0][..., None], b[1], b[2], b[3][..., None], b[4]),
    "lists": lambda b: [each.tolist() for each in b],
    "rows": lambda b: list(zip(*b, strict=True)),
    "deque of named rows": lambda b: deque(Row(*row) for row in zip(*b, strict=True)),
    "rows with actions [1]": lambda b: [
        (s[None], [a], [r], n[None], int(d)) for s, a, r, n, d in zip(*b, strict=True)
    ],
    "tensors": lambda b: [torch.from_numpy(np.asarray(each)) for each in b],
    "rows of tensors": lambda b: [
        tuple(torch.from_numpy(np.asarray(each)) for each in row) for row in zip(*b, strict=True)
    ],
    "float indices": lambda b: (b[0], b[1].astype(np.float32), *b[2:4], b[4].astype(np.float32)),
    "not full": lambda b: [np.concatenate([each, 0 * each[:500]]) for each in b],
    "columns of objects": lambda b: [np.array([*each, None], object)[:-1] for each in b],
    "rows of objects": lambda b: np.array([(*row,) for row in zip(*b, strict=True)], object),
    "rows of bfloat16": lambda b: [
        (s, a, r, n, torch.tensor(float(d), dtype=torch.bfloat16))
        for s, a, r, n, d in zip(*b, strict=True)
    ],
    "torques": lambda b: (b[0], TORQUES[b[1]].astype(np.float32), *b[2:]),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_of_a_replay_buffer_are_the_same(layout: str, run: Any) -> None:
    expected = record_of(transitions=buffer_of(run))
    found = record_of(transitions=LAYOUTS[layout](buffer_of(run)))
    for column, other in zip(found.replay, expected.replay, strict=True):
        assert np.array_equal(column, other) and column.dtype == other.dtype


@pytest.mark.parametrize("count", [1, 5])
def test_few_rows_are_not_taken_for_columns(count: int, run: Any) -> None:
    rows = list(zip(*buffer_of(run), strict=True))[:count]
    assert transitions_of(rows, Pendulum()).observation.shape == (count, 3)
    assert transitions_of(
        [np.array(each) for each in zip(*rows, strict=True)], Pendulum()
    ).reward.shape == (count,)


def stored(run: Any, **fields: Any) -> Any:
    names = ("s", "a", "r", "next", "done")
    columns = dict(zip(names, buffer_of(run), strict=True))
    return [fields.get(name, columns[name]) for name in names]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda run: 3, "transitions is a int; expected .s, a, r, s′, done.: five arrays"),
        (lambda run: [], "transitions has 0 items|transitions is empty"),
        (lambda run: buffer_of(run)[:4], "transitions has 4 items .* but a ndarray of 3000"),
        (
            lambda run: [(0,) * 6] * 9,
            "9 items .* but a tuple of 6 with the sizes .1, 1, 1, 1, 1, 1.",
        ),
        (
            lambda run: [([1] * 3, 0, [1] * 3, 0, 0)] * 9,
            "a tuple of 5 with the sizes .3, 1, 3, 1, 1.",
        ),
        (
            lambda run: stored(run, s=np.zeros((3000, 2, 3))),
            "action has the shape .3000.; expected 3000 times 1 numbers for each of 2 environments",
        ),
        (lambda run: stored(run, s=np.zeros((3000, 4))), "observation has the shape .3000, 4."),
        (lambda run: stored(run, r=np.zeros(7)), "reward has the shape .7."),
        (lambda run: stored(run, a=["left"] * 3000), "action is not an array of numbers"),
        (lambda run: stored(run, r=np.full(3000, np.nan)), "NaN or infinite numbers"),
        (lambda run: stored(run, a=np.full(3000, 41)), "the actions are from 41 to 41; .*0 to 40"),
        (lambda run: stored(run, a=np.full(3000, 9.5)), "from 9.5 to 9.5; expected indices"),
        (lambda run: stored(run, done=np.full(3000, 0.5)), "done has other values than 0 and 1"),
        (lambda run: stored(run, s=0.5 * buffer_of(run)[0]), r"100% .* not 1, such as 0.25"),
    ],
)
def test_wrong_transitions_are_refused_in_one_line(change: Any, message: str, run: Any) -> None:
    with pytest.raises((kp.ConfigError, TypeError), match=message) as caught:
        record_of(transitions=change(run))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("actions", "torques", "indices"),
    [
        ([0, 1, 2], [-2, 0, 2], [0, 1, 2]),
        ([0.0, 2.0, -2.0], [-2, 0, 2], [1, 2, 0]),
        ([-2, 0, 2], [-2, 0, 2], [0, 1, 2]),
        ([0.0, 1.0, 2.0], [-2, 0, 2], [0, 1, 2]),  # 1 N·m is not a torque of the agent
        ([0.0, 1.0, 2.0], [-2, -1, 0, 1, 2], [2, 3, 4]),
        ([0, 1, 2], [-2, -1, 0, 1, 2], [0, 1, 2]),
    ],
)
def test_indices_and_torques_are_told_apart(actions: Any, torques: Any, indices: Any) -> None:
    found, torque = read_actions(np.array(actions), np.array(torques, float), "record")
    assert found.tolist() == indices
    assert torque is None or torque.tolist() == actions


def test_right_run_of_a_bad_agent_gets_no_fault(run: Any) -> None:
    assert first(run, buffer_of(run)) == "nothing"
    diagnosis = diagnose_values(bad_values, record_of(run, buffer_of(run)))
    assert diagnosis.findings[0].name == "not-converged"


def greedy(run: Any, share: float) -> Any:
    """Returns the stored actions, some of them replaced by the agent's greedy one."""
    s, a, *_ = buffer_of(run)
    replaced = np.random.RandomState(0).random_sample(len(a)) < share
    return np.where(replaced, bad_values(s).argmax(axis=1), a)


def truncated(run: Any) -> Any:
    ends = np.zeros(len(run.steps.first), bool)
    ends[np.append(np.flatnonzero(run.steps.first)[1:] - 1, -1)] = True
    return ends


@pytest.mark.parametrize(
    ("finding", "change"),
    [
        ("misaligned-transitions (greedy-stored)", lambda run: stored(run, a=greedy(run, 0.3))),
        ("misaligned-transitions (greedy-stored)", lambda run: stored(run, a=greedy(run, 0.05))),
        ("misaligned-transitions", lambda run: stored(run, a=np.roll(buffer_of(run)[1], 1))),
        ("torque-map", lambda run: stored(run, a=(buffer_of(run)[1] + 1) % 41)),
        ("torque-map", lambda run: stored(run, a=40 - buffer_of(run)[1])),
        ("misaligned-transitions (same-state)", lambda run: stored(run, next=buffer_of(run)[0])),
        (
            "misaligned-transitions (same-state)",
            lambda run: stored(run, s=np.repeat(buffer_of(run)[0][::100], 100, axis=0)),
        ),
        ("no-bootstrapping (truncation)", lambda run: stored(run, done=truncated(run))),
        ("no-bootstrapping", lambda run: stored(run, done=np.ones(3000))),
        ("reward-sign", lambda run: stored(run, r=-buffer_of(run)[2])),
        ("reward-scale", lambda run: stored(run, r=buffer_of(run)[2] / 16)),
        ("reward-scale", lambda run: stored(run, r=50 * buffer_of(run)[2])),
        ("other-reward", lambda run: stored(run, r=np.maximum(buffer_of(run)[2], -1))),
        ("other-reward", lambda run: stored(run, r=np.where(buffer_of(run)[0][:, 0] > 0.9, 1, 0))),
        ("forgetting (no-replay)", lambda run: [each[-64:] for each in buffer_of(run)]),
    ],
)
def test_transitions_show_the_mistake(finding: str, change: Any, run: Any) -> None:
    assert first(None, change(run)) == finding


@pytest.mark.parametrize("count", [10, 187, 250, 450])
def test_few_transitions_and_a_young_buffer_are_no_batch(count: int, run: Any) -> None:
    found = first(None, [each[-count:] for each in buffer_of(run)])
    assert not found.startswith("forgetting")


@pytest.mark.parametrize(
    "rows",
    [np.repeat(np.arange(3000), 2), np.random.RandomState(0).permutation(3000)[:64]],
    ids=["each stored twice", "a random batch"],
)
def test_other_rows_of_a_right_buffer_show_nothing(rows: Any, run: Any) -> None:
    assert first(None, [each[rows] for each in buffer_of(run)]) == "nothing"


def test_outputs_that_are_often_stored_are_not_called_untrained() -> None:
    record = record_of(transitions=buffer_of(record_run(epsilon=lambda done: 1.0)))
    assert training_rules.untrained_outputs(measure(untrained_outputs)) is not None
    assert training_rules.untrained_outputs(measure(untrained_outputs, record)) is None


@pytest.mark.parametrize("steps", [2, 4])
@pytest.mark.parametrize("environment", ["Pendulum-v1", "CartPole-v1"])
def test_wrapper_that_repeats_each_action_is_no_fault(environment: str, steps: int) -> None:
    env, random = gymnasium.make(environment), np.random.RandomState(0)
    efforts = [[-2.0], [2.0]] if environment == "Pendulum-v1" else [0, 1]
    transitions = []
    observation, _ = env.reset(seed=0)
    for _ in range(600):
        index, rewards, over = random.randint(2), 0.0, False
        for _ in range(steps):
            following, reward, terminated, truncated, _ = env.step(efforts[index])
            rewards, over = rewards + float(reward), terminated or truncated
            if over:
                break
        transitions.append((observation, index, rewards, following, terminated))
        observation = env.reset()[0] if over else following
    noise = random.normal(size=(len(observation), 2))
    torques = [-2.0, 2.0] if environment == "Pendulum-v1" else None
    agent = kp.q_function(lambda x: np.sin(x @ noise), torques)
    found = kp.diagnose(
        agent, environment=environment, gravity=10 if torques else None, transitions=transitions
    )
    names = {each.name for each in found.findings}
    assert not names & {"misaligned-transitions", "other-gravity", "torque-map"}


def test_constant_that_is_added_to_the_stored_rewards_is_named(run: Any) -> None:
    finding = shown_by(stored(run, r=buffer_of(run)[2] / 8 + 1))
    assert finding.evidence == "stored rewards 0.125 times the declared ones plus 1"
    assert "Leave the constant out" in finding.remedy


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_declared_reward_scale_is_that_of_the_buffer(share: float, run: Any) -> None:
    record = record_of(transitions=stored(run, r=0.1 * share * buffer_of(run)[2]))
    measured = replace(measure(bad_values), reward_scale=0.1)
    slope, _, correlation = StoredRewards(measured, record).fit
    assert (correlation, slope) == pytest.approx((1, share), abs=1e-3)


def test_small_buffer_is_compared_with_the_record(run: Any) -> None:
    small = [each[-900:] for each in buffer_of(run)]
    assert first(run, small) == "forgetting"
    assert first(None, small) == "nothing"  # the run may have had 900 steps


@pytest.mark.parametrize(
    ("finding", "options"),
    [
        ("exploration", {"epsilon": lambda done: 1.0, "episodes": 40}),
        ("exploration", {"epsilon": lambda done: done, "episodes": 40}),
        ("exploration", {"epsilon": lambda done: 0.01, "episodes": 40}),
        ("narrow-starts", {"reset": {"x_init": 0.1, "y_init": 0.1}, "steps": 10, "episodes": 300}),
        ("other-gravity", {"gravity": 10.0}),
        ("other-reward", {"wrap": lambda env: TransformReward(env, lambda r: max(float(r), -1.0))}),
        ("reward-sign", {"wrap": turn_reward}),
        ("torque-map", {"wrap": lambda env: TransformAction(env, np.negative, None)}),
    ],
)
def test_record_shows_the_mistake(finding: str, options: Any) -> None:
    assert first(record_run(**({"episodes": 30} | options))) == finding


def test_actions_that_answer_the_first_observation_are_an_old_state() -> None:
    first_seen: list[Any] = []

    def act(observation: Any) -> float:
        if not first_seen:
            first_seen.append(observation)
        return float(TORQUES[bad_values(first_seen[-1][None])[0].argmax()])

    class Forget(gymnasium.Wrapper[Any, Any, Any, Any]):
        def reset(self, **options: Any) -> Any:
            first_seen.clear()
            return super().reset(**options)

    assert first(record_run(act, wrap=Forget, episodes=40)) == "misaligned-transitions (same-state)"


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s[:, [1, 0, 2]],
        lambda s: s * [1, 1, -1],
        lambda s: s * [1, 1, 1 / 8],
        lambda s: s[:, [2, 0, 1]],
    ],
    ids=["sine first", "speed reversed", "speed over 8", "speed first"],
)
def test_other_observations_of_the_buffer_are_understood(change: Any, run: Any) -> None:
    """The agent may change them itself, so only the rest is judged."""
    s, a, r, after, done = buffer_of(run)
    record = record_of(transitions=(change(s), a, r, change(after), done))
    assert record.replay.observation == pytest.approx(s, abs=1e-6)
    assert measure(bad_values, record).motion.obeying() > 0.99


def push_upright(observation: Any) -> float:
    return float(np.clip(-10 * observation[1] - 2 * observation[2], -2, 2))


def falls(done: float) -> float:
    return max(0.05, 1 - 4 * done)


def test_run_that_was_better_before_its_end_forgot() -> None:
    steps = count()
    act = lambda o: push_upright(o) if next(steps) < 2500 else 2.0  # noqa: E731
    assert first(record_run(act, episodes=50, epsilon=falls)) == "not-converged (forgot)"
    assert first(record_run(lambda o: 2.0, episodes=50, epsilon=falls)) == "nothing"


def test_run_whose_episodes_alternate_jumps() -> None:
    steps = count()
    act = lambda o: push_upright(o) if next(steps) // 100 % 2 else 2.0  # noqa: E731
    assert first(record_run(act, episodes=50, epsilon=falls)) == "not-converged (jumps)"
    assert first(record_run(push_upright, episodes=50, epsilon=falls)) == "nothing"


def test_policy_without_values_is_judged_by_its_record(run: Any) -> None:
    def found(record: Any) -> list[str]:
        measured = measure(exact_values, make_record(record, None, None, PENDULUM), bare=True)
        return [finding.title for finding in find_in_record(measured)]

    assert found(run) == []
    assert found(record_run(wrap=turn_reward)) == ["reward-sign"]
    narrow = record_run(reset={"x_init": 0.1, "y_init": 0.1}, steps=10, episodes=300)
    assert found(narrow) == ["narrow-starts"]


@pytest.mark.parametrize(
    ("episodes", "epsilon"),
    [
        (20, lambda done: 0.1),
        (100, lambda done: 0.1),
        (20, lambda done: 0.95 - 0.2 * done),  # stopped before ε has fallen
    ],
)
def test_usual_exploration_is_no_fault(episodes: int, epsilon: Callable[[float], float]) -> None:
    assert first(record_run(episodes=episodes, epsilon=epsilon)) == "nothing"


def test_random_torques_may_be_smaller_than_those_of_the_outputs() -> None:
    env = record_run(epsilon=lambda done: 1.0 if done < 0.5 else 0.1)
    played = PlayedSteps.of(env.steps, env.steps.action / 2, TORQUES, PENDULUM)
    shares = played.random_shares()
    assert shares is not None and min(shares.beginning, shares.tenths[:5].min()) > 0.5


@pytest.mark.parametrize(("epsilon", "shown"), [(0.02, True), (0.12, False)])
def test_low_epsilon_is_seen_where_the_policy_changes(epsilon: float, shown: bool) -> None:
    steps = count()
    act = lambda o: 2 * np.sign(np.sin(o @ [4, 5, 3] + next(steps) / 50))  # noqa: E731
    run = record_run(act, episodes=40, epsilon=lambda done: epsilon)
    assert (first(run) == "exploration") is shown


@pytest.mark.parametrize(("epsilon", "shown"), [(0.0, True), (0.12, False)])
def test_low_epsilon_is_seen_before_the_policy_changes(epsilon: float, shown: bool) -> None:
    steps, random = count(), np.random.RandomState(1)
    act = lambda o: random.choice(TORQUES) if 200 < next(steps) < 2400 else swing_up(o)  # noqa: E731
    run = record_run(act, episodes=40, epsilon=lambda done: epsilon)
    assert (first(run) == "exploration") is shown


@pytest.mark.parametrize("falls", [700, 4000])  # steps
def test_random_actions_may_be_held_for_some_steps(falls: int) -> None:
    steps, random, held = count(), np.random.RandomState(1), [0.0]

    def act(observation: Any) -> float:
        step = next(steps)
        if step % 6 == 0:
            explores = random.random_sample() < 1 - step / falls
            held[0] = random.choice(TORQUES) if explores else np.nan
        return swing_up(observation) if np.isnan(held[0]) else held[0]

    assert first(record_run(act, episodes=40, epsilon=lambda done: 0)) == "nothing"


@pytest.mark.parametrize(("lasting", "epsilon"), [(2, 0.02), (3, 1.0), (8, 0.15)])
def test_each_action_may_last_for_some_steps(lasting: int, epsilon: float) -> None:
    """Then it shows neither which actions are random nor which values the next step has."""
    steps, random, held = count(), np.random.RandomState(1), [0.0]

    def act(observation: Any) -> float:
        if next(steps) % 100 % lasting == 0:  # each episode has 100 steps
            explores = random.random_sample() < epsilon
            held[0] = random.choice(TORQUES) if explores else swing_up(observation)
        return held[0]

    record = make_record(record_run(act, 50, epsilon=lambda done: 0), None, TORQUES, PENDULUM)
    assert record is not None and record.played is not None
    assert record.played.action_steps() == lasting
    found = find(measure(bad_values, record))
    assert [finding.title for finding in found] == ["not-converged (lasting-actions)"]
    assert found[0].evidence == f"each recorded action lasts for {lasting} steps"


def test_usual_actions_do_not_last() -> None:
    for run in record_run(), record_run(episodes=50, epsilon=lambda done: 0.0):
        played = PlayedSteps.of(run.steps, run.steps.action, TORQUES, PENDULUM)
        assert played.action_steps() == 1


def test_record_may_be_a_file_and_on_the_command_line(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from keras_pendulum.diagnosis.__main__ import main

    monkeypatch.chdir(tmp_path)
    record_run(episodes=40, epsilon=lambda done: 1.0).save("run.npz")
    Path("mine.py").write_text(
        "import numpy as np\n"
        "import keras_pendulum as kp\n"
        "noise = np.random.RandomState(0).normal(size=(3, 41))\n"
        "q = kp.q_function(lambda x: -30 + 9 * np.sin(9 * x @ noise))\n",
        encoding="utf-8",
    )
    words = ["mine.py:q", "--gravity", "1", "--discount", "0.9", "--record"]
    assert main([*words, "run.npz"]) == 0
    out = capsys.readouterr().out
    assert "exploration" in out and "Not determined" not in out
    assert main([*words, "no.npz"]) == 2
    assert capsys.readouterr().err == "error: cannot read no.npz: No such file or directory\n"


def test_run_folder_has_a_record_of_its_own(run: Any, tmp_path: Path) -> None:
    config = kp.preset("reference", episodes=1, hidden_units=(8,))
    kp.train_dqn(config, tmp_path / "run")
    with pytest.raises(kp.ConfigError, match="is a run folder, which has a record of its own"):
        kp.diagnose(tmp_path / "run", record=run)


@pytest.mark.parametrize("actions", [[0, 1, 2], [0, 1, 0], [0.0, 3.0, 4.0]])
def test_indices_need_the_torques_that_they_stand_for(actions: Any) -> None:
    with pytest.raises(kp.ConfigError, match=r"indices from 0 to \d without their torques"):
        read_actions(np.array(actions), None, "record")


@pytest.mark.parametrize(
    ("actions", "torques"),
    [([-1, 0, 2], [-1, 0, 2]), ([0.0, 1.0, 2.0], [0, 1, 2]), ([-11.5, 0.5, 9.0], [-2, 0.5, 2])],
)
def test_torques_of_a_program_are_cut_as_the_pendulum_does(actions: Any, torques: Any) -> None:
    found, torque = read_actions(np.array(actions), None, "record")
    assert torque is not None and found.tolist() == torque.tolist() == torques


def test_ends_that_may_be_a_mask_are_said_to_be(run: Any) -> None:
    assert "1 - done" in shown_by(stored(run, done=np.ones(3000))).evidence
