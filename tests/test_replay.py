from __future__ import annotations

import numpy as np
import pytest

from keras_pendulum.replay import ReplayBuffer


def filled(capacity: int, count: int) -> ReplayBuffer:
    """A buffer to which transitions 0, 1, …, count - 1 were added."""
    replay = ReplayBuffer(capacity)
    for i in range(count):
        replay.add([i, i, i], i % 41, -i, [i + 1, i + 1, i + 1], i % 5 == 4)
    return replay


def test_an_unfilled_buffer_holds_what_was_added_oldest_first() -> None:
    replay = filled(capacity=10, count=4)
    assert len(replay) == 4
    everything = replay.at(range(4))
    np.testing.assert_array_equal(everything.action, [0, 1, 2, 3])
    np.testing.assert_array_equal(everything.observation[:, 0], [0, 1, 2, 3])
    np.testing.assert_array_equal(everything.next_observation[:, 2], [1, 2, 3, 4])
    np.testing.assert_array_equal(everything.reward, [0, -1, -2, -3])
    np.testing.assert_array_equal(everything.terminated, [False] * 4)


def test_a_full_buffer_forgets_the_oldest() -> None:
    replay = filled(capacity=4, count=11)
    assert len(replay) == 4
    assert replay.added == 11
    np.testing.assert_array_equal(replay.at(range(4)).action, [7, 8, 9, 10])
    np.testing.assert_array_equal(replay.at([2]).terminated, [True])


def test_batches_keep_their_shape() -> None:
    batches = filled(10, 10).at([[1, 2, 3], [4, 5, 6]])
    assert batches.observation.shape == (2, 3, 3)
    assert batches.reward.shape == (2, 3)
    np.testing.assert_array_equal(batches.action, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("position", [-1, 4])
def test_a_position_that_holds_nothing_is_refused(position: int) -> None:
    with pytest.raises(IndexError, match="outside the 4 stored"):
        filled(10, 4).at([position])


@pytest.mark.parametrize("count", [3, 4, 11])
def test_a_restored_buffer_goes_on_like_the_saved_one(count: int) -> None:
    saved = filled(4, count)
    restored = ReplayBuffer(4)
    restored.set_state(saved.get_state(), saved.added)
    for replay in (saved, restored):
        replay.add([9, 9, 9], 40, 1.5, [8, 8, 8], True)
    for ours, theirs in zip(
        restored.at(range(len(restored))), saved.at(range(len(saved))), strict=True
    ):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("added", [-3, 2, 4])
def test_a_number_of_transitions_other_than_the_stored_ones_is_refused(added: int) -> None:
    state = filled(4, 3).get_state()
    replay = filled(4, 1)
    with pytest.raises(ValueError, match=f"of {added} transitions has shape"):
        replay.set_state(state, added)
    assert replay.added == 1


def test_what_was_taken_back_is_as_if_it_never_came() -> None:
    replay, plain = ReplayBuffer(4, spare=3), filled(4, 9)
    for count in (9, 12):  # 9, 10 and 11 come, and go
        while replay.added < count:
            replay.add(
                [replay.added] * 3, replay.added, -replay.added, [replay.added + 1] * 3, False
            )
    numbers = np.array([[5, 8], [8, 11]])
    np.testing.assert_array_equal(replay.numbered(numbers).action, numbers)
    replay.take_back(3)
    assert (replay.added, replay.oldest, len(replay)) == (9, 5, 4)
    for ours, theirs in zip(replay.at(range(4))[:4], plain.at(range(4))[:4], strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(replay.get_state()["action"], [5, 6, 7, 8])
    restored = ReplayBuffer(4, spare=3)
    restored.set_state(replay.get_state(), 9)
    np.testing.assert_array_equal(restored.at(range(4)).action, [5, 6, 7, 8])
