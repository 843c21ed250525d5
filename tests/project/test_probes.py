"""examples/probes.py: each probe has the values that it says, and finds the faults of its row."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import pytest
from conftest import ROOT

from keras_pendulum.exercise.program import program

PAGE = (ROOT / "docs" / "my_dqn_does_not_learn.md").read_text(encoding="utf-8")
STORE = "buffer.store(s, a, REWARD_SCALE * r, next_s, terminated)"
# The first probe that fails, and what is replaced in my_dqn.py, by the words of the page.
FAULTS: dict[str, tuple[str, str, str]] = {
    "an end without `1 - ended`": ("OneState-v0", " * (1 - ended)", ""),
    "rewards with the wrong sign": ("OneState-v0", "REWARD_SCALE * r,", "-REWARD_SCALE * r,"),
    "(B, 1) minus (B,) in the loss": (
        "ByObservation-v0",
        "tf.gather(online(s), a, batch_dims=1)",
        "tf.gather(online(s), a, batch_dims=1)[:, None]",
    ),
    "a last layer with ReLU or softmax": (
        "ByObservation-v0",
        "Dense(len(ACTIONS))",
        'Dense(len(ACTIONS), activation="relu")',
    ),
    "a target network that is never copied": (
        "Delayed-v0",
        "target.set_weights(online.get_weights())  # [20]",
        "pass",
    ),
    "s in place of s′, or s′ in place of s": ("Delayed-v0", STORE, STORE.replace("next_s", "s")),
    "every step stored as an end": ("Delayed-v0", "next_s, terminated)", "next_s, True)"),
    "a maximum over the batch": (
        "Delayed-v0",
        "tf.reduce_max(target(next_s), axis=1)",
        "tf.reduce_max(target(next_s))",
    ),
    "the value of another action than the taken one": (
        "ByAction-v0",
        "tf.gather(online(s), a, batch_dims=1)",
        "online(s)[:, 0]",
    ),
    "a mean in place of the maximum": (
        "Both-v0",
        "tf.reduce_max(target(next_s), axis=1)",
        "tf.reduce_mean(target(next_s), axis=1)",
    ),
    "a last layer with tanh": (
        "Both-v0",
        "Dense(len(ACTIONS))",
        'Dense(len(ACTIONS), activation="tanh")',
    ),
}


def module_of(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # where TensorFlow finds the source
    spec.loader.exec_module(module)
    return module


probes = module_of(ROOT / "examples" / "probes.py")


def trained(text: str, name: str, folder: Path, steps: int = 2_000) -> Any:
    """Returns the network that a program with this text learns in a probe."""
    path = folder / "my_dqn.py"
    path.write_text(text, encoding="utf-8")
    return probes.train_my_dqn(name, module_of(path), steps)


@pytest.mark.parametrize("name", probes.PROBES)
def test_program_without_a_fault_learns_the_right_values(name: str, tmp_path: Path) -> None:
    assert probes.check(trained(program(0), name, tmp_path), name)


@pytest.mark.parametrize("fault", FAULTS)
def test_probe_finds_the_fault_and_the_one_before_it_does_not(fault: str, tmp_path: Path) -> None:
    name, old, new = FAULTS[fault]
    text = program(0)
    assert text.count(old) == 1
    text = text.replace(old, new)
    names = list(probes.PROBES)
    before = names[: names.index(name)][-1:]
    assert all(probes.check(trained(text, each, tmp_path, 1_200), each) for each in before)
    assert not probes.check(trained(text, name, tmp_path, 1_200), name)


def test_page_lists_the_probes_in_their_order_with_these_faults() -> None:
    rows = re.findall(r"^\| `(\w+-v0)` \|.*\| ([^|]+) \|$", PAGE, re.MULTILINE)
    assert [name for name, _ in rows] == list(probes.PROBES)
    for name, cell in rows:
        assert cell.split("; ") == [fault for fault, (probe, *_) in FAULTS.items() if probe == name]


@pytest.mark.parametrize("name", probes.PROBES)
def test_right_values_are_those_of_the_best_actions(name: str) -> None:
    discount = 0.9
    observations, values = probes.PROBES[name].right_values(discount)
    right = {observed[0]: row for observed, row in zip(observations, values, strict=True)}
    env = gymnasium.make(name)
    seen = set()
    for seed in range(20):
        for action in range(len(values[0])):
            observation, _ = env.reset(seed=seed)
            ended = False
            while not ended:
                state = float(observation[0])
                seen.add(state)
                observation, reward, ended, _, _ = env.step(action)
                following = 0.0 if ended else discount * max(right[float(observation[0])])
                assert right[state][action] == pytest.approx(float(reward) + following)
    assert seen == set(right)


def test_values_of_another_shape_are_wrong() -> None:
    assert not probes.check(lambda observations: observations[:, 0], "OneState-v0")
