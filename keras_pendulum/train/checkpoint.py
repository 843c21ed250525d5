"""Checkpoints: the whole state of a run in its `.h5`, beside the weights that Keras loads."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import RENAMED, Config
from keras_pendulum.dqn.agent import Variables
from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError, WeightsError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage import keras_h5
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.weights import encode_weights, require_finite
from keras_pendulum.train.run import Run, make_run

# A resumed run may change these settings; any other change makes another run.
_MAY_CHANGE = {"episodes", "save_every"}


def save_checkpoint(run: Run, path: str | os.PathLike[str]) -> None:
    """Writes the state of a run between two episodes.

    Raises UserError when the file cannot be written, or when a weight or an optimizer variable is
    not finite. The old checkpoint is then unchanged.
    """
    _write(path, _copy_state(run))


class CheckpointWriter:
    """A writer of checkpoints that writes in a thread while the run continues.

    `save` copies the state of the run, and the thread writes the file. The end of the `with` block
    waits for the last file.

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
        """Copies the state of the run and starts to write it, after the previous checkpoint.

        An error of the thread is raised by the next call or at the end of the `with` block; see
        `save_checkpoint`.
        """
        state = _copy_state(run)
        self._wait()
        self._last = self._thread.submit(_write, self.path, state, self._require_not_moved)

    def _wait(self) -> None:
        if self._last is not None:
            self._last.result()

    def __enter__(self) -> CheckpointWriter:
        return self

    def __exit__(self, *exception: object) -> None:
        self._thread.shutdown()
        if exception[0] is None:
            self._wait()


class _RunState(NamedTuple):
    """A copy of a run's state."""

    network: DQN  # for its layers and provenance; its weights may change meanwhile
    weights: list[NDArray[np.float32]]  # of the online network
    agent: dict[str, Variables]
    replay: dict[str, NDArray[Any]]
    json_state: dict[str, Any]  # settings, random-number generators and a counter
    history: list[EpisodeRecord]


def _copy_state(run: Run) -> _RunState:
    json_state = {
        "config": vars(run.config),
        "random": run.streams.get_state(),
        "environment": run.env.unwrapped.np_random.bit_generator.state,
        "replay_added": run.replay.added,
    }
    return _RunState(
        run.agent.online,
        run.agent.online.get_weights(),
        run.agent.get_state(),
        run.replay.get_state(),
        json_state,
        list(run.history),
    )


def _write(
    path: str | os.PathLike[str],
    state: _RunState,
    require_not_moved: Callable[[], None] = lambda: None,
) -> None:
    for variables in state.agent.values():
        require_finite(variables.values())
    content = encode_weights(
        state.network,
        state.weights,
        target=_dataset_names(state.agent["target"]),
        optimizer=_dataset_names(state.agent["optimizer"]),
        replay=state.replay,
        run={
            # JSON as an array, because an attribute can hold no more than 64 KB.
            "state": np.frombuffer(json.dumps(state.json_state).encode(), np.uint8),
            "history": np.array(state.history, np.float64),
        },
    )
    write_with_checksum(path, content, check=lambda file: require_not_moved())


def _dataset_names(variables: Variables) -> Variables:
    """Returns the variables with "." for each "/" of their paths: HDF5 takes "/" for a group."""
    return {path.replace("/", "."): array for path, array in variables.items()}


def load_config(path: str | os.PathLike[str]) -> Config:
    """Returns the settings of the run in a checkpoint. Raises as `load_checkpoint` does."""
    with keras_h5.open_h5(path) as file:
        return _config(_read_json_state(file, path), path)


def load_checkpoint(path: str | os.PathLike[str], config: Config, render: bool = False) -> Run:
    """Returns the run in a checkpoint, ready to continue.

    Args:
        path: the checkpoint.
        config: the settings of the run; only `episodes` and `save_every` may differ.
        render: whether to show the environment in a window.

    Raises:
        WeightsError: the file is damaged, or holds weights without a run.
        ConfigError: `config` belongs to another run.
    """
    with keras_h5.open_h5(path) as file:
        state = _read_json_state(file, path)
        stored = _config(state, path)
        for spec in fields(Config):
            new, old = getattr(config, spec.name), getattr(stored, spec.name)
            if new != old and spec.name not in _MAY_CHANGE:
                raise ConfigError(
                    f"{path}: this run has {spec.name} {old}, not {new}: resume it without this "
                    "change, or start another run in another folder"
                )
        rows = keras_h5.read_array(file["run/history"], path, finite=False)
        if len(rows) > config.episodes:
            raise ConfigError(
                f"{path}: this run has {len(rows)} episodes already; episodes is "
                f"{config.episodes}, expected at least {len(rows)}"
            )
        weights = keras_h5.read_layers(file, path, TASKS[stored.environment].observation_size)
        agent = {
            group: {name.replace(".", "/"): array for name, array in _arrays(file, group, path)}
            for group in ("target", "optimizer")
        }
        replay = dict(_arrays(file, "replay", path))
    run = make_run(config, render=render)
    with keras_h5.report_damage(path):
        run.agent.set_state(weights, agent)
        run.replay.set_state(replay, state["replay_added"])
        run.streams.set_state(state["random"])
        run.env.unwrapped.np_random.bit_generator.state = state["environment"]
        run.history = [_record(row) for row in rows]
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


def _read_json_state(file: h5py.File, path: str | os.PathLike[str]) -> dict[str, Any]:
    if "run" not in file:
        raise WeightsError(
            f"{path}: holds weights without a run to resume; use --init to start a run from them"
        )
    text = keras_h5.read_array(file["run/state"], path).tobytes()
    state: dict[str, Any] = json.loads(text)
    return state


def _arrays(
    file: h5py.File, group: str, path: str | os.PathLike[str]
) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, entry in file[group].items():
        yield name, keras_h5.read_array(entry, path)


def _record(row: NDArray[np.float64]) -> EpisodeRecord:
    integers = {"episode", "environment_steps", "updates"}
    values = zip(EpisodeRecord._fields, row.tolist(), strict=True)
    return EpisodeRecord(
        **{name: int(value) if name in integers else value for name, value in values}
    )
