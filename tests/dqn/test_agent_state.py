"""The state of an agent, and the average of its weights."""

from __future__ import annotations

import copy
from collections.abc import Callable

import keras
import numpy as np
import pytest
from small_agents import (
    OBSERVATION,
    SOFT,
    Weights,
    assert_weights,
    differ,
    make_agent,
    random_batches,
)

from keras_pendulum.dqn.agent import Agent, Variables
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import TargetUpdate, no_update


def assert_equal(ours: dict[str, Variables], theirs: dict[str, Variables]) -> None:
    for group, arrays in ours.items():
        assert_weights(list(arrays.values()), list(theirs[group].values()))


def other_state() -> dict[str, Variables]:
    """Returns a state that differs from that of `make_agent()` in every variable."""
    return {
        group: {path: array + 1 for path, array in arrays.items()}
        for group, arrays in make_agent(seed=9).get_state().items()
    }


@pytest.mark.parametrize("update_target", [SOFT, no_update])
def test_set_state_continues_like_the_saved_agent(update_target: TargetUpdate) -> None:
    saved = make_agent(update_target=update_target)
    saved.update(random_batches(4))
    state = saved.get_state()
    restored = make_agent(update_target=update_target, seed=9)
    restored.update(random_batches(4, seed=9))  # its compiled update uses the restored variables
    restored.set_state(state)
    q = saved.policy.q_values(OBSERVATION)
    np.testing.assert_array_equal(restored.policy.q_values(OBSERVATION), q)
    for agent in (saved, restored):
        agent.update(random_batches(4, seed=1))
    assert_equal(restored.get_state(), saved.get_state())


def test_get_state_names_the_variables_by_their_paths() -> None:
    layers = ("hidden_0/kernel", "hidden_0/bias", "head/kernel", "head/bias")
    state = make_agent().get_state()
    assert set(state) == {"online", "target", "optimizer"}
    assert set(state["online"]) == set(state["target"]) == {f"dqn/{layer}" for layer in layers}
    moments = {
        f"adam/dqn_{layer.replace('/', '_')}_{moment}"
        for layer in layers
        for moment in ("momentum", "velocity")
    }
    assert set(state["optimizer"]) == {"adam/iteration", "adam/learning_rate", *moments}


def test_get_state_is_a_copy() -> None:
    agent = make_agent()
    state = agent.get_state()
    before = copy.deepcopy(state)
    agent.update(random_batches(2))
    assert_equal(state, before)


@pytest.mark.parametrize("change", ["remove", "add", "rename", "transpose", "shorten"])
@pytest.mark.parametrize(
    ("group", "path"),
    [
        ("online", "dqn/head/kernel"),
        ("target", "dqn/head/kernel"),
        ("optimizer", "adam/dqn_head_kernel_momentum"),
    ],
)
def test_set_state_refuses_other_paths_or_shapes_and_changes_nothing(
    group: str, path: str, change: str
) -> None:
    state = other_state()
    array = state[group][path] if change == "add" else state[group].pop(path)
    if change in ("add", "rename"):
        state[group]["other/kernel"] = array
    elif change != "remove":
        state[group][path] = array.T if change == "transpose" else array[:1]
    agent = make_agent()
    before, policy = agent.get_state(), agent.policy
    name = "other/kernel" if change == "add" else path
    with pytest.raises(ValueError, match=f"^{group}/{name} is missing, unknown or of another"):
        agent.set_state(state)
    assert_equal(agent.get_state(), before)
    assert agent.policy is policy


def averaging_agent() -> Agent:
    """Returns an agent whose optimizer halves the weight of the past at each update."""
    return make_agent(
        optimizer=keras.optimizers.Adam(0.01, name="adam", use_ema=True, ema_momentum=0.5)
    )


def test_average_weights_sets_the_moving_average_of_the_updates() -> None:
    agent = averaging_agent()
    batches = random_batches(12)
    expected: Weights = []
    for k in range(12):
        agent.update(Transitions(*(field[k : k + 1] for field in batches)))
        weights = agent.online.get_weights()
        pairs = zip(expected or weights, weights, strict=True)
        expected = [(before + now) / 2 for before, now in pairs]
    assert differ(weights, expected)
    agent.average_weights()
    assert_weights(agent.online.get_weights(), expected, atol=1e-7)
    q = agent.online(OBSERVATION[np.newaxis]).numpy()[0]
    np.testing.assert_allclose(agent.policy.q_values(OBSERVATION), q, atol=1e-6)


@pytest.mark.parametrize(
    ("make", "updates"),
    # After 9 updates, a share of 1/512 of the average is from the first one.
    [(averaging_agent, 0), (make_agent, 2), (averaging_agent, 9)],
)
def test_average_weights_changes_nothing_without_an_average_that_forgot_its_beginning(
    make: Callable[[], Agent], updates: int
) -> None:
    agent = make()
    if updates:
        agent.update(random_batches(updates))
    before = agent.get_state()
    agent.average_weights()
    assert_equal(agent.get_state(), before)
