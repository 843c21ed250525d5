from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.optimum.pendulum import PendulumSolution
from keras_pendulum.train.reference_returns import reference_returns, run_title
from keras_pendulum.version import __version__

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("preset", "settings", "names"),
    [
        ("reference", {}, ["best possible", "optimal policy for γ = 0.9", "random actions"]),
        ("reference", {"discount": 1.0}, ["best possible", "random actions"]),
        ("swingup", {}, ["best possible", "optimal policy for γ = 0.985", "random actions"]),
        ("reference", {"max_episode_steps": 201}, []),
        ("cartpole", {}, ["best possible", "random actions"]),
    ],
)
def test_returns_of_the_pendulum_include_those_of_its_discount(
    preset: str, settings: dict[str, Any], names: list[str]
) -> None:
    assert list(reference_returns(kp.preset(preset, **settings))) == names


def test_optimal_policy_for_the_discount_collects_less_than_the_optimum() -> None:
    returns = reference_returns(kp.preset("reference"))
    discounted = returns["optimal policy for γ = 0.9"]
    exact = PendulumSolution(Pendulum()).discounted_returns(0.9, range(1000), 100)
    assert discounted == exact.mean()
    assert -45 < discounted < returns["best possible"]


def test_title_has_preset_seed_regret_task_and_version() -> None:
    score = kp.Score(Pendulum(), np.array([-41.5, -2.5]), np.array([-40.0, -2.0]))
    config = kp.preset("reference", seed=3)
    first, second = run_title(config, score).split("\n")
    assert first == "reference, seed 3: regret 1.00"
    facts = f"Pendulum-v1, g = 1 · greedy policy on 2 fixed starts · keras_pendulum {__version__}"
    assert second == facts
    assert run_title(config).startswith("reference, seed 3\nPendulum-v1, g = 1 · keras_pendulum")
