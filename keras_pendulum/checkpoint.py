"""A run's whole state in its `.h5`: the weights as Keras loads them, the rest in extra groups."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from keras_pendulum import layer_files
from keras_pendulum.config import Config
from keras_pendulum.environment import TASKS
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.errors import ConfigError, WeightsError
from keras_pendulum.flat_variables import Arrays
from keras_pendulum.integrity import write_sealed
from keras_pendulum.network import DQN
from keras_pendulum.run import Run
from keras_pendulum.weights import require_finite, weights_file

# A resumed run may be made longer or saved at other times; anything else would be another run.
_MAY_CHANGE = {"episodes", "save_every"}


def save_checkpoint(run: Run, path: str | os.PathLike[str]) -> None:
    """Writes the run as it stands between two episodes.

    Raises UserError when the file cannot be written, or a weight or a variable of the optimizer is
    not finite; an old checkpoint is then unharmed.
    """
    _write(path, _snapshot(run))


class CheckpointWriter:
    """Saves a run while it goes on.

    The run waits until its state is copied; a thread of its own makes the file. Leaving the `with`
    block waits for the last one.

    Args:
        path: the file.
        require_in_place: raises UserError where no file may be put at `path` any more.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        require_in_place: Callable[[], None] = lambda: None,
    ) -> None:
        self.path = path
        self._require_in_place = require_in_place
        self._thread = ThreadPoolExecutor(1, "checkpoint")
        self._last: Future[None] | None = None

    def save(self, run: Run) -> None:
        """Begins a checkpoint of the run as it stands, once the one before it is written.

        Raises UserError as `save_checkpoint` does, if not now, then from the next call or the end
        of the `with` block.
        """
        snapshot = _snapshot(run)
        self._wait()
        self._last = self._thread.submit(_write, self.path, snapshot, self._require_in_place)

    def _wait(self) -> None:
        if self._last is not None:
            self._last.result()

    def __enter__(self) -> CheckpointWriter:
        return self

    def __exit__(self, *problem: object) -> None:
        self._thread.shutdown()
        if problem[0] is None:
            self._wait()


class _Snapshot(NamedTuple):
    """A run as it stood; nothing in it changes when the run goes on."""

    network: DQN  # tells what it is; its weights then are `online`
    online: list[NDArray[np.float32]]
    agent: dict[str, Arrays]
    replay: Arrays
    state: dict[str, Any]
    history: list[EpisodeRecord]


def _snapshot(run: Run) -> _Snapshot:
    online, agent = run.agent.get_state()
    state = {
        "config": vars(run.config),
        "random": run.random.get_state(),
        "environment": run.env.unwrapped.np_random.bit_generator.state,
        "replay_added": run.replay.added,
    }
    replay = run.replay.get_state()
    return _Snapshot(run.agent.online, online, agent, replay, state, list(run.history))


def _write(
    path: str | os.PathLike[str],
    snapshot: _Snapshot,
    require_in_place: Callable[[], None] = lambda: None,
) -> None:
    for arrays in snapshot.agent.values():
        require_finite(arrays.values())
    content = weights_file(
        snapshot.network,
        snapshot.online,
        target=snapshot.agent["target"],
        optimizer=snapshot.agent["optimizer"],
        replay=snapshot.replay,
        run={
            # JSON as an array: an attribute can hold no more than 64 KB.
            "state": np.frombuffer(json.dumps(snapshot.state).encode(), np.uint8),
            "history": _rows(snapshot.history),
        },
    )
    write_sealed(path, content, check=lambda file: require_in_place())


def load_config(path: str | os.PathLike[str]) -> Config:
    """The settings of the run in a checkpoint. Raises as `load_checkpoint` does."""
    with layer_files.opened(path) as file:
        return _config(_state(file, path), path)


def load_checkpoint(path: str | os.PathLike[str], config: Config, render: bool = False) -> Run:
    """The run in a checkpoint, ready to go on.

    Args:
        path: the checkpoint.
        config: the run's settings; only `episodes` and `save_every` may differ from the file's.
        render: show the environment in a window.

    Raises:
        WeightsError: the file is damaged or holds weights alone.
        ConfigError: `config` is that of another run.
    """
    with layer_files.opened(path) as file:
        state = _state(file, path)
        stored = _config(state, path)
        for spec in fields(Config):
            ours, theirs = getattr(config, spec.name), getattr(stored, spec.name)
            if ours != theirs and spec.name not in _MAY_CHANGE:
                raise ConfigError(
                    f"{path}: this run has {spec.name} {theirs}, not {ours}: resume it without "
                    "changing that, or start another run in another folder"
                )
        rows = layer_files.read_array(file["run/history"], path, finite=False)
        if len(rows) > config.episodes:
            raise ConfigError(
                f"{path}: this run has {len(rows)} episodes behind it; episodes {config.episodes} "
                "cannot be its end"
            )
        online = layer_files.read_layers(file, path, TASKS[stored.environment].observation_size)
        agent = {name: _arrays(file, name, path) for name in ("target", "optimizer")}
        replay = _arrays(file, "replay", path)
    run = Run(config, render=render)
    with layer_files.damage_told(path):
        run.agent.set_state(online, agent)
        run.replay.set_state(replay, state["replay_added"])
        run.random.set_state(state["random"])
        run.env.unwrapped.np_random.bit_generator.state = state["environment"]
        run.history = [_record(row) for row in rows]
    return run


def _config(state: dict[str, Any], path: str | os.PathLike[str]) -> Config:
    values = state["config"]
    try:
        return Config(**{**values, "hidden_units": tuple(values["hidden_units"])})
    except (TypeError, ConfigError) as error:
        raise WeightsError(f"{path}: records settings that no run can have ({error})") from error


def _state(file: h5py.File, path: str | os.PathLike[str]) -> dict[str, Any]:
    if "run" not in file:
        raise WeightsError(
            f"{path}: holds weights alone, no run to resume: use --init to start one"
        )
    if "0" in file["target"]:  # an array for each variable, as they once were kept
        raise WeightsError(
            f"{path}: its run was saved by an older version of keras_pendulum and cannot go on "
            "with this one; to start a run from its weights use --init"
        )
    text = layer_files.read_array(file["run/state"], path).tobytes()
    state: dict[str, Any] = json.loads(text)
    return state


def _arrays(file: h5py.File, group: str, path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    return {name: layer_files.read_array(entry, path) for name, entry in file[group].items()}


def _rows(history: list[EpisodeRecord]) -> NDArray[np.float64]:
    # Sooner done than np.array(history).
    numbers = np.fromiter(itertools.chain.from_iterable(history), np.float64)
    return numbers.reshape(-1, len(EpisodeRecord._fields))


def _record(row: NDArray[np.float64]) -> EpisodeRecord:
    whole = {"episode", "environment_steps", "updates"}
    values = zip(EpisodeRecord._fields, row.tolist(), strict=True)
    return EpisodeRecord(**{name: int(value) if name in whole else value for name, value in values})
