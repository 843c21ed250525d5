"""Every kind of agent, in the one form that an evaluation uses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import keras
import numpy as np
import pytest
import tensorflow as tf
import torch
from numpy.typing import NDArray

import keras_pendulum as kp
from keras_pendulum.environments.actions import TorqueActions
from keras_pendulum.evaluate.answers import ActionError
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.storage.run_info import RunInfo

OBSERVATIONS = np.random.default_rng(0).uniform(-1, 1, (9, 3)).astype(np.float32)
GRID = np.linspace(-2, 2, 5)


@pytest.fixture(scope="module")
def network() -> kp.DQN:
    return kp.DQN((8, 6), 5, seed=3)


def torques_of(policy: Policy) -> NDArray[np.float64]:
    assert isinstance(policy.actions, TorqueActions)
    return policy.actions.torques


def dense_chain(network: kp.DQN) -> keras.Model:
    """Returns the network as a Sequential model of Keras."""
    layers = [keras.layers.Dense(units, "tanh") for units in network.hidden_units]
    model = keras.Sequential(
        [keras.Input((3,)), *layers, keras.layers.Dense(network.action_count)], name="mine"
    )
    model.set_weights(network.get_weights())
    return model


@keras.saving.register_keras_serializable("tests")
class Subclassed(keras.Model):
    """The same layers, called by a model's own code."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.parts = [keras.layers.Dense(n, "tanh") for n in (8, 6)] + [keras.layers.Dense(5)]

    def call(self, x: Any) -> Any:
        for part in self.parts:
            x = part(x)
        return x


def subclassed(network: kp.DQN) -> keras.Model:
    model = Subclassed(name="mine")
    model(OBSERVATIONS)
    model.set_weights(network.get_weights())
    return model


def torch_module(network: kp.DQN) -> torch.nn.Module:
    weights = [torch.tensor(array) for array in network.get_weights()]
    parts: list[torch.nn.Module] = []
    for kernel, bias in zip(weights[::2], weights[1::2], strict=True):
        linear = torch.nn.Linear(*kernel.shape)
        linear.load_state_dict({"weight": kernel.T, "bias": bias})
        parts += [linear, torch.nn.Tanh()]
    return torch.nn.Sequential(*parts[:-1])


class Predicts:
    """An object with the `predict` of Stable-Baselines3, whose actions are indices."""

    action_space = SimpleNamespace(n=5, start=0)
    observation_space = SimpleNamespace(shape=(3,))
    gamma = 0.97

    def __init__(self, network: kp.DQN) -> None:
        self.q_net = torch_module(network)

    def predict(
        self,
        observation: NDArray[np.float32],
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], Any]:
        assert deterministic
        return self.q_net(torch.tensor(observation)).argmax(dim=-1).numpy(), None


class PredictsTorque(Predicts):
    """The same, with a continuous torque."""

    action_space = SimpleNamespace(low=np.array([-2.0]), high=np.array([2.0]))

    def predict(self, *args: Any, **options: Any) -> tuple[NDArray[Any], Any]:
        return GRID[super().predict(*args, **options)[0]][..., np.newaxis], None


def a_torque(network: kp.DQN) -> Callable[[NDArray[np.float32]], Any]:
    policy = kp.load_policy(network)
    return lambda observation: policy(observation)[0]


def q_in_numpy(network: kp.DQN) -> Any:
    return kp.q_function(kp.load_policy(network).q_values, GRID)


def q_in_torch_with_gradients(network: kp.DQN) -> Any:
    module = torch_module(network)
    return kp.q_function(lambda x: module(torch.from_numpy(x)))


