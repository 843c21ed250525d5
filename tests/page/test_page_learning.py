"""The learning of the page: its arithmetic compared with the package's own."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import keras
import numpy as np
import pytest
import tensorflow as tf
from browser import Player
from page_fixtures import large_screen

import keras_pendulum as kp
from keras_pendulum.config.config import Config
from keras_pendulum.dqn import exploration
from keras_pendulum.dqn.network import DQN
from keras_pendulum.dqn.replay_buffer import Transitions
from keras_pendulum.environments.actions import truncated_index
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.environments.tasks import make_task
from keras_pendulum.page.learning import OWN_SETTINGS, SWITCHES, learning_config
from keras_pendulum.train.run import make_optimizer, make_run

if TYPE_CHECKING:
    from selenium import webdriver

UPDATES = 20
HEALTHY = learning_config(Pendulum(1.0))
# Every switch, and every value of a setting that changes the update.
CASES: dict[str, tuple[Config, dict[str, Any]]] = {
    "healthy": (HEALTHY, {}),
    "swingup": (learning_config(Pendulum(10.0)), {}),
    "cartpole": (learning_config(make_task("CartPole-v1", {})), {}),
    "hard": (HEALTHY.change(target_update="hard", target_period=7, double_q=True), {}),
    "relu": (HEALTHY.change(activation="relu", hidden_units=(17, 9, 6), batch_size=31), {}),
    "huber": (HEALTHY.change(loss="huber", gradient_clip=1e-3, double_q=True), {}),
    "one layer": (HEALTHY.change(hidden_units=(21,), optimizer="adamw", weight_decay=0.1), {}),
    "average": (HEALTHY.change(average_updates=3, episodes=42), {}),
}
for name, switch in SWITCHES.items():
    own = {key: value for key, value in switch.changes.items() if key in OWN_SETTINGS}
    others = {key: value for key, value in switch.changes.items() if key not in own}
    CASES[name] = HEALTHY.change(**others), own

UPDATE = """
const [settings, sizes, weights, batches] = arguments;
const network = new LearningNetwork(sizes, settings.activation);
network.weights.set(weights);
const learner = new Learner(network, settings);
const rows = settings.batch_size;
const losses = batches.map((batch) => {
  const { observations, actions, rewards, nextObservations, ended } = batch;
  const replay = new ReplayBuffer(rows, rows, sizes[0]);
  for (let i = 0; i < rows; i++) {
    replay.add(observations[i], actions[i], rewards[i], nextObservations[i], ended[i]);
  }
  replay.sample(new Random(1));
  return learner.update(replay.batch);
});
learner.optimizer.averageWeights(network.weights);
return [losses, Array.from(network.weights), Array.from(learner.target.weights)];
"""


def flat(network: DQN) -> list[float]:
    return np.concatenate([array.ravel() for array in network.get_weights()]).tolist()


def rule_of(bootstrap: str, rule: Any) -> Any:
    """Returns the rule of the TD targets [B]: that of the package, or one with a fault."""

    def mean(online: DQN, target: DQN, batch: Transitions, discount: float) -> tf.Tensor:
        future = tf.reduce_mean(target(batch.next_observation), axis=1)  # [B]
        bootstrap = tf.where(batch.terminated, 0.0, discount * future)
        return tf.stop_gradient(batch.reward + bootstrap)

    def none(online: DQN, target: DQN, batch: Transitions, discount: float) -> tf.Tensor:
        return batch.reward

    return {"maximum": rule, "mean": mean, "none": none}[bootstrap]


def draw_batches(run: Any, scale: float) -> Transitions:
    """Returns random batches [K, B, ...] with rewards as large as a run's."""
    random, config = np.random.RandomState(3), run.config
    shape = (UPDATES, config.batch_size)
    size = run.agent.online.observation_size
    observation = random.uniform(-1, 1, (*shape, size)).astype(np.float32)
    return Transitions(
        observation,
        random.randint(0, run.agent.online.action_count, shape).astype(np.int32),
        (-scale * random.uniform(0, 10, shape)).astype(np.float32),
        (observation + random.normal(0, 0.1, observation.shape)).astype(np.float32),
        random.random_sample(shape) < 0.1,
    )


@pytest.fixture(scope="module")
def user(pages: dict[str, str], chromium: webdriver.Chrome) -> Iterator[Player]:
    """One paused page for all tests of this file, which change nothing on it."""
    with large_screen(chromium) as player:
        player.open_paused(pages["small"])
        yield player


