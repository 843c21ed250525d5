"""Pictures do not depend on the user's settings of Matplotlib."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import matplotlib
import pytest
from cycler import cycler

import keras_pendulum as kp
from keras_pendulum.diagnosis.report import as_html
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.figures.run_figure import draw_live, draw_run
from keras_pendulum.history import EpisodeRecord

HISTORY = [EpisodeRecord(i, -1.0 - i, -200.0, 0.9, 0.5, 200, 40, 1.0) for i in range(12)]
# Each would end in an error, or change the picture.
SETTINGS: Any = {
    "text.usetex": True,
    "font.size": 30,
    "savefig.transparent": True,
    "axes.prop_cycle": cycler(color=["black"]),
}


def report() -> bytes:
    return as_html(kp.diagnose("original")).encode()


@pytest.mark.parametrize(
    "draw",
    [
        lambda: draw_run(HISTORY, Pendulum(), {}, {}, "a run"),
        lambda: draw_live(HISTORY, Pendulum(), {}, "a run", 9),
        report,
    ],
    ids=["run", "live", "report"],
)
def test_picture_is_the_same_with_the_users_settings(draw: Callable[[], bytes]) -> None:
    expected = draw()
    with matplotlib.rc_context(SETTINGS), warnings.catch_warnings():
        warnings.simplefilter("error")
        assert draw() == expected
        assert matplotlib.rcParams["font.size"] == 30
