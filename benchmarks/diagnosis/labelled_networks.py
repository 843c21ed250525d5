"""Networks whose faults are known, for `benchmarks.diagnosis.single_faults` and its like."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.diagnosis.faults import (
    ACTING,
    ACTIVATIONS,
    HEALTHY,
    HEALTHY_10,
    SIZES,
    TRAINING,
    Acting,
    Training,
    exists,
)
from keras_pendulum.config.config import Config
from keras_pendulum.environments.pendulum import Pendulum

if TYPE_CHECKING:
    from keras_pendulum.diagnosis.measurement import Measurement

FAULTS = [*TRAINING, *ACTING]
# Two faults at once: one in the settings of the run, one in its data or in how it acts.
OF_THE_SETTINGS = ("learning-rate", "forgetting", "exploration")
OF_THE_DATA = (
    "untrained-outputs",
    "reward-sign",
    "reward-scale",
    "misaligned-transitions",
    "no-bootstrapping",
    "torque-map",
    "observation-map",
    "other-gravity",
)
PAIRS = [*combinations(OF_THE_SETTINGS, 2), *product(OF_THE_DATA, OF_THE_SETTINGS)]


@dataclass(frozen=True)
class Case:
    """A network with its faults: (fault, variant) each; none for a healthy one."""

    faults: tuple[tuple[str, str], ...]
    gravity: float
    hidden_units: tuple[int, ...]
    activation: str
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the faults."""
        return tuple(fault for fault, _ in self.faults)

    @property
    def trainings(self) -> list[Training]:
        """The faults of the training."""
        return [TRAINING[fault][variant] for fault, variant in self.faults if fault in TRAINING]

    @property
    def actings(self) -> list[Acting]:
        """The faults outside the training."""
        return [ACTING[fault][variant] for fault, variant in self.faults if fault in ACTING]

    @property
    def key(self) -> str:
        """A name of the case."""
        kinds = [f"{fault}_{variant}" for fault, variant in self.faults]
        size = "-".join(map(str, self.hidden_units))
        parts = ["+".join(kinds) or "healthy", f"g{self.gravity:g}", size, self.activation]
        return "_".join([*parts, str(self.seed)])

    @property
    def folder(self) -> str:
        """The name of the run's folder; a fault of the acting has that of the healthy run."""
        faults = tuple(each for each in self.faults if each[0] in TRAINING)
        return replace(self, faults=faults).key

    @property
    def healthy(self) -> Config:
        """The settings of a run without a fault."""
        return replace(
            HEALTHY_10 if self.gravity == 10 else HEALTHY,
            hidden_units=self.hidden_units,
            activation=self.activation,
            seed=self.seed,
        )

    @property
    def config(self) -> Config:
        """The settings of the run."""
        config = self.healthy
        for training in self.trainings:
            config = config.change(**training.settings)
        return config

    @property
    def declared(self) -> Config:
        """The settings that the user believes in."""
        hidden = {name for training in self.trainings for name in training.hidden}
        config = self.config.change(**{name: getattr(self.healthy, name) for name in hidden})
        for acting in self.actings:
            if acting.gravity is not None:
                config = config.change(gravity=acting.gravity)
        return config


def single_cases(seeds: Iterable[int]) -> Iterator[Case]:
    """Yields for each seed a healthy network, and one for each fault."""
    for seed in seeds:
        random = np.random.RandomState(seed)
        yield _case((), seed, random)
        for fault in FAULTS:
            yield _case((fault,), seed, random)


def pair_cases(seeds: Iterable[int]) -> Iterator[Case]:
    """Yields for each seed a third of the pairs: three seeds have all."""
    for seed in seeds:
        random = np.random.RandomState(seed)
        for pair in PAIRS[seed % 3 :: 3]:
            yield _case(pair, seed, random)


def _case(faults: tuple[str, ...], seed: int, random: np.random.RandomState) -> Case:
    """Returns a case: one seed, one size and activation; every fourth seed is for g = 10.

    A fault that costs nothing at g = 10 is trained at g = 1.
    """
    shape = np.random.RandomState(seed)
    size, activation = SIZES[shape.randint(3)], ACTIVATIONS[shape.randint(2)]
    for gravity in (10.0, 1.0) if seed % 4 == 3 else (1.0,):
        variants = [
            [name for name in (TRAINING | ACTING)[fault] if exists(fault, name, gravity)]
            for fault in faults
        ]
        if all(variants):
            break
    chosen = tuple(
        (fault, names[random.randint(len(names))])
        for fault, names in zip(faults, variants, strict=True)
    )
    return Case(chosen, gravity, size, activation, seed)


def train_case(case: Case, folder: Path) -> Path:
    """Trains the network of a case if `folder` has none; returns its checkpoint."""
    path = folder / case.folder / "pendulum_weight.h5"
    if not path.exists():
        train_config(case.config, case.trainings, path)
    return path


def train_config(config: Config, trainings: Iterable[Training], path: Path) -> None:
    """Trains with the faults of `trainings`, and writes the checkpoint.

    A run that diverges ends there: its checkpoint holds the last finite weights.
    """
    import keras

    from keras_pendulum.errors import UserError
    from keras_pendulum.train.checkpoint import save_checkpoint
    from keras_pendulum.train.loop import train_episodes
    from keras_pendulum.train.run import make_run

    run = make_run(config)
    for training in trainings:
        training.swap(run)
    try:
        for _ in train_episodes(run):
            pass
    except UserError as error:
        print(f"{path.parent.name}: {error}")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_checkpoint(run, path)
    keras.backend.clear_session()


def measurement_of(case: Case, checkpoint: Path, recorded: bool = False) -> Measurement:
    """Returns the agent of a case with the task that its user declares.

    Args:
        case: the case.
        checkpoint: of its run.
        recorded: whether the record of its run is used.
    """
    from keras_pendulum.diagnosis.measurement import Measurement
    from keras_pendulum.diagnosis.run_record import read_record
    from keras_pendulum.evaluate.q_policies import DQNPolicy
    from keras_pendulum.storage.load_weights import load_weights
    from keras_pendulum.storage.run_folder import find_run

    class ActingPolicy(DQNPolicy):
        """The policy of a network with faults that it has only when it acts."""

        def q_values(self, observations: ArrayLike) -> NDArray[Any]:
            seen = np.asarray(observations, np.float32)
            for acting in case.actings:
                seen = acting.observations(seen)
            q: NDArray[Any] = self._greedy.q_values(seen).astype(float)
            for acting in case.actings:
                q = acting.q_values(q)
            return q

        def act(self, observations: NDArray[np.float32]) -> NDArray[Any]:
            return self.actions.values.take(self.q_values(observations).argmax(axis=1), axis=0)

    network, declared = load_weights(checkpoint), case.declared
    for acting in case.actings:
        network.set_weights(acting.weights(network.get_weights()))
    policy = ActingPolicy(network, name=case.folder)
    record = None
    if recorded:
        record = replace(read_record(find_run(checkpoint.parent)), config=declared)
    task = Pendulum(declared.gravity or 0.0)
    return Measurement(policy, task, declared.discount, declared.reward_scale, record)
