"""Would a study be cheaper if one process trained several seeds of an arm at once?

    python -m benchmarks.seeds_together

The weights of S networks are stacked, so that one compiled program makes an update of each, and one
call chooses an action for each. Beside it S separate agents, as the processes of a study have them.
The update is the package's own `Agent`, with the preset `reference`: only the network differs, and
what it learns is compared. Medians, the two sides in turns, on one thread, as in a study's workers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from keras_pendulum.backend import keep_to_one_thread

keep_to_one_thread()

import keras  # noqa: E402
import numpy as np  # noqa: E402
import tensorflow as tf  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

import keras_pendulum as kp  # noqa: E402
from benchmarks.inner_loops import seconds  # noqa: E402
from benchmarks.report import Row, median, write  # noqa: E402
from keras_pendulum.agent import Agent  # noqa: E402
from keras_pendulum.config import Config  # noqa: E402
from keras_pendulum.policy import GreedyPolicy  # noqa: E402
from keras_pendulum.q_learning import mean_squared_error  # noqa: E402
from keras_pendulum.randomness import RandomSource  # noqa: E402
from keras_pendulum.replay import Transitions  # noqa: E402
from keras_pendulum.run import make_agent, make_optimizer  # noqa: E402
from keras_pendulum.target_network import make_target  # noqa: E402

SEEDS = (2, 4, 8)
UPDATES = 30  # in one call, as after an episode
STEPS = 2000
ROUNDS = 25

Array = NDArray[np.float32]


class StackedDQN(keras.Model):
    """S networks of one shape: observations [S·B, D] to Q-values [S·B, A], B rows to each.

    Args:
        weights: kernels [S, inputs, units] and biases [S, 1, units] in turn.
    """

    def __init__(self, weights: Sequence[Array]) -> None:
        super().__init__()
        for values in weights:
            initial = keras.initializers.Constant(values)
            self.add_weight(shape=values.shape, initializer=initial)
        self.networks = len(weights[0])
        self.activation = "tanh"  # the agent asks for it, to act by itself
        self.built = True

    def call(self, observation: Any) -> Any:
        """Q-values of each network for its own rows."""
        features = tf.reshape(observation, [self.networks, -1, observation.shape[-1]])
        *hidden, (kernel, bias) = zip(self.weights[::2], self.weights[1::2], strict=True)
        for weights, biases in hidden:
            features = tf.tanh(tf.matmul(features, weights) + biases)
        q = tf.matmul(features, kernel) + bias
        return tf.reshape(q, [-1, q.shape[-1]])

    def twin(self) -> StackedDQN:
        """A second one with the same weights."""
        return StackedDQN([weight.numpy() for weight in self.weights])


def stacked(agents: Sequence[Agent]) -> list[Array]:
    """The weights of all agents' networks, one array for each variable."""
    variables = zip(*(agent.online.get_weights() for agent in agents), strict=True)
    stacks = [np.stack(values) for values in variables]
    return [stack if stack.ndim == 3 else stack[:, np.newaxis] for stack in stacks]


def stacked_agent(agents: Sequence[Agent], config: Config) -> Agent:
    """One agent that learns what `agents` learn, from their batches side by side."""
    online: Any = StackedDQN(stacked(agents))
    target, update_target = make_target(online, config)

    def loss(q: tf.Tensor, action: tf.Tensor, wanted: tf.Tensor) -> tf.Tensor:
        # The mean goes over the rows of all networks, and each is to learn from its own.
        return len(agents) * mean_squared_error(q, action, wanted)

    optimizer, random = make_optimizer(config), RandomSource(0)
    return Agent(online, target, update_target, optimizer, loss, config.discount, False, random)


def batches(config: Config, seed: int) -> Transitions:
    """UPDATES random batches."""
    random = np.random.default_rng(seed)
    shape = (UPDATES, config.batch_size)
    return Transitions(
        observation=random.normal(size=(*shape, 3)).astype(np.float32),
        action=random.integers(config.torque_count, size=shape, dtype=np.int32),
        reward=random.normal(size=shape).astype(np.float32),
        next_observation=random.normal(size=(*shape, 3)).astype(np.float32),
        terminated=np.zeros(shape, bool),
    )


def stacked_actions(weights: Sequence[Array], observations: Array) -> NDArray[np.intp]:
    """The greedy action [S] of each network for its own observation [S, D]."""
    features = observations[:, np.newaxis]  # [S, 1, D]
    *hidden, (kernel, bias) = zip(weights[::2], weights[1::2], strict=True)
    for matrix, biases in hidden:
        features = np.matmul(features, matrix)
        features += biases
        np.tanh(features, out=features)
    q = np.matmul(features, kernel)
    q += bias
    return q[:, 0].argmax(axis=1)


def measured(count: int) -> Row:
    """A row for so many seeds."""
    config = kp.preset("reference")
    agents = [
        make_agent(kp.preset("reference", seed=seed), RandomSource(0)) for seed in range(count)
    ]
    together = stacked_agent(agents, config)
    each = [batches(config, seed) for seed in range(count)]
    joined = Transitions(*(np.concatenate(field, axis=1) for field in zip(*each, strict=True)))

    def apart() -> None:
        for agent, own in zip(agents, each, strict=True):
            agent.update(own)

    sides: list[Callable[[], object]] = [apart, lambda: together.update(joined)]
    for side in sides:
        side()  # compiles
    difference = max(
        float(np.abs(ours - theirs.numpy()).max())
        for ours, theirs in zip(stacked(agents), together.online.weights, strict=True)
    )
    learning = [[seconds(side) for side in sides] for _ in range(ROUNDS)]

    observations = np.random.default_rng(0).normal(size=(count, 3)).astype(np.float32)
    policies = [GreedyPolicy(agent.online) for agent in agents]
    weights = stacked(agents)
    pairs = list(zip(policies, observations, strict=True))

    def act_apart() -> None:
        for _ in range(STEPS):
            for policy, observation in pairs:
                policy.action(observation)

    def act_together() -> None:
        for _ in range(STEPS):
            stacked_actions(weights, observations)

    acting = [[seconds(side) for side in (act_apart, act_together)] for _ in range(ROUNDS)]
    row: Row = {"seeds": count}
    for work, times, unit, parts in (
        ("update", learning, "ms", 1e3 / UPDATES),
        ("action", acting, "µs", 1e6 / STEPS),
    ):
        alone, joint = (median(column, 9) * parts / count for column in zip(*times, strict=True))
        row |= {
            f"{work} apart ({unit} a seed)": round(alone, 3),
            f"{work} together ({unit} a seed)": round(joint, 3),
            f"{work}: times as fast": round(alone / joint, 2),
        }
    return row | {"largest difference of a weight": f"{difference:.0e}"}


def main() -> None:
    """Measures and writes the table."""
    rows = [measured(count) for count in SEEDS]
    write("seeds_together", "python -m benchmarks.seeds_together", rows)


if __name__ == "__main__":
    main()
