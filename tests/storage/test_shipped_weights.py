from __future__ import annotations

import pytest
from conftest import ROOT

import keras_pendulum as kp
from keras_pendulum.storage.load_weights import recorded_return
from keras_pendulum.storage.shipped_weights import shipped_names, shipped_returns


def test_shipped_names_are_those_that_find_weights_finds() -> None:
    files = {kp.find_weights(name) for name in shipped_names()}
    assert files == set(ROOT.glob("weights/*.h5"))


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_return_is_the_recorded_one(name: str) -> None:
    assert shipped_returns()[name] == recorded_return(kp.find_weights(name)) is not None
