"""Faults: runs with changed settings or one seam swapped, and changes to a healthy network.

`benchmarks.diagnosis.labelled_networks` makes networks with them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.environments.actions import TorqueGrid
from keras_pendulum.train.run import Run

SIZES = ((64, 64), (128, 64, 32), (32, 32))
ACTIVATIONS = ("tanh", "relu")

# Short runs that learn: on average they lose about 4 at g = 1.
HEALTHY = Config(
    episodes=150,
    max_episode_steps=100,
    updates_per_episode=100,
    warmup_episodes=20,
    epsilon_decay=0.97,
    tau=0.02,
    learning_rate=2e-3,
)
HEALTHY_10 = replace(
    HEALTHY,
    gravity=10.0,
    episodes=600,
    max_episode_steps=60,
    updates_per_episode=60,
    batch_size=64,
    discount=0.98,
    reward_scale=0.02,
    epsilon_decay=0.993,
)

Change = Callable[[Run], None]
Map = Callable[[NDArray[Any]], NDArray[Any]]


@dataclass(frozen=True)
class Training:
    """A fault of the training: changed settings, and a seam that is swapped in the run."""

    settings: dict[str, Any]
    swap: Change = lambda run: None
    hidden: tuple[str, ...] = ()  # settings that the user declares as those of a healthy run


@dataclass(frozen=True)
class Acting:
    """A fault outside the training: a map of the observations [B, 3] or of the Q-values [B, A]."""

    observations: Map = lambda observations: observations
    q_values: Map = lambda q: q
    gravity: float | None = None  # that the user declares
    weights: Callable[[list[Any]], list[Any]] = lambda weights: weights


class _Replay:
    """A replay buffer that stores changed transitions.

    Args:
        replay: the buffer.
        change: returns the transition to store, from this one and from the one before (or None).
    """

    def __init__(self, replay: Any, change: Callable[[Any, Any], Any]) -> None:
        self._replay = replay
        self._change = change
        self._before: Any = None

    def add(self, *transition: Any) -> None:
        changed = self._change(transition, self._before)
        self._before = transition
        self._replay.add(*changed)

    def __len__(self) -> int:
        return len(self._replay)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._replay, name)


def _store(change: Callable[[Any, Any], Any]) -> Change:
    def swap(run: Run) -> None:
        run.replay = _Replay(run.replay, change)  # type: ignore[assignment]

    return swap


class _MergedTorques(TorqueGrid):
    """Torques of which the replay buffer stores `lost` as the neighbour: never learned."""

    def __init__(self, lost: tuple[int, ...]) -> None:
        super().__init__()
        self._lost = lost

    def stored_index(self, index: int) -> int:
        return index + 1 if index in self._lost else index


def _merge(*lost: int) -> Change:
    def swap(run: Run) -> None:
        run.actions = _MergedTorques(lost)

    return swap


class _Starts(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A pendulum whose episodes start within a part of the plane."""

    def __init__(self, env: gymnasium.Env[Any, Any], low: Any, high: Any) -> None:
        super().__init__(env)
        self._low, self._high = low, high

    def reset(self, **options: Any) -> Any:
        _, info = self.env.reset(**options)
        inner: Any = self.env.unwrapped
        inner.state = inner.np_random.uniform(self._low, self._high)
        return inner._get_obs(), info


def _start(low: tuple[float, float], high: tuple[float, float]) -> Change:
    def swap(run: Run) -> None:
        run.env = _Starts(run.env, np.array(low), np.array(high))

    return swap


def _reward(change: Callable[[float], float]) -> Change:
    return _store(lambda now, _: (now[0], now[1], change(now[2]), *now[3:]))


_NOISE = np.random.RandomState(0)

