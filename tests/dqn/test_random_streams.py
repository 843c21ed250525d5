from __future__ import annotations

import copy
import json
import random
from typing import Any

import numpy as np
import pytest

from keras_pendulum.dqn.random_streams import RandomStreams


def draws(streams: RandomStreams) -> list[Any]:
    """Returns draws of both streams, as a run makes them."""
    return [
        streams.exploration.random_sample(),
        int(streams.exploration.randint(41)),
        streams.replay.sample(range(1000), 8),
        streams.exploration.random_sample(),
    ]


def test_draws_are_those_of_the_recorded_run() -> None:
    legacy = np.random.RandomState(1)
    expected = [
        legacy.rand(),
        legacy.choice(41),
        random.Random(1).sample(range(1000), 8),
        legacy.rand(),
    ]
    assert draws(RandomStreams(1)) == expected


def test_streams_do_not_depend_on_each_other() -> None:
    streams = RandomStreams(0)
    streams.replay.sample(range(1000), 8)
    assert streams.exploration.random_sample() == RandomStreams(0).exploration.random_sample()


@pytest.mark.parametrize("through_json", [False, True])
def test_set_state_continues_both_streams(through_json: bool) -> None:
    saved = RandomStreams(3)
    draws(saved)
    state = saved.get_state()
    if through_json:
        state = json.loads(json.dumps(state))
    expected = draws(saved)
    restored = RandomStreams(99)
    restored.set_state(state)
    assert draws(restored) == expected


@pytest.mark.parametrize("position", [0, 624])
def test_set_state_accepts_the_first_and_the_last_position(position: int) -> None:
    state = RandomStreams(3).get_state()
    state["exploration"][2] = position
    streams = RandomStreams(0)
    streams.set_state(state)
    assert streams.get_state()["exploration"][2] == position


@pytest.mark.parametrize(
    ("stream", "position", "value"),
    [
        ("exploration", 0, "PCG64"),
        ("exploration", 1, [1, 2, 3]),
        ("exploration", 2, 625),  # NumPy would read beyond its 624 words
        ("exploration", 2, -1),
        ("replay", 0, 99),
        ("replay", 1, [1, 2, 3]),
    ],
)
def test_set_state_refuses_a_wrong_state_and_changes_nothing(
    stream: str, position: int, value: Any
) -> None:
    state = json.loads(json.dumps(RandomStreams(3).get_state()))
    state[stream][position] = value
    streams = RandomStreams(0)
    before = copy.deepcopy(streams)
    with pytest.raises(ValueError):
        streams.set_state(state)
    assert draws(streams) == draws(before)
