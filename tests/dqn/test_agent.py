"""The agent: its actions, its gradient steps, and its state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.dqn.agent import Agent
from keras_pendulum.dqn.losses import huber, mean_squared_error
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.policy import greedy_policy
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.dqn.target_network import make_target

OBSERVATION = np.array([1, 0, 0], np.float32)  # [D]
Weights = list[NDArray[np.float32]]


def make_agent(
    online: DQN | None = None,
    *,
    optimizer: keras.optimizers.Optimizer | None = None,
    loss: Callable[..., tf.Tensor] = mean_squared_error,
    discount: float = 0.9,
    double_q: bool = False,
    target_update: str = "soft",
    seed: int = 0,
) -> Agent:
    online = online or DQN((8,), seed=seed)
    return Agent(
        online,
        *make_target(online, kp.preset("reference", target_update=target_update, target_period=3)),
        optimizer or keras.optimizers.Adam(0.01, name="adam"),
        loss,
        discount,
        double_q,
        np.random.RandomState(seed),
    )


def random_batches(batches: int, batch_size: int = 4, seed: int = 0) -> Transitions:
    """Returns transitions [K, B]; about one in three is terminated."""
    random = np.random.RandomState(seed)
    shape = (batches, batch_size)
    return Transitions(
        random.randn(*shape, 3).astype(np.float32),
        random.randint(0, 41, shape).astype(np.int32),
        -random.rand(*shape).astype(np.float32),
        random.randn(*shape, 3).astype(np.float32),
        random.rand(*shape) < 1 / 3,
    )


def one_transition(action: int, reward: float, terminated: bool) -> Transitions:
    """Returns one batch of one transition [1, 1] between equal observations."""
    observation = np.array([[[1, 2, 0]]], np.float32)
    return Transitions(
        observation,
        np.array([[action]], np.int32),
        np.array([[reward]], np.float32),
        observation,
        np.array([[terminated]]),
    )


def linear_agent(**settings: Any) -> Agent:
    """Returns an agent with Q(s, 0) = 1 and Q(s, 1) = 0 for every s, and the step size 0.1."""
    network = DQN((), 2)
    network.set_weights([np.zeros((3, 2)), np.array([1, 0])])
    return make_agent(
        network,
        optimizer=keras.optimizers.SGD(0.1),
        target_update="none",
        discount=0.5,
        **settings,
    )


def values(agent: Agent) -> list[Weights]:
    """Returns copies of all variables of the agent."""
    groups = (agent.online.weights, agent.target.weights, agent.optimizer.variables)
    return [[variable.numpy().copy() for variable in group] for group in groups]


def assert_equal(ours: list[Weights], theirs: list[Weights]) -> None:
    for mine, yours in zip(ours, theirs, strict=True):
        for one, other in zip(mine, yours, strict=True):
            np.testing.assert_array_equal(one, other)


def other_state() -> tuple[Weights, dict[str, dict[str, NDArray[Any]]]]:
    """Returns weights and a state that differ from those of `make_agent()` in every variable."""
    agent = make_agent(seed=9)
    state = {
        group: {path: array + 1 for path, array in arrays.items()}
        for group, arrays in agent.get_state().items()
    }
    return [array + 1 for array in agent.online.get_weights()], state


@pytest.mark.parametrize(("draw", "explores"), [(0.29, True), (0.3, True), (0.31, False)])
def test_agent_explores_when_the_draw_is_at_most_epsilon(
    draw: float, explores: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []

    class Draws:
        def random_sample(self) -> float:
            return draw

        def randint(self, count: int) -> int:
            counts.append(count)
            return 7

    agent = make_agent()
    monkeypatch.setattr(agent, "rng", Draws())
    greedy = int(agent.online(OBSERVATION[np.newaxis]).numpy().argmax())
    assert greedy != 7
    assert agent.select_action(OBSERVATION, epsilon=0.3) == (7 if explores else greedy)
    assert counts == ([41] if explores else [])


def test_actions_are_drawn_as_in_the_recorded_run() -> None:
    agent = make_agent(seed=1)
    greedy = agent.policy.action(OBSERVATION)
    legacy = np.random.RandomState(1)
    expected = [legacy.choice(41) if legacy.rand() <= 0.5 else greedy for _ in range(100)]
    assert [agent.select_action(OBSERVATION, 0.5) for _ in range(100)] == expected


@pytest.mark.parametrize("count", [2, 41])
def test_actions_are_uniform_with_epsilon_1(count: int) -> None:
    agent = make_agent(DQN((8,), count))
    actions = [agent.select_action(OBSERVATION, 1.0) for _ in range(1000 * count)]
    assert {type(action) for action in actions} == {int}
    counts = np.bincount(actions)
    assert len(counts) == count
    assert counts.min() > 850
    assert counts.max() < 1150


def test_actions_are_greedy_with_epsilon_0() -> None:
    agent = make_agent()
    for observation in random_batches(1, 50).observation[0]:
        greedy = int(agent.online(observation[np.newaxis]).numpy().argmax())
        assert agent.select_action(observation, 0.0) == greedy


def test_gradient_step_of_a_terminated_transition_is_that_computed_by_hand() -> None:
    agent = linear_agent()
    (loss,) = agent.update(one_transition(action=1, reward=-3, terminated=True))
    # Q - target is 0 + 3. The mean is over two outputs, so the slope is 2 * 3 / 2.
    assert loss == pytest.approx(3**2 / 2)
    kernel, bias = agent.online.get_weights()
    np.testing.assert_allclose(kernel, [[0, -0.3], [0, -0.6], [0, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(bias, [1, -0.3], rtol=1e-6)


def test_gradient_step_does_not_change_the_value_that_it_bootstraps_from() -> None:
    agent = linear_agent()
    (loss,) = agent.update(one_transition(action=1, reward=-1, terminated=False))
    # The target is -1 + 0.5 * max(1, 0), and Q is 0.
    assert loss == pytest.approx(0.5**2 / 2)
    kernel, bias = agent.online.get_weights()
    np.testing.assert_allclose(kernel, [[0, -0.05], [0, -0.1], [0, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(bias, [1, -0.05], rtol=1e-6)


def test_gradient_step_minimizes_the_given_loss() -> None:
    agent = linear_agent(loss=huber)
    (loss,) = agent.update(one_transition(action=1, reward=-3, terminated=True))
    assert loss == pytest.approx(3 - 0.5)
    np.testing.assert_allclose(agent.online.get_weights()[1], [1, -0.1], rtol=1e-6)


@pytest.mark.parametrize(("double_q", "next_value"), [(False, 5.0), (True, 2.0)])
def test_target_network_values_the_next_observation(double_q: bool, next_value: float) -> None:
    agent = linear_agent(double_q=double_q)
    agent.target = agent.online.clone()
    agent.target.set_weights([np.zeros((3, 2)), np.array([2, 5])])  # the online choice is action 0
    (loss,) = agent.update(one_transition(action=1, reward=-1, terminated=False))
    assert loss == pytest.approx((-1 + 0.5 * next_value) ** 2 / 2)


def test_update_makes_one_gradient_step_for_each_batch() -> None:
    together, one_by_one = make_agent(), make_agent()
    batches = random_batches(5)
    losses = together.update(batches)
    assert losses.shape == (5,)
    single = [
        one_by_one.update(Transitions(*(field[k : k + 1] for field in batches)))[0]
        for k in range(5)
    ]
    np.testing.assert_allclose(losses, single, rtol=1e-5)
    assert int(together.optimizer.iterations) == 5
    for ours, theirs in zip(values(together), values(one_by_one), strict=True):
        for mine, yours in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(mine, yours, rtol=1e-4, atol=1e-6)


def test_update_is_compiled_once_for_each_shape() -> None:
    traces = []

    def loss(*batch: tf.Tensor) -> tf.Tensor:
        traces.append(batch)
        return mean_squared_error(*batch)

    agent = make_agent(loss=loss)
    compiled = []
    for batches in (2, 2, 3, 2, 3):
        agent.update(random_batches(batches))
        compiled.append(len(traces))
    assert compiled[0] > 0
    assert compiled[1] == compiled[0]
    assert compiled[2] > compiled[1]
    assert compiled[2:] == [compiled[2]] * 3


def test_update_makes_the_agent_act_on_the_new_weights() -> None:
    agent = make_agent(optimizer=keras.optimizers.Adam(0.5))
    old_policy = agent.policy
    old_q = old_policy.q_values(OBSERVATION)
    for seed in range(3):
        agent.update(random_batches(2, seed=seed))
        new_q = greedy_policy(agent.online).q_values(OBSERVATION)
        np.testing.assert_array_equal(agent.policy.q_values(OBSERVATION), new_q)
        assert (new_q != old_q).all()
        assert agent.select_action(OBSERVATION, 0.0) == new_q.argmax()
    np.testing.assert_array_equal(old_policy.q_values(OBSERVATION), old_q)


@pytest.mark.parametrize("target_update", ["soft", "none"])
def test_set_state_continues_like_the_saved_agent(target_update: str) -> None:
    saved = make_agent(target_update=target_update)
    saved.update(random_batches(4))
    weights, state = saved.online.get_weights(), saved.get_state()
    restored = make_agent(target_update=target_update, seed=9)
    restored.update(random_batches(4, seed=9))  # its compiled update uses the restored variables
    restored.set_state(weights, state)
    assert_equal(values(restored), values(saved))
    for agent in (saved, restored):
        agent.update(random_batches(4, seed=1))
    assert_equal(values(restored), values(saved))


def test_set_state_restores_the_greedy_policy() -> None:
    agent = make_agent()
    q = agent.policy.q_values(OBSERVATION)
    weights, state = agent.online.get_weights(), agent.get_state()
    agent.set_state(*other_state())
    assert (agent.policy.q_values(OBSERVATION) != q).any()
    agent.set_state(weights, state)
    np.testing.assert_array_equal(agent.policy.q_values(OBSERVATION), q)


def test_get_state_names_the_variables_by_their_paths() -> None:
    layers = ("hidden_0/kernel", "hidden_0/bias", "head/kernel", "head/bias")
    state = make_agent().get_state()
    assert set(state) == {"target", "optimizer"}
    assert set(state["target"]) == {f"dqn/{layer}" for layer in layers}
    moments = {
        f"adam/dqn_{layer.replace('/', '_')}_{moment}"
        for layer in layers
        for moment in ("momentum", "velocity")
    }
    assert set(state["optimizer"]) == {"adam/iteration", "adam/learning_rate", *moments}


def test_get_state_is_a_copy() -> None:
    agent = make_agent()
    state = agent.get_state()
    before = {path: array.copy() for group in state.values() for path, array in group.items()}
    agent.update(random_batches(2))
    for group in state.values():
        for path, array in group.items():
            np.testing.assert_array_equal(array, before[path])


def remove(arrays: dict[str, NDArray[Any]], path: str) -> None:
    del arrays[path]


def add(arrays: dict[str, NDArray[Any]], path: str) -> None:
    arrays["other/kernel"] = arrays[path]


def rename(arrays: dict[str, NDArray[Any]], path: str) -> None:
    arrays["other/kernel"] = arrays.pop(path)


def transpose(arrays: dict[str, NDArray[Any]], path: str) -> None:
    arrays[path] = arrays[path].T


def shorten(arrays: dict[str, NDArray[Any]], path: str) -> None:
    arrays[path] = arrays[path][:1]


@pytest.mark.parametrize("change", [remove, add, rename, transpose, shorten])
@pytest.mark.parametrize(
    ("group", "path"),
    [("target", "dqn/head/kernel"), ("optimizer", "adam/dqn_head_kernel_momentum")],
)
def test_set_state_refuses_other_paths_or_shapes_and_changes_nothing(
    group: str, path: str, change: Callable[..., None]
) -> None:
    weights, state = other_state()
    change(state[group], path)
    agent = make_agent()
    before, policy = values(agent), agent.policy
    name = "other/kernel" if change is add else path
    with pytest.raises(ValueError, match=f"^{group}/{name} is missing, unknown or of another"):
        agent.set_state(weights, state)
    assert_equal(values(agent), before)
    assert agent.policy is policy


@pytest.mark.parametrize("wrong", ["one array too few", "a shorter array"])
def test_set_state_refuses_weights_of_other_layers_and_changes_nothing(wrong: str) -> None:
    weights, state = other_state()
    last = weights.pop()
    if wrong == "a shorter array":
        weights.append(last[:1])
    agent = make_agent()
    before = values(agent)
    with pytest.raises(ValueError):
        agent.set_state(weights, state)
    assert_equal(values(agent), before)


def averaging_agent() -> Agent:
    """Returns an agent whose optimizer halves the weight of the past at each update."""
    return make_agent(
        optimizer=keras.optimizers.Adam(0.01, name="adam", use_ema=True, ema_momentum=0.5)
    )


def test_average_weights_sets_the_moving_average_of_the_updates() -> None:
    agent = averaging_agent()
    batches = random_batches(3)
    expected: Weights = []
    for k in range(3):
        agent.update(Transitions(*(field[k : k + 1] for field in batches)))
        weights = agent.online.get_weights()
        pairs = zip(expected or weights, weights, strict=True)
        expected = [(before + now) / 2 for before, now in pairs]
    assert any((now != mean).any() for now, mean in zip(weights, expected, strict=True))
    agent.average_weights()
    for found, mean in zip(agent.online.get_weights(), expected, strict=True):
        np.testing.assert_allclose(found, mean, atol=1e-7)
    q = agent.online(OBSERVATION[np.newaxis]).numpy()[0]
    np.testing.assert_allclose(agent.policy.q_values(OBSERVATION), q, atol=1e-6)


@pytest.mark.parametrize("make", [make_agent, averaging_agent])
def test_average_weights_changes_nothing_before_the_first_update(make: Callable[[], Agent]) -> None:
    agent = make()
    before = values(agent)
    agent.average_weights()
    assert_equal(values(agent), before)


def test_average_weights_changes_nothing_without_an_average() -> None:
    agent = make_agent()
    agent.update(random_batches(2))
    before = values(agent)
    agent.average_weights()
    assert_equal(values(agent), before)