TRAINING: dict[str, dict[str, Training]] = {
    "too-few-updates": {
        "one": Training({"updates_per_episode": 1, "learning_rate": 1e-3}),
        "two": Training({"updates_per_episode": 2, "learning_rate": 1e-3}),
        "short": Training({"episodes": 24, "updates_per_episode": 30, "learning_rate": 1e-3}),
    },
    "untrained-outputs": {
        "truncated": Training({"stored_index": "truncated"}),
        "end": Training({}, _merge(39)),
        "four": Training({}, _merge(5, 17, 22, 31)),
    },
    "other-discount": {
        "half": Training({"discount": 0.5}, hidden=("discount",)),
        "three": Training({"discount": 0.3}, hidden=("discount",)),
        "seven": Training({"discount": 0.7}, hidden=("discount",)),  # at g = 10
    },
    "reward-sign": {"negated": Training({}, _reward(lambda reward: -reward))},
    "reward-scale": {
        "hundred": Training({"reward_scale": 100.0}, hidden=("reward_scale",)),
        "tiny": Training({"reward_scale": 1e-4}, hidden=("reward_scale",)),
        "thousand": Training({"reward_scale": 1000.0}, hidden=("reward_scale",)),
    },
    "overestimation": {
        "noise": Training(
            {"replay_capacity": 8000, "updates_per_episode": 200, "target_update": "none"},
            _reward(lambda reward: reward + float(_NOISE.normal(0, 10))),
        ),
        "no-target": Training(
            {"target_update": "none", "discount": 0.98, "learning_rate": 3e-3},
        ),
        "little-noise": Training(
            {"replay_capacity": 4000, "discount": 0.98, "target_update": "none"},
            _reward(lambda reward: reward + float(_NOISE.normal(0, 4))),
        ),
    },
    "learning-rate": {
        "large": Training({"learning_rate": 2e-2, "learning_rate_schedule": "constant"}),
        "larger": Training({"learning_rate": 6e-2}),
        "constant": Training({"learning_rate": 6e-3, "learning_rate_schedule": "constant"}),
    },
    "forgetting": {
        "thousand": Training({"replay_capacity": 1000, "epsilon_decay": 0.9}),
        "small": Training({"replay_capacity": 500, "epsilon_decay": 0.9}),
        "longer": Training({"replay_capacity": 1000, "epsilon_decay": 0.974}),  # at g = 10
    },
    "exploration": {
        "never-falls": Training({"epsilon_start": 1.0, "epsilon_decay": 1.0}),
        "at-once": Training({"epsilon_start": 0.0, "epsilon_decay": 0.0, "epsilon_min": 0.0}),
    },
    "misaligned-transitions": {
        "same-observation": Training(
            {}, _store(lambda now, _: (now[0], now[1], now[2], now[0], now[4]))
        ),
        "action-before": Training(
            {}, _store(lambda now, last: (now[0], (last or now)[1], *now[2:]))
        ),
        "reward-before": Training(
            {}, _store(lambda now, last: (*now[:2], (last or now)[2], *now[3:]))
        ),
    },
    "no-bootstrapping": {
        "terminal": Training({}, _store(lambda now, _: (*now[:4], True))),
        "no-discount": Training({"discount": 0.0}, hidden=("discount",)),
    },
    "narrow-starts": {
        "upright": Training(
            {"max_episode_steps": 25, "episodes": 400, "updates_per_episode": 36},
            _start((-0.4, -0.5), (0.4, 0.5)),
        ),
        "one-side": Training(
            {"max_episode_steps": 12, "episodes": 800, "updates_per_episode": 18},
            _start((0.5, 0.0), (np.pi - 0.5, 4.0)),
        ),
    },
}


def _angle_in_degrees(observations: NDArray[Any]) -> NDArray[Any]:
    return observations * np.array([1, 1, 180 / np.pi], np.float32)


def _turn(*signs: float) -> Map:
    return lambda observations: observations * np.array(signs, np.float32)


def _order(*columns: int) -> Map:
    return lambda observations: observations[:, list(columns)]


def _spread_indices(count: int) -> NDArray[np.intp]:
    """Returns a fixed permutation of the indices."""
    return np.random.RandomState(7).permutation(count)


def _saturate(weights: list[Any]) -> list[Any]:
    """Returns the weights of a network with its last hidden layer saturated or dead."""
    return [*weights[:-3], weights[-3] - 100, *weights[-2:]]


# Acting reads the value of torque i from column `columns[i]`.
_REVERSED: Map = lambda q: q[:, ::-1]  # noqa: E731
ACTING: dict[str, dict[str, Acting]] = {
    "other-gravity": {
        "ten": Acting(gravity=10.0),
        "five": Acting(gravity=5.0),
        "three": Acting(gravity=3.0),
        "one": Acting(gravity=1.0),
    },
    "torque-map": {
        "reversed": Acting(q_values=_REVERSED),
        "shifted": Acting(q_values=lambda q: np.roll(q, 20, axis=1)),
        "scaled": Acting(q_values=lambda q: q[:, 20 + (np.arange(41) - 20) // 4]),
        "permuted": Acting(q_values=lambda q: q[:, _spread_indices(q.shape[1])]),
    },
    "observation-map": {
        "speed-sign": Acting(_turn(1, 1, -1)),
        "order": Acting(_order(1, 0, 2)),
        "degrees": Acting(_angle_in_degrees),
        "angle-sign": Acting(_turn(1, -1, 1)),
        "upside-down": Acting(_turn(-1, 1, 1)),
        "last-first": Acting(_order(2, 0, 1)),
    },
    "broken-network": {
        "saturated": Acting(weights=_saturate),
        "constant": Acting(q_values=np.zeros_like),
        "diverged": Acting(q_values=lambda q: 1e9 * np.sin(50 * q)),
        "not-finite": Acting(q_values=lambda q: np.where(np.arange(41) == 5, np.nan, q)),
        "bias": Acting(q_values=lambda q: np.repeat(q.mean(axis=1, keepdims=True), 41, axis=1)),
    },
}


def exists(fault: str, variant: str, gravity: float) -> bool:
    """Returns whether the variant is a fault at the gravity of the training."""
    if fault == "other-gravity":
        return variant in (("ten", "five") if gravity == 1 else ("one", "three"))
    if gravity == 1:
        return variant not in ("seven", "longer")
    return fault in ("too-few-updates", "untrained-outputs", *ACTING) or (
        (fault, variant)
        in {
            ("reward-sign", "negated"),
            ("no-bootstrapping", "terminal"),
            ("no-bootstrapping", "no-discount"),
            ("misaligned-transitions", "same-observation"),
            ("misaligned-transitions", "action-before"),
            ("other-discount", "seven"),
            ("forgetting", "longer"),
            ("learning-rate", "large"),
            ("narrow-starts", "upright"),
        }
    )
