from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from keras_pendulum.dqn.random_streams import RandomStreams
from keras_pendulum.dqn.replay_buffer import ReplayBuffer, Transitions


def filled(capacity: int, count: int) -> ReplayBuffer:
    """Returns a buffer to which the transitions 0, 1, …, count - 1 were added."""
    replay = ReplayBuffer(capacity, observation_size=3)
    for i in range(count):
        replay.add([i, i, i], i, -i, [i + 1, i + 1, i + 1], i % 5 == 4)
    return replay


def assert_transitions(found: Transitions, numbers: Any) -> None:
    """Checks that these are the transitions of `filled` with these numbers, of any shape."""
    numbers = np.asarray(numbers)
    rows = np.repeat(numbers[..., np.newaxis], 3, axis=-1)
    expected = Transitions(rows, numbers, -numbers, rows + 1, numbers % 5 == 4)
    for name, array in expected._asdict().items():
        np.testing.assert_array_equal(getattr(found, name), array, name)


@pytest.mark.parametrize("count", [0, 3, 4])
def test_buffer_that_is_not_full_stores_every_transition_oldest_first(count: int) -> None:
    replay = filled(capacity=4, count=count)
    assert (len(replay), replay.added) == (count, count)
    assert_transitions(replay.transitions(), range(count))


def test_full_buffer_replaces_the_oldest_transition() -> None:
    replay = filled(capacity=4, count=11)
    assert (len(replay), replay.added) == (4, 11)
    assert_transitions(replay.transitions(), [7, 8, 9, 10])


def test_fields_have_the_dtypes_of_the_update() -> None:
    batches = filled(4, 4).sample(2, random.Random(0))
    assert [array.dtype for array in batches] == [
        *(np.float32, np.int32, np.float32, np.float32, bool)
    ]


@pytest.mark.parametrize("count", [7, 10, 13, 20, 25])
def test_batches_are_the_draws_of_the_recorded_run(count: int) -> None:
    # Position 0 is the oldest transition, also where the ring has wrapped round.
    replay = filled(capacity=10, count=count)
    oldest, stored = max(0, count - 10), min(count, 10)
    streams, generator = RandomStreams(1), random.Random(1)
    for batches in (1, 3, 1):
        positions = [generator.sample(range(stored), 5) for _ in range(batches)]
        found = replay.sample(5, streams.replay, batches)
        assert_transitions(found, oldest + np.array(positions))
    assert streams.replay.getstate() == generator.getstate()


def test_sample_is_a_copy() -> None:
    replay = filled(capacity=4, count=4)
    batches = replay.sample(4, random.Random(0))
    before = batches.action.copy()
    for _ in range(4):
        replay.add([9, 9, 9], 9, 9.0, [9, 9, 9], True)
    np.testing.assert_array_equal(batches.action, before)


@pytest.mark.parametrize(("capacity", "count"), [(10, 4), (4, 4), (4, 11)])
def test_batch_has_at_most_all_stored_transitions(capacity: int, count: int) -> None:
    replay = filled(capacity, count)
    stored = min(capacity, count)
    batch = replay.sample(stored, random.Random(0))
    assert sorted(batch.action[0].tolist()) == list(range(count - stored, count))
    with pytest.raises(ValueError, match="larger than population"):
        replay.sample(stored + 1, random.Random(0))
    with pytest.raises(ValueError, match="larger than population"):
        filled(capacity, 0).sample(1, random.Random(0))


@pytest.mark.parametrize("count", [0, 3, 4, 5, 11])
def test_set_state_continues_like_the_saved_buffer(count: int) -> None:
    saved = filled(4, count)
    restored = filled(4, 9)
    restored.set_state(saved.get_state())
    for replay in (saved, restored):
        replay.add([9, 9, 9], 40, 1.5, [8, 8, 8], True)
    assert (len(restored), restored.added) == (len(saved), count + 1)
    for ours, theirs in zip(
        restored.sample(len(saved), random.Random(0)),
        saved.sample(len(saved), random.Random(0)),
        strict=True,
    ):
        np.testing.assert_array_equal(ours, theirs)


def test_get_state_is_a_copy() -> None:
    replay = filled(4, 4)
    state = replay.get_state()
    replay.add([9, 9, 9], 9, 9.0, [9, 9, 9], True)
    assert state.pop("added") == 4
    assert_transitions(Transitions(**state), range(4))


@pytest.mark.parametrize("name", ["added", *Transitions._fields])
def test_set_state_refuses_a_state_that_does_not_fit_and_changes_nothing(name: str) -> None:
    replay = filled(4, 6)
    wrong = [-3, 0, 2, 3] if name == "added" else map(np.zeros, [(1,), (3,), (4, 2), (4, 4), ()])
    for value in wrong:
        with pytest.raises(ValueError, match=r"of -?\d transitions has shape \("):
            replay.set_state({**filled(4, 9).get_state(), name: value})
    assert replay.added == 6
    assert_transitions(replay.transitions(), [2, 3, 4, 5])
