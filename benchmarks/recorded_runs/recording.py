"""The recorded runs in tests/data: their arrays and their printed lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.result_files import ROOT

DATA = ROOT / "tests" / "data"
Recorded = Mapping[str, NDArray[Any]]


def load_recording(name: str) -> Recorded:
    """Returns the arrays of tests/data/NAME.npz."""
    with np.load(DATA / f"{name}.npz") as arrays:
        return dict(arrays)


def printed_lines(name: str) -> list[str]:
    """Returns the lines that a recorded run printed, from tests/data/NAME.log."""
    return (DATA / f"{name}.log").read_text("utf-8").splitlines()


def initial_weights(recorded: Recorded) -> list[NDArray[np.float32]]:
    """Returns the weights with which a recorded run began, in the order of the layers."""
    names = [name for name in recorded if name.startswith("initial_weight_")]
    return [recorded[f"initial_weight_{i}"] for i in range(len(names))]
