"""Greedy evaluations during a run, and the file with the best evaluated weights."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from keras_pendulum.errors import WeightsError
from keras_pendulum.evaluate.evaluation import evaluate_policy
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.storage.quarantine import open_h5
from keras_pendulum.storage.weights import encode_weights
from keras_pendulum.train.checkpoint import CheckpointWriter
from keras_pendulum.train.run import Run

# No result is reported on these starts, so the best weights are not chosen by their result. They
# are among the starts whose optimum every gravity has (`optimal_return.USUAL_SEEDS`).
SEEDS = range(900, 950)


def evaluate_if_due(run: Run, on_evaluate: Callable[[], object]) -> EpisodeRecord:
    """Returns the record of the run's last episode, with its greedy regret where one is due.

    Evaluations are due after `evaluate_every` episodes, twice as many, and so on. The evaluation
    has an environment of its own and draws no random number of the run.

    Args:
        run: a run with at least one episode.
        on_evaluate: called before an evaluation.
    """
    record, every = run.history[-1], run.config.evaluate_every
    if every and (record.episode + 1) % every == 0:
        on_evaluate()
        score = evaluate_policy(run.agent.online, len(SEEDS), SEEDS.start)
        run.history[-1] = record = record._replace(greedy_regret=score.regret)
    return record


class BestWeights:
    """The file with the weights of the best evaluation of a run.

    The file records the regret of its weights, so a resumed run continues with the best so far.

    Args:
        path: the file; it may not exist yet.
        history: the records of the run so far.

    Raises WeightsError when the file is damaged, or when it records no evaluation of this run.
    """

    def __init__(self, path: Path, history: Sequence[EpisodeRecord]) -> None:
        self._path = path
        self._regret = math.inf
        if path.exists():
            with open_h5(path) as file:
                names = ("evaluation/episode", "evaluation/regret")
                found = [float(file.read(name)) for name in names if name in file]
            if found not in [[record.episode, record.greedy_regret] for record in history]:
                raise WeightsError(
                    f"{path}: its weights are not those of an evaluation of this run; move it to "
                    "another folder"
                )
            self._regret = found[1]

    def are_beaten_by(self, record: EpisodeRecord) -> bool:
        """Returns whether an evaluation is as good as the best one; the later of two equals wins.

        It is false for an episode without an evaluation.
        """
        return record.greedy_regret <= self._regret

    def write(self, run: Run, writer: CheckpointWriter) -> None:
        """Replaces the file by the present weights, whose evaluation the last record holds.

        The run's checkpoint must be written before. A run that is killed between the two files
        then writes this one when it is resumed.
        """
        record = run.history[-1]
        evaluation = {
            "episode": np.array(record.episode, np.int64),
            "regret": np.array(record.greedy_regret, np.float64),
        }
        online = run.agent.online
        content = encode_weights(online, online.get_weights(), evaluation=evaluation)
        writer.write(self._path, content)
        self._regret = record.greedy_regret
