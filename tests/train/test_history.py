"""The record of an episode, as the original's line and as a row of history.csv."""

from __future__ import annotations

import math

import pytest

from keras_pendulum.history import EpisodeRecord, csv_header

pytestmark = pytest.mark.quick
RECORD = EpisodeRecord(7, -1.23456, -246.912, 0.0512, 0.25, 1600, 210, 0.5)


def test_line_is_that_of_the_original() -> None:
    assert RECORD.line() == "Episode: 7, Average Reward: -1.235, Epsilon: 0.05"


def test_row_has_every_digit_in_the_order_of_the_header() -> None:
    assert csv_header() == (
        "episode,average_reward,episode_return,epsilon,loss,environment_steps,updates,seconds"
    )
    assert RECORD.csv_row() == "7,-1.23456,-246.912,0.0512,0.25,1600,210,0.5"


def test_row_of_an_episode_without_updates_has_an_empty_loss() -> None:
    assert RECORD._replace(loss=math.nan).csv_row() == "7,-1.23456,-246.912,0.0512,,1600,210,0.5"
