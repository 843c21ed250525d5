"""An update after each step, many of them in one compiled call.

What an update changes may change the next action, so strictly one call has to follow each step, and
most of its time would be the call's and not the update's. But an update seldom changes the action.
So the next steps are rehearsed with the weights as they are, and one call then makes the updates
that belong between them, up to the first that would have acted otherwise: from there on the steps
are taken back. What comes of it is what steps and updates in turn give.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.agent import ANY_ACTION, NO_ACTION
from keras_pendulum.rollout import Parts, Rollout, Step

AHEAD = 12  # steps; more are in vain more often, fewer share a call


def learn_each_step(rollout: Rollout, parts: Parts, ahead: int = AHEAD) -> list[float]:
    """Plays an episode to its end with an update after each step; returns the losses.

    Args:
        rollout: the episode.
        parts: of its run; the memory can take back `ahead` transitions.
        ahead: how many steps to rehearse at a time.
    """
    losses: list[float] = []
    while not rollout.over:
        if len(parts.replay) + 1 < parts.config.batch_size:
            rollout.step()
        else:
            losses += _rehearse(rollout, parts, ahead)
    return losses


def _rehearse(rollout: Rollout, parts: Parts, ahead: int) -> list[float]:
    """Goes on by 1 to `ahead` steps, each with its update; returns the losses."""
    _, _, agent, replay, random, config = parts
    take_back = rollout.snapshot()
    steps: list[Step] = []
    batches: list[list[int]] = []  # positions
    numbers: list[NDArray[np.int64]] = []  # of the transitions at them
    while len(steps) < ahead and not rollout.over:
        steps.append(rollout.step())
        batches.append(random.batch_positions(len(replay), config.batch_size))
        numbers.append(replay.oldest + np.array(batches[-1], np.int64))
    # The compiled call has a fixed size: what is beyond the end comes after NO_ACTION.
    rest = ahead - len(steps)
    actions = [ANY_ACTION if step.explored else step.action for step in steps[1:]]
    losses = agent.update_between(
        replay.numbered(np.array(numbers + numbers[:1] * rest)),
        np.array([step.following for step in steps + steps[:1] * rest]),
        actions + [NO_ACTION] * (1 + rest),
    )
    made = len(losses)
    if made < len(steps):
        random.put_back(batches[made:])
        take_back()
        for step in steps[:made]:
            rollout.step(step.action)
    return losses.tolist()
