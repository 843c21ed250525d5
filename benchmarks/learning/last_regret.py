"""Where the last regret is: the regret of trained policies by step, state, start and seed.

    python -m benchmarks.learning.last_regret [reference|swingup [SEEDS]]

Trains the preset with the training seeds 100, 101, … (8 seeds), two runs at a time. Plays greedy
episodes from the starts of seeds 1000 to 1299. Writes a table to benchmarks/results and a picture
to docs, for docs/last_regret.md. On two cores, `reference` takes three minutes and `swingup` 25.

Let V(s) be the highest return from the state s. A step from s with the reward r to s' loses

    V(s) - r - V(s').

This is 0 for an optimal torque. The losses of an episode add up to its regret, so each part of the
regret belongs to a step and to a state. V is computed by `value_iteration` for 200 steps.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import keras_pendulum as kp
from benchmarks.learning.last_regret_figure import draw
from benchmarks.learning.variants import two_processes
from benchmarks.result_files import ROOT, Row, write
from keras_pendulum.dqn.policy import GreedyPolicy, greedy_policy
from keras_pendulum.environments.pendulum import STEPS_PER_EPISODE, Pendulum
from keras_pendulum.optimum.dynamics import TORQUES, step_all_torques
from keras_pendulum.optimum.value_iteration import solve, value_at
from keras_pendulum.study.arms import own_arms

STARTS = range(1000, 1300)
# The arms of each picture, written as for the study; the last one is the preset.
ARMS = {
    "reference": [
        "before: reference max_episode_steps=200 replay_capacity=25000 updates_per_episode=30",
        "reference: reference",
    ],
    "swingup": [
        "before: swingup replay_capacity=25000 discount=0.98 epsilon_min=0.01 "
        "updates_per_episode=15 learning_rate_min=0 average_updates=1",
        "swingup: swingup",
    ],
}
UPRIGHT = 0.3, 1.0  # |θ| in rad and |θ̇| in rad/s below which the pendulum has arrived
HANGING = 0.5  # rad; a start closer than this to hanging is near the watershed
_NO_TORQUE = len(TORQUES) // 2  # the index of 0 N·m
_TABLE_CELLS = 400  # finer ones change the regrets below by less than 0.01

Array = NDArray[Any]
QFunction = Callable[[Array, Array], Array]  # θ [N], θ̇ [N] -> Q-values [N, A]


@dataclass(frozen=True)
class Episodes:
    """Greedy episodes of one policy: T steps from each of N starts."""

    theta: Array  # [T, N] rad, -π to π, before the step
    speed: Array  # [T, N] rad/s
    lost: Array  # [T, N] V(s) - r - V(s')
    torque: Array  # [T, N] index of the torque taken, minus that of 0 N·m
    best: Array  # [T, N] the same of the optimal torque
    error: Array  # [T, N] learned minus exact Q-value of the torque taken, for the training's γ
    uneven: Array  # [T, N] standard deviation of that error over the torques

    @property
    def on_the_way(self) -> NDArray[np.bool_]:
        """[T, N]: true until the pendulum is upright and slow for the first time."""
        arrived = (np.abs(self.theta) < UPRIGHT[0]) & (np.abs(self.speed) < UPRIGHT[1])
        return ~np.logical_or.accumulate(arrived, axis=0)


def play(learned: QFunction, exact: QFunction, gravity: float, value: Array) -> Episodes:
    """Plays greedy episodes from the starts of seeds 1000 to 1299.

    Args:
        learned: the Q-values of the policy, in units of return.
        exact: the Q-values of the optimal policy for the training's discount.
        gravity: m/s².
        value: V without a discount, a table of `value_iteration`.
    """
    theta, speed = Pendulum().starts(STARTS).T
    rows, steps = np.arange(len(theta)), []
    for _ in range(STEPS_PER_EPISODE):
        q = learned(theta, speed)
        error = q - exact(theta, speed)
        torque = q.argmax(axis=1)
        reward, next_theta, next_speed = step_all_torques(gravity, theta, speed)
        returns = reward + value_at(value, next_theta, next_speed)
        step = (
            (theta + np.pi) % (2 * np.pi) - np.pi,
            speed,
            value_at(value, theta, speed) - returns[rows, torque],
            torque - _NO_TORQUE,
            returns.argmax(axis=1) - _NO_TORQUE,
            error[rows, torque],
            error.std(axis=1),
        )
        steps.append(step)
        theta, speed = next_theta[rows, torque], next_speed[rows, torque]
    return Episodes(*(np.array(field) for field in zip(*steps, strict=True)))


def exact_q(gravity: float, discount: float) -> QFunction:
    """Returns the Q-values of the optimal policy for a discount."""
    table = solve(gravity, STEPS_PER_EPISODE, _TABLE_CELLS, discount)

    def q_values(theta: Array, speed: Array) -> Array:
        reward, next_theta, next_speed = step_all_torques(gravity, theta, speed)
        return reward + discount * value_at(table, next_theta, next_speed)

    return q_values


def learned_q(policy: GreedyPolicy, reward_scale: float) -> QFunction:
    """Returns the Q-values of a trained policy, divided by the training's factor on rewards."""

    def q_values(theta: Array, speed: Array) -> Array:
        columns = [np.cos(theta), np.sin(theta), speed]
        return policy.q_values(np.stack(columns, axis=1, dtype=np.float32)) / reward_scale

    return q_values


