"""The policy of `load_policy`: its actions, its checks, and other libraries that call it."""

from __future__ import annotations

import copy
import importlib.util
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.pendulum import Pendulum

pytestmark = pytest.mark.quick

TORQUES = np.linspace(-2, 2, 41)  # N·m
PENDULUM = np.random.RandomState(0).randn(50, 3).astype(np.float32)  # [B, D]
CARTPOLE = np.random.RandomState(0).randn(50, 4).astype(np.float32)  # [B, D]
# Calls of a policy with one observation or a batch, by name.
CALLS: dict[str, Callable[[kp.Policy, Any], Any]] = {
    "call": lambda policy, observation: policy(observation),
    "q_values": lambda policy, observation: policy.q_values(observation),
    "predict": lambda policy, observation: policy.predict(observation)[0],
}


def pendulum_policy(seed: int = 1) -> kp.Policy:
    return kp.load_policy(kp.DQN((8,), seed=seed))


def cartpole_policy() -> kp.Policy:
    metadata = {"environment": "CartPole-v1"}
    return kp.load_policy(kp.DQN((8,), 2, observation_size=4, seed=1, metadata=metadata))


def test_torque_is_that_of_the_highest_q_value_as_the_environment_takes_it() -> None:
    network = kp.DQN((64, 32), seed=1)
    policy = kp.load_policy(network)
    indices = network(PENDULUM).numpy().argmax(axis=1)
    assert len(set(indices)) > 3
    for observation, index in zip(PENDULUM, indices, strict=True):
        torque = policy(observation)
        assert (torque.shape, torque.dtype) == ((1,), np.float32)
        assert torque[0] == np.float32(TORQUES[index])
    batch = policy(PENDULUM)
    assert (batch.shape, batch.dtype) == ((50, 1), np.float32)
    np.testing.assert_array_equal(batch[:, 0], TORQUES[indices].astype(np.float32))
    assert policy(PENDULUM[:0]).shape == (0, 1)


def test_action_of_cartpole_is_an_index() -> None:
    policy = cartpole_policy()
    batch = policy(CARTPOLE)
    assert (batch.shape, batch.dtype) == ((50,), np.int64)
    assert set(batch) == {0, 1}
    assert [policy(observation) for observation in CARTPOLE] == batch.tolist()
    assert type(policy(CARTPOLE[0])) is int


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_lists_and_other_types_of_numbers_are_rounded_to_float32(
    call: Callable[[kp.Policy, Any], Any],
) -> None:
    policy = pendulum_policy()
    expected = call(policy, np.array([1, -2, 3], np.float32))
    for observation in ([1, -2, 3], np.array([1, -2, 3]), np.array([1, -2, 3 + 1e-12])):
        np.testing.assert_array_equal(call(policy, observation), expected)


def test_predict_returns_the_action_as_an_array_and_the_state() -> None:
    policy = pendulum_policy()
    for observation in (PENDULUM, PENDULUM[0]):
        action, state = policy.predict(observation, deterministic=True)
        np.testing.assert_array_equal(action, policy(observation))
        assert state is None
    marker = object()
    action, state = policy.predict(PENDULUM, marker, np.ones(50, bool), deterministic=False)
    np.testing.assert_array_equal(action, policy(PENDULUM))
    assert state is marker
    single, _ = cartpole_policy().predict(CARTPOLE[0])
    assert type(single) is np.ndarray
    assert single.ndim == 0 and single.dtype == np.int64


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_returned_array_can_be_changed(call: Callable[[kp.Policy, Any], Any]) -> None:
    policy = pendulum_policy()
    before = call(policy, PENDULUM[0]).copy()
    call(policy, PENDULUM[0])[:] = 7
    np.testing.assert_array_equal(call(policy, PENDULUM[0]), before)


