from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.pendulum import PendulumSolution


def test_returns_equal_those_of_a_plain_loop_on_gymnasium() -> None:
    network = kp.DQN((8,), seed=1)
    score = kp.evaluate_policy(network, episodes=3, seed=5)
    np.testing.assert_array_equal(score.optimal_returns, kp.optimal_return(1, [5, 6, 7]))
    env = gymnasium.make("Pendulum-v1", g=1.0)
    torques = np.linspace(-2, 2, 41)
    for i in range(3):
        observation, _ = env.reset(seed=5 + i)
        total = 0.0
        for _ in range(200):
            index = int(np.argmax(network(observation[np.newaxis])[0]))
            observation, reward, _, _, _ = env.step(torques[index : index + 1])
            total += float(reward)
        assert score.returns[i] == pytest.approx(total, rel=1e-6)


def test_network_policy_path_and_shipped_name_are_evaluated_alike() -> None:
    path = kp.find_weights("swingup")
    agents = ("swingup", str(path), path, kp.load_weights("swingup"), kp.load_policy("swingup"))
    scores = [kp.evaluate_policy(agent, 1) for agent in agents]
    assert {(score.gravity, score.mean_return) for score in scores} == {
        (10.0, scores[0].mean_return)
    }


def test_score_computes_its_statistics() -> None:
    score = kp.Score(Pendulum(), np.array([-1.0, -2.0, -9.0]), np.array([-1.0, -1.0, -4.0]))
    assert score.as_json() == {
        "environment": "Pendulum-v1",
        "gravity": 1.0,
        "episodes": 3,
        "mean_return": -4.0,
        "std_return": pytest.approx(np.sqrt((9 + 4 + 25) / 3)),
        "median_return": -2.0,
        "worst_return": -9.0,
        "optimal_mean_return": -2.0,
        "regret": 2.0,
        "discount": None,
        "discount_regret": None,
        "learning_regret": None,
    }


def score_with_discount(regret: float) -> kp.Score:
    """Returns a score for γ = 0.9 at g = 1, which costs 0.245 of the regret."""
    optimum = kp.optimal_return(1.0, range(100))
    return kp.Score(Pendulum(), optimum - regret, optimum, 0.9, range(100))


def test_regret_has_a_part_of_the_discount_and_one_of_learning() -> None:
    score = score_with_discount(2.0)
    returns = PendulumSolution(Pendulum()).discounted_returns(0.9, range(100))
    cost = (kp.optimal_return(1.0, range(100)) - returns).mean()
    assert score.discount_regret == pytest.approx(cost)
    assert score.learning_regret == pytest.approx(2 - cost)
    values = score.as_json()
    assert values["discount"] == 0.9
    assert values["discount_regret"] + values["learning_regret"] == pytest.approx(values["regret"])
    assert score.summary().splitlines()[2:] == [
        "Regret: 2.00",
        f"Exact policy for the discount 0.9: regret {cost:.2f}. Regret from "
        f"learning: {2 - cost:.2f}",
    ]
    assert (
        score_with_discount(0.1)
        .summary()
        .splitlines()[3]
        .endswith(f"regret {cost:.2f}. This policy is better by {cost - 0.1:.2f}")
    )


def test_discount_is_the_given_one_else_the_recorded_one() -> None:
    scores = [kp.evaluate_policy("reference", 1, discount=given) for given in (None, 1, 0.9)]
    assert [score.discount for score in scores] == [kp.preset("reference").discount, 1, 0.9]
    assert scores[1].discount_regret == 0
    assert kp.evaluate_policy(kp.DQN((8,)), 1).discount is None
    with pytest.raises(kp.ConfigError, match=r"^discount is 1\.5; expected a number from 0 to 1$"):
        kp.evaluate_policy("reference", 1, discount=1.5)


def test_exact_policy_of_cartpole_for_a_short_sight_falls() -> None:
    score = kp.evaluate_policy("cartpole", 10, discount=0.5)
    assert score.discount_regret is not None and 380 < score.discount_regret < 420
    assert kp.evaluate_policy("cartpole", 10).discount_regret == 0  # γ = 0.99


