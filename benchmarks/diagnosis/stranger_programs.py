"""Small DQN programs as beginners write them, with one mistake each.

`train` is a complete program: Gymnasium's environment, a NumPy replay buffer and a network of
PyTorch or Keras. It shares no code with this package, so `benchmarks.diagnosis.strangers` can
measure how `diagnose` judges networks of other people. `MISTAKES` lists what can be wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Program:
    """The settings of a program, and its mistakes; the defaults are right."""

    environment: str = "Pendulum-v1"  # or "CartPole-v1"
    library: str = "torch"  # or "keras"
    gravity: float = 10.0
    torque_count: int = 9
    discount: float = 0.95
    activation: str = "relu"
    hidden: tuple[int, ...] = (64, 64)
    steps: int = 12_000
    learning_rate: float = 1e-3
    seed: int = 0

    target: str = "max"  # r + γ·this over the next values
    loss: str = "chosen"  # which outputs are compared with which targets
    head: str = "linear"  # activation of the last layer
    copy_every: int = 50  # updates between two copies to the target network; 0 is never
    soft_copy: float = 0.0  # above 0: this share of the weights is copied at each update
    through_target: bool = False  # whether the gradient passes the target
    ends_always: bool = False  # whether every transition ends its episode
    observation: Callable[[Array], Array] = lambda observation: observation  # in learning
    reward: Callable[[float], float] = lambda reward: reward
    last_reward: float = 0.0  # that of the step that ends an episode, where it is not 0
    torque: Callable[[Array], Array] = lambda torque: torque  # in learning
    stores_action_before: bool = False
    stores_greedy: bool = False  # the greedy action in place of the one that acted
    stores_next_index: bool = False
    keeps_first_state: bool = False  # as the state of the whole episode
    truncation_is_end: bool = False
    ends_never: bool = False  # whether the end of an episode is not stored
    capacity: int = 10**6  # of the replay buffer
    consecutive: bool = False  # whether a batch is the last transitions
    epsilon: Callable[[float], float] = lambda done: max(0.05, 1 - 2 * done)  # by share of the run
    episode_steps: int = 200
    start: float | None = None  # rad and rad/s: bound of the starts
    env_reward: Callable[[Any], Any] | None = None  # of a wrapper
    # The program in use, after learning:
    acting_observation: Callable[[Array], Array] = lambda observation: observation
    acting_torque: Callable[[Array], Array] = lambda torque: torque
    # What its author believes:
    declared_gravity: float | None = None
    declared_discount: float | None = None
    declared_scale: float | None = None  # of the rewards

    @property
    def is_cartpole(self) -> bool:
        """Whether the environment is CartPole."""
        return self.environment == "CartPole-v1"

    @property
    def torques(self) -> Array:
        """The torques [A] in N·m that the author believes in, or the actions of CartPole."""
        return np.arange(2) if self.is_cartpole else np.linspace(-2, 2, self.torque_count)

    @property
    def observation_size(self) -> int:
        """The numbers of an observation."""
        return 4 if self.is_cartpole else 3


@dataclass(frozen=True)
class Mistake:
    """A mistake: what it changes, and which finding and variant are right."""

    changes: dict[str, Any]
    finding: str
    variant: str = ""
    hand_in: tuple[str, ...] = ()  # beside the network: "record", "transitions"


def _turn(order: list[int], signs: list[int]) -> Callable[[Array], Array]:
    return lambda observation: observation[..., order] * np.array(signs, np.float32)


def _shown(finding: str, hand_in: str, variant: str = "", **changes: Any) -> Mistake:
    return Mistake(changes, finding, variant, tuple(hand_in.split()))


def _wrong_target(variant: str, **changes: Any) -> Mistake:
    return Mistake(changes, "wrong-target", variant)


MISTAKES: dict[str, Mistake] = {
    "mean of the next values": _wrong_target("mean-next", target="mean"),
    "minimum of the next values": _wrong_target("min-next", target="min"),
    "first of the next values": _wrong_target("fixed-action-next", target="first"),
    "last of the next values": _wrong_target("fixed-action-next", target="last"),
    "maximum over the batch": _wrong_target("batch-max", target="batch-max"),
    "index for value": _wrong_target("index-for-value", target="index"),
    "next state is the state": _wrong_target("same-state", target="same-state"),
    "target network never copied": _wrong_target("frozen-target", copy_every=0),
    "one target for all outputs": Mistake({"loss": "same-target"}, "wrong-loss", "same-target"),
    "zeros for the others": Mistake({"loss": "zero-others"}, "wrong-loss", "zero-others"),
    "(B, 1) minus (B,)": Mistake({"loss": "broadcast"}, "wrong-loss", "batch-broadcast"),
    "softmax head": Mistake({"head": "softmax"}, "bounded-output", "softmax"),
    "tanh head": Mistake({"head": "tanh"}, "bounded-output", "tanh"),
    "sigmoid head": Mistake({"head": "sigmoid"}, "bounded-output", "sigmoid"),
    "ReLU head": Mistake({"head": "relu"}, "bounded-output", "relu"),
    "no lookahead": Mistake({"target": "none"}, "no-bootstrapping"),
    "every step is an end": Mistake({"ends_always": True}, "no-bootstrapping"),
    "another discount": Mistake({"discount": 0.6, "declared_discount": 0.95}, "other-discount"),
    "another gravity": Mistake({"declared_gravity": 10.0, "gravity": 5.0}, "other-gravity"),
    "reward with the wrong sign": Mistake({"reward": lambda reward: -reward}, "reward-sign"),
    "reward times 0.01": Mistake({"reward": lambda reward: 0.01 * reward}, "reward-scale"),
    "reward times 20": Mistake({"reward": lambda reward: 20 * reward}, "reward-scale"),
    "sine before cosine in learning": Mistake(
        {"observation": _turn([1, 0, 2], [1, 1, 1])}, "observation-map"
    ),
    "speed reversed in learning": Mistake(
        {"observation": _turn([0, 1, 2], [1, 1, -1])}, "observation-map"
    ),
    "torques reversed in learning": Mistake({"torque": lambda torque: -torque}, "torque-map"),
    "sine before cosine in use": Mistake(
        {"acting_observation": _turn([1, 0, 2], [1, 1, 1])}, "observation-map"
    ),
    "torques reversed in use": Mistake({"acting_torque": lambda torque: -torque}, "torque-map"),
    # What only a record or the transitions show:
    "action of the step before": _shown(
        "misaligned-transitions", "transitions", stores_action_before=True
    ),
    "no random actions": _shown("exploration", "record", epsilon=lambda done: 0.02),
    "random actions only": _shown("exploration", "record", epsilon=lambda done: 1.0),
    "random actions at the end": _shown("exploration", "record", epsilon=lambda done: done),
    "rewards clipped to -1": _shown("other-reward", "record", env_reward=lambda r: max(r, -1.0)),
    "truncation stored as an end": _shown(
        *("no-bootstrapping", "transitions", "truncation"), truncation_is_end=True, episode_steps=25
    ),
    "buffer of 300 steps": _shown("forgetting", "record transitions", capacity=300),
    "greedy index stored": _shown(
        "misaligned-transitions", "transitions", "greedy-stored", stores_greedy=True
    ),
    "no replay": _shown("forgetting", "transitions", "no-replay", capacity=64, consecutive=True),
    "starts near the top": _shown("narrow-starts", "record", start=0.3, episode_steps=20),
    "state never updated": _shown(
        "misaligned-transitions", "transitions", "same-state", keeps_first_state=True
    ),
    "index of the next torque stored": _shown("torque-map", "transitions", stores_next_index=True),
    "a constant added to the rewards": Mistake(
        {"reward": lambda reward: (reward + 8.1) / 8.1}, "reward-scale"
    ),
    "next value of the action before": _wrong_target("same-action-next", target="same-action"),
    "next values subtracted": _wrong_target("negative-next", target="negative"),
    "target network never copied, rewards times 0.02": _wrong_target(
        "frozen-target", copy_every=0, reward=lambda reward: 0.02 * reward, declared_scale=0.02
    ),
}

# What differs between two right programs.
RIGHT: dict[str, dict[str, Any]] = {
    "right": {},
    "gradient through the target": {"through_target": True},
    "a third of the training": {"steps": 4_000},
    "a tenth of the training": {"steps": 1_200},
}


def make_program(changes: dict[str, Any], seed: int) -> Program:
    """Returns a program of a seed: the seed chooses library, task and network."""
    random = np.random.RandomState(seed)
    program = Program(
        library=("torch", "torch", "keras")[random.randint(3)],
        gravity=(1.0, 10.0, 10.0)[random.randint(3)],
        torque_count=(3, 5, 9, 11, 21, 41)[random.randint(6)],
        discount=(0.9, 0.95, 0.98)[random.randint(3)],
        activation=("relu", "tanh")[random.randint(2)],
        seed=seed,
    )
    if changes.get("environment") == "CartPole-v1":
        discount = (0.95, 0.98, 0.99)[random.randint(3)]
        program = replace(
            program, torque_count=2, discount=discount, steps=15_000, episode_steps=500
        )
    return replace(program, **changes)


class Network(Protocol):
    """A network of PyTorch or Keras, with its target network and optimizer."""

    def q_values(self, observations: Array) -> Array:
        """Returns the values [B, A] of observations [B, 3]."""

    def update(self, batch: tuple[Array, ...]) -> None:
        """Makes a step of Adam on a batch (s, a, r, s', end)."""

    def copy(self) -> None:
        """Copies the weights to the target network."""


@dataclass
class Trained:
    """A trained program: what a user hands in."""

    program: Program
    weights: list[Array]  # kernel [in, out] and bias of each layer
    steps: dict[str, Array] = field(default_factory=dict)  # its replay buffer, in order

    def q_values(self, observations: Array) -> Array:
        """Returns the values [B, A] of the program in use."""
        program = self.program
        features = program.acting_observation(np.asarray(observations, np.float32))
        hidden = np.tanh if program.activation == "tanh" else lambda x: np.maximum(x, 0)
        for kernel, bias in zip(self.weights[:-2:2], self.weights[1:-2:2], strict=True):
            features = hidden(features @ kernel + bias)
        q = features @ self.weights[-2] + self.weights[-1]
        if program.head == "softmax":
            q = np.exp(q - q.max(axis=1, keepdims=True))
            q = q / q.sum(axis=1, keepdims=True)
        heads: dict[str, Callable[[Array], Array]] = {
            "tanh": np.tanh,
            "sigmoid": lambda x: 1 / (1 + np.exp(-x)),
            "relu": lambda x: np.maximum(x, 0),
        }
        if program.head in heads:
            q = heads[program.head](q)
        order = np.argsort(np.argsort(program.acting_torque(program.torques)))
        return np.asarray(q[:, order])


def train(program: Program, wrap: Callable[[Any], Any] = lambda env: env) -> Trained:
    """Trains; returns the weights and the replay buffer. `wrap` wraps the environment."""
    random = np.random.RandomState(program.seed)
    physics: dict[str, Any] = {} if program.is_cartpole else {"g": program.gravity}
    env: Any = gymnasium.make(program.environment, **physics)
    if program.env_reward is not None:
        env = gymnasium.wrappers.TransformReward(env, program.env_reward)
    env = wrap(env)
    options = {} if program.start is None else {"x_init": program.start, "y_init": program.start}
    network = _network(program)
    torques = program.torque(program.torques)
    observed = (program.observation_size,)
    arrays = [np.zeros((program.steps, *shape), kind) for shape, kind in _columns(observed)]
    observation = None
    acted = began = 0
    for step in range(program.steps):
        if observation is None:
            observation, _ = env.reset(seed=program.seed if step == 0 else None, options=options)
            began = step
        seen = program.observation(observation)
        greedy = int(network.q_values(seen[None])[0].argmax())
        explores = random.random_sample() < program.epsilon(step / program.steps)
        acted_before = acted
        acted = random.randint(len(torques)) if explores else greedy
        action = int(torques[acted]) if program.is_cartpole else [torques[acted]]
        following, reward, terminated, truncated, _ = env.step(action)
        truncated = truncated or step + 1 == began + program.episode_steps
        stored = acted_before if program.stores_action_before else acted
        stored = greedy if program.stores_greedy else stored
        stored = (stored + program.stores_next_index) % len(torques)
        gained = program.reward(float(reward))
        gained = program.last_reward if terminated and program.last_reward else gained
        following_seen = program.observation(following)
        ended = terminated and not program.ends_never
        ended = ended or program.ends_always or (program.truncation_is_end and truncated)
        row = (seen, stored, gained, following_seen, ended, truncated)
        for array, value in zip(arrays, row, strict=True):
            array[step] = value
        following = observation if program.keeps_first_state else following
        observation = None if terminated or truncated else following
        if step >= 200:
            oldest = max(0, step + 1 - program.capacity)
            rows = oldest + random.randint(step + 1 - oldest, size=64)
            if program.consecutive:
                rows = np.arange(step - 63, step + 1)
            network.update(tuple(array[rows] for array in arrays[:5]))
            if program.copy_every and step % program.copy_every == 0:
                network.copy()
    env.close()
    names = ("observation", "action", "reward", "next_observation", "terminated", "truncated")
    kept = [array[-program.capacity :] for array in arrays]
    return Trained(program, network.weights(), dict(zip(names, kept, strict=True)))


def _columns(observed: tuple[int, ...]) -> list[tuple[tuple[int, ...], Any]]:
    """Returns shape and type of each column of the replay buffer."""
    observation, number = (observed, np.float32), ((), np.float32)
    return [observation, ((), np.int64), number, observation, number, ((), np.bool_)]


def _network(program: Program) -> Any:
    if program.library == "torch":
        from benchmarks.diagnosis.stranger_torch import TorchNetwork

        return TorchNetwork(program)
    from benchmarks.diagnosis.stranger_keras import KerasNetwork

    return KerasNetwork(program)
