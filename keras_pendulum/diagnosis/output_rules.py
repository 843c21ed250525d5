"""Rules for outputs that show no values: not finite, bounded, or the same everywhere.

Each returns a finding, or None. `findings` says where the thresholds come from.
"""

from __future__ import annotations

import numpy as np

from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.signals import Array
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.evaluate.q_policies import DQNPolicy

_WORST_REWARD = -Pendulum.reward_range[0]
# A pendulum that hangs at rest costs π² a step, and no policy more on average.
_LOWEST_MEAN_REWARD = -1.3 * np.pi**2
_SAME_VALUES = 0.01  # spread of values that are the same in all states, as a share of their mean
_BEYOND_REWARDS = 1000  # times the lowest possible value
_BOTH_SIDES = 0.5  # times the mean below 0, of the highest value above 0
_STILL_FALLING = 0.5  # distance to the targets, as a share of the mean reward
_LOGARITHMS = "exp of the values of each state has the sum 1"
_AT_THE_BOUND = 0.3  # share of the outputs; a linear head has none there


def not_finite(m: Measurement) -> Finding | None:
    """Finds values that are not finite or far beyond every possible one."""
    if not m.finite:
        return Finding("broken-network", "Q-values that are not finite", "all finite")
    largest = float(np.abs(m.learned_q).max())
    worst, best = m.task.reward_range
    limit = max(-worst, best) / max(1 - m.discount, 0.005)
    if largest > 1e5 * limit:
        if m.learned_q.mean() > m.learned_q.std():
            highest = best / max(1 - m.discount, 0.005)
            evidence = f"values of {m.learned_q.mean():.1e}, and the highest possible is "
            return Finding("overestimation", f"{evidence}{highest:.0f}", f"at most {highest:.0f}")
        return Finding("broken-network", f"values up to {largest:.1e}", f"at most {limit:.0f}")
    return None


def bounded_output(m: Measurement) -> Finding | None:
    """Finds the traces of an activation after the last layer."""
    if isinstance(m.policy, DQNPolicy):  # its head is linear
        return None
    if m.task.never_terminates:
        found = _bounds(m.learned_q * m.reward_scale)
        exact = f"All returns of the pendulum are negative, down to {m.exact_q.min():.0f}."
    else:
        found = _bounds_everywhere(m)
        exact = f"A pole that does not fall has a value of {m.exact_q.max():.0f}."
    if found is None:
        return None
    variant, evidence = found
    text = Fault(
        f"The last layer ends with {variant}, which cannot give these values. {exact}",
        f"Remove {variant} from the last layer: Q-values need a linear head.",
    )
    return Finding("bounded-output", evidence, "no bound", variant=variant, text=text)


def _bounds(outputs: Array) -> tuple[str, str] | None:
    """Returns the activation whose bounds outputs [N, A] of the pendulum have, and the evidence."""
    low, high = float(outputs.min()), float(outputs.max())
    tiny = bool(((outputs > 0) & (outputs < 1e-6)).any())  # of a ReLU head, all are 0 or larger
    at_zero, at_minus_one = np.mean(np.abs(outputs) < 1e-3), np.mean(outputs < -0.999)
    if _are_shares(outputs):
        return "softmax", "the values of each state are from 0 to 1, and their sum is 1"
    if _are_logarithms(outputs):
        return "log-softmax", _LOGARITHMS
    if low >= -1 and high <= 1 and at_minus_one > _AT_THE_BOUND:
        return "tanh", f"no value is below -1, and {at_minus_one:.0%} of them are there"
    if low == 0 and not tiny and at_zero > _AT_THE_BOUND:
        return "relu", f"no value is below 0, and {at_zero:.0%} of them are there"
    if low >= 0 and high <= 1 and at_zero > _AT_THE_BOUND:
        return "sigmoid", f"all values are from 0 to 1, and {at_zero:.0%} of them are near 0"
    return None


def _bounds_everywhere(m: Measurement) -> tuple[str, str] | None:
    """Returns the same where the values are positive: far away, a linear head has no bounds."""
    random = np.random.RandomState(0)
    far = random.normal(scale=1000, size=(200, m.task.observation_size)).astype(np.float32)
    outputs = np.concatenate([m.q_values(far), m.learned_q]) * m.reward_scale
    low, high = float(outputs.min()), float(outputs.max())
    # Small values of hidden layers with tanh do not leave -1 to 1 either, but few are at a bound.
    at_bound = np.mean(np.abs(outputs) > 0.99) > _AT_THE_BOUND
    if _are_shares(outputs):
        return "softmax", "all values are from 0 to 1, and their sum is 1"
    if _are_logarithms(outputs):
        return "log-softmax", f"all values are below 0, and {_LOGARITHMS}"
    if np.ptp(outputs) < 1e-3 and 0.999 < high <= 1:
        return "tanh or sigmoid", "all values are 1, also far outside of the task"
    if 0 <= low < 0.1 and high <= 1 and at_bound:
        return "sigmoid", "all values are from 0 to 1, also far outside of the task"
    if -1 <= low < 0 and high <= 1 and at_bound:
        return "tanh", "all values are from -1 to 1, also far outside of the task"
    return None


