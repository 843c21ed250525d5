"""Training as a function: a run, its listeners, and the files that it leaves."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

from keras_pendulum.config.config import Config
from keras_pendulum.dqn.network import DQN
from keras_pendulum.errors import UserError, require_type
from keras_pendulum.evaluate.evaluation import evaluate_policy
from keras_pendulum.evaluate.score import Score
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.phase_plane import run_phase_planes
from keras_pendulum.storage.atomic_write import write_atomically
from keras_pendulum.tensorflow_setup import warn_if_not_reproducible
from keras_pendulum.train import run_figure
from keras_pendulum.train.checkpoint import CheckpointWriter, load_checkpoint, save_checkpoint
from keras_pendulum.train.evaluations import BestWeights, evaluate_if_due
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.reference_returns import reference_returns, run_title
from keras_pendulum.train.run import Run, make_run
from keras_pendulum.train.run_folder import RunFolder
from keras_pendulum.train.snapshots import Snapshots

Phase = Literal["compiling", "evaluating", "drawing"]


@dataclass(frozen=True)
class TrainingResult:
    """The trained network, and the record of each episode."""

    network: DQN  #: the network after the last update
    history: list[EpisodeRecord]  #: one record per episode, with the names of history.csv's columns
    finished: bool  #: false where `should_stop` ended the run before its last episode
    score: Score | None = None  #: greedy, of a finished run with a folder, for the picture's title


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
    on_phase: Callable[[Phase], None] = lambda phase: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> TrainingResult:
    """Trains a DQN.

    Args:
        config: the settings; `preset` returns them.
        out: folder for checkpoint, history, settings and picture; None writes no file.
        init: a network whose weights replace the seeded initial weights.
        render: whether to show the environment in a window, at its own speed.
        overwrite: replaces a run that `out` already holds.
        resume: continues from the checkpoint in `out`; `config` may change only `episodes`,
            `save_every`, `evaluate_every`, `keep_best` and `snapshots`.
        listeners: called with the record of each episode.
        on_checkpoint: called with the network and the episode at each checkpoint.
        on_phase: called when another phase than the training begins. A record ends it.
        should_stop: called after each episode; true ends the run there, with a checkpoint.

    Raises:
        ConfigError: the settings do not fit `init` or the checkpoint.
        WeightsError: the checkpoint is damaged.
        UserError: `resume` is combined with `init` or `overwrite`; `keep_best` or `snapshots` has
            no `out`; `out` holds no run to resume, is in use, cannot be written or is moved
            meanwhile; or an observation, a reward, a loss or a weight is not finite. The last
            checkpoint then holds finite weights.
        TypeError: `config` is no Config, or `init` is no DQN.
    """
    require_type("config", config, Config)
    if init is not None:
        require_type("init", init, DQN)
    if resume and (init is not None or overwrite):
        raise UserError("resume continues a run; init and overwrite start a new one")
    if config.keep_best and out is None:
        raise UserError("keep_best needs `out`, the folder for the best weights")
    if config.snapshots and out is None:
        raise UserError("snapshots needs `out`, the folder for the snapshots")
    hooks = _Hooks(list(listeners), on_checkpoint, on_phase, should_stop)
    warn_if_not_reproducible()
    folder = None if out is None else RunFolder(out, config.environment)
    with contextlib.ExitStack() as stack:
        if resume:
            if folder is None:
                raise UserError("resume needs `out`, the folder of the run")
            folder.require_run()
            stack.enter_context(folder.lock())
            run = load_checkpoint(folder.weights, config, render)
            stack.callback(run.env.close)
        else:
            run = make_run(config, init, render)
            stack.callback(run.env.close)
            if folder is not None:
                folder.create()
                stack.enter_context(folder.lock())
                folder.require_unused(overwrite)
                # The checkpoint comes before the other files: a run killed now can be resumed, and
                # no policy of another run stays in the folder.
                save_checkpoint(run, folder.weights)
                folder.remove_old_run()
        run.agent.on_compile = lambda: on_phase("compiling")
        score = None
        if folder is None:
            finished = _train(run, hooks)
        else:
            best = BestWeights(folder.best, run.history) if config.keep_best else None
            snapshots = Snapshots(folder.snapshots, run) if config.snapshots else None
            folder.start_files(config, run.history)
            finished = _train_in_folder(run, folder, best, snapshots, hooks)
            if finished:
                score = _draw(run, folder, hooks)
    return TrainingResult(run.agent.online, run.history, finished, score)


@dataclass(frozen=True)
class _Hooks:
    """The caller's functions; see `train_dqn`."""

    listeners: list[Callable[[EpisodeRecord], None]]
    on_checkpoint: Callable[[DQN, int], None]
    on_phase: Callable[[Phase], None]
    should_stop: Callable[[], bool]


def _train_in_folder(
    run: Run,
    folder: RunFolder,
    best: BestWeights | None,
    snapshots: Snapshots | None,
    hooks: _Hooks,
) -> bool:
    """Trains as `_train` does, and writes history, checkpoints, best weights and snapshots."""
    config = run.config
    last_saved = -1  # the episode of the last checkpoint
    with CheckpointWriter(folder.weights, folder.require_not_moved) as writer:

        def save() -> None:
            nonlocal last_saved
            last_saved = run.history[-1].episode
            folder.restore_history(run.history)
            writer.save(run)
            hooks.on_checkpoint(run.agent.online, last_saved)

        def write_files(record: EpisodeRecord) -> None:
            folder.append(record)
            if snapshots is not None:
                snapshots.take_if_due(run, writer)
            is_best = best is not None and best.are_beaten_by(record)
            if is_best or record.episode % config.save_every == 0:
                save()
            if best is not None and is_best:
                best.write(run, writer)

        if best is not None and run.history and best.are_beaten_by(run.history[-1]):
            best.write(run, writer)  # the run was killed between the two files
        if snapshots is not None:
            snapshots.take_if_due(run, writer)  # the initial network
        finished = _train(run, hooks, write_files)
        if run.history[-1].episode != last_saved:
            save()
    return finished


def _draw(run: Run, folder: RunFolder, hooks: _Hooks) -> Score:
    """Evaluates the finished run and writes its picture; returns the score in its title."""
    config = run.config
    hooks.on_phase("evaluating")
    score = evaluate_policy(run.agent.online)
    hooks.on_phase("drawing")
    planes = run_phase_planes(run.agent.online, config)
    returns = reference_returns(config)
    title = run_title(config, score)
    try:
        picture = run_figure.draw_run(run.history, config.environment, returns, planes, title)
    except (OSError, ImportError) as error:  # such as too many open files
        raise UserError(
            f"cannot draw {folder.picture}: {error}; the run is saved, and --resume draws it"
        ) from error
    write_atomically(folder.picture, picture)
    return score


def _train(run: Run, hooks: _Hooks, *first_listeners: Callable[[EpisodeRecord], None]) -> bool:
    """Trains to the last episode or until `should_stop`; returns whether the run is finished."""
    for _ in train_episodes(run):
        record = evaluate_if_due(run, lambda: hooks.on_phase("evaluating"))
        for listener in (*first_listeners, *hooks.listeners):
            listener(record)
        if hooks.should_stop() and record.episode + 1 < run.config.episodes:
            return False
    return True
