"""One seed has one result: in the command, in Python and in a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from conftest import Command, environment_restored

import keras_pendulum as kp
from keras_pendulum.study.job import Job, decode, installed_versions, train_and_score


def test_command_function_and_study_make_the_same_run(tmp_path: Path, command: Command) -> None:
    """Networks of full size, because small ones never compute on several threads."""
    settings = {"seed": 7, "episodes": 5, "warmup_episodes": 3}
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
    result = command("train", *flags, "--out", "run", "--quiet")
    assert result.returncode == 0, result.stderr
    config = kp.preset("reference", **settings)
    network = kp.train_dqn(config).network
    trained = kp.load_weights(tmp_path / "run").get_weights()
    np.testing.assert_equal(network.get_weights(), trained)
    job = Job("arm", "arm", config, installed_versions())
    with environment_restored():
        of_the_study = decode(train_and_score(job).result, job)
    assert of_the_study is not None
    assert of_the_study.returns == kp.evaluate_policy(network).returns.tolist()
