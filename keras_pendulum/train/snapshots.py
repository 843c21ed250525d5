"""Snapshots: evenly spaced networks of a run, kept to show how it learned."""

from __future__ import annotations

from pathlib import Path

from keras_pendulum.storage.snapshots import encode_snapshots, read_snapshots, take_snapshot
from keras_pendulum.train.checkpoint import CheckpointWriter
from keras_pendulum.train.run import Run


def due_episodes(count: int, episodes: int) -> list[int]:
    """Returns after how many episodes each of `count` networks is kept: 0, …, `episodes`."""
    return [round(i * episodes / (count - 1)) for i in range(count)]


class Snapshots:
    """The file with the networks of a run; its settings say how many, at least 2.

    A resumed run continues with the networks in the file. If it has more episodes now, or another
    number of networks, those nearest to the new even spacing stay.

    Args:
        path: the file; it may not exist yet.
        run: the run.

    Raises WeightsError when the file is damaged or belongs to another run.
    """

    def __init__(self, path: Path, run: Run) -> None:
        self._path = path
        self._due = due_episodes(run.config.snapshots, run.config.episodes)
        kept = read_snapshots(path, run.agent.online, run.history) if path.exists() else []
        past = [due for due in self._due if due <= len(run.history)] if kept else []
        nearest = {min(range(len(kept)), key=lambda i: abs(kept[i].episodes - due)) for due in past}
        self._kept = [kept[i] for i in sorted(nearest)]

    def take_if_due(self, run: Run, writer: CheckpointWriter) -> None:
        """Adds the present network to the file if one is due after the last episode."""
        episodes = len(run.history)
        if episodes in self._due and episodes not in [each.episodes for each in self._kept]:
            self._kept.append(take_snapshot(run.agent.online, run.history))
            writer.write(self._path, encode_snapshots(run.agent.online, self._kept))
