"""Loads the files that Keras 2 and Keras 3 save of the networks of `keras_networks`.

    python -m benchmarks.files.keras_files

Prints a table: how many files load with the same Q-values, how many are refused, and how many break
the rule of their network. Ends with exit status 1 when one does. Needs the extra `test`; three
minutes.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import keras_pendulum as kp
from benchmarks.files.keras_networks import (
    NETWORKS,
    SUBCLASSED,
    WEIGHTS,
    WHOLE,
    Network,
    saved_files,
)
from benchmarks.result_files import markdown
from keras_pendulum.dqn.policy import greedy_policy

_TOLERANCE = 1e-5


def observations(size: int = 3) -> np.ndarray[Any, Any]:
    """Returns random observations [50, size]."""
    return np.random.default_rng(1).normal(size=(50, size)).astype(np.float32)


def check_files(name: str, version: int, keras: Any, folder: Path) -> Counter[str]:
    """Saves a network in all its files, and loads those for which it has a rule.

    Args:
        name: of the network.
        version: of Keras.
        keras: the module of this version.
        folder: where the files are written.

    Returns how many were `loaded`, and how many `refused`.

    Raises AssertionError when a file breaks the rule, or loads with other Q-values.
    """
    network = NETWORKS[name]
    model = network.model(keras)
    outcomes: Counter[str] = Counter()
    for path in saved_files(model, version, (*WHOLE, *WEIGHTS), folder):
        # A whole model records its activations, unless it is a subclassed one.
        records_none = path.name in WEIGHTS or name in SUBCLASSED
        arguments = {"activation": network.activation} if records_none else {}
        if network.rule(path.name, version) != "untested" or path.name in WHOLE:
            outcomes[_check(path, network, version, model, arguments)] += 1
    return outcomes


def _check(
    path: Path, network: Network, version: int, model: Any, arguments: dict[str, str]
) -> str:
    rule = network.rule(path.name, version)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            warnings.filterwarnings("ignore", ".* whose code it does not hold")
            loaded = kp.load_weights(path, **arguments)
    except kp.WeightsError as error:
        message = str(error)
        assert rule in ("refused", "either"), message
        assert str(path) in message
        assert message.isprintable()  # one line
        if path.name in WHOLE and network.blamed:
            words = message.replace(str(path), "")
            assert any(layer in words for layer in network.blamed), message
        return "refused"
    assert rule in ("loads", "either"), f"{path.name} loads as {loaded.hidden_units}"
    inputs = observations(network.inputs)
    expected = np.asarray(model(inputs), np.float32)
    for found in (loaded(inputs), greedy_policy(loaded).q_values(inputs)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=_TOLERANCE, err_msg=path.name)
    return "loaded"


def main() -> int:
    """Loads the files of all networks and prints the table; returns the exit status."""
    import keras
    import tf_keras

    warnings.filterwarnings("ignore", message=".*as an HDF5 file")
    outcomes = {version: Counter({"networks": 0, "loaded": 0, "refused": 0}) for version in (2, 3)}
    failures = []
    for name, network in NETWORKS.items():
        for version in network.versions:
            outcomes[version]["networks"] += 1
            with tempfile.TemporaryDirectory() as folder:
                module = keras if version == 3 else tf_keras
                try:
                    outcomes[version] += check_files(name, version, module, Path(folder))
                except AssertionError as error:
                    failures.append(f"{name}, Keras {version}: {error}")
    print(markdown([{"Keras": version, **counts} for version, counts in outcomes.items()]))
    print(*failures, sep="\n", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
