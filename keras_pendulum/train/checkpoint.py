"""Checkpoints: the whole state of a run in its `.h5`, beside the weights that Keras loads."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.config.settings import RENAMED
from keras_pendulum.dqn.agent import Variables
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError, WeightsError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.keras_h5 import read_layers
from keras_pendulum.storage.quarantine import H5File, open_h5, report_damage
from keras_pendulum.storage.run_history import history_arrays, read_history
from keras_pendulum.storage.weights import changed_versions, encode_weights, require_finite
from keras_pendulum.train.run import Run, make_run

# A resumed run may change these settings; any other change makes another run.
_MAY_CHANGE = {"episodes", "save_every", "evaluate_every", "keep_best", "snapshots"}


def save_checkpoint(run: Run, path: str | os.PathLike[str]) -> None:
    """Writes the state of a run between two episodes.

    Raises UserError when the file cannot be written, or when a weight or an optimizer variable is
    not finite. The old checkpoint is then unchanged.
    """
    write_with_checksum(path, _encode(run))


class CheckpointWriter:
    """A writer of checkpoints whose disk is written by a thread while the run continues.

    The end of the `with` block waits for the last file.

    Args:
        path: the file.
        require_not_moved: raises UserError when the run's folder was moved.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        require_not_moved: Callable[[], None] = lambda: None,
    ) -> None:
        self.path = path
        self._require_not_moved = require_not_moved
        self._thread = ThreadPoolExecutor(1, "checkpoint")
        self._last: Future[None] | None = None

    def save(self, run: Run) -> None:
        """Starts to write the present state of the run, after the previous checkpoint.

        Raises UserError as `save_checkpoint` does. An error of the thread is raised by the next
        call, or at the end of the `with` block.
        """
        # The thread does not encode: it would take Python's lock from the run, for twice as long.
        self.write(self.path, _encode(run))

    def write(self, path: str | os.PathLike[str], content: bytes) -> None:
        """Starts to write a file of the run, after the previous one. Raises as `save` does."""
        self._wait()
        self._last = self._thread.submit(
            write_with_checksum, path, content, check=lambda file: self._require_not_moved()
        )

    def _wait(self) -> None:
        if self._last is not None:
            self._last.result()

    def __enter__(self) -> CheckpointWriter:
        return self

    def __exit__(self, *exception: object) -> None:
        self._thread.shutdown()
        if exception[0] is None:
            self._wait()


def _encode(run: Run) -> bytes:
    """Returns the content of the run's checkpoint."""
    online, agent = run.agent.online, run.agent.get_state()
    for variables in agent.values():
        require_finite(variables.values())
    json_state = {
        "config": vars(run.config),
        "random": run.streams.get_state(),
        "environment": run.env.unwrapped.np_random.bit_generator.state,
        "replay_added": run.replay.added,
    }
    arrays: dict[str, NDArray[Any]] = {
        # JSON as an array, because an attribute can hold no more than 64 KB.
        "state": np.frombuffer(json.dumps(json_state).encode(), np.uint8),
        **history_arrays(run.history),
    }
    return encode_weights(
        online,
        online.get_weights(),
        target=_dataset_names(agent["target"]),
        optimizer=_dataset_names(agent["optimizer"]),
        replay=run.replay.get_state(),
        run=arrays,
    )


def _dataset_names(variables: Variables) -> Variables:
    """Returns the variables with "." for each "/" of their paths: HDF5 takes "/" for a group."""
    return {path.replace("/", "."): array for path, array in variables.items()}


def load_config(path: str | os.PathLike[str]) -> Config:
    """Returns the settings of the run in a checkpoint. Raises as `load_checkpoint` does."""
    with open_h5(path) as file:
        return _config(_read_json_state(file, path), path)


def load_history(path: str | os.PathLike[str]) -> tuple[Config, list[EpisodeRecord]]:
    """Returns the settings and the history of the run in a checkpoint.

    Raises as `load_checkpoint` does.
    """
    with open_h5(path) as file:
        config = _config(_read_json_state(file, path), path)
        return config, read_history(file)


def load_checkpoint(path: str | os.PathLike[str], config: Config, render: bool = False) -> Run:
    """Returns the run in a checkpoint, ready to continue.

    Args:
        path: the checkpoint.
        config: the settings of the run; only `episodes`, `save_every`, `evaluate_every`,
            `keep_best` and `snapshots` may differ.
        render: whether to show the environment in a window.

    Raises:
        WeightsError: the file is damaged, or holds weights without a run.
        ConfigError: `config` belongs to another run.
    """
    with open_h5(path) as file:
        state = _read_json_state(file, path)
        stored = _config(state, path)
        for spec in fields(Config):
            new, old = getattr(config, spec.name), getattr(stored, spec.name)
            if new != old and spec.name not in _MAY_CHANGE:
                raise ConfigError(
                    f"{path}: this run has {spec.name} {old}, not {new}: resume it without this "
                    "change, or start another run in another folder"
                )
        history = read_history(file)
        if len(history) > config.episodes:
            raise ConfigError(
                f"{path}: this run has {len(history)} episodes already; episodes is "
                f"{config.episodes}, expected at least {len(history)}"
            )
        size = TASKS[stored.environment].observation_size
        layers = read_layers(file, os.fsdecode(path), size, None)
        agent = {
            group: {name.replace(".", "/"): array for name, array in _arrays(file, group)}
            for group in ("target", "optimizer")
        }
        replay = dict(_arrays(file, "replay"))
        if versions := changed_versions(file):
            warnings.warn(
                f"{os.fsdecode(path)} was saved with {', '.join(versions)}; these differ now: "
                "the resumed run need not equal an uninterrupted one to the last bit",
                stacklevel=2,
            )
    run = make_run(config, render=render)
    with report_damage(path):
        weights = [array for layer in layers for array in (layer.kernel, layer.bias)]
        try:
            run.agent.set_state(weights, agent)
        except ValueError as error:
            raise WeightsError(f"{os.fsdecode(path)}: cannot be resumed, {error}") from error
        run.replay.set_state(replay, state["replay_added"])
        run.streams.set_state(state["random"])
        run.env.unwrapped.np_random.bit_generator.state = state["environment"]
        run.history = history
    return run


def _config(state: dict[str, Any], path: str | os.PathLike[str]) -> Config:
    values = state["config"]
    renamed = sorted(RENAMED.keys() & values.keys())
    if renamed:
        raise WeightsError(
            f"{path}: this run was saved by an older version of keras_pendulum (it has the setting "
            f"{renamed[0]}) and cannot be resumed; use --init to start a run from its weights"
        )
    try:
        return Config(**{**values, "hidden_units": tuple(values["hidden_units"])})
    except (TypeError, ConfigError) as error:
        raise WeightsError(f"{path}: records settings that no run can have ({error})") from error


def _read_json_state(file: H5File, path: str | os.PathLike[str]) -> dict[str, Any]:
    if "run" not in file:
        raise WeightsError(
            f"{path}: holds weights without a run to resume; use --init to start a run from them"
        )
    state: dict[str, Any] = json.loads(file.read("run/state").tobytes())
    return state


def _arrays(file: H5File, group: str) -> Iterator[tuple[str, NDArray[Any]]]:
    for name in file:
        if name.startswith(f"{group}/"):
            yield name.removeprefix(f"{group}/"), file.read(name)
