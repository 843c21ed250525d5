"""Checkpoints: the whole state of a run in its `.h5`, beside the weights that Keras loads."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.config import Config
from keras_pendulum.dqn.agent import Variables
from keras_pendulum.errors import ConfigError, WeightsError, require_finite
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.checksum import write_with_checksum
from keras_pendulum.storage.keras_h5 import require_sane
from keras_pendulum.storage.quarantine import H5File, open_h5, report_damage
from keras_pendulum.storage.recorded_run import history_arrays, read_run
from keras_pendulum.storage.save_weights import changed_versions, encode_weights
from keras_pendulum.train.run import Run, make_run


def save_checkpoint(run: Run, path: str | os.PathLike[str]) -> None:
    """Writes the state of a run between two episodes.

    Raises UserError when the file cannot be written, or when a weight or an optimizer variable is
    not finite. The old checkpoint is then unchanged.
    """
    write_with_checksum(path, _encode(run))


class CheckpointWriter:
    """A writer of checkpoints whose disk is written by a thread while the run continues.

    The end of the `with` block waits for the last file. `require_not_moved` raises UserError when
    the run's folder was moved.
    """

    def __init__(
        self, path: str | os.PathLike[str], require_not_moved: Callable[[], None] = lambda: None
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
    online, agent, replay = run.agent.online, run.agent.get_state(), run.replay.get_state()
    for variables in agent.values():
        require_finite(variables.values())
    json_state = {
        "config": vars(run.config),
        "random": run.streams.get_state(),
        "environment": run.env.unwrapped.np_random.bit_generator.state,
        "replay_added": replay.pop("added"),
    }
    arrays: dict[str, NDArray[Any]] = {
        # JSON as an array, because an attribute can hold no more than 64 KB.
        "state": np.frombuffer(json.dumps(json_state).encode(), np.uint8),
        **history_arrays(run.history),
    }
    return encode_weights(
        online,
        target=_dataset_names(agent["target"]),
        optimizer=_dataset_names(agent["optimizer"]),
        replay=replay,
        run=arrays,
    )


def _dataset_names(variables: Variables) -> Variables:
    """Returns the variables with "." for each "/" of their paths: HDF5 takes "/" for a group."""
    return {path.replace("/", "."): array for path, array in variables.items()}


def _read_variables(file: H5File, group: str) -> Variables:
    """Returns the variables of a group by their paths; see `_dataset_names`."""
    names = [name for name in file.shapes if name.startswith(f"{group}/")]
    return {name.removeprefix(f"{group}/").replace(".", "/"): file.read(name) for name in names}


def load_checkpoint(path: str | os.PathLike[str], config: Config, render: bool = False) -> Run:
    """Returns the run in a checkpoint, ready to continue; with `render`, it has a window.

    Of the settings, only `episodes` and those of Recording may differ from the recorded ones.

    Raises:
        WeightsError: the file is damaged, or holds weights without a run.
        ConfigError: `config` belongs to another run.
    """
    with open_h5(path) as file:
        recorded = read_run(file)
        for name, old in recorded.config.learning().items():
            new = getattr(config, name)
            if new != old and name != "episodes":
                raise ConfigError(
                    f"{path}: this run has {name} {old}, not {new}: resume it without this change, "
                    "or start another run in another folder"
                )
        episodes = len(recorded.history)
        if episodes > config.episodes:
            raise ConfigError(
                f"{path}: this run has {episodes} episodes already; episodes is "
                f"{config.episodes}, expected at least {episodes}"
            )
        agent = {group: _read_variables(file, group) for group in ("target", "optimizer")}
        for name, array in agent["target"].items():
            require_sane(array, f"target/{name}", path)
        if versions := changed_versions(file):
            warnings.warn(
                f"{os.fsdecode(path)} was saved with {', '.join(versions)}; these differ now: "
                "the resumed run need not equal an uninterrupted one to the last bit",
                stacklevel=2,
            )
    run = make_run(config, render=render)
    with report_damage(path):
        weights = [array for layer in recorded.layers for array in (layer.kernel, layer.bias)]
        paths = [variable.path for variable in run.agent.online.weights]
        if config.episodes != recorded.config.episodes and config.average_updates > 1:
            # The old average belongs to a run of another length.
            names = [f"{config.optimizer}/{path.replace('/', '_')}_average" for path in paths]
            agent["optimizer"] |= dict(zip(names, weights, strict=True))
        try:
            run.agent.set_state({"online": dict(zip(paths, weights, strict=True)), **agent})
        except ValueError as error:
            raise WeightsError(f"{os.fsdecode(path)}: cannot be resumed, {error}") from error
        _check_optimizer(agent["optimizer"], recorded.history)
        state = recorded.state
        run.replay.set_state({"added": state["replay_added"], **recorded.replay._asdict()})
        run.streams.set_state(state["random"])
        run.env.unwrapped.np_random.bit_generator.state = state["environment"]
        run.history = recorded.history
    return run


def _check_optimizer(variables: Variables, history: list[EpisodeRecord]) -> None:
    """Raises ValueError for variables that no optimizer has after the updates of a run."""
    updates = history[-1].updates if history else 0
    for name, array in variables.items():
        if name.endswith("iteration") and (array.dtype.kind != "i" or (array != updates).any()):
            raise ValueError(f"optimizer/{name} is {array}; its history has {updates} updates")
        if not name.endswith(("momentum", "average")) and (array < 0).any():
            raise ValueError(f"optimizer/{name} is negative")