def train(config: kp.Config) -> GreedyPolicy:
    """Trains; returns the greedy policy of the final network."""
    return greedy_policy(kp.train_dqn(config).network)


def parts(runs: Sequence[Episodes], discount_alone: Episodes) -> Row:
    """Returns the parts of the mean regret, by name."""
    lost = np.array([run.lost for run in runs])  # [S, T, N]
    torque, best = np.array([run.torque for run in runs]), np.array([run.best for run in runs])
    way = np.array([run.on_the_way for run in runs])
    error, uneven = np.array([run.error for run in runs]), np.array([run.uneven for run in runs])
    regrets = lost.sum(axis=1)  # [S, N]
    wrong = torque * best < 0
    weak = ~wrong & (np.abs(torque) < np.abs(best))
    hanging = np.abs(runs[0].theta[0]) > np.pi - HANGING  # [N]
    sorted_regrets = np.sort(regrets, axis=1)
    twentieth = regrets.shape[1] // 20
    discount = discount_alone.lost.sum(axis=0).mean()

    def mean(where: NDArray[np.bool_]) -> str:
        return f"{(lost * where).sum(axis=1).mean():.2f}"

    def root_mean_square(values: Array, where: NDArray[np.bool_]) -> str:
        return f"{np.sqrt((values[where] ** 2).mean()):.2f}"

    return {
        "mean regret": f"{regrets.mean():.2f}",
        "worst training seed": f"{regrets.mean(axis=1).max():.2f}",
        "the discount alone: the exact policy for γ": f"{discount:.2f}",
        "until the pendulum is upright": mean(way),
        "in its first 5 steps": mean(way & (np.arange(lost.shape[1]) < 5)[:, np.newaxis]),
        "after that": mean(~way),
        "in the last 80 of 200 steps": f"{lost[:, 120:].sum(axis=1).mean():.2f}",
        "torque to the wrong side": mean(wrong),
        "right side, torque too small": mean(weak),
        "right side, torque too large": mean(~wrong & ~weak),
        f"starts within {HANGING} rad of hanging ({hanging.mean():.0%} of the starts)": (
            f"{regrets[:, hanging].sum() / regrets.size:.2f}"
        ),
        "the worst 5 % of the starts": f"{sorted_regrets[:, -twentieth:].sum() / regrets.size:.2f}",
        "the median start": f"{np.median(regrets):.2f}",
        "error of Q on the way up, of the torque taken": root_mean_square(error, way),
        "error of Q on the way up, spread over the torques": root_mean_square(uneven, way),
        "error of Q after that, of the torque taken": root_mean_square(error, ~way),
        "error of Q after that, spread over the torques": root_mean_square(uneven, ~way),
    }


def main(preset: str = "reference", seeds: str = "8") -> None:
    """Trains, plays, and writes the table and the picture."""
    arms = own_arms([], ARMS[preset])
    gravity = arms[-1].config.gravity
    assert gravity is not None  # only CartPole has none
    value = solve(gravity, STEPS_PER_EPISODE, _TABLE_CELLS)
    columns: dict[str, Row] = {}
    episodes: dict[str, list[Episodes]] = {}
    with two_processes() as pool:
        for arm in arms:
            config = arm.config
            configs = [replace(config, seed=100 + seed) for seed in range(int(seeds))]
            exact = exact_q(gravity, config.discount)
            policies = pool.map(train, configs, 1)
            learned = [learned_q(policy, config.reward_scale) for policy in policies]
            episodes[arm.name] = [play(q_values, exact, gravity, value) for q_values in learned]
            discount_alone = play(exact, exact, gravity, value)
            columns[arm.name] = parts(episodes[arm.name], discount_alone)
    rows = [
        {"part of the regret": part, **{name: column[part] for name, column in columns.items()}}
        for part in columns[preset]
    ]
    write(
        f"last_regret_{preset}", f"python -m benchmarks.learning.last_regret {preset} {seeds}", rows
    )

    picture = draw(preset, gravity, episodes, discount_alone, value)
    (ROOT / "docs" / f"last_regret_{preset}.png").write_bytes(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
