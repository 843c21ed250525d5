"""Training as a function: a run, its listeners, and the files that it leaves."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Iterable, Sequence

from keras_pendulum.config.config import Config
from keras_pendulum.dqn.network import DQN
from keras_pendulum.errors import UserError, require_type
from keras_pendulum.evaluate.evaluation import evaluate_policy
from keras_pendulum.evaluate.score import Score
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.atomic_write import write_atomically
from keras_pendulum.storage.run_folder import RunFolder
from keras_pendulum.tensorflow_setup import require_own_tensorflow, warn_if_not_reproducible
from keras_pendulum.train.checkpoint import CheckpointWriter, load_checkpoint, save_checkpoint
from keras_pendulum.train.evaluations import greedy_regret
from keras_pendulum.train.folder_files import run_listeners
from keras_pendulum.train.listeners import FunctionListener, Listener, Phase
from keras_pendulum.train.loop import train_episodes
from keras_pendulum.train.progress import make_progress
from keras_pendulum.train.result import TrainingResult
from keras_pendulum.train.run import Run, make_run


def train_dqn(
    config: Config,
    out: str | os.PathLike[str] | None = None,
    *,
    init: DQN | None = None,
    render: bool = False,
    overwrite: bool = False,
    resume: bool = False,
    listeners: Iterable[Listener | Callable[[EpisodeRecord], None]] = (),
    on_checkpoint: Callable[[DQN, int], None] = lambda network, episode: None,
    on_phase: Callable[[Phase], None] = lambda phase: None,
    should_stop: Callable[[], bool] = lambda: False,
    progress: bool = False,
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
        listeners: called with the record of each episode. A `Listener` follows checkpoints and
            phases too.
        on_checkpoint: called with the network and the episode at each checkpoint.
        on_phase: called with `compiling`, `evaluating` or `drawing` when that phase starts. The
            next record ends the phase.
        should_stop: called after each episode; true ends the run there, with a checkpoint.
        progress: shows a progress bar on a terminal and in a notebook, else a line per episode.

    Raises:
        ConfigError: the settings do not fit `init` or the checkpoint.
        WeightsError: the checkpoint is damaged.
        UserError: `resume` is combined with `init` or `overwrite`; `keep_best` or `snapshots` has
            no `out`; `out` holds no run to resume, is in use, cannot be written or is moved
            meanwhile; this process is a fork of one with TensorFlow; or an observation, a reward,
            a loss or a weight is not finite. The last checkpoint then holds finite weights.
        TypeError: `config` is not a Config, or `init` not a DQN.

    >>> result = kp.train_dqn(kp.preset(episodes=2))  # too few for an update
    >>> [record.updates for record in result.history], result.finished
    ([0, 0], True)
    """
    if isinstance(config, str):
        raise TypeError(f"config is {config!r}; expected Config, such as kp.preset({config!r})")
    require_type("config", config, Config)
    if init is not None:
        require_type("init", init, DQN)
    if resume and (init is not None or overwrite):
        raise UserError("resume continues a run; init and overwrite start a new one")
    if config.keep_best and out is None:
        raise UserError("keep_best needs `out`, the folder for the best weights")
    if config.snapshots and out is None:
        raise UserError("snapshots needs `out`, the folder for the snapshots")
    require_own_tensorflow()
    warn_if_not_reproducible()
    folder = None if out is None else RunFolder(out, config.environment)
    followers = [
        each if isinstance(each, Listener) else FunctionListener(on_episode=each)
        for each in listeners
    ]
    followers.append(FunctionListener(on_checkpoint=on_checkpoint, on_phase=on_phase))
    with contextlib.ExitStack() as stack:
        if progress:
            bar = make_progress(config)
            followers.append(bar)
            stack.callback(bar.end)
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
                stack.enter_context(folder.lock())
                folder.require_unused(overwrite)
                # The checkpoint comes before the other files: a run killed now can be resumed, and
                # no policy of another run stays in the folder.
                save_checkpoint(run, folder.weights)
                folder.remove_old_run()
        score = None
        if folder is None:
            finished = _train(run, followers, should_stop)
        else:
            with CheckpointWriter(folder.weights, folder.require_not_moved) as writer:
                all_listeners = run_listeners(run, folder, writer, followers)
                folder.start_files(config, run.history)
                finished = _train(run, all_listeners, should_stop)
            if finished:
                run.announce("evaluating")
                score = evaluate_policy(run.agent.online)
        result = TrainingResult(run.agent.online, run.history, finished, score)
        for follower in followers:
            follower.on_result(result)
        if folder is not None and score is not None:
            run.announce("drawing")
            _draw(run, folder, score)
    return result


def _train(run: Run, listeners: Sequence[Listener], should_stop: Callable[[], bool]) -> bool:
    """Trains to the last episode or until `should_stop`; returns whether the run is finished."""

    def announce(phase: Phase) -> None:
        for listener in listeners:
            listener.on_phase(phase)

    run.announce = announce
    for listener in listeners:
        listener.on_start()
    for record in train_episodes(run, greedy_regret):
        for listener in listeners:
            listener.on_episode(record)
        if should_stop():
            break
    for listener in listeners:
        listener.on_end()
    return len(run.history) == run.config.episodes


def _draw(run: Run, folder: RunFolder, score: Score) -> None:
    """Writes the picture of a finished run, with its score in the title.

    A picture that cannot be made is a warning: the run itself is complete.
    """
    from keras_pendulum.figures.run_figure import draw_run
    from keras_pendulum.optimum.phase_plane import run_phase_planes
    from keras_pendulum.train.reference_returns import reference_returns, run_title

    config = run.config
    try:
        planes = run_phase_planes(run.agent.online, config)
        returns, title = reference_returns(config), run_title(config, score)
        picture = draw_run(run.history, config.task, returns, planes, title)
        write_atomically(folder.picture, picture)
    except Exception as error:  # such as too many open files, or no font
        warnings.warn(
            f"cannot draw {folder.picture}: {error or type(error).__name__}; the run is saved, and "
            "--resume draws it",
            stacklevel=2,
        )
