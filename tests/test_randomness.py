from __future__ import annotations

import json
import random

import numpy as np
import pytest

from keras_pendulum.randomness import RandomSource


def draws(source: RandomSource) -> list[object]:
    return [source.uniform(), source.action(41), source.batch_positions(1000, 8), source.uniform()]


def test_the_draws_are_those_of_the_recorded_run() -> None:
    source = RandomSource(1)
    legacy = np.random.RandomState(1)
    expected = [
        legacy.rand(),
        legacy.choice(41),
        random.Random(1).sample(range(1000), 8),
        legacy.rand(),
    ]
    assert draws(source) == expected


def test_equal_seeds_draw_alike_and_others_do_not() -> None:
    assert draws(RandomSource(7)) == draws(RandomSource(7))
    assert draws(RandomSource(7)) != draws(RandomSource(8))


def test_a_batch_has_no_transition_twice() -> None:
    assert sorted(RandomSource(0).batch_positions(32, 32)) == list(range(32))


def test_a_state_that_went_through_json_goes_on_alike() -> None:
    source = RandomSource(3)
    draws(source)
    state = json.loads(json.dumps(source.get_state()))
    expected = draws(source)
    other = RandomSource(99)
    other.set_state(state)
    assert draws(other) == expected


def test_the_global_random_states_do_not_matter() -> None:
    np.random.seed(5)
    random.seed(5)
    first = draws(RandomSource(0))
    np.random.seed(6)
    random.seed(6)
    assert draws(RandomSource(0)) == first


def test_exploration_is_uniform_over_the_torques() -> None:
    source = RandomSource(0)
    counts = np.bincount([source.action(41) for _ in range(41_000)], minlength=41)
    assert counts.min() > 850
    assert counts.max() < 1150


@pytest.mark.parametrize("count", [2, 41])
def test_every_action_can_be_drawn(count: int) -> None:
    source = RandomSource(0)
    assert {source.action(count) for _ in range(2000)} == set(range(count))


def test_batches_put_back_come_again_first_also_from_a_saved_state() -> None:
    source, plain = RandomSource(0), RandomSource(0)
    drawn = [source.batch_positions(1000, 8) for _ in range(4)]
    source.put_back(drawn[2:])
    assert source.batch_positions(1000, 8) == drawn[2]
    source.put_back(drawn[2:3])
    other = RandomSource(99)
    other.set_state(json.loads(json.dumps(source.get_state())))
    for goes_on in (source, other):
        assert [goes_on.batch_positions(1000, 8) for _ in range(2)] == drawn[2:]
    for _ in range(4):
        plain.batch_positions(1000, 8)
    assert source.batch_positions(1000, 8) == plain.batch_positions(1000, 8)


def test_a_state_of_a_version_that_put_nothing_back_is_taken() -> None:
    state = RandomSource(0).get_state()
    del state["put_back"]
    source = RandomSource(5)
    source.put_back([[1, 2]])
    source.set_state(state)
    assert draws(source) == draws(RandomSource(0))


def test_exploration_goes_on_from_a_snapshot_once_more() -> None:
    source = RandomSource(0)
    source.uniform()
    go_back = source.exploration_snapshot()
    first = [source.uniform(), source.action(41), source.uniform()]
    go_back()
    assert [source.uniform(), source.action(41), source.uniform()] == first
