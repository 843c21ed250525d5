"""Steps rehearsed before their updates give what steps and updates in turn give."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum import episodes
from keras_pendulum.agent import ANY_ACTION, NO_ACTION, Agent
from keras_pendulum.checkpoint import load_checkpoint, save_checkpoint
from keras_pendulum.policy import GreedyPolicy
from keras_pendulum.rehearsal import AHEAD
from keras_pendulum.rollout import Rollout
from keras_pendulum.run import Run

# Few random actions, updates that often change one, and a memory that is soon full.
CONFIG = kp.preset(
    "cartpole-original",
    hidden_units=(16,),
    batch_size=8,
    learning_rate=0.03,
    epsilon_start=0.2,
    replay_capacity=50,
    episodes=15,
)


def after_all_episodes(ahead: int, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Run:
    monkeypatch.setattr(episodes, "AHEAD", ahead)
    run = Run(kp.preset(**{**CONFIG.__dict__, "name": "cartpole-original", **changes}))
    for _ in run.episodes():
        pass
    return run


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"epsilon_schedule": "episodes", "epsilon_decay": 0.7},
        {"bootstrap": "double", "seed": 3},
        {
            "environment": "Pendulum-v1",
            "gravity": 1.0,
            "episode_steps": 30,
            "episodes": 4,
        },
    ],
)
def test_a_rehearsed_run_is_the_one_made_step_by_step(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken_back = []
    snapshot = Rollout.snapshot

    def counted(rollout: Rollout) -> Any:
        go_back = snapshot(rollout)

        def noted() -> None:
            taken_back.append(rollout.episode)
            go_back()

        return noted

    monkeypatch.setattr(Rollout, "snapshot", counted)
    plain = after_all_episodes(1, monkeypatch, **changes)
    assert not taken_back
    rehearsed = after_all_episodes(12, monkeypatch, **changes)
    assert len(taken_back) > 5
    assert [record[:4] for record in rehearsed.history] == [record[:4] for record in plain.history]
    assert rehearsed.history[-1][5:7] == plain.history[-1][5:7]
    for ours, theirs in zip(
        rehearsed.replay.get_state().values(), plain.replay.get_state().values(), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)
    for ours, theirs in zip(
        rehearsed.agent.online.get_weights(), plain.agent.online.get_weights(), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-4)
    # All that is still to come is drawn alike.
    assert rehearsed.random.uniform() == plain.random.uniform()
    for _ in range(13):
        assert rehearsed.random.batch_positions(50, 8) == plain.random.batch_positions(50, 8)
    np.testing.assert_array_equal(rehearsed.env.reset()[0], plain.env.reset()[0])


def test_what_is_shown_is_never_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def step_by_step(rollout: Rollout, parts: Any, ahead: int) -> list[float]:
        asked.append(ahead)
        while not rollout.over:
            rollout.step()
        return []

    monkeypatch.setattr(episodes, "learn_each_step", step_by_step)
    for mode in ("rgb_array", None):
        run = Run(CONFIG)
        monkeypatch.setattr(run.env.unwrapped, "render_mode", mode)
        next(run.episodes())
    assert asked == [1, AHEAD]


def filled_agent() -> tuple[Agent, Any, Any]:
    """An agent, batches [5, 8, ...] for it, and five observations [5, 4]."""
    run = Run(CONFIG)
    random = np.random.RandomState(0)
    for _ in range(40):
        run.replay.add(random.randn(4), random.randint(2), 1.0, random.randn(4), False)
    positions = random.randint(0, 40, (5, 8))
    return run.agent, run.replay.at(positions), random.randn(5, 4).astype(np.float32)


def actions_after_each_update() -> list[int]:
    agent, batches, observations = filled_agent()
    actions = []
    for k in range(5):
        agent.update(type(batches)(*(field[k : k + 1] for field in batches)))
        actions.append(GreedyPolicy(agent.online).action(observations[k]))
    return actions


@pytest.mark.parametrize(
    ("changed", "made"), [(None, 5), (0, 1), (2, 3), (4, 5)], ids=["none", "first", "third", "last"]
)
def test_updates_go_on_until_one_would_have_changed_the_action(
    changed: int | None, made: int
) -> None:
    actions = actions_after_each_update()
    if changed is not None:
        actions[changed] = 1 - actions[changed]
    agent, batches, observations = filled_agent()
    losses = agent.update_between(batches, observations, actions)
    twin, batches, _ = filled_agent()
    expected = twin.update(type(batches)(*(field[:made] for field in batches)))
    np.testing.assert_allclose(losses, expected, rtol=1e-5)
    for ours, theirs in zip(agent.online.get_weights(), twin.online.get_weights(), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-6)
    values = agent.policy().q_values(observations)
    np.testing.assert_array_equal(values, GreedyPolicy(agent.online).q_values(observations))


def test_random_actions_need_not_agree_and_nothing_comes_after_no_action() -> None:
    for made in (1, 3, 5):
        agent, batches, observations = filled_agent()
        actions = [ANY_ACTION] * (made - 1) + [NO_ACTION] * (6 - made)
        assert len(agent.update_between(batches, observations, actions)) == made


def test_a_loss_that_is_not_finite_is_told_with_its_step(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(CONFIG)
    update = run.agent.update_between
    made: list[float] = []

    def diverging(*parts: Any) -> Any:
        losses = update(*parts)
        losses[max(0, 40 - len(made)) :] = np.nan  # from the 41st update on
        made.extend(losses)
        return losses

    monkeypatch.setattr(run.agent, "update_between", diverging)
    with pytest.raises(kp.UserError, match=r"episode \d+, step \d+: the loss is nan") as caught:
        for _ in run.episodes():
            pass
    episode, step = (int(word.rstrip(",:")) for word in str(caught.value).split()[1:4:2])
    before = run.history[episode - 1].environment_steps
    assert before + step == CONFIG.batch_size + 40


def test_a_run_saved_with_batches_put_back_goes_on_like_the_unsaved_one(tmp_path: Path) -> None:
    run = Run(CONFIG)
    left = run.episodes()
    while not run.random.get_state()["put_back"]:
        next(left)  # ends with StopIteration if no rehearsal ever went beyond the episode's end
    save_checkpoint(run, tmp_path / "cartpole_weight.h5")
    resumed = load_checkpoint(tmp_path / "cartpole_weight.h5", CONFIG)
    rest = len(list(left))
    assert len(list(resumed.episodes())) == rest > 0
    assert [record[:4] for record in resumed.history] == [record[:4] for record in run.history]
    for ours, theirs in zip(
        resumed.agent.online.get_weights(), run.agent.online.get_weights(), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)
