"""The table of the exercises: each is a program with one fault, made from examples/my_dqn.py.

An exercise replaces a few lines of that program. An exercise is added here, and nowhere else.
"""

from __future__ import annotations

from typing import NamedTuple

PENDULUM, CARTPOLE = "Pendulum-v1", "CartPole-v1"


class Exercise(NamedTuple):
    """A fault of the program, and what a student and a teacher read about it."""

    environment: str
    symptom: str  # what a run shows
    changes: tuple[tuple[str, str], ...]  # parts of the program, and what is there instead
    finding: str  # the name that `diagnose` should give it first
    question: str  # the first hint
    place: str  # the numbers in the program's comments where the fault is
    solution: str  # the third hint


_NEXT = "tf.reduce_max(target(next_s), axis=1)"
_VALUE = "tf.gather(online(s), a, batch_dims=1)"
_LOSS = "(goal - value) ** 2"
_HEAD = "Dense(len(ACTIONS))"
_ACT = "a = random.integers(len(ACTIONS)) if random.random() < epsilon else int(greedy(s))"
_STEP = "env.step([ACTIONS[a]] if PENDULUM else a)"
_STORE = "buffer.store(s, a, REWARD_SCALE * r, next_s, terminated)"
_MOVE = "s = next_s  # [19]"


def _replace(text: str, old: str, new: str) -> tuple[str, str]:
    """Returns the change of a part of the program: `text`, with `new` in place of `old`."""
    return text, text.replace(old, new)