@pytest.mark.parametrize(
    ("observation", "message"),
    [
        ([1, 2], "observation has the shape [2]; expected real numbers of the shape [3], or"),
        (np.zeros((3, 4)), "observation has the shape [3, 4]; expected real numbers of"),
        (1.0, "observation has the shape []; expected real numbers of the shape [3], or [B, 3]"),
        ([1, 2, np.nan], "observation holds NaN or infinite numbers; expected finite ones"),
        ([[1, 2, 3], [1, -np.inf, 3]], "observation holds NaN or infinite numbers"),
        ([1, 2, 1e300], "observation holds NaN or infinite numbers"),
        ("abc", "observation has the type <U3; expected real numbers of the shape [3]"),
        ([1, 2, 3j], "observation has the type complex128; expected real numbers"),
        ({"theta": 1}, "observation has the type object; expected real numbers"),
        ((np.zeros(3), {}), "observation is a tuple; expected real numbers of the shape [3]"),
    ],
    ids=str,
)
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_wrong_observation_is_refused_in_one_line(
    call: Callable[[kp.Policy, Any], Any], observation: Any, message: str
) -> None:
    with pytest.raises(ValueError) as caught:
        call(pendulum_policy(), observation)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_policy_asks_its_network_for_nothing_later(monkeypatch: pytest.MonkeyPatch) -> None:
    policy = pendulum_policy()

    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("a call into Keras")

    monkeypatch.setattr(DQN, "__call__", refuse)
    monkeypatch.setattr(DQN, "get_weights", refuse)
    for call in CALLS.values():
        call(policy, PENDULUM)


@pytest.mark.parametrize(
    "copied",
    [copy.deepcopy, lambda policy: pickle.loads(pickle.dumps(policy))],
    ids=["deepcopy", "pickle"],
)
@pytest.mark.parametrize("activation", ["tanh", "relu", "linear"])
def test_copy_is_an_equal_policy(copied: Callable[[Any], Any], activation: str) -> None:
    policy = kp.load_policy(kp.DQN((8,), activation=activation, metadata={"gravity": 3.0}))
    copy = copied(policy)
    np.testing.assert_array_equal(copy.q_values(PENDULUM), policy.q_values(PENDULUM))
    assert copy.info == policy.info


def test_network_that_is_not_finite_and_other_objects_have_no_policy() -> None:
    network = kp.DQN((4,))
    network.head.bias.assign(np.full(41, np.nan))
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        kp.load_policy(network)
    with pytest.raises(TypeError, match="path is 3; expected str or PathLike"):
        kp.load_policy(3)  # type: ignore[arg-type]


def test_load_policy_takes_a_path_or_a_shipped_name() -> None:
    by_name, by_path = kp.load_policy("swingup"), kp.load_policy(kp.find_weights("swingup"))
    assert by_name.info == by_path.info
    assert (by_name.info.preset, by_name.info.task) == ("swingup", Pendulum(10.0))
    np.testing.assert_array_equal(by_name.q_values(PENDULUM), by_path.q_values(PENDULUM))
    assert kp.load_policy("cartpole")(CARTPOLE[0]) in (0, 1)
    with pytest.raises(kp.WeightsError, match="nonsense: no such file"):
        kp.load_policy("nonsense")
    with pytest.raises(kp.WeightsError, match="with the activation tanh, not relu"):
        kp.load_policy("swingup", activation="relu")


@pytest.mark.skipif(
    importlib.util.find_spec("stable_baselines3") is None, reason="needs the extra `bench`"
)
@pytest.mark.parametrize("name", ["reference", "cartpole"])
def test_evaluate_policy_of_stable_baselines3_gives_the_same_returns(name: str) -> None:
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.evaluation import evaluate_policy

    policy = kp.load_policy(name)
    task = policy.task
    env = make_vec_env(task.environment, n_envs=1, seed=0, env_kwargs=task.physics)
    returns, lengths = evaluate_policy(policy, env, 1, return_episode_rewards=True)
    score = kp.evaluate_policy(policy, 1, 0)
    assert returns == pytest.approx(score.returns, abs=1e-5)  # Monitor rounds to 6 decimals
    assert lengths == [200 if name == "reference" else 500]
