"""A run: the same for the same seed, learning, and stopped by what is not finite."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import keras
import numpy as np
import pytest
from conftest import assert_same, comparable
from gymnasium.wrappers import TimeLimit

import keras_pendulum as kp
from keras_pendulum.agent import Agent
from keras_pendulum.backend import keep_to_one_thread
from keras_pendulum.checkpoint import load_checkpoint
from keras_pendulum.replay import Transitions
from keras_pendulum.run import Run
from keras_pendulum.run_folder import RunFolder

SHORT: dict[str, Any] = {"episodes": 46}  # learning begins at episode 41


@pytest.mark.parametrize(
    "name", ["original", "walkthrough", "reference", "cartpole-original", "cartpole"]
)
def test_the_same_seed_twice_is_the_same_run_bit_for_bit(name: str) -> None:
    config = kp.preset(name, **SHORT)
    assert_same(kp.train_dqn(config), kp.train_dqn(config))


@pytest.mark.parametrize("name", ["reference", "cartpole-original"])
def test_a_user_whose_keras_computes_in_float64_gets_the_same_run(name: str) -> None:
    config = kp.preset(name, hidden_units=(8,), **SHORT)
    whole = kp.train_dqn(config)
    keras.config.set_floatx("float64")
    keras.config.set_dtype_policy("float64")
    try:
        assert_same(kp.train_dqn(config), whole)
    finally:
        keras.config.set_floatx("float32")
        keras.config.set_dtype_policy("float32")


def test_listeners_that_come_one_by_one_are_all_told_all() -> None:
    told: list[object] = []
    config = kp.preset("original", hidden_units=(8,), episodes=3)
    kp.train_dqn(config, listeners=(told.append for _ in range(2)))
    assert len(told) == 6


def test_the_network_is_told_once_of_each_checkpoint(tmp_path: Path) -> None:
    told: list[int] = []
    config = kp.preset("original", hidden_units=(8,), episodes=21)
    kp.train_dqn(config, tmp_path, on_checkpoint=lambda network, episode: told.append(episode))
    assert told == [0, 10, 20]


def test_windows_and_threads_end_with_their_run_however_it_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[str] = []
    monkeypatch.setattr(TimeLimit, "close", lambda self: ended.append("environment"))
    monkeypatch.setattr(Agent, "close", lambda self: ended.append("thread"))

    def fail(record: object) -> None:
        raise ZeroDivisionError

    config, longer = (kp.preset("original", hidden_units=(8,), episodes=n) for n in (1, 2))
    kp.train_dqn(config, tmp_path)
    assert ended == ["environment", "thread"]
    for again in ({"overwrite": True}, {"resume": True}):
        ended.clear()
        with pytest.raises(ZeroDivisionError):
            kp.train_dqn(longer, tmp_path, listeners=[fail], **again)  # type: ignore[arg-type]
        assert ended == ["environment", "thread"]


@pytest.mark.parametrize("more", [{"init": kp.DQN((8,))}, {"overwrite": True}])
def test_a_resumed_run_takes_neither_other_weights_nor_another_runs_place(
    more: dict[str, Any], tmp_path: Path
) -> None:
    config = kp.preset("original", hidden_units=(8,), episodes=1)
    kp.train_dqn(config, tmp_path)
    with pytest.raises(kp.UserError, match="init and overwrite start a new one"):
        kp.train_dqn(config, tmp_path, resume=True, **more)


@pytest.mark.parametrize("first", ["the update", "the episode"])
def test_it_does_not_matter_whether_acting_or_learning_is_the_faster(
    first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A policy that changed as soon as it could would act otherwise here.
    config = kp.preset(
        "reference", hidden_units=(8,), learning_rate=0.02, epsilon_start=0.0, **SHORT
    )
    monkeypatch.delenv("TF_NUM_INTEROP_THREADS", raising=False)  # else no thread would learn
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        whole = kp.train_dqn(config)
    finally:
        sys.setswitchinterval(interval)

    if first == "the episode":
        monkeypatch.setattr(os, "environ", dict(os.environ))
        keep_to_one_thread()
    else:
        monkeypatch.setattr(Agent, "begin_update", update_at_once)
    assert_same(kp.train_dqn(config), whole)


def update_at_once(self: Agent, batches: Transitions) -> Callable[[], Any]:
    """`Agent.begin_update` as if the thread always were the faster."""
    before = self.policy()
    losses = self.update(batches)
    after, self._greedy = self._greedy, before

    def finish() -> Any:
        self._greedy = after
        return losses

    return finish


def test_another_seed_starts_from_other_weights_and_another_state() -> None:
    first, second = (Run(kp.preset("original", seed=seed, hidden_units=(8,))) for seed in (0, 1))
    assert (first.agent.online.get_weights()[0] != second.agent.online.get_weights()[0]).all()
    for run in (first, second):
        next(run.episodes())
    assert (first.replay.at([0]).observation != second.replay.at([0]).observation).all()


def test_another_seed_is_another_run() -> None:
    small = {**SHORT, "hidden_units": (8,)}
    first, second = (kp.train_dqn(kp.preset("original", seed=seed, **small)) for seed in (0, 1))
    assert comparable(first) != comparable(second)


def test_a_short_run_learns_far_better_than_chance(tmp_path: Path) -> None:
    result = kp.train_dqn(kp.preset("reference", episodes=150), tmp_path)
    score = kp.evaluate_policy(result.network, episodes=30)
    assert score.mean_return > -250  # uniformly random torque: -909
    saved = kp.evaluate_policy(kp.load_weights(tmp_path / "pendulum_weight.h5"), episodes=30)
    np.testing.assert_array_equal(saved.returns, score.returns)


def test_a_run_that_diverges_stops_and_keeps_the_last_good_checkpoint(tmp_path: Path) -> None:
    huge = kp.DQN((8,))
    huge.head.bias.assign(np.full(41, 1e25))  # its square is beyond float32
    config = kp.preset("original", episodes=60, hidden_units=(8,))
    with pytest.raises(kp.UserError, match=r"episode 41, step 200: the loss is inf.*diverged"):
        kp.train_dqn(config, tmp_path, init=huge)
    assert len(load_checkpoint(tmp_path / "pendulum_weight.h5", config).history) == 41


@pytest.mark.parametrize("name", ["original", "cartpole-original"])
@pytest.mark.parametrize("broken", ["observation", "reward"])
def test_what_is_not_finite_stops_the_run_at_its_step_and_keeps_the_last_checkpoint(
    name: str, broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = kp.preset(name, episodes=9, hidden_units=(8,), save_every=1)
    steps = itertools.count(1)
    step = TimeLimit.step

    def breaking(env: Any, action: Any) -> tuple[Any, ...]:
        observation, reward, *rest = step(env, action)
        if next(steps) == last:
            if broken == "reward":
                reward = float("inf")
            else:
                observation[-1] = np.nan
        return observation, reward, *rest

    whole = kp.train_dqn(config).history
    last = whole[2].environment_steps + 5  # of the run, the 5th of episode 3
    monkeypatch.setattr(TimeLimit, "step", breaking)
    with pytest.raises(kp.UserError, match=f"^episode 3, step 5: the environment gave.*{broken}"):
        kp.train_dqn(config, tmp_path)
    assert len(load_checkpoint(RunFolder(tmp_path).weights, config).history) == 3


@pytest.mark.parametrize("name", ["original", "walkthrough", "reference"])
def test_only_finite_torques_within_the_limits_reach_the_environment(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    torques = []
    step = TimeLimit.step

    def recording(env: Any, action: Any) -> Any:
        torques.append(action.copy())
        return step(env, action)

    monkeypatch.setattr(TimeLimit, "step", recording)
    network = kp.train_dqn(kp.preset(name, episodes=3, hidden_units=(8,))).network
    network.head.bias.assign(np.full(41, np.nan))  # also of values that are none
    kp.evaluate_policy(network, 1)
    sent = np.array(torques)
    assert sent.shape == (800, 1)
    assert (np.abs(sent) <= 2).all()
    assert len(np.unique(sent)) > 20


def test_initial_weights_are_the_given_networks(tmp_path: Path) -> None:
    given = kp.DQN((8,), seed=77)
    config = kp.preset("original", hidden_units=(8,), episodes=2)
    result = kp.train_dqn(config, init=given)
    for ours, theirs in zip(result.network.get_weights(), given.get_weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(kp.ConfigError, match="8-41, the settings say 512-256-128-41"):
        kp.train_dqn(kp.preset("original"), init=given)


def test_a_training_episode_has_the_steps_that_are_asked_for() -> None:
    result = kp.train_dqn(kp.preset(episodes=3, episode_steps=7, batch_size=8))
    assert [record.environment_steps for record in result.history] == [7, 14, 21]


def test_rewards_are_learned_from_at_their_scale_and_reported_as_they_are() -> None:
    plain, scaled = (Run(kp.preset(episodes=1, reward_scale=scale)) for scale in (1.0, 0.5))
    for run in (plain, scaled):
        list(run.episodes())
    np.testing.assert_allclose(
        scaled.replay.at(range(200)).reward, 0.5 * plain.replay.at(range(200)).reward
    )
    assert scaled.history[0].episode_return == plain.history[0].episode_return
