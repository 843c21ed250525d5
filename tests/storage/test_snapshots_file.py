"""The file of snapshots: wrong contents are refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.snapshots import encode_snapshots, read_snapshots, take_snapshot

pytestmark = pytest.mark.usefixtures("files_read_here")
NETWORK = kp.DQN((4,), 2)
HISTORY = [EpisodeRecord(i, -0.1 * i, -20.0 * i, 0.5, 0.1, 200 * i, i, 1.0) for i in range(3)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with the snapshots after 0, 2 and 3 episodes."""
    snapshots = [take_snapshot(NETWORK, HISTORY[:count]) for count in (0, 2, 3)]
    write_with_checksum(tmp_path / "a.h5", encode_snapshots(NETWORK, snapshots))
    return tmp_path / "a.h5"


def test_snapshots_are_read_as_they_were_written(path: Path) -> None:
    found = read_snapshots(path, NETWORK, HISTORY)
    assert [(each.episodes, each.average_reward) for each in found] == [
        (0, 0),
        (2, -0.1),
        (3, -0.2),
    ]
    flat = np.concatenate([array.ravel() for array in NETWORK.get_weights()])
    for each in found:
        np.testing.assert_array_equal(each.weights, flat.astype(np.float16))


def test_snapshots_after_the_last_episode_of_the_history_are_left_out(path: Path) -> None:
    assert [each.episodes for each in read_snapshots(path, NETWORK, HISTORY[:2])] == [0, 2]


def test_weights_beyond_float16_get_its_largest_number() -> None:
    network = kp.DQN((4,), 2)
    network.set_weights([np.full_like(array, -1e30) for array in network.get_weights()])
    assert set(take_snapshot(network, []).weights.tolist()) == {-65504.0}
    network.set_weights([array * np.nan for array in network.get_weights()])
    with pytest.raises(kp.UserError, match="a weight is not finite"):
        take_snapshot(network, [])


DAMAGE: dict[str, tuple[str, Any]] = {
    "no weights": ("weights", None),
    "float32": ("weights", np.zeros((3, 26), np.float32)),
    "too few weights": ("weights", np.zeros((3, 25), np.float16)),
    "another number of snapshots": ("weights", np.zeros((2, 26), np.float16)),
    "infinite weights": ("weights", np.full((3, 26), np.inf, np.float16)),
    "episodes not ascending": ("episodes", np.array([0, 3, 2])),
    "negative episode": ("episodes", np.array([-2, 2, 3])),
    "floating-point episodes": ("episodes", np.array([0.0, 2.0, 3.0])),
    "episodes in a table": ("episodes", np.array([[0], [2], [3]])),
    "a single episode": ("episodes", np.array(3)),
    "too few rewards": ("average_reward", np.zeros(2)),
    "infinite reward": ("average_reward", np.array([0, -0.1, np.inf])),
    "other reward": ("average_reward", np.array([0, -0.1, -0.3])),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_wrong_content_is_refused_in_one_line(name: str, path: Path) -> None:
    key, array = DAMAGE[name]
    with h5py.File(path, "r+") as file:
        del file["snapshots"][key]
        if array is not None:
            file["snapshots"][key] = array
    with pytest.raises(kp.WeightsError, match=r"a\.h5: ") as caught:
        read_snapshots(path, NETWORK, HISTORY)
    assert "\n" not in str(caught.value)
