"""A run as a user starts it: what it learns, and the files that it leaves."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import matplotlib.image
import numpy as np

import keras_pendulum as kp
from keras_pendulum.config.settings import read_settings
from keras_pendulum.history import csv_header


def test_run_learns_far_more_than_random_actions_and_leaves_four_files(tmp_path: Path) -> None:
    config, folder = kp.preset("reference", episodes=100), tmp_path / "new" / "folder"
    result = kp.train_dqn(config, folder)
    score = kp.evaluate_policy(result.network)
    assert result.score is not None and result.score.regret == score.regret
    assert score.mean_return > -250  # uniformly random torque: -909
    saved = kp.evaluate_policy(kp.load_weights(folder / "pendulum_weight.h5"))
    np.testing.assert_array_equal(saved.returns, score.returns)

    names = {"pendulum_weight.h5", "history.csv", "config.json", "rewards.png"}
    assert {file.name for file in folder.iterdir()} == names
    assert read_settings(json.loads((folder / "config.json").read_text())) == config
    with open(folder / "history.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == csv_header()
    returns = [record.episode_return for record in result.history]
    assert [float(row["episode_return"]) for row in rows] == returns
    assert rows[40]["loss"] == ""
    assert float(rows[41]["loss"]) > 0
    assert (rows[-1]["environment_steps"], rows[-1]["updates"]) == ("10000", "2360")
    picture = matplotlib.image.imread(folder / "rewards.png")
    assert picture.shape[0] > 300
    assert picture[..., :3].std() > 0.05  # not a blank picture
