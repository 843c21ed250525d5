"""The equations that Q - r shows: in most, a constant takes the place of the next values.

Then Q - r is nothing, a constant, an index, or the values of a network that never learns. Where it
falls as the next values rise, they are subtracted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from keras_pendulum.diagnosis.backup import Backup
from keras_pendulum.diagnosis.equation import Equation
from keras_pendulum.diagnosis.signals import Array, line_fit
from keras_pendulum.diagnosis.target_equations import NEGATIVE_NEXT, ZERO_OTHERS

# What a network that has not learned hardly exceeds. One with 64-64 units, Keras' initial weights
# and speeds up to 8 in its input has the largest values.
_UNTRAINED, _UNTRAINED_SPREAD = 2.0, 0.54


def _constant(b: Backup) -> Array:
    return b.reward + b.offset.mean() * b.continues


_NO_BOOTSTRAPPING = Equation(
    "no-bootstrapping",
    "",
    "r",
    lambda b: b.reward,
    largest_error=0.15,
    share=0.2,
    offset=True,
)
_FROZEN_TARGET = Equation(
    "wrong-target",
    "frozen-target",
    "r + a small constant",
    _constant,
    "The values are the rewards of one step plus a little that changes slowly with the next state. "
    "That is γ·max of a network that has not learned: the target network is never copied, or the "
    "training ended before its first copy.",
    "Copy the online weights into the target network, every 100 to 1000 updates or a little at "
    "each one.",
    share=0.2,
    offset=True,
)
_BATCH_MAX = Equation(
    "wrong-target",
    "batch-max",
    "r + a constant",
    _constant,
    "The values are the rewards of one step plus a constant: the target takes one maximum for the "
    "whole batch. So the best state of the batch follows on every state.",
    "Give the maximum its axis: max(axis=1) of [B, A] is [B].",
    largest_error=0.1,
    share=0.2,
    offset=True,
)


def _index_for_value(last: int, largest_error: float = 1.7, share: float = 0.88) -> Equation:
    return Equation(
        "wrong-target",
        "index-for-value",
        f"r + γ·(an index from 0 to {last})",
        _constant,
        "The values are the rewards of one step plus numbers between 0 and A - 1. The target adds "
        "the index of the best next action, which argmax returns, and not its value.",
        "Use max in the target; argmax is for acting.",
        largest_error,
        share,
        offset=True,
    )


def constant_futures(declared: Backup) -> Iterator[Equation]:
    """Yields the equations that Q - r shows, each with `offset`."""
    highest = declared.next_q.max(axis=2)[declared.continues]
    falls = line_fit(declared.offset, highest)  # as the next values rise
    if -1.45 < falls.slope < -0.5 and falls.correlation < -0.85:
        yield replace(NEGATIVE_NEXT, offset=True)
        return
    scale, last = declared.reward_scale, declared.q.shape[1] - 1
    output = declared.offset * scale  # as the program adds an index, or what has not learned
    mean, spread = float(output.mean()), float(output.std())
    small = 0.06 < spread < min(_UNTRAINED_SPREAD, 0.25 * scale * declared.q.std())
    frozen = bool(small and declared.offset_is_smooth and -0.1 < mean < _UNTRAINED)
    line = line_fit(declared.q, declared.reward)
    usual = 0.6 < line.slope < 1.3
    # No reward is positive, so no other target adds positive numbers that differ.
    indices = bool(np.mean((output > -2) & (output < declared.discount * last + 1)) > 0.8)
    indices = indices and not frozen and mean > max(0.3, 0.1 * last) and spread > 0.33
    # After a short training, values are as near to the rewards, but agree with them less.
    rewards = line.correlation > 0.85 and 0.45 < line.slope < 1.8
    rest = float((declared.offset - declared.offset_by_next_state).std())
    smooth = rest < 0.33 * declared.q.std()  # so what is added is a function of the next state
    values = smooth and (rewards or float(declared.q.mean()) * scale > _UNTRAINED)
    indices = indices and (values or (declared.index_correlation > 0.4 and spread > 0.5))
    nothing = abs(float(declared.offset.mean())) < max(0.1, float(declared.offset.std()))
    if usual and not frozen and nothing:
        yield _NO_BOOTSTRAPPING
    if usual and frozen:
        yield _FROZEN_TARGET
    if not indices and mean < _UNTRAINED and np.mean(output > 0) > 0.85:
        yield replace(
            _FROZEN_TARGET,
            formula="r + a number above 0 that the next state sets",
            target=lambda b: b.reward + b.offset_by_next_state.reshape(b.q.shape),
            explanation="The values are the rewards of one step plus numbers above 0. No reward is "
            "above 0, so no values are that have learned. These are γ·max of a network that has "
            "not: the target network is never copied, or the training ended before its first copy.",
            largest_error=0.35,  # a polynomial is not all of a network
            share=0.65,  # large numbers are a part of the next values, too
        )
    if usual and not frozen and not indices and not nothing:
        yield _BATCH_MAX
    if indices:
        yield _index_for_value(last)


def constant_futures_with_ends(declared: Backup) -> Iterator[Equation]:
    """Yields the same for a task whose reward is constant: then Q - r alone shows them.

    There, the shares of the actions in the batches differ from state to state. But their sum is 1.
    """
    offset, last = declared.offset, declared.q.shape[1] - 1
    mean, spread = float(offset.mean()), float(offset.std())
    size = float(np.abs(declared.reward).mean())
    end = float(declared.q[~declared.continues].mean()) if not declared.continues.all() else size
    # The values of a network that has never learned are smooth, and some are small.
    smooth = declared.offset_is_smooth and spread > 0.01 * size
    none = abs(mean) < 0.03 * size and spread < 0.05 * size and not smooth
    small = (
        not none and spread < 0.5 * size and -0.3 * size < mean < last * declared.discount + 0.05
    )
    # What an index adds can be as smooth, where batches mix 0 and 1. But it need not be small at 0,
    # and it differs from state to state, while the values of such a network may hardly differ.
    never_learned = declared.offset_at_zero < 0.3 and (smooth or spread < 0.06 * size)
    index = small and mean > 0 and not never_learned
    # Nothing is added at an end. After a short training, the values there are not right either.
    right_at_ends = abs(end - size) < 0.15 * size
    if none:
        yield replace(_NO_BOOTSTRAPPING, largest_error=1.6, share=0.6)
    if small and not index and right_at_ends:
        yield replace(_FROZEN_TARGET, largest_error=1.6, share=0.6)
    if mean > 2 * size and spread < 0.12 * mean and end < 0.5 * mean:
        yield replace(
            _BATCH_MAX,
            variant="batch-max or same-state",  # which has the same values where the reward is one
            explanation="All values are nearly the highest possible one, but not those of a step "
            "that ends the episode. Either the target takes one maximum for the whole batch, or "
            "the values of the state itself in place of the next one.",
            remedy="Give the maximum its axis: max(axis=1) of [B, A] is [B]. And store "
            "(s, a, r, s′) before s = s′.",
            largest_error=1.6,
            share=0.5,
        )
    if index:  # values that are nearly the same have large errors
        yield _index_for_value(last, largest_error=3.0, share=0.36)
    # All values are r / (1 + γ): the future of a step is this, times -γ.
    subtracted = -declared.discount / (1 + declared.discount) * size
    if abs(mean / subtracted - 1) < 0.2 and spread < 0.12 * size:
        yield replace(
            NEGATIVE_NEXT,
            target=lambda b: b.reward + subtracted,
            largest_error=2.0,
            offset=True,
        )
    lowest, highest = float(np.quantile(declared.q.min(axis=1), 0.25)), float(declared.q.max())
    if lowest < 0.9 * size and highest > 2.5 * size:
        yield replace(
            ZERO_OTHERS,
            formula="sum of Q(s, ·) / (r + γ·max Q(s′, ·)) = 1",
            target=lambda b: b.q / (b.q / b.right).sum(axis=1, keepdims=True),
            share=0.35,
            offset=True,
        )