EXERCISES: dict[int, Exercise] = {
    1: Exercise(
        PENDULUM,
        "The return stays where it was at the start. The network gives the same values at every "
        "state.",
        ((_VALUE, f"{_VALUE}[:, None]"),),
        "wrong-loss",
        "What are the shapes of `goal`, of `value`, and of their difference?",
        "[11]",
        "`value` has the shape [B, 1] and `goal` has [B], so their difference has [B, B]. Remove "
        "the last index.",
    ),
    2: Exercise(
        PENDULUM,
        "The agent learns to do the opposite: it spins as fast as it can.",
        ((_STORE, _STORE.replace("REWARD", "-REWARD")),),
        "reward-sign",
        "The reward of the pendulum is never positive. Print the largest reward of the buffer.",
        "[18]",
        "The reward is stored with the wrong sign. Remove the minus.",
    ),
    3: Exercise(
        PENDULUM,
        "The agent balances for a while, but it loses more than it must, in every run.",
        (_replace(_NEXT, "max", "mean"),),
        "wrong-target",
        "Which value of the next state does the best policy collect?",
        "[9]",
        "The target takes the mean of the next values. Take their maximum.",
    ),
    4: Exercise(
        CARTPOLE,
        "The pole falls at once, also after the whole run.",
        ((_HEAD, 'Dense(len(ACTIONS), activation="softmax")'),),
        "bounded-output",
        "Print the values of a few states. Can they be as large as the sum of the rewards?",
        "[7]",
        "The last layer ends with softmax: the values of a state are probabilities. Remove the "
        "activation.",
    ),
    5: Exercise(
        PENDULUM,
        "The agent gets better, and then the return stays in the middle and jumps.",
        (("CAPACITY = 50_000", "CAPACITY = 500"),),
        "forgetting",
        "From how many of the last steps are the batches drawn?",
        "[5]",
        "The replay buffer holds 500 transitions, less than three episodes. Give it 50 000.",
    ),
    6: Exercise(
        CARTPOLE,
        "The values grow, and nearly all states have the same one. The pole falls.",
        (_replace(_STORE, "terminated", "truncated"),),
        "missing-end",
        "How many of the stored transitions are ends? How many should be?",
        "[18]",
        "`truncated` is stored in place of `terminated`, so a fall does not end an episode.",
    ),
    7: Exercise(
        PENDULUM,
        "The return of the training gets worse from the start to the end.",
        (("random.random() < epsilon", "random.random() > epsilon"),),
        "exploration",
        "Which share of the actions is random in the first episode, and which in the last?",
        "[17]",
        "The comparison is the wrong way round: the action is random with the probability 1 - ε.",
    ),
    8: Exercise(
        PENDULUM,
        "The return stays where it was at the start, and all actions have nearly the same value.",
        ((f"{_STORE}  # [18]\n        {_MOVE}", f"{_MOVE}\n        {_STORE}  # [18]"),),
        "misaligned-transitions",
        "Print one stored transition. How far does the pendulum move in it?",
        "[18] and [19]",
        "s becomes s′ before the transition is stored. Store first.",
    ),
    9: Exercise(
        PENDULUM,
        "The agent does something in training, and the evaluated network fails.",
        (_replace(_STEP, "ACTIONS[a]", "ACTIONS[a - 1]"),),
        "torque-map",
        "Which torque acts for the index 0, and which one do you declare for it?",
        "just above [18]",
        "The torque that acts is that of the index before, and the last one for 0. Use ACTIONS[a].",
    ),
    10: Exercise(
        CARTPOLE,
        "Both actions have nearly the same value at every state.",
        ((_VALUE, "online(s)"), (_LOSS, "(goal[:, None] - value) ** 2")),
        "wrong-loss",
        "Which outputs change when the batch has one transition with the action 0?",
        "[11] and [12]",
        "All outputs learn the target of the one action that was taken. Gather its value.",
    ),
    11: Exercise(
        PENDULUM,
        "Everything is as it should be until the first updates. Then the network is broken.",
        (("LEARNING_RATE = 1e-3", "LEARNING_RATE = 1e-1"),),
        "broken-network",
        "How much does one update change the values?",
        "[6]",
        "The learning rate is a hundred times too large.",
    ),
    12: Exercise(
        PENDULUM,
        "The values are hundreds of times as large as the returns.",
        (_replace(_STORE, "REWARD_SCALE * r", "r / REWARD_SCALE"),),
        "reward-scale",
        "Which rewards are in the buffer? Compare them with those of the environment.",
        "[18]",
        "The reward is divided by its scale. Multiply.",
    ),
    13: Exercise(
        CARTPOLE,
        "From the first episode on the agent does the same again and again.",
        (("np.interp(done, (0, 0.5), EPSILON)", "np.interp(done, (0, 0.5), EPSILON) / 100"),),
        "exploration",
        "How many of the first 1000 actions are random? How many should be?",
        "[16]",
        "ε is a share, not a percentage. Do not divide it by 100.",
    ),
    14: Exercise(
        PENDULUM,
        "The agent is a little worse than it should be, and near the top it does not mind moving.",
        (_replace(_STORE, "REWARD_SCALE * r", "REWARD_SCALE * max(r, -1.0)"),),
        "other-reward",
        "Plot the stored rewards over the angle.",
        "[18]",
        "The rewards are clipped at -1, so most states are equally bad. Store the whole reward.",
    ),
    15: Exercise(
        PENDULUM,
        "The agent looks at the reward of the next step only.",
        (_replace(_STORE, "terminated", "not terminated"),),
        "no-bootstrapping",
        "Which share of the stored transitions is an end? How many ends has this task?",
        "[18]",
        "The buffer stores whether the episode goes on, and the target takes it for the end.",
    ),
    16: Exercise(
        PENDULUM,
        "It learns slowly, and the more random actions there are, the worse are the values.",
        (
            (_ACT, "a = int(greedy(s))"),
            (
                _STEP,
                "env.step(\n"
                "            [ACTIONS[random.integers(11) if random.random() < epsilon else a]]\n"
                "        )",
            ),
        ),
        "misaligned-transitions",
        "Is the stored action the one that acted?",
        "[17] and the line after it",
        "The greedy action is stored, also where a random one acts. Store the one that acts.",
    ),
    17: Exercise(
        PENDULUM,
        "The loss falls, and nothing is learned. All actions of a state are equally good.",
        ((_NEXT, "tf.reduce_max(target(next_s))"),),
        "wrong-target",
        "What is the shape of `next_value`?",
        "[9]",
        "The maximum is that of the whole batch: one number. Take it over the actions, axis 1.",
    ),
    18: Exercise(
        PENDULUM,
        "The agent is good, and never quite as good as it should be.",
        (_replace(_STORE, "terminated", "terminated or truncated"),),
        "no-bootstrapping",
        "Does the pendulum know that the 200th step is the last one?",
        "[18]",
        "A truncated episode is stored as one that ended. Store `terminated`.",
    ),
    19: Exercise(
        PENDULUM,
        "Each episode has only one action, or a few. The pendulum does not react to what it does.",
        ((_MOVE, "state = next_s  # [19]"),),
        "misaligned-transitions",
        "Print s at each step of one episode.",
        "[19]",
        "s is never updated: `state` is another variable.",
    ),
    20: Exercise(
        PENDULUM,
        "The values stay small, whatever the length of the run. The agent sees no swing-up.",
        (("if updates % COPY_EVERY == 0", "if step % COPY_EVERY == 1"),),
        "wrong-target",
        "How often is the target network copied? Count it.",
        "[20]",
        "Updates are made at even steps, so this condition never holds. Count updates.",
    ),
}
