"""The CartPole programs of `benchmarks.diagnosis.strangers`, with one mistake each."""

from __future__ import annotations

from typing import Any

from benchmarks.diagnosis.stranger_programs import Mistake

_CARTPOLE: dict[str, Any] = {"environment": "CartPole-v1"}
_TUTORIAL: dict[str, Any] = {
    "library": "torch",
    "activation": "relu",
    "hidden": (128, 128),
    "discount": 0.99,
    "learning_rate": 3e-4,
    "copy_every": 0,
    "soft_copy": 0.005,
}


def _mistake(finding: str, variant: str = "", hand_in: str = "", **changes: Any) -> Mistake:
    return Mistake(_CARTPOLE | changes, finding, variant, tuple(hand_in.split()))


def _exchange(action: Any) -> Any:
    return 1 - action


def _angle_first(observation: Any) -> Any:
    return observation[..., [2, 3, 0, 1]]


_MISTAKES = {
    "mean of the next values": _mistake("wrong-target", "mean-next", target="mean"),
    "minimum of the next values": _mistake("wrong-target", "min-next", target="min"),
    "maximum over the batch": _mistake("wrong-target", "batch-max", target="batch-max"),
    "index for value": _mistake("wrong-target", "index-for-value", target="index"),
    "target network never copied": _mistake("wrong-target", "frozen-target", copy_every=0),
    "one target for all outputs": _mistake("wrong-loss", "same-target", loss="same-target"),
    "zeros for the others": _mistake("wrong-loss", "zero-others", loss="zero-others"),
    "(B, 1) minus (B,)": _mistake("wrong-loss", "batch-broadcast", loss="broadcast"),
    "softmax head": _mistake("bounded-output", "softmax", head="softmax"),
    "tanh head": _mistake("bounded-output", "tanh", head="tanh"),
    "sigmoid head": _mistake("bounded-output", "sigmoid", head="sigmoid"),
    "no lookahead": _mistake("no-bootstrapping", target="none"),
    "another discount": _mistake("other-discount", discount=0.8, declared_discount=0.99),
    "reward with the wrong sign": _mistake("reward-sign", reward=lambda reward: -reward),
    "reward times 0.01": _mistake("reward-scale", reward=lambda reward: 0.01 * reward),
    "end not stored": _mistake("missing-end", ends_never=True),
    "left and right exchanged in learning": _mistake("torque-map", torque=_exchange),
    "left and right exchanged in use": _mistake("torque-map", acting_torque=_exchange),
    "angle first in use": _mistake("observation-map", acting_observation=_angle_first),
    # What only a record or the transitions show:
    "truncation stored as an end": _mistake(
        "truncation-as-end", hand_in="transitions", truncation_is_end=True, episode_steps=30
    ),
    "action of the step before": _mistake(
        "misaligned-transitions", hand_in="transitions", stores_action_before=True
    ),
    "greedy index stored": _mistake(
        "misaligned-transitions", "greedy-stored", hand_in="transitions", stores_greedy=True
    ),
    "random actions only": _mistake("exploration", hand_in="record", epsilon=lambda done: 1.0),
    "buffer of 100 steps": _mistake("forgetting", hand_in="record transitions", capacity=100),
    "the tutorial's, minimum of the next values": _mistake(
        "wrong-target", "min-next", target="min", **_TUTORIAL
    ),
    "the tutorial's, no lookahead": _mistake("no-bootstrapping", target="none", **_TUTORIAL),
    "the tutorial's, end not stored": _mistake("missing-end", ends_never=True, **_TUTORIAL),
    "next value of the action before": _mistake(
        "wrong-target", "same-action-next", target="same-action"
    ),
    "next values subtracted": _mistake("wrong-target", "negative-next", target="negative"),
}
_RIGHT: dict[str, dict[str, Any]] = {
    "right": {},
    "the tutorial's program": _TUTORIAL,
    "penalty for the fall": {"last_reward": -10.0},
    "a third of the training": {"steps": 5_000},
    "a tenth of the training": {"steps": 1_500},
}
CARTPOLE_MISTAKES = {f"CartPole: {name}": mistake for name, mistake in _MISTAKES.items()}
CARTPOLE_RIGHT = {f"CartPole: {name}": _CARTPOLE | changes for name, changes in _RIGHT.items()}
