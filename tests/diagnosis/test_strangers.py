"""Tests of the programs on which the diagnosis is measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.diagnosis import strangers
from benchmarks.diagnosis.stranger_programs import MISTAKES, Program, train
from keras_pendulum.diagnosis.faults import FAULTS

OBSERVATIONS = np.random.RandomState(0).normal(size=(5, 3)).astype(np.float32)


def test_every_mistake_has_a_finding() -> None:
    assert {mistake.finding for mistake in MISTAKES.values()} <= set(FAULTS)


@pytest.mark.parametrize("library", ["torch", "keras"])
@pytest.mark.parametrize("head", ["linear", "softmax", "tanh"])
def test_numpy_values_are_those_of_the_library(library: str, head: str) -> None:
    from benchmarks.diagnosis.stranger_programs import _network

    program = Program(library=library, head=head, torque_count=5, hidden=(8,), steps=260)
    trained = train(program)
    network = _network(program)
    if library == "torch":
        import torch

        for parameter, weights in zip(network.online.parameters(), trained.weights, strict=True):
            parameter.data = torch.from_numpy(weights.T.copy())
        expected = network.q_values(OBSERVATIONS)
    else:
        network.online.set_weights(trained.weights)
        expected = network.online(OBSERVATIONS).numpy()
    assert trained.q_values(OBSERVATIONS) == pytest.approx(expected, abs=1e-5)


def test_programs_of_both_libraries_learn_the_same_targets() -> None:
    """Compares the loss that each mistake minimises: one update from the same weights."""
    from benchmarks.diagnosis.stranger_keras import KerasNetwork
    from benchmarks.diagnosis.stranger_torch import TorchNetwork

    random = np.random.RandomState(1)
    batch = (
        OBSERVATIONS,
        np.array([0, 2, 1, 1, 0]),
        random.normal(size=5).astype(np.float32),
        OBSERVATIONS[::-1].copy(),
        np.zeros(5, np.float32),
    )
    mistakes: list[dict[str, Any]] = [
        {"target": name}
        for name in ("max", "mean", "min", "first", "same-action", "negative", "batch-max", "index")
    ] + [
        {"loss": "same-target"},
        {"loss": "zero-others"},
        {"loss": "broadcast"},
        {"through_target": True},
    ]
    for changes in mistakes:
        program = Program(torque_count=3, hidden=(4,), learning_rate=1e-2, **changes)
        keras_network, torch_network = KerasNetwork(program), TorchNetwork(program)
        import torch

        for parameter, weights in zip(
            torch_network.online.parameters(), keras_network.weights(), strict=True
        ):
            parameter.data = torch.from_numpy(weights.T.copy())
        torch_network.copy()
        keras_network.copy()
        for _ in range(3):
            keras_network.update(batch)
            torch_network.update(batch)
        for found, expected in zip(torch_network.weights(), keras_network.weights(), strict=True):
            assert found == pytest.approx(expected, abs=1e-3), changes


def test_benchmark_uses_its_networks_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = []

    def short(program: Program, wrap: Callable[[Any], Any]) -> object:
        calls.append(program)
        return train(Program(steps=210, hidden=(4,), torque_count=3, seed=program.seed), wrap)

    monkeypatch.setattr(strangers, "train", short)
    kinds = ["right", "no replay"]
    monkeypatch.setattr(strangers, "KINDS", {"Pendulum-v1": kinds})
    monkeypatch.setattr(
        strangers, "make_program", lambda changes, seed: Program(hidden=(4,), torque_count=3)
    )
    written: list[list[dict[str, object]]] = []
    monkeypatch.setattr(strangers, "write", lambda name, command, rows: written.append(rows))
    strangers.main(str(tmp_path), "Pendulum-v1", "1", "1")
    assert len(calls) == 3
    assert [row["program"] for row in written[0]] == [
        *(*kinds, "all mistakes", "all right programs")
    ]
    strangers.main(str(tmp_path), "Pendulum-v1", "1", "1")
    assert len(calls) == 3 and written[0] == written[1]
    (tmp_path / "strangers.jsonl").unlink()
    strangers.main(str(tmp_path), "Pendulum-v1", "1", "1")
    assert len(calls) == 3 and written[0] == written[2]


def test_wrong_answers_are_counted() -> None:
    results = [
        {"kind": "right", "regret": 90.0, "little": 9.0, "findings": [["not-converged", ""]]},
        {"kind": "right", "regret": 90.0, "little": 9.0, "findings": [["torque-map", ""]]},
        {"kind": "tanh head", "regret": 90.0, "little": 9.0, "findings": []},
        {"kind": "tanh head", "regret": 9.0, "little": 9.0, "findings": []},
    ]
    rows = {row["program"]: row for row in strangers.summarize(results)}
    assert rows["right"]["right first finding"] == "1 of 2 (50 %)"
    assert rows["tanh head"]["right first finding"] == "0 of 1 (0 %)"
    assert rows["tanh head"]["costs little"] == 1
    assert rows["all right programs"]["instead"] == "torque-map 1"


def test_mistakes_of_the_storage_change_what_is_stored() -> None:
    """Compares the stored steps with what the environment did; no network learns enough here."""
    import keras_pendulum as kp

    recorders: list[Any] = []

    def wrap(env: Any) -> Any:
        recorders.append(kp.Recorder(env))
        return recorders[-1]

    def run(**changes: Any) -> tuple[dict[str, Any], Any]:
        program = Program(steps=260, hidden=(4,), torque_count=5, library="keras", **changes)
        stored = train(program, wrap)
        return stored.steps, recorders[-1].steps

    stored, played = run()
    torques = np.linspace(-2, 2, 5)
    assert np.array_equal(stored["observation"], played.observation)
    assert np.allclose(torques[stored["action"]], played.action)
    stored, played = run(stores_next_index=True)
    assert np.allclose(torques[(stored["action"] - 1) % 5], played.action)
    stored, played = run(stores_greedy=True)
    assert 0.1 < np.mean(torques[stored["action"]] != played.action) < 0.9
    stored, played = run(keeps_first_state=True)
    assert len(np.unique(stored["observation"], axis=0)) == 2
    assert np.array_equal(stored["next_observation"], played.next_observation)
    stored, played = run(capacity=64, consecutive=True, episode_steps=50, truncation_is_end=True)
    assert len(stored["reward"]) == 64 and stored["terminated"].sum() == 2
    assert played.first.sum() == 6
    stored, played = run(start=0.1, env_reward=lambda reward: max(reward, -0.01))
    assert played.reward.min() == pytest.approx(-0.01)
    assert np.abs(played.observation[played.first][:, 1]).max() < 0.1