KINDS: dict[str, Callable[[kp.DQN], Any]] = {
    "policy": kp.load_policy,
    "Sequential": dense_chain,
    "functional": lambda network: keras.Model(
        inputs := keras.Input((3,)), dense_chain(network)(inputs)
    ),
    "subclassed": subclassed,
    "NumPy": q_in_numpy,
    "TensorFlow": lambda network: kp.q_function(tf.function(lambda x: network(x)), list(GRID)),
    "PyTorch": lambda network: kp.q_function(torch_module(network)),
    "PyTorch with gradients": q_in_torch_with_gradients,
    "predict, indices": Predicts,
    "predict, torque": PredictsTorque,
    "torque": a_torque,
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_agent_has_the_returns_of_the_network(kind: str, network: kp.DQN) -> None:
    source = KINDS[kind](network)
    agent = as_policy(source)
    own = as_policy(network)
    np.testing.assert_array_equal(agent.act(OBSERVATIONS), own.act(OBSERVATIONS))
    assert agent.has_q_values == ("torque" not in kind)
    if agent.has_q_values:
        np.testing.assert_allclose(
            agent.q_values(OBSERVATIONS), own.q_values(OBSERVATIONS), atol=1e-5
        )
        np.testing.assert_array_equal(torques_of(agent), GRID)
    score, expected = (kp.evaluate_policy(each, 3) for each in (source, network))
    np.testing.assert_allclose(score.returns, expected.returns, rtol=1e-9)


def test_torques_of_a_file_are_those_that_are_given(network: kp.DQN, tmp_path: Path) -> None:
    path = tmp_path / "mine.keras"
    dense_chain(network).save(path)
    np.testing.assert_array_equal(torques_of(as_policy(path, -GRID)), -GRID)


def test_network_without_weights_is_refused() -> None:
    with pytest.raises(kp.UserError, match="has no weights yet"):
        as_policy(Subclassed())


def test_torch_module_is_evaluated_in_its_evaluation_mode(network: kp.DQN) -> None:
    module = torch.nn.Sequential(torch.nn.Dropout(0.9), torch_module(network))
    module[1].eval()
    agent = as_policy(kp.q_function(module))
    np.testing.assert_array_equal(agent.act(OBSERVATIONS), as_policy(network).act(OBSERVATIONS))
    assert [part.training for part in (module, module[0], module[1])] == [True, True, False]


def test_torques_stand_for_the_outputs(network: kp.DQN) -> None:
    torques = np.array([2.0, 1.5, 0.0, -1.5, -2.0])
    index = kp.load_policy(network).q_values(OBSERVATIONS).argmax(axis=1)
    for source in (network, dense_chain(network), Predicts(network)):
        agent = as_policy(source, torques=torques)
        np.testing.assert_array_equal(agent.act(OBSERVATIONS)[:, 0], torques[index])
        np.testing.assert_array_equal(torques_of(agent), torques)
        assert agent.action(OBSERVATIONS[0]) == torques[index[:1]]


def test_known_discount_is_that_of_the_run_or_of_stable_baselines3(network: kp.DQN) -> None:
    assert as_policy("swingup").info.discount == 0.985
    assert as_policy(Predicts(network)).info.discount == 0.97
    assert as_policy(network).info.discount is None
    for config in (None, "", "{", "[]", "{}", '{"discount": 2}', '{"discount": "x"}', "[" * 10**5):
        assert RunInfo.from_record({"config": config}).discount is None


@pytest.mark.parametrize(
    ("torques", "problem"),
    [
        ([-2, 0, 2], "torques has 3 numbers; the agent has 5 actions"),
        ([-2, -1, 0, 1, np.nan], "expected numbers from -2 to 2"),
        (np.linspace(-4, 4, 5), "torques are from -4 to 4; expected numbers from -2 to 2"),
        ([[0, 0, 0, 0, 0]], "expected a list of numbers"),
        ([1, [2, 3]], "expected a list of numbers"),
        ("abcde", "expected a list of numbers"),
    ],
)
def test_wrong_torques_are_refused(torques: Any, problem: str, network: kp.DQN) -> None:
    for source in (network, dense_chain(network), Predicts(network)):
        with pytest.raises(kp.ConfigError, match=problem):
            as_policy(source, torques)


@pytest.mark.parametrize(
    "source",
    [PredictsTorque, q_in_numpy, lambda network: kp.load_policy("cartpole")],
)
def test_torques_are_refused_where_nothing_stands_for_one(source: Any, network: kp.DQN) -> None:
    with pytest.raises(kp.ConfigError, match=r"^torques "):
        as_policy(source(network), torques=GRID)


@pytest.mark.parametrize("source", [3, None, {}, kp.DQN, object(), torch.nn.Linear(3, 5)])
def test_other_objects_are_refused_with_what_is_expected(source: Any) -> None:
    with pytest.raises(TypeError, match=r"^agent is .*kp\.q_function"):
        as_policy(source)


def with_spaces(**spaces: Any) -> Any:
    return type("Model", (Predicts,), spaces)(kp.DQN((8, 6), 5))


@pytest.mark.parametrize(
    ("spaces", "problem"),
    [
        ({"observation_space": SimpleNamespace(shape=(4,))}, r"of the shape \(4,\)"),
        ({"action_space": SimpleNamespace(low=[-1.0], high=[1.0])}, "one torque from -2 to 2"),
        ({"action_space": SimpleNamespace(low=[-2, -2], high=[2, 2])}, "one torque from -2 to 2"),
        ({"action_space": SimpleNamespace(nvec=[3, 3])}, "one torque from -2 to 2"),
    ],
)
def test_model_of_another_task_is_refused(spaces: dict[str, Any], problem: str) -> None:
    with pytest.raises(kp.ConfigError, match=problem):
        as_policy(with_spaces(**spaces))


def answering(answer: Any) -> Policy:
    return as_policy(lambda observation: answer)


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (float("nan"), "the torque nan N·m; expected a number from -2 to 2"),
        (-2.001, "the torque -2.001 N·m"),
        (np.zeros(2), r"an array of the shape \[2\]; expected a torque in N·m"),
        (np.zeros((1, 2)), r"an array of the shape \[1, 2\]"),
        ("left", "a str of the type <U4"),
        (1, r"the integer 1; expected a torque as a floating-point number; for an index, give"),
        (np.int8(1), "the integer 1"),
        (None, "a NoneType of the type object"),
        (True, "a bool of the type bool"),
        ([[1], [2, 3]], "a list; expected a torque in N·m"),
    ],
)
def test_answer_that_is_no_torque_is_refused(answer: Any, problem: str) -> None:
    with pytest.raises(ActionError, match=f"^the agent returned {problem}"):
        answering(answer).act(OBSERVATIONS)


