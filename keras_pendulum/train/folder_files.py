"""The listeners that write the files of a run into its folder."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from keras_pendulum.errors import WeightsError
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.quarantine import open_h5
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.storage.save_weights import encode_weights
from keras_pendulum.storage.snapshots import encode_snapshots, read_snapshots, take_snapshot
from keras_pendulum.train.checkpoint import CheckpointWriter
from keras_pendulum.train.listeners import FunctionListener, Listener
from keras_pendulum.train.run import Run


def run_listeners(
    run: Run, folder: RunFolder, writer: CheckpointWriter, others: Sequence[Listener]
) -> list[Listener]:
    """Returns all listeners of a run in the order of their calls. It is the only such list.

    1. `history.csv` has the row of an episode before any other file shows the episode.
    2. The snapshots.
    3. The checkpoint, which a resumed run starts from.
    4. The best weights, after the checkpoint: a run that is killed between these two files writes
       the second one when it is resumed.
    5. The others, which show the run: they see files that are complete.

    Raises WeightsError when a file of a resumed run is damaged or belongs to another run.
    """
    history = FunctionListener(
        on_episode=folder.append,
        on_checkpoint=lambda network, episode: folder.restore_history(run.history),
    )
    best = BestWeightsFile(run, folder, writer) if run.config.keep_best else None
    snapshots = SnapshotsFile(run, folder, writer) if run.config.snapshots else None
    checkpoint = CheckpointFile(run, writer, best, [history, *others])
    files = (history, snapshots, checkpoint, best)
    return [*(file for file in files if file is not None), *others]


class SnapshotsFile(Listener):
    """Keeps evenly spaced networks of the run; its settings say how many, at least 2.

    A resumed run continues with the networks in the file. If it has more episodes now, or another
    number of networks, those nearest to the new even spacing stay.
    """

    def __init__(self, run: Run, folder: RunFolder, writer: CheckpointWriter) -> None:
        self._run, self._path, self._writer = run, folder.snapshots, writer
        count, episodes = run.config.snapshots, run.config.episodes
        self._due = [round(i * episodes / (count - 1)) for i in range(count)]  # 0, …, `episodes`
        kept = []
        if self._path.exists():
            kept = read_snapshots(self._path, run.agent.online, run.history)
        past = [due for due in self._due if due <= len(run.history)] if kept else []
        nearest = {min(range(len(kept)), key=lambda i: abs(kept[i].episodes - due)) for due in past}
        self._kept = [kept[i] for i in sorted(nearest)]

    def on_start(self) -> None:
        """Keeps the initial network of a new run."""
        self._take_if_due()

    def on_episode(self, record: EpisodeRecord) -> None:
        """Keeps the present network if one is due."""
        self._take_if_due()

    def _take_if_due(self) -> None:
        network, history = self._run.agent.online, self._run.history
        if len(history) in self._due and len(history) not in [each.episodes for each in self._kept]:
            self._kept.append(take_snapshot(network, history))
            self._writer.write(self._path, encode_snapshots(network, self._kept))


class CheckpointFile(Listener):
    """Writes the checkpoint every `save_every` episodes, at the end, and for the best weights.

    At each checkpoint, it calls `on_checkpoint` of the followers.
    """

    def __init__(
        self,
        run: Run,
        writer: CheckpointWriter,
        best: BestWeightsFile | None,
        followers: Sequence[Listener],
    ) -> None:
        self._run, self._writer, self._best, self._followers = run, writer, best, followers
        self._last_saved = -1  # episode

    def on_episode(self, record: EpisodeRecord) -> None:
        """Writes the checkpoint if it is due."""
        is_best = self._best is not None and self._best.are_beaten_by(record)
        if is_best or record.episode % self._run.config.save_every == 0:
            self._save(record.episode)

    def on_end(self) -> None:
        """Writes the checkpoint of the last episode."""
        last = self._run.history[-1].episode
        if last != self._last_saved:
            self._save(last)

    def _save(self, episode: int) -> None:
        self._last_saved = episode
        self._writer.save(self._run)
        for follower in self._followers:
            follower.on_checkpoint(self._run.agent.online, episode)


class BestWeightsFile(Listener):
    """Keeps the weights of the best evaluation of a run.

    The file records the regret of its weights, so a resumed run continues with the best so far.
    """

    def __init__(self, run: Run, folder: RunFolder, writer: CheckpointWriter) -> None:
        self._run, self._path, self._writer = run, folder.best, writer
        self._regret = math.inf
        if self._path.exists():
            with open_h5(self._path) as file:
                names = ("evaluation/episode", "evaluation/regret")
                found = [float(file.read(name)) for name in names if name in file]
            if found not in [[record.episode, record.greedy_regret] for record in run.history]:
                raise WeightsError(
                    f"{self._path}: its weights are not those of an evaluation of this run; move "
                    "it to another folder"
                )
            self._regret = found[1]

    def are_beaten_by(self, record: EpisodeRecord) -> bool:
        """Returns whether an evaluation is as good as the best one; the later of two equals wins.

        It is false for an episode without an evaluation.
        """
        return record.greedy_regret <= self._regret

    def on_start(self) -> None:
        """Writes the file if the run was killed between the checkpoint and this file."""
        if self._run.history:
            self.on_episode(self._run.history[-1])

    def on_episode(self, record: EpisodeRecord) -> None:
        """Replaces the file by the present weights if they are the best."""
        if self.are_beaten_by(record):
            evaluation = {
                "episode": np.array(record.episode, np.int64),
                "regret": np.array(record.greedy_regret, np.float64),
            }
            content = encode_weights(self._run.agent.online, evaluation=evaluation)
            self._writer.write(self._path, content)
            self._regret = record.greedy_regret
