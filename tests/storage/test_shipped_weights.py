from __future__ import annotations

from pathlib import Path

import pytest
from conftest import ROOT

import keras_pendulum as kp
from keras_pendulum.storage.shipped_weights import shipped_files, shipped_names, shipped_return
from keras_pendulum.storage.weights import recorded_return


def test_shipped_files_are_those_that_find_weights_finds() -> None:
    assert shipped_files() == sorted(ROOT.glob("weights/*.h5"))
    assert [kp.find_weights(name) for name in shipped_names()] == shipped_files()


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_return_is_the_recorded_one(name: str) -> None:
    path = kp.find_weights(name)
    assert shipped_return(path) == recorded_return(path) is not None


def test_return_of_a_new_file_is_the_recorded_one(tmp_path: Path) -> None:
    path = tmp_path / "new.h5"
    kp.save_weights(kp.DQN((8,)), path, evaluated_return=-12.5)
    assert shipped_return(path) == -12.5
    kp.save_weights(kp.DQN((8,)), path)
    assert shipped_return(path) is None
    path.write_bytes(b"evaluated_return\0 too short")
    assert shipped_return(path) is None