def test_torques_in_all_libraries_and_types_are_accepted() -> None:
    numbers = (1.0, np.float32(1), [1.0], [[1.0]], np.ones((1, 1), np.float32))
    for answer in (*numbers, torch.ones(1), tf.ones(()), tf.ones((1, 1))):
        np.testing.assert_array_equal(answering(answer).act(OBSERVATIONS), np.ones((9, 1)))
    half = torch.ones(1, dtype=torch.bfloat16, requires_grad=True)
    np.testing.assert_array_equal(answering(half).act(OBSERVATIONS), np.ones((9, 1)))


def test_torque_beyond_the_limit_by_a_rounding_is_the_limit() -> None:
    for answer, torque in ((2.000004, 2.0), (-2.000004, -2.0)):
        np.testing.assert_array_equal(answering(answer).act(OBSERVATIONS), np.full((9, 1), torque))


def test_integers_of_an_agent_are_indices_of_its_torques() -> None:
    for index in (2, np.int64(2), np.array([2])):
        agent = as_policy(lambda observation, index=index: index, torques=[-2, 0, 1.5])
        np.testing.assert_array_equal(agent.act(OBSERVATIONS), np.full((9, 1), 1.5))
    chooses = SimpleNamespace(choose_action=lambda observation: 2)
    agent = as_policy(chooses, torques=[-2, 0, 1.5])
    np.testing.assert_array_equal(agent.act(OBSERVATIONS), np.full((9, 1), 1.5))
    with pytest.raises(ActionError, match="the index 3; expected an integer from 0 to 2"):
        as_policy(lambda observation: 3, torques=[-2, 0, 1.5]).act(OBSERVATIONS)


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        ((np.full(9, 5), None), "the index 5; expected an integer from 0 to 4"),
        ((np.full(9, -1), None), "the index -1"),
        ((np.full(9, 1.0), None), "a number of the type float64"),
        ((np.zeros(8, int), None), r"an array of the shape \[8\]"),
        (np.zeros(9, int), r"expected a pair \(action, state\)"),
    ],
)
def test_answer_that_is_no_index_is_refused(answer: Any, problem: str) -> None:
    model = with_spaces(predict=lambda self, observation, deterministic: answer)
    with pytest.raises(ActionError, match=problem):
        as_policy(model).act(OBSERVATIONS)


