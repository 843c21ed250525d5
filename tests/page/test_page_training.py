"""The slider through the training, on the page of a run with snapshots."""

from __future__ import annotations

import base64
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from browser import SCREENS, Player, pixels_of
from conftest import Refusal, wait_for
from page_fixtures import coarse_optimum
from selenium.webdriver.common.keys import Keys

import keras_pendulum as kp
from keras_pendulum.page import __main__ as page_command
from keras_pendulum.page.training import training_content
from keras_pendulum.storage.recorded_run import load_recorded_run
from keras_pendulum.storage.run_folder import find_run
from keras_pendulum.storage.snapshots import read_snapshots

CONFIG = kp.preset("swingup", episodes=8, snapshots=5, hidden_units=(16, 8), warmup_episodes=1)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with the networks after 0, 2, 4, 6 and 8 episodes."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("keras_pendulum.optimum.phase_plane.run_phase_planes", lambda *run: {})
        patched.setattr("keras_pendulum.figures.run_figure.draw_run", lambda *run: b"a picture")
        folder = tmp_path_factory.mktemp("runs") / "my run"
        kp.train_dqn(CONFIG, folder)
    return folder


@pytest.fixture(scope="module")
def page(run: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of the run's page."""
    out = tmp_path_factory.mktemp("page") / "page.html"
    with pytest.MonkeyPatch.context() as patched:
        coarse_optimum(patched)
        assert page_command.main([str(run), "--out", str(out)]) == 0
    return out.as_uri()


def shown_episode(player: Player) -> str:
    return str(player.find("snapshot").get_attribute("aria-valuetext"))


def test_slider_shows_each_network_of_the_run(run: Path, page: str, player: Player) -> None:
    player.open_paused(page)
    assert player.text("about").startswith("my run (preset swingup), a 16-8 tanh network")
    assert shown_episode(player) == "episode 8 of 8"
    player.run("pendulum.reset(2, 0.5)")
    player.find("snapshot").send_keys(Keys.HOME)
    assert shown_episode(player) == "episode 0 of 8"
    assert player.text("training-text").endswith(", no update yet")
    final = kp.load_weights(run / "pendulum_weight.h5")
    history = load_recorded_run(run / "pendulum_weight.h5").history
    observation = [np.cos(2.0), np.sin(2.0), 0.5]
    values = []
    for each in read_snapshots(run / "pendulum_weight_snapshots.h5", final, history):
        assert shown_episode(player) == f"episode {each.episodes} of 8"
        trained = each.episodes > sum(record.updates == 0 for record in history)
        assert ("no update" in player.text("training-text")) != trained
        shapes = [array.shape for array in final.get_weights()]
        ends = np.cumsum([np.prod(shape) for shape in shapes])[:-1]
        parts = np.split(each.weights.astype(np.float32), ends)
        network = final.clone()
        network.set_weights(
            [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
        )
        expected = network(np.array([observation], np.float32)).numpy()[0]
        state = player.state()
        np.testing.assert_allclose(state["qValues"], expected, atol=3e-3 * np.ptp(expected) + 3e-3)
        assert (state["theta"], state["thetadot"], state["steps"]) == (2, 0.5, 0)
        values.append(state["qValues"])
        player.press("s", "s")  # the next network starts where this one did
        player.find("snapshot").send_keys(Keys.ARROW_RIGHT)
    exact = final(np.array([observation], np.float32)).numpy()[0]
    np.testing.assert_allclose(values[-1], exact, atol=1e-5)
    assert all(one != two for one, two in pairwise(values))


def test_page_reads_every_finite_half_float(user: Player) -> None:
    halves = np.arange(2**16, dtype=np.uint16).view(np.float16)
    halves = halves[np.isfinite(halves)]
    text = base64.b64encode(halves.astype("<f2").tobytes()).decode()
    found = user.run("return Array.from(decodedHalves(arguments[0]))", text)
    np.testing.assert_array_equal(np.array(found, np.float32), halves.astype(np.float32))


def test_map_and_cursor_move_with_the_slider(run: Path, page: str, player: Player) -> None:
    player.open_paused(page)
    maps = []
    for index in (4, 1, 4):
        player.run("pendulum.page.training.show(arguments[0])", index)
        wait_for(lambda: player.run("return pendulum.page.map.ready"))
        maps.append(player.run("return Array.from(pendulum.page.map.efforts)"))
        if index == 1:
            ink = pixels_of(player, "curve", "ink")
            column = ink.sum(axis=0).argmax()
            assert (column - 48) / (ink.shape[1] - 56) == pytest.approx(2 / 8, abs=0.01)
    assert maps[0] == maps[2] != maps[1]


def test_slider_and_curve_have_the_same_ends(page: str, player: Player) -> None:
    player.open(page)
    curve, slider = player.boxes("#curve", "#snapshot")
    axis = player.run("return CURVE_AXIS")
    assert slider["left"] == pytest.approx(curve["left"] + axis, abs=0.5)
    assert slider["right"] == pytest.approx(curve["right"], abs=0.5)


def test_a_key_plays_the_training_from_its_start(page: str, player: Player) -> None:
    player.open_paused(page)
    player.press("p")
    assert player.text("play-training").startswith("Stop")
    assert player.text("status") == "The network drives."  # time runs
    assert player.run("return pendulum.page.training.shown") == 0
    shown = "return pendulum.page.training.shown === arguments[0]"
    for index in (1, 2):
        player.run("pendulum.page.training.seconds = 3")
        wait_for(partial(player.run, shown, index))
    player.press(Keys.SPACE)  # the pause stops it
    assert player.text("play-training").startswith("Play training")
    player.find("play-training").click()
    assert player.run("return pendulum.page.training.shown") == 2
    for _ in range(3):
        player.run("pendulum.page.training.seconds = 3")
        wait_for(lambda: player.run("return pendulum.page.training.seconds") < 3)
    wait_for(lambda: not player.run("return pendulum.page.training.playing"))
    assert shown_episode(player) == "episode 8 of 8"


def test_training_plays_without_motion_for_reduced_motion(page: str, player: Player) -> None:
    player.set_screen(1280, 800, **{"reduced-motion": "reduce"})
    player.open(page)
    player.press("p")
    player.run("pendulum.page.training.seconds = 3")
    wait_for(lambda: shown_episode(player) == "episode 2 of 8")
    assert player.text("status") == "Paused. The network drives."
    assert player.state()["steps"] == 0


def test_slider_is_visible_with_the_pendulum(page: str, player: Player) -> None:
    player.open(page)
    for width, height in SCREENS:
        player.set_screen(width, height)
        player.redraw()
        ids = ["#pair", "#training", "#snapshot", "#curve", "#play-training"]
        boxes = player.boxes(*ids, *(["#phase"] if width != 844 else []))
        for box in boxes:
            assert 0 <= box["top"] < box["bottom"] <= height
            assert 0 <= box["left"] < box["right"] <= width
        assert boxes[0]["bottom"] <= boxes[1]["top"]  # the slider covers nothing of the pendulum


def test_page_without_snapshots_has_no_slider(user: Player) -> None:
    assert not user.find("training").is_displayed()
    user.press("p")
    assert user.text("problem") == ""


def test_learning_curve_is_the_mean_of_ten_episodes(run: Path) -> None:
    checkpoint = run / "pendulum_weight.h5"
    content = training_content(find_run(run), kp.load_weights(checkpoint))
    assert content is not None
    history = load_recorded_run(checkpoint).history
    rewards = [record.average_reward for record in history]
    means = [np.mean(rewards[: count + 1]) for count in range(8)]  # fewer than 10 so far
    np.testing.assert_allclose(content["curve"], means, rtol=1e-3)
    best, random = (content["levels"][name] for name in ("best possible", "random actions"))
    assert random < best < 0
    steps = CONFIG.max_episode_steps  # fewer than 200, so the mean of a step is lower
    assert best == pytest.approx(kp.optimal_return(10.0, steps=steps).mean() / steps, rel=0.05)


def test_run_without_snapshots_has_a_page_and_a_hint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kp.save_weights(kp.DQN((8,), metadata={"gravity": 10.0}), tmp_path / "pendulum_weight.h5")
    out = tmp_path / "page.html"
    assert page_command.main([str(tmp_path), "--out", str(out)]) == 0
    assert "There is no slider: the run has no snapshots" in capsys.readouterr().out
    assert '"training": null' in out.read_text(encoding="utf-8")


def test_damaged_snapshots_are_refused_in_one_line(
    run: Path, refusal: Refusal, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("copy")
    (folder / "pendulum_weight.h5").write_bytes((run / "pendulum_weight.h5").read_bytes())
    (folder / "pendulum_weight_snapshots.h5").write_bytes(b"damaged")
    message = "pendulum_weight_snapshots.h5: not an HDF5 file"
    assert message in refusal(page_command.main, [folder])
