"""A DQN in one file, to read, to change and to break: `python my_dqn.py` trains and tests it.

It needs NumPy, Gymnasium, TensorFlow and Keras. Where keras_pendulum is installed, the last lines
compare the result with the exact solution of the task. docs/exercises.md explains the numbers [1]
to [20]. Shapes: B transitions of a batch, D numbers of an observation, A actions.
"""

import time

import gymnasium
import keras
import numpy as np
import tensorflow as tf

try:
    import keras_pendulum as kp
except ImportError:  # then nothing tests the result
    kp = None

ENVIRONMENT = "Pendulum-v1"  # [1] or "CartPole-v1"
PENDULUM = ENVIRONMENT == "Pendulum-v1"
ACTIONS = np.linspace(-2, 2, 11) if PENDULUM else np.arange(2)  # [2] N·m, or left and right
SIZES = (1, 1, 8) if PENDULUM else (2.4, 2, 0.2, 2)  # [3] of the numbers of an observation
REWARD_SCALE = 0.02  # [4]
DISCOUNT = 0.985 if PENDULUM else 0.98  # γ
STEPS = 40_000  # of the environment
FIRST_UPDATE = 1_000  # step
UPDATE_EVERY = 2  # steps
BATCH = 128  # transitions
CAPACITY = 50_000  # [5] transitions
COPY_EVERY = 50  # updates
LEARNING_RATE = 1e-3  # [6] at the start
EPSILON = (1.0, 0.05 if PENDULUM else 0.2)  # at the start, and from the middle of the run on


def make_network(size):
    """Returns a network from observations [B, D], D = size, to the values of all actions [B, A]."""
    return keras.Sequential(
        [
            keras.Input((size,)),
            keras.layers.Rescaling([1 / each for each in SIZES]),
            keras.layers.Dense(64, activation="relu"),
            keras.layers.Dense(64, activation="relu"),
            keras.layers.Dense(len(ACTIONS)),  # [7]
        ]
    )


class ReplayBuffer:
    """The last transitions (s, a, r, s′, ended), in arrays that are filled in a circle."""

    def __init__(self, size):
        self.s, self.next_s = np.zeros((2, CAPACITY, size), np.float32)
        self.r, self.ended = np.zeros((2, CAPACITY), np.float32)
        self.a = np.zeros(CAPACITY, np.int32)
        self.count = 0

    def store(self, s, a, r, next_s, ended):
        """Stores a transition in the place of the oldest one."""
        i = self.count % CAPACITY
        self.s[i], self.a[i], self.r[i], self.next_s[i], self.ended[i] = s, a, r, next_s, ended
        self.count += 1

    def draw(self, random):
        """Returns a random batch: s [B, D], a [B], r [B], s′ [B, D], ended [B]."""
        return self.take(random.integers(min(self.count, CAPACITY), size=BATCH))  # [8]

    def all(self):
        """Returns all stored transitions, the oldest first."""
        return self.take(np.arange(max(0, self.count - CAPACITY), self.count) % CAPACITY)

    def take(self, i):
        """Returns the transitions at the places i [B]."""
        return self.s[i], self.a[i], self.r[i], self.next_s[i], self.ended[i]


def make_update(online, target, optimizer):
    """Returns a compiled function that changes the weights of `online` by one batch."""

    @tf.function
    def update(s, a, r, next_s, ended):
        next_value = tf.reduce_max(target(next_s), axis=1)  # [9] [B]
        goal = r + DISCOUNT * (1 - ended) * next_value  # [10] [B]
        with tf.GradientTape() as tape:
            value = tf.gather(online(s), a, batch_dims=1)  # [11] [B]
            loss = tf.reduce_mean((goal - value) ** 2)  # [12]
        gradients = tape.gradient(loss, online.trainable_variables)
        optimizer.apply(gradients, online.trainable_variables)

    return update


def train(steps=STEPS, seed=0):
    """Trains; returns the network, the replay buffer and the environment."""
    keras.utils.set_random_seed(seed)
    random = np.random.default_rng(seed)
    env = gymnasium.make(ENVIRONMENT)
    env = kp.Recorder(env) if kp else env  # [13]
    online, target = make_network(len(SIZES)), make_network(len(SIZES))
    target.set_weights(online.get_weights())
    greedy = tf.function(lambda s: tf.argmax(online(s[None])[0]))  # [14]
    optimizer = keras.optimizers.Adam(LEARNING_RATE)
    update = make_update(online, target, optimizer)
    buffer = ReplayBuffer(len(SIZES))
    returns, updates, over = [], 0, True
    for step in range(steps):
        if over:
            s, _ = env.reset(seed=None if returns else seed)  # [15]
            returns.append(0.0)
            done = step / steps  # share of the run
            epsilon = np.interp(done, (0, 0.5), EPSILON)  # [16]
            optimizer.learning_rate = LEARNING_RATE * (1 - done)
        a = random.integers(len(ACTIONS)) if random.random() < epsilon else int(greedy(s))  # [17]
        next_s, r, terminated, truncated, _ = env.step([ACTIONS[a]] if PENDULUM else a)
        buffer.store(s, a, REWARD_SCALE * r, next_s, terminated)  # [18]
        s = next_s  # [19]
        returns[-1] += r
        over = terminated or truncated
        if step >= FIRST_UPDATE and step % UPDATE_EVERY == 0:
            update(*buffer.draw(random))
            updates += 1
            if updates % COPY_EVERY == 0:
                target.set_weights(online.get_weights())  # [20]
        if (step + 1) % (steps // 10) == 0:
            mean = np.mean(returns[-11:-1] or returns)  # of 10 whole episodes, if there are any
            print(f"step {step + 1}: mean return {mean:.0f}, epsilon {epsilon:.2f}", flush=True)
    return online, buffer, env


if __name__ == "__main__":
    began = time.perf_counter()
    network, buffer, env = train()
    print(f"Trained in {time.perf_counter() - began:.0f} s")
    if kp:
        task = {"environment": ENVIRONMENT, "discount": DISCOUNT}
        task |= {"gravity": 10.0, "torques": ACTIONS} if PENDULUM else {}
        print(kp.evaluate_policy(network, **task).summary())
        given = {"record": env, "transitions": buffer.all(), "reward_scale": REWARD_SCALE}
        print(kp.diagnose(network, **given, **task).summary())
