"""How often a diagnosis finds a fault in a healthy network.

    python -m benchmarks.diagnosis.healthy_networks FOLDER [FIRST_SEED PERCENT]

Trains 44 networks without a fault in FOLDER, or this share of them: with the presets, and with the
settings of a short run of `benchmarks.diagnosis.faults`, by the PyTorch twin of tests/torch, by
Stable-Baselines3 and by this package. COUNTS says how many of each. Each is diagnosed alone, and
with its run's record where it has one. The command may be stopped and started again. Remove
FOLDER/healthy.jsonl after a change of the rules. Needs the extra `bench`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.diagnosis.faults import ACTIVATIONS, SIZES
from benchmarks.diagnosis.labelled_networks import Case, train_config
from benchmarks.diagnosis.single_faults import counts
from benchmarks.learning.other_libraries import train_sb3
from benchmarks.result_files import ROOT, Row, write
from benchmarks.resumable import Result, measure_each
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import preset

COUNTS = {
    "reference": 10,
    "swingup": 4,
    "PyTorch twin": 10,
    "Stable-Baselines3": 10,
    "short run": 10,
}


@dataclass(frozen=True)
class Network:
    """A healthy network: how it is trained, and with which settings."""

    kind: str
    config: Config

    @property
    def name(self) -> str:
        """The name of its folder."""
        config = self.config
        size = "-".join(map(str, config.hidden_units))
        kind = self.kind.replace(" ", "-")
        return f"{kind}_g{config.gravity:g}_{size}_{config.activation}_{config.seed}"


def networks(first_seed: int, percent: int = 100) -> Iterator[Network]:
    """Yields so many of the networks, but one of each kind. The first of a preset is shipped."""
    for kind, count in COUNTS.items():
        for index in range(max(1, round(count * percent / 100))):
            seed = first_seed + index
            if kind in ("reference", "swingup"):
                yield Network(kind, preset(kind) if index == 0 else preset(kind, seed=seed))
                continue
            gravity = 10.0 if kind == "short run" and index % 4 == 3 else 1.0
            random = np.random.RandomState(seed)
            size, activation = SIZES[random.randint(3)], ACTIVATIONS[random.randint(2)]
            if kind != "short run":
                activation = "tanh"  # the only one of both
            yield Network(kind, Case((), gravity, size, activation, seed).config)


def train(network: Network, folder: Path) -> Path:
    """Trains a network if `folder` has none; returns its file."""
    from keras_pendulum.storage.find_weights import find_weights

    config = network.config
    if network.kind in ("reference", "swingup") and config.seed == 0:
        return Path(find_weights(network.kind))
    path = folder / network.name / "pendulum_weight.h5"
    if not path.exists():
        if network.kind == "PyTorch twin":
            _save(config, _train_twin(config), path)
        elif network.kind == "Stable-Baselines3":
            _save(config, train_sb3(config), path)
        else:
            train_config(config, [], path)
    return path


def _save(config: Config, weights: list[NDArray[np.float32]], path: Path) -> None:
    import keras_pendulum as kp

    network = kp.DQN(config.hidden_units, config.torque_count, activation=config.activation)
    network.set_weights(weights)
    path.parent.mkdir(parents=True, exist_ok=True)
    kp.save_weights(network, path)


def _train_twin(config: Config) -> list[NDArray[np.float32]]:
    """Trains with the updates of the PyTorch twin; returns the weights."""
    sys.path.insert(0, str(ROOT / "tests" / "torch"))
    import torch
    import torch_agent as twin

    from keras_pendulum.dqn.policy import GreedyPolicy
    from keras_pendulum.train.loop import train_episodes
    from keras_pendulum.train.run import make_run

    torch.set_num_threads(1)
    run = make_run(config)
    online = twin.from_keras(run.agent.online.get_weights())
    agent = twin.Agent(
        online,
        twin.from_keras(run.agent.online.get_weights()),
        twin.q_learning,
        partial(twin.soft_update, config.tau),
        twin.KerasAdam(
            online.parameters(), twin.cosine_rate(config.learning_rate, config.total_updates)
        ),
        twin.mean_squared_error,
        config.discount,
    )

    def update(batches: Any) -> Any:
        losses = agent.update(twin.Transitions(*map(torch.from_numpy, batches)))
        run.agent.policy = GreedyPolicy(twin.to_keras(online), config.activation)
        return losses

    run.agent.update = update  # type: ignore[method-assign]
    for _ in train_episodes(run):
        pass
    weights: list[NDArray[np.float32]] = twin.to_keras(online)
    return weights


def diagnose_network(network: Network, folder: Path) -> Result:
    """Returns the findings on a network, alone and with its run's record."""
    import keras_pendulum as kp
    from keras_pendulum.diagnosis.diagnose import diagnose_measurement
    from keras_pendulum.diagnosis.run_record import read_record
    from keras_pendulum.storage.run_folder import find_run

    config, path = network.config, train(network, folder)
    alone = kp.diagnose(path, gravity=config.gravity, discount=config.discount)
    result: Result = {
        "kind": network.kind,
        "regret": round(alone.measurement.regret, 2),
        "little": round(alone.measurement.regret_tolerance, 2),
        "findings": [finding.name for finding in alone.findings],
    }
    if folder in path.parents and network.kind not in ("PyTorch twin", "Stable-Baselines3"):
        record = read_record(find_run(path.parent))
        known = diagnose_measurement(replace(alone.measurement, record=record))
        result["findings"] += [finding.name for finding in known.findings]
    return result


def summarize(results: list[Result]) -> list[Row]:
    """Returns a row for each kind, and one for all."""
    rows = []
    for kind in [*COUNTS, "all"]:
        own = [result for result in results if kind in ("all", result["kind"])]
        if not own:
            continue
        rows.append(
            {
                "trained as": kind,
                "networks": len(own),
                "with a finding": sum(bool(result["findings"]) for result in own),
                "findings": counts(name for each in own for name in set(each["findings"])),
                "largest regret": max(result["regret"] for result in own),
            }
        )
    return rows


def main(folder: str, first_seed: str = "700", percent: str = "100") -> None:
    """Trains, diagnoses and writes the results."""
    chosen = networks(int(first_seed), int(percent))
    items = ((each.name, partial(diagnose_network, each, Path(folder))) for each in chosen)
    results = measure_each(items, folder, "healthy")
    command = f"python -m benchmarks.diagnosis.healthy_networks FOLDER {first_seed} {percent}"
    write("diagnosis_healthy", command, summarize(results))


if __name__ == "__main__":
    main(*sys.argv[1:])