def _are_shares(outputs: Array) -> bool:
    """Returns whether values [N, A] are positive, with the sum 1 for each state."""
    return bool(outputs.min() >= 0 and np.abs(outputs.sum(axis=1) - 1).max() < 1e-3)


def _are_logarithms(outputs: Array) -> bool:
    """Returns whether values [N, A] are logarithms of shares."""
    return bool(outputs.max() <= 0 and _are_shares(np.exp(outputs)))


def same_everywhere(m: Measurement) -> Finding | None:
    """Finds values that are the same for all states or for all actions."""
    units = max(m.stuck_units)
    spread = m.learned_q.std(axis=0)
    if _is_constant(spread, m.learned_q):
        evidence = f"values that differ by {spread.max():.1g} from state to state"
        if units > 0.99:
            evidence += f"; {units:.0%} of a layer's units saturated or dead"
        return Finding("broken-network", evidence, f"{m.value_spread:.0f}")
    across = np.ptp(m.learned_q, axis=1)
    if _is_constant(across, m.learned_q):
        evidence = f"values that differ by {across.max():.1g} from action to action"
        return Finding("broken-network", evidence, "above 1")
    return None


def _is_constant(spread: Array, values: Array) -> bool:
    """Returns whether the spread of values is no more than their rounding."""
    return bool(spread.max() < 1e-6 * max(1.0, float(np.abs(values).max())))


def lowest_mean(m: Measurement) -> Finding | None:
    """Finds a network that large rewards have broken: its one value is too low for a mean."""
    mean, spread = float(m.learned_q.mean()), float(m.learned_q.std())
    lowest = _LOWEST_MEAN_REWARD / max(1 - m.discount, 0.005)
    if not m.task.never_terminates or mean > lowest or spread > _SAME_VALUES * -mean:
        return None
    evidence = f"values of {mean:.3g} in all states"
    return Finding("reward-scale", evidence, f"above {lowest:.0f}, the lowest possible mean")


def batch_broadcast(m: Measurement) -> Finding | None:
    """Finds values that are the mean target of a batch in all states."""
    values = m.backup.q
    mean, spread = float(values.mean()), float(values.std())
    reward = mean * (1 - m.discount)  # of a step, if this value is the mean target
    if _is_constant(values.std(axis=0), values) or max(m.stuck_units) > 0.99:  # a dead network
        return None
    if m.task.never_terminates:
        own = spread < 0.3 * m.backup.reward.std() and _LOWEST_MEAN_REWARD < reward < -0.3
        # After a short training, values differ as little. But they still fall to their targets.
        falls = float((values - m.backup.right).mean())
        own = own and falls < -_STILL_FALLING * float(m.backup.reward.mean())
        rewards = f"the rewards by {m.backup.reward.std():.2g}"
    else:  # of the constant reward 1
        own = spread < 0.02 * mean and mean > 1.5 and reward < 0.8
        rewards = "and are neither 1 nor those of a pole that never falls"
    if not own:
        return None
    text = Fault(
        "Every value is the mean of all targets, so the loss compares each value with the targets "
        "of the whole batch. A difference of the shapes (B, 1) and (B,) has the shape (B, B).",
        "Give Q(s, a) and the target the same shape: squeeze the first one, or reshape the other "
        "one to (B, 1).",
    )
    return Finding(
        "wrong-loss",
        f"values of {mean:.0f} in all states: they differ by {spread:.2g}, {rewards}",
        f"a difference of {m.value_spread:.0f}",
        variant="batch-broadcast",
        text=text,
    )


def reward_size(m: Measurement) -> Finding | None:
    """Finds values beyond the lowest possible one, or lost in the noise of the weights."""
    if not m.task.never_terminates:
        return None  # its equation shows it
    lowest = -_WORST_REWARD / max(1 - m.discount, 0.005)
    mean = float(m.learned_q.mean())
    if mean < lowest:
        # No rewards are so large, but values that grow without bound are, also to both sides.
        grows = mean < _BEYOND_REWARDS * lowest or m.learned_q.max() > -_BOTH_SIDES * mean
        name = "broken-network" if grows else "reward-scale"
        return Finding(
            name, f"a mean value of {mean:.3g}", f"above {lowest:.0f}, the lowest possible"
        )
    slope = m.value.slope
    if mean < 0.04 * float(m.exact_q.mean()):
        return None  # a training begins with the mean of the values
    if 0 <= slope < 0.02 and m.advantage_size < 0.03 and m.value.correlation > 0.85:
        evidence = f"values {slope:.1g} times the exact ones, and actions as close"
        return Finding("reward-scale", evidence, "1")
    return None