@pytest.mark.parametrize(
    ("excess", "reason"),
    [
        (0.0011, "0.0011 above the best known one: a torque between the 41 of the optimum can"),
        (0.3, "0.3000 above the best known one: torques between the 41 of the optimum gain at"),
    ],
)
def test_return_above_the_best_one_with_41_torques_is_explained(excess: float, reason: str) -> None:
    line = score_with_discount(-excess).summary().splitlines()[2]
    assert line.startswith(f"Regret: 0.00 (the mean return is {reason} ")


def test_summary_has_the_same_lines_for_both_environments_and_one_for_a_fall() -> None:
    pendulum = kp.Score(Pendulum(), np.array([-4.0, -2.0]), np.array([-2.5, -1.5]))
    assert pendulum.summary().splitlines() == [
        "Greedy on 2 fixed starts, Pendulum-v1, g = 1: mean return -3.00 "
        "(standard deviation 1.00, median -3.00, worst -4.00)",
        "Best possible on the same starts: -2.00",
        "Regret: 1.00",
    ]
    cartpole = kp.Score(CartPole(), np.array([500.0, 300.0]), np.array([500.0, 500.0]))
    assert cartpole.summary().splitlines() == [
        "Greedy on 2 fixed starts, CartPole-v1: mean return 400.00 "
        "(standard deviation 100.00, median 400.00, worst 300.00)",
        "Best possible on the same starts: 500.00",
        "Regret: 100.00",
        "The pole fell in 1 of 2 episodes",
    ]


def test_environment_is_closed_when_on_step_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[Any] = []

    def raise_error(env: gymnasium.Env[Any, Any]) -> None:
        monkeypatch.setattr(env, "close", lambda: closed.append(env))
        raise kp.UserError("stop")

    with pytest.raises(kp.UserError, match="stop"):
        kp.evaluate_policy(kp.DQN((8,)), 1, on_step=raise_error)
    assert len(closed) == 1


@pytest.mark.parametrize(
    ("name", "episodes", "seed", "gravity"),
    [
        ("episodes", 0, 0, None),
        ("episodes", 10**9, 0, None),
        ("seed", 1, -1, None),
        ("seed", 2, 2**32 - 1, None),
        ("gravity", 1, 0, -1.0),
    ],
)
def test_number_out_of_range_is_refused_by_name(
    name: str, episodes: int, seed: int, gravity: float | None
) -> None:
    with pytest.raises(kp.ConfigError, match=f"^{name} is .*expected"):
        kp.evaluate_policy(kp.DQN((8,)), episodes, seed, gravity=gravity)


@pytest.mark.parametrize("gravity", [1.0, 10.0])
def test_agent_without_a_task_is_judged_at_the_gravity_where_it_is_good(gravity: float) -> None:
    """Gymnasium's default is 10, that of the presets is 1."""
    policy = kp.load_policy("reference" if gravity == 1 else "swingup")
    assumed = kp.evaluate_policy(kp.q_function(policy.q_values), 5)
    declared = kp.evaluate_policy(kp.q_function(policy.q_values), 5, gravity=gravity)
    assert (assumed.gravity, assumed.regret) == (gravity, declared.regret)
    assert assumed.summary().splitlines()[1].startswith("The agent records no gravity. It gains ")
    assert declared.assumption == kp.evaluate_policy(policy, 1).assumption == ""
    diagnosis = kp.diagnose(kp.q_function(policy.q_values))
    assert diagnosis.measurement.task == Pendulum(gravity)
    assert "The agent records no gravity" in diagnosis.summary().splitlines()[2]


@pytest.mark.parametrize(
    ("recorded", "given", "gravity"),
    [
        (10.0, None, 10.0),
        (10.0, 2, 2.0),
        (10.0, 0, 0.0),
        (0.0, None, 0.0),
        (None, 100, 100.0),
    ],
)
def test_gravity_is_the_given_one_else_the_recorded_one(
    recorded: float | None, given: float | None, gravity: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        PendulumSolution, "best_returns", lambda self, seeds: np.array([self.task.gravity])
    )
    metadata = {} if recorded is None else {"gravity": recorded}
    score = kp.evaluate_policy(kp.DQN((8,), metadata=metadata), 1, gravity=given)
    assert (score.gravity, type(score.gravity)) == (gravity, float)
    assert score.optimal_returns == [gravity]
    alone = kp.evaluate_policy(kp.DQN((8,)), 1, gravity=gravity)
    assert alone.returns == score.returns