@pytest.mark.parametrize(
    ("function", "problem"),
    [
        (lambda x: x[:, 0], r"an array of the shape \[2\]; expected Q-values of the shape \[2, "),
        (lambda x: x[:1], r"an array of the shape \[1, 3\]"),
        (lambda x: x[:, :1], r"one number for each observation; .* actor, .* give lambda o: "),
        (lambda x: {"q": x}, "a dict of the type object"),
        (lambda x: x.missing, r"raised AttributeError: .*missing.* \(test_agents.py, line \d+\)$"),
    ],
)
def test_function_that_gives_no_q_values_is_refused_at_once(function: Any, problem: str) -> None:
    with pytest.raises(kp.UserError, match=f"^the agent (returned )?{problem}"):
        kp.q_function(function)


def test_q_function_needs_a_function() -> None:
    with pytest.raises(TypeError, match=r"^function is 3; expected a function"):
        kp.q_function(3)  # type: ignore[arg-type]


def test_row_of_a_wrong_answer_is_known() -> None:
    def act(observation: NDArray[np.float32]) -> float:
        return 3.0 if (observation == OBSERVATIONS[6]).all() else 0.0

    with pytest.raises(ActionError) as caught:
        as_policy(act).act(OBSERVATIONS)
    assert caught.value.row == 6


@pytest.mark.parametrize("kind", [object, torch.nn.Module])
@pytest.mark.parametrize(
    "method", ["act", "choose_action", "select_action", "get_action", "predict"]
)
def test_object_that_chooses_an_action_is_an_agent(method: str, kind: type) -> None:
    agent = as_policy(type("Agent", (kind,), {method: lambda self, observation: 1.5})())
    np.testing.assert_array_equal(agent.act(OBSERVATIONS), np.full((9, 1), 1.5))


def test_model_of_a_class_of_ones_own_is_not_compiled() -> None:
    calls = []

    class Counting(keras.Model):
        def __init__(self) -> None:
            super().__init__()
            self.head = keras.layers.Dense(5)

        def call(self, observations: Any) -> Any:
            calls.append(observations.numpy().shape)  # what a graph cannot
            return self.head(observations)

    model = Counting()
    model(np.zeros((1, 3), np.float32))
    calls.clear()
    kp.evaluate_policy(model, episodes=1, gravity=1)
    assert len(calls) >= 200


class Recurrent:
    """Pushes with 1 N·m, and from the second step of an episode on with 2."""

    def predict(
        self, observation: Any, state: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        return np.array([1.0 if state is None else 2.0]), 1


def test_state_of_predict_is_kept_until_the_end_of_the_episode() -> None:
    policy = as_policy(Recurrent())
    assert policy.one_by_one
    assert [policy.act(OBSERVATIONS[:1]).item() for _ in range(3)] == [1, 2, 2]
    policy.reset()
    assert policy.act(OBSERVATIONS[:1]).item() == 1


def test_state_of_a_batch_is_refused() -> None:
    model = with_spaces(
        predict=lambda self, observation, state=None, deterministic=True: (
            np.zeros(len(observation), int),
            np.ones(2),
        )
    )
    with pytest.raises(ActionError, match=r"predict returned a state, .* that keeps it"):
        as_policy(model).act(OBSERVATIONS)


def test_model_gets_the_observations_with_which_it_learned() -> None:
    class Normalized(Recurrent):
        def get_vec_normalize_env(self) -> Any:
            return SimpleNamespace(normalize_obs=lambda each: each / 10)

        def predict(self, observation: Any, deterministic: bool = False) -> Any:  # type: ignore[override]
            return observation[:1], None

    policy = as_policy(Normalized())
    assert policy.act(np.array([[1, 0, 0]], np.float32)).item() == pytest.approx(0.1)
