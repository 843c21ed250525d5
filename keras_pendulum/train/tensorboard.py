"""Event files for TensorBoard: curves, settings and phase planes of a run."""

from __future__ import annotations

import importlib.util
import math
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any

from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import format_value
from keras_pendulum.errors import UserError
from keras_pendulum.train.listeners import Listener

if TYPE_CHECKING:
    from keras_pendulum.dqn.network import DQN
    from keras_pendulum.history import EpisodeRecord

_EPISODES_BETWEEN_PLANES = 50  # drawing the phase planes takes half a second


class TensorBoardLog(Listener):
    """A listener that writes event files.

    Args:
        folder: folder for the event files; it is created after the first episode.
        config: the settings of the run.

    Raises UserError when the package tensorboard is not installed, or when the folder's name is not
    text.
    """

    def __init__(self, folder: str | os.PathLike[str], config: Config) -> None:
        if importlib.util.find_spec("tensorboard") is None:
            raise UserError("tensorboard is not installed: pip install tensorboard")
        self._folder = os.fspath(folder)
        try:
            self._folder.encode()
        except UnicodeEncodeError as error:  # TensorFlow takes no other names
            raise UserError(
                f"TensorBoard cannot write in {folder}, a name that is not UTF-8: name another "
                "folder with --out, or leave out --tensorboard"
            ) from error
        self._config = config

    def on_episode(self, record: EpisodeRecord) -> None:
        """Writes the figures of an episode."""
        import tensorflow as tf

        values = {
            "rollout/return": record.episode_return,
            "rollout/average_reward": record.average_reward,
            "rollout/epsilon": record.epsilon,
            "rollout/environment_steps": record.environment_steps,
            "train/loss": record.loss,
            "train/updates": record.updates,
            "eval/greedy_regret": record.greedy_regret,
            "time/seconds": record.seconds,
        }
        with self._writer.as_default(step=record.episode):
            for name, value in values.items():
                if not math.isnan(value):
                    tf.summary.scalar(name, value)

    def on_checkpoint(self, network: DQN, episode: int) -> None:
        """Writes the phase planes of the network, every 50 episodes and at the end."""
        import tensorflow as tf

        from keras_pendulum.figures.run_figure import draw_phase_planes
        from keras_pendulum.optimum.phase_plane import run_phase_planes

        is_last = episode == self._config.episodes - 1
        if is_last or episode % _EPISODES_BETWEEN_PLANES == 0:
            planes = run_phase_planes(network, self._config)
            if planes:
                picture = tf.io.decode_png(draw_phase_planes(planes))
                with self._writer.as_default(step=episode):
                    tf.summary.image("phase plane", picture[tf.newaxis])
        self._writer.flush()

    def on_end(self) -> None:
        """Closes the file."""
        if "_writer" in vars(self):  # there was an episode
            self._writer.close()

    @cached_property
    def _writer(self) -> Any:
        import tensorflow as tf
        from tensorboard.plugins.hparams import api

        settings = {  # in the types that TensorBoard's table of runs takes
            name: value if isinstance(value, bool | int | float) else format_value(value)
            for name, value in vars(self._config).items()
        }
        writer = tf.summary.create_file_writer(self._folder)
        with writer.as_default(step=0):
            api.hparams(settings)
        return writer
