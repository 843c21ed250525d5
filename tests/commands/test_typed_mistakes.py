"""What a person types wrong: one line that says what to do."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import keras
import numpy as np
import pytest
from conftest import Command

import keras_pendulum as kp

LONG = "n" * 250


def test_empty_names_are_refused_in_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    network = kp.load_weights("reference")
    for use in (
        lambda: kp.load_weights(""),
        lambda: kp.save_weights(network, ""),
        lambda: kp.train_dqn(kp.preset(episodes=1), out=""),
    ):
        with pytest.raises(kp.UserError, match="is empty"):
            use()
    assert not list(tmp_path.iterdir())


def test_name_of_the_greatest_length_is_written(tmp_path: Path) -> None:
    path = tmp_path / f"{LONG}.h5"
    kp.save_weights(kp.DQN((4,)), path)
    assert kp.load_weights(path).hidden_units == (4,)


def test_name_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(kp.UserError, match="name it FILE"):
        kp.save_weights(kp.load_weights("reference"), tmp_path / "network.keras")


def test_keras_model_of_other_inputs_is_named() -> None:
    model = keras.Sequential([keras.layers.Input((5,)), keras.layers.Dense(5)])
    with pytest.raises(kp.UserError, match=r"inputs of the shape \(None, 5\)"):
        kp.evaluate_policy(model, 1)
    with pytest.raises(kp.UserError, match="expected axis -1 of input shape") as error:
        kp.evaluate_policy(kp.q_function(model), 1)
    assert "\x1b" not in str(error.value) and r"\x1b" not in str(error.value)
    assert "Arguments received" not in str(error.value)


@pytest.mark.parametrize("excess", [2e-7, 1e-6])
def test_torque_of_an_output_within_rounding_is_the_limit(excess: float) -> None:
    expected = kp.evaluate_policy(lambda observation: 2.0, 1).mean_return
    outputs = kp.q_function(lambda batch: np.eye(2)[[1] * len(batch)], torques=[-2, 2 + excess])
    assert kp.evaluate_policy(outputs, 1).mean_return == expected


def test_torque_beyond_rounding_is_shown_with_its_digits() -> None:
    with pytest.raises(kp.UserError, match=r"the torque 2\.0001 N·m"):
        kp.evaluate_policy(lambda observation: 2.0001, 1)


def test_run_folder_is_an_agent_everywhere(
    short_ending: None, tmp_path: Path, in_process: Command
) -> None:
    config = kp.preset("reference", hidden_units=(8,), episodes=2)
    network = kp.train_dqn(config, tmp_path / "run").network
    regret = kp.evaluate_policy(network, 2).regret
    assert kp.evaluate_policy(tmp_path / "run", 2).regret == regret
    printed = in_process("evaluate", "run", "--episodes", "2", "--json").stdout
    assert json.loads(printed)["regret"] == regret
    result = in_process("page", "reference", "--against", "run")
    assert result.returncode == 0, result.stderr


def test_edited_config_json_is_said_to_be_unused(tmp_path: Path, in_process: Command) -> None:
    words = ("train", "--hidden-units", "8", "--episodes", "1", "--out", "run", "--quiet")
    assert in_process(*words).returncode == 0
    resume = ("train", "--resume", "--out", "run", "--quiet", "--episodes")
    assert "config.json" not in in_process(*resume, "2").stderr
    file = tmp_path / "run" / "config.json"
    file.write_text(file.read_text().replace('"discount": 0.9', '"discount": 0.5'))
    result = in_process(*resume, "3")
    assert result.returncode == 0
    assert "config.json is not used" in result.stderr
    assert json.loads(file.read_text())["discount"] == 0.9


def test_results_can_be_compared_and_pickled() -> None:
    scores = [kp.evaluate_policy("reference", 1) for _ in range(2)]
    assert scores[0] == scores[0] != scores[1]
    for agent in ("original", kp.q_function(lambda batch: batch)):
        diagnosis = kp.diagnose(agent, gravity=1.0)
        copied = pickle.loads(pickle.dumps(diagnosis))
        assert copied.summary() == diagnosis.summary()
        assert len(copied.figure().axes) == len(diagnosis.figure().axes)


def test_regret_is_compared_with_what_the_discount_costs() -> None:
    healthy = kp.diagnose("reference").verdict
    assert "No finding: regret" in healthy
    assert "Up to 9.1 counts as small: 0.25 from the discount, and 8.8 of tolerance." in healthy
    bare = kp.diagnose(lambda observation: 0.0, gravity=1.0)
    assert bare.verdict.startswith("Undetermined: ") and "kp.q_function" in bare.verdict
    assert any("records no discount. 0.9 was assumed" in each for each in bare.assumptions)


def test_picture_that_cannot_be_made_leaves_the_score(
    in_process: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> bytes:
        print("drawing now")
        raise RuntimeError("no font")

    monkeypatch.setattr("keras_pendulum.figures.run_figure.draw_run", fail)
    result = in_process("train", "--hidden-units", "8", "--episodes", "1", "--quiet")
    assert result.returncode == 0
    score, drawing, saved = map(result.stdout.index, ("Regret: ", "drawing now", "Saved in "))
    assert score < drawing < saved
    assert "cannot draw" in result.stderr and "no font" in result.stderr


def test_progress_shows_a_line_for_each_episode(capsys: pytest.CaptureFixture[str]) -> None:
    kp.train_dqn(kp.preset(hidden_units=(8,), episodes=3), progress=True)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0] for line in lines] == [f"Episode: {i}" for i in range(3)]
