"""A run from its first episode to its last, with what is kept of it on the way."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from keras_pendulum import pictures
from keras_pendulum.atomic_file import write_atomically
from keras_pendulum.checkpoint import CheckpointWriter, load_checkpoint, save_checkpoint
from keras_pendulum.config import Config
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.errors import UserError
from keras_pendulum.evaluation import best_training_return, random_return
from keras_pendulum.network import DQN
from keras_pendulum.phase_plane import beside_optimum
from keras_pendulum.run import Run
from keras_pendulum.run_folder import RunFolder


@dataclass(frozen=True)
class TrainingResult:
    """What a run leaves: the trained network and a record for each episode."""

    network: DQN
    history: list[EpisodeRecord]
    finished: bool  # false when it was stopped before its last episode


def train_dqn(
    config: Config,
    out: str | os.PathLike[str] | None = None,
    *,
    init: DQN | None = None,
    render: bool = False,
    overwrite: bool = False,
    resume: bool = False,
    listeners: Iterable[Callable[[EpisodeRecord], None]] = (),
    on_checkpoint: Callable[[DQN, int], None] = lambda network, episode: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> TrainingResult:
    """Trains a DQN.

    Args:
        config: the settings; `preset` gives them.
        out: a folder for checkpoint, history, settings and picture; None keeps nothing.
        init: a network whose weights to start from.
        render: show the environment in a window, at its own speed.
        overwrite: replace a run that `out` already holds.
        resume: go on from the checkpoint in `out`; `config` may only change `episodes` and
            `save_every`.
        listeners: called with the record of each episode.
        on_checkpoint: called with the network as it stands, and the episode, at each checkpoint.
        should_stop: asked after each episode; true ends the run there, with a checkpoint.

    Raises:
        ConfigError: settings and `init`, or settings and checkpoint, do not fit.
        WeightsError: the checkpoint to resume from is damaged.
        UserError: `resume` comes with `init` or `overwrite`; `out` is in use, cannot be written or
            is moved meanwhile; or a loss, a weight or what the environment gives is not finite. The
            last checkpoint is then that of a sound run.
    """
    if resume and (init is not None or overwrite):
        raise UserError("resume goes on with a run; init and overwrite start a new one")
    listeners = list(listeners)
    folder = None if out is None else RunFolder(out, config.environment)
    with contextlib.ExitStack() as held:
        if resume:
            if folder is None:
                raise UserError("resume needs the folder of the run to go on with")
            held.enter_context(folder.held())
            run = load_checkpoint(folder.weights, config, render)
            held.callback(run.close)
        else:
            run = Run(config, init, render)
            held.callback(run.close)
            if folder is not None:
                folder.make()
                held.enter_context(folder.held())
                folder.claim(overwrite)
                # Before the other files, so that no policy of another run lies beside them, and so
                # that there is a run to resume from the start.
                save_checkpoint(run, folder.weights)
                folder.replace_others()
        if folder is None:
            finished = _learn(run, listeners, should_stop)
        else:
            folder.begin(config, run.history)
            finished = _learn_and_keep(run, folder, listeners, on_checkpoint, should_stop)
    return TrainingResult(run.agent.online, run.history, finished)


def _learn_and_keep(
    run: Run,
    folder: RunFolder,
    listeners: Iterable[Callable[[EpisodeRecord], None]],
    on_checkpoint: Callable[[DQN, int], None],
    should_stop: Callable[[], bool],
) -> bool:
    """As `_learn`, with a checkpoint now and then, and at the end a last one and the picture."""
    config = run.config
    kept = -1  # the last episode of which there is a checkpoint
    with CheckpointWriter(folder.weights, folder.require_in_place) as writer:

        def save() -> None:
            nonlocal kept
            kept = run.history[-1].episode
            writer.save(run)
            on_checkpoint(run.agent.online, kept)

        def keep(record: EpisodeRecord) -> None:
            folder.append(record)
            if record.episode % config.save_every == 0:
                save()

        finished = _learn(run, [keep, *listeners], should_stop)
        if run.history[-1].episode != kept:
            save()
    if finished:
        maps = beside_optimum(run.agent.online, config)
        picture = pictures.finished_run(run.history, config.environment, _levels(config), maps)
        write_atomically(folder.picture, picture)
    return finished


def _learn(
    run: Run,
    listeners: Iterable[Callable[[EpisodeRecord], None]],
    should_stop: Callable[[], bool],
) -> bool:
    """Goes on to the run's end, or to where it should stop; returns whether it is finished."""
    for record in run.episodes():
        for listener in listeners:
            listener(record)
        if should_stop() and record.episode + 1 < run.config.episodes:
            return False
    return True


def _levels(config: Config) -> dict[str, float]:
    """Mean returns of episodes as long as a training one to compare it with, by name."""
    best = best_training_return(config)
    if math.isnan(best):
        return {}
    chance = random_return(config.environment, config.gravity, config.episode_steps)
    return {"best possible": best, "random actions": chance}
