"""A run as TensorBoard shows it: curves, and maps of the phase plane."""

from __future__ import annotations

import importlib.util
import math
import os
from typing import TYPE_CHECKING, Any

from keras_pendulum.config import Config
from keras_pendulum.errors import UserError

if TYPE_CHECKING:
    from keras_pendulum.episodes import EpisodeRecord
    from keras_pendulum.network import DQN

_EPISODES_BETWEEN_MAPS = 50  # a map takes half a second to draw


class TensorBoardLog:
    """Writes what `train_dqn` tells its `listeners` and `on_checkpoint` into a folder.

    Args:
        folder: for the event files; made when the first episode is over.
        config: of the run.

    Raises UserError when the package tensorboard is not installed.
    """

    def __init__(self, folder: str | os.PathLike[str], config: Config) -> None:
        if importlib.util.find_spec("tensorboard") is None:
            raise UserError("tensorboard is not installed: pip install tensorboard")
        self._folder = os.fspath(folder)
        self._config = config
        self._opened: Any = None

    def __call__(self, record: EpisodeRecord) -> None:
        """Takes in one more episode."""
        import tensorflow as tf

        values = {
            "return": record.episode_return,
            "average reward a step": record.average_reward,
            "epsilon": record.epsilon,
            "loss": record.loss,
            "seconds": record.seconds,
        }
        with self._writer().as_default(step=record.episode):
            for name, value in values.items():
                if not math.isnan(value):
                    tf.summary.scalar(name, value)

    def on_checkpoint(self, network: DQN, episode: int) -> None:
        """Adds maps of the network's torques and values, where it is of the pendulum."""
        import tensorflow as tf

        from keras_pendulum import pictures
        from keras_pendulum.phase_plane import beside_optimum

        last = episode == self._config.episodes - 1
        if last or episode % _EPISODES_BETWEEN_MAPS == 0:
            planes = beside_optimum(network, self._config)
            if planes:
                picture = tf.io.decode_png(pictures.phase_planes(planes))
                with self._writer().as_default(step=episode):
                    tf.summary.image("phase plane", picture[tf.newaxis])
        self._writer().flush()

    def _writer(self) -> Any:
        import tensorflow as tf

        if self._opened is None:
            self._opened = tf.summary.create_file_writer(self._folder)
        return self._opened
