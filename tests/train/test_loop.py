"""The training loop: episodes, stored transitions, updates, and what stops it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.run import Run, make_run

pytestmark = pytest.mark.quick


def trained(name: str, **changes: Any) -> Run:
    """Returns a run of a small network after its last episode."""
    run = make_run(kp.preset(name, hidden_units=(8,), **changes))
    list(train_episodes(run))
    return run


def updates(run: Run) -> list[int]:
    """Returns the updates of each episode."""
    totals = [record.updates for record in run.history]
    return np.diff(totals, prepend=0).tolist()


def stored(run: Run) -> Transitions:
    """Returns the transitions in the replay buffer, oldest first."""
    return run.replay.transitions()


@dataclass
class ScriptedRun:
    """A run of episodes with given ends, whose updates return losses without computing.

    Args:
        ends: one letter for each step: "." for a step inside an episode, "T" for one that
            terminates it, "t" for one that truncates it. A further step raises an error.
        settings: changes to the preset `original`.
        losses: of the updates, in order; further ones are 1.
    """

    ends: str
    settings: dict[str, Any]
    losses: list[float] = field(default_factory=list)
    reset_seeds: list[int | None] = field(default_factory=list)
    batch_shapes: list[tuple[int, ...]] = field(default_factory=list)  # [K, B] of each update

    def train(self) -> list[EpisodeRecord]:
        run = make_run(kp.preset("original", hidden_units=(4,), **self.settings))
        ends, losses = iter(self.ends), itertools.chain(self.losses, itertools.repeat(1.0))

        def reset(seed: int | None) -> tuple[NDArray[np.float32], dict[str, Any]]:
            self.reset_seeds.append(seed)
            return np.zeros(3, np.float32), {}

        def step(action: Any) -> tuple[Any, ...]:
            end = next(ends, "no further step")
            assert end in ".Tt"
            return np.zeros(3, np.float32), -1.0, end == "T", end == "t", {}

        def update(batches: Transitions) -> NDArray[np.float32]:
            self.batch_shapes.append(batches.action.shape)
            count = len(batches.action)
            return np.fromiter(itertools.islice(losses, count), np.float32, count)

        run.env.reset, run.env.step = reset, step  # type: ignore[method-assign, assignment]
        run.agent.update = update  # type: ignore[method-assign]
        return list(train_episodes(run))


def test_terminated_and_truncated_steps_end_an_episode() -> None:
    run = ScriptedRun("..T.tt", {"episodes": 3})
    records = run.train()
    assert [record.environment_steps for record in records] == [3, 5, 6]
    assert [record.average_reward for record in records] == [-1.0] * 3


def test_seed_is_given_to_the_first_reset_only() -> None:
    run = ScriptedRun("ttt", {"episodes": 3, "seed": 5})
    run.train()
    assert run.reset_seeds == [5, None, None]


def test_train_frequency_episode_updates_after_each_episode_from_the_warmup_on() -> None:
    settings = {"episodes": 4, "warmup_episodes": 2, "updates_per_episode": 3, "batch_size": 2}
    run = ScriptedRun("t.t..tt", settings, losses=[1, 2, 6, 5, 5, 2])
    records = run.train()
    assert run.batch_shapes == [(3, 2), (3, 2)]
    assert [record.updates for record in records] == [0, 0, 3, 6]
    assert [record.loss for record in records[2:]] == [3, 4]
    assert all(math.isnan(record.loss) for record in records[:2])


def test_no_update_is_made_while_the_buffer_has_less_than_a_batch() -> None:
    run = ScriptedRun("t.t", {"episodes": 2, "warmup_episodes": 0, "batch_size": 2})
    assert [record.updates for record in run.train()] == [0, 1]


def test_train_frequency_step_updates_after_each_step_from_the_first_full_batch() -> None:
    # warmup_episodes and updates_per_episode belong to train_frequency episode.
    run = ScriptedRun(".t.t.t", {"episodes": 3, "train_frequency": "step", "batch_size": 3})
    records = run.train()
    assert run.batch_shapes == [(1, 3)] * 4
    assert [record.updates for record in records] == [0, 2, 4]


@pytest.mark.parametrize("loss", [math.inf, -math.inf, math.nan])
def test_loss_that_is_not_finite_is_refused_after_finite_ones(loss: float) -> None:
    settings = {"episodes": 2, "warmup_episodes": 0, "updates_per_episode": 2, "batch_size": 2}
    run = ScriptedRun(".t.t", settings, losses=[1, 1, 1, loss])
    with pytest.raises(kp.UserError, match=f"^episode 1, step 2: the loss is {loss}, learning"):
        run.train()


def test_updates_begin_after_the_warmup_with_every_stored_transition() -> None:
    # The largest batch that the Config allows.
    run = trained(
        "reference",
        episodes=4,
        warmup_episodes=2,
        max_episode_steps=5,
        batch_size=15,
        updates_per_episode=3,
    )
    assert updates(run) == [0, 0, 3, 3]
    assert run.history[-1].updates == run.config.total_updates


def test_record_has_the_numbers_of_its_episode() -> None:
    run = trained("original", episodes=3, max_episode_steps=7)
    rewards = stored(run).reward.reshape(3, 7)
    for episode, record in enumerate(run.history):
        assert isinstance(record, EpisodeRecord)
        assert record.episode == episode
        assert record.environment_steps == 7 * (episode + 1)
        assert record.episode_return == pytest.approx(rewards[episode].sum(), rel=1e-6)
        assert record.average_reward == record.episode_return / 7
        assert record.epsilon == run.epsilon(episode, 0)
        assert record.seconds > 0


def test_epsilon_of_a_record_is_that_of_the_last_step() -> None:
    run = trained("cartpole-original", episodes=3)
    for record in run.history:
        assert record.epsilon == run.epsilon(0, record.environment_steps - 1)


def test_transitions_are_stored_in_the_order_of_the_steps() -> None:
    run = trained("reference", episodes=2, max_episode_steps=5)
    observation, _, _, next_observation, terminated = stored(run)
    for first in (0, 5):
        np.testing.assert_array_equal(
            observation[first + 1 : first + 5], next_observation[first : first + 4]
        )
    assert (observation[5] != next_observation[4]).any()  # a new episode
    assert not terminated.any()


def test_fallen_pole_is_terminated_and_the_step_limit_is_not() -> None:
    fallen = trained("cartpole-original", episodes=3)
    ends = [record.environment_steps - 1 for record in fallen.history]
    assert np.flatnonzero(stored(fallen).terminated).tolist() == ends
    truncated = trained("cartpole-original", episodes=3, max_episode_steps=4)
    assert [record.environment_steps for record in truncated.history] == [4, 8, 12]
    assert not stored(truncated).terminated.any()


def test_rewards_are_scaled_in_the_buffer_and_not_in_the_records() -> None:
    plain, scaled = (trained("reference", episodes=1, reward_scale=scale) for scale in (1.0, 0.5))
    np.testing.assert_allclose(stored(scaled).reward, 0.5 * stored(plain).reward)
    assert scaled.history[0].episode_return == plain.history[0].episode_return


@pytest.mark.parametrize("broken", ["observation", "reward"])
def test_number_that_is_not_finite_stops_the_run_at_its_step(
    broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    last = 3 * 7 + 5  # the 5th of episode 3
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

    monkeypatch.setattr(TimeLimit, "step", breaking)
    run = make_run(kp.preset("original", hidden_units=(8,), episodes=9, max_episode_steps=7))
    with pytest.raises(kp.UserError, match=f"^episode 3, step 5: the environment .*{broken}"):
        list(train_episodes(run))
    assert len(run.history) == 3
    assert run.replay.added == last - 1


def test_last_episode_replaces_the_weights_by_their_average() -> None:
    settings = {"hidden_units": (8,), "episodes": 3, "warmup_episodes": 1}
    run = make_run(kp.preset("reference", updates_per_episode=20, average_updates=4, **settings))
    averages = [
        variable for variable in run.agent.optimizer.variables if variable.path.endswith("_average")
    ]
    weights = run.agent.online.weights
    assert len(averages) == len(weights)
    averaged = [
        all(
            (average.numpy() == array.numpy()).all()
            for average, array in zip(averages, weights, strict=True)
        )
        for _ in train_episodes(run)
    ]
    assert averaged == [False, False, True]