@pytest.mark.parametrize("case", CASES)
def test_update_is_that_of_the_package(case: str, user: Player) -> None:
    config, own = CASES[case]
    own = OWN_SETTINGS | own
    run = make_run(config)
    agent = run.agent
    agent.target_rule = rule_of(own["bootstrap"], agent.target_rule)
    batches = draw_batches(run, config.reward_scale * own["reward_factor"])
    sizes = [agent.online.observation_size, *config.hidden_units, agent.online.action_count]
    before = flat(agent.online)
    names = ("observations", "actions", "rewards", "nextObservations", "ended")
    rows = [
        {name: array[k].tolist() for name, array in zip(names, batches, strict=True)}
        for k in range(UPDATES)
    ]
    steps = (Transitions(*(tf.constant(array[k]) for array in batches)) for k in range(UPDATES))
    losses = [float(agent.gradient_step(batch)) for batch in steps]
    agent.average_weights()
    found, weights, target = user.run(UPDATE, vars(config) | own, sizes, before, rows)
    np.testing.assert_allclose(found, losses, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(weights, flat(agent.online), rtol=0, atol=1e-4)
    np.testing.assert_allclose(target, flat(agent.target), rtol=0, atol=1e-4)
    assert not np.allclose(weights, before, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", ["adam", "adamw"])
def test_optimizer_is_that_of_keras_after_any_gradients(name: str, user: Player) -> None:
    changes = {"weight_decay": 0.05} if name == "adamw" else {}
    config = HEALTHY.change(
        optimizer=name, learning_rate=0.5, gradient_clip=3.0, average_updates=9, **changes
    )
    random = np.random.RandomState(0)
    sizes = np.array([5, 1, 0.1, 0.01])  # the gradients shrink, so that AMSGrad's maximum counts
    gradients = (sizes[:, np.newaxis] * random.normal(size=(4, 6))).astype(np.float32)
    optimizer: Any = make_optimizer(config)
    weights = keras.Variable(np.linspace(-1, 1, 6, dtype=np.float32))
    optimizer.build([weights])
    for gradient in gradients:
        optimizer.apply_gradients([(tf.constant(gradient), weights)])
    found, average = user.run(
        "const [settings, gradients] = arguments;"
        "const weights = Float64Array.from({length: 6}, (_, i) => 0.4 * i - 1);"
        "const optimizer = new Optimizer(settings, 6);"
        "for (const each of gradients) optimizer.apply(weights, each);"
        "return [Array.from(weights), Array.from(optimizer.average)]",
        vars(config),
        gradients.tolist(),
    )
    np.testing.assert_allclose(found, weights.numpy(), rtol=0, atol=1e-4)
    (expected,) = optimizer._model_variables_moving_average
    np.testing.assert_allclose(average, expected.numpy(), rtol=0, atol=1e-4)


def test_schedules_are_those_of_the_package(user: Player) -> None:
    cosine = HEALTHY.change(learning_rate_min=1e-4)
    optimizer: Any = make_optimizer(cosine)
    updates = [0, 1, 100, 9180, 18359, 18360, 20000]
    script = (
        "return arguments[1].map(n => learningRate(arguments[0], n, totalUpdates(arguments[0])))"
    )
    rates = [float(optimizer._learning_rate(keras.ops.convert_to_tensor(n))) for n in updates]
    np.testing.assert_allclose(user.run(script, vars(cosine), updates), rates, rtol=1e-5)
    steps = HEALTHY.change(epsilon_schedule="steps", epsilon_min=0.05)
    for config, epsilon in (
        (HEALTHY, partial(exploration.epsilon_by_episodes, 0.9, 0.99, 0.01)),
        (steps, partial(exploration.epsilon_by_steps, 0.9, 1000.0, 0.05)),
    ):
        found = user.run(
            "const s = arguments[0];"
            "return arguments[1].map(n => EPSILON_SCHEDULES[s.epsilon_schedule](s, n, 100 * n))",
            vars(config),
            [0, 1, 50, 499],
        )
        assert found == pytest.approx([epsilon(n, 100 * n) for n in (0, 1, 50, 499)], rel=1e-12)


def test_truncated_indices_are_those_of_the_walkthrough(user: Player) -> None:
    found = user.run("return Array.from({length: 41}, (_, i) => STORED_INDICES.truncated(i))")
    assert found == [truncated_index(k / 10 - 2) for k in range(41)] != list(range(41))


@pytest.mark.parametrize("rule", ["glorot", "fan-in", "spread"])
def test_initial_weights_have_the_limits_of_the_package(rule: str, user: Player) -> None:
    network = kp.DQN((64, 64), initial_weights=rule, seed=1)
    numbers = user.run(
        "const network = new LearningNetwork([3, 64, 64, 41], 'tanh');"
        "network.initialize(arguments[0], new Random(1)); return Array.from(network.weights)",
        rule,
    )
    arrays = network.get_weights()
    parts = np.split(np.array(numbers), np.cumsum([array.size for array in arrays])[:-1])
    for part, array in zip(parts, arrays, strict=True):
        assert np.abs(part).max() == pytest.approx(np.abs(array).max(), rel=0.1, abs=1e-9)
        assert part.std() == pytest.approx(array.std(), rel=0.25, abs=1e-9)


def test_random_source_is_even_and_repeats(user: Player) -> None:
    numbers, again, other = user.run(
        "const draw = (seed, stream) => { const random = new Random(seed, stream);"
        "  return Array.from({length: 4000}, () => random.next()); };"
        "return [draw(5, 0), draw(5, 0), draw(5, 1)]"
    )
    assert numbers == again != other
    counts, _ = np.histogram(numbers, 20, (0, 1))
    assert counts.sum() == 4000 and 140 < counts.min() <= counts.max() < 260
    assert abs(np.corrcoef(numbers[1:], numbers[:-1])[0, 1]) < 0.05
    assert abs(np.corrcoef(numbers, other)[0, 1]) < 0.05
    places = user.run(
        "const places = new Uint32Array(32); new Random(1).draw(places, 40); return [...places]"
    )
    assert len(set(places)) == 32 and max(places) < 40
