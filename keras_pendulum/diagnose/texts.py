"""The words of each finding: what it is, why it hurts, and what to do."""

from __future__ import annotations

from typing import NamedTuple


class Text(NamedTuple):
    """The words of a finding."""

    explanation: str  # two sentences
    remedy: str


TEXTS: dict[str, Text] = {
    "broken-network": Text(
        "The outputs are not numbers, have no sensible size, or are the same for all actions. Such "
        "a network cannot choose an action, and more training does not repair it.",
        "Start again with a smaller learning rate, scaled observations and rewards, and a clipped "
        "gradient.",
    ),
    "reward-sign": Text(
        "The learned values are high where the exact values are low. The agent learned to collect "
        "costs.",
        "Check the sign of the reward where it is stored: the pendulum's reward is never positive.",
    ),
    "observation-map": Text(
        "The values fit the exact ones as soon as the observation is changed. So the agent sees "
        "another observation when it acts than when it learned.",
        "Give the agent [cos θ, sin θ, θ̇] in this order, with θ̇ in rad/s, in training and after.",
    ),
    "torque-map": Text(
        "The values are right, but each output behaves like another torque than the one it stands "
        "for. So an index means another torque when acting than when learning.",
        "Use one table from index to torque for acting and for storing; store the index itself.",
    ),
    "no-bootstrapping": Text(
        "The values are the rewards of one step. The agent does not look ahead, so it cannot swing "
        "the pendulum up.",
        "Add γ·max Q(next) to each target; the pendulum never terminates, truncation is no end.",
    ),
    "misaligned-transitions": Text(
        "The values have no use for the torque, or a stored transition is one that the pendulum "
        "cannot make. So observation, action, reward and next observation are of different steps.",
        "Store (s, a, r, s') of one step; copy the observation before the environment changes it.",
    ),
    "other-gravity": Text(
        "The values fit another gravity much better than the declared one. The agent learned a "
        "different pendulum.",
        "Train at the gravity at which you evaluate, or declare the one of the training.",
    ),
    "other-discount": Text(
        "The values fit another discount much better than the declared one. The agent looks ahead "
        "over another number of steps.",
        "Check the γ of the TD target against the one that you declare.",
    ),
    "reward-scale": Text(
        "The values are those of rewards with another size. Large rewards need larger outputs than "
        "the network reaches in time, and small ones are lost in the noise of its initial weights.",
        "Scale the rewards so that the values are between 1 and 100 in size.",
    ),
    "untrained-outputs": Text(
        "A few outputs differ from all others in every state, and the maximum picks them. They "
        "were never learned, so they still have their initial values, and every target uses them.",
        "Count the stored actions by index: each index must occur.",
    ),
    "too-few-updates": Text(
        "The values have hardly left their initial size. Each update carries a reward back by one "
        "step, so the values of the swing-up need thousands of updates.",
        "Make more updates for each step of the environment, up to one for each step.",
    ),
    "overestimation": Text(
        "The network promises more than its policy collects. The maximum of noisy values is too "
        "high, and each target passes the error on.",
        "Use a target network, double Q-learning and a replay buffer of many episodes.",
    ),
    "narrow-starts": Text(
        "The values are right in a part of the plane and wrong in the rest. The agent has never "
        "been in the rest.",
        "Start the episodes all over the plane, and let them last long enough to leave the start.",
    ),
    "forgetting": Text(
        "The replay buffer holds the last episodes only. What the network learned about the way "
        "up is overwritten when no stored transition shows it.",
        "Make the replay buffer larger: it should hold at least 14 000 transitions.",
    ),
    "exploration": Text(
        "The share of random actions does not fall, or has fallen before the values were known. So "
        "the stored transitions do not show what good actions lead to.",
        "Let ε fall from about 0.9 to 0.01 over the first half of the run.",
    ),
    "learning-rate": Text(
        "The values change from update to update more than actions differ. The policy is still "
        "jumping at the end of the run.",
        "Make the learning rate smaller, and let it fall to 0 at the end.",
    ),
    "undetermined": Text(
        "The values are wrong, but no single fault explains how. Several faults of the training "
        "leave the same network behind.",
        "Diagnose the run folder instead of the network: its history and replay buffer tell more.",
    ),
}
PAGE = "docs/diagnose.md"
