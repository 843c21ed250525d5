from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import Command, ending_shortly
from figure_texts import figure_of, require_legible

import keras_pendulum as kp
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.train import live_plot

pygame = pytest.importorskip("pygame")


def record(episode: int) -> EpisodeRecord:
    return EpisodeRecord(episode, 1.0, 10.0 * episode, 0.5, 0.1, 10 * (episode + 1), episode, 0.1)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> live_plot.LivePlot:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(live_plot, "_SECONDS_BETWEEN", 0.0)
    return live_plot.LivePlot(kp.preset("original"))


def window_pixels() -> np.ndarray:
    """Returns the pixels of the window [W, H, 3]."""
    return pygame.surfarray.array3d(pygame.display.get_surface())


def test_window_shows_the_curve_and_each_new_episode(window: live_plot.LivePlot) -> None:
    window.on_episode(record(0))
    window.on_episode(record(1))
    before = window_pixels()
    assert before.shape == (960, 540, 3)
    assert len(np.unique(before.reshape(-1, 3), axis=0)) > 10  # not an empty window
    window.on_episode(record(2))
    assert (window_pixels() != before).any()
    pygame.display.quit()


@pytest.mark.parametrize(
    ("preset", "quantity"), [("reference", "Reward per step"), ("cartpole", "Return (steps)")]
)
def test_plot_shows_the_learning_curve_of_the_run(
    preset: str, quantity: str, window: live_plot.LivePlot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window, "_config", kp.preset(preset, seed=7))
    monkeypatch.setattr(window, "_drawn", math.inf)  # the window draws nothing
    for episode in range(120):
        window.on_episode(record(episode))
        if episode in (0, 2, 119):
            figure = figure_of(window._picture)
            require_legible(figure)
            assert figure.texts[0].get_text() == f"{preset}, seed 7"
            curve, epsilon = figure.axes
            assert (curve.get_ylabel(), len(curve.get_lines())) == (quantity, 5)
            assert epsilon.get_ylabel() == "Random actions (ε)"
            for axes in figure.axes:  # the whole run, from the first episode on
                low, high = axes.get_xlim()
                assert low < 0 < window._config.episodes - 1 < high < 1.1 * window._config.episodes
            assert len(np.asarray(curve.get_lines()[1].get_ydata())) == episode + 1


def test_end_draws_episodes_since_the_last_drawing(
    window: live_plot.LivePlot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.on_episode(record(0))
    before = window_pixels()
    monkeypatch.setattr(live_plot, "_SECONDS_BETWEEN", 1e9)
    window.on_episode(record(1))
    assert (window_pixels() == before).all()
    window.on_end()
    assert (window_pixels() != before).any()
    pygame.display.quit()


def test_closed_window_is_not_opened_again(window: live_plot.LivePlot) -> None:
    window.on_episode(record(0))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    window.on_episode(record(1))
    assert not pygame.display.get_init()
    window.on_episode(record(2))
    window.on_end()
    assert not pygame.display.get_init()


def test_window_stays_open_after_the_run_until_it_is_closed(
    window: live_plot.LivePlot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.wait_until_closed()  # no window yet
    window.on_episode(record(0))
    window.on_end()
    waits = []

    def close_at_the_third(seconds: float) -> None:
        waits.append(seconds)
        if len(waits) == 3:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    monkeypatch.setattr("time.sleep", close_at_the_third)
    window.wait_until_closed()
    assert len(waits) == 3
    assert not pygame.display.get_init()


def test_train_live_without_a_display_prints_one_line_and_trains(in_process: Command) -> None:
    no_display = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "SDL_VIDEODRIVER": ""}
    words = ["--live", "--preset", "original", "--episodes", "2", "--hidden-units", "8"]
    with ending_shortly():
        done = in_process("train", *words, environment=no_display)
    assert done.returncode == 0
    assert done.stderr.startswith("no live plot: there is no display")
    assert done.stderr.count("\n") == 1
    assert "Trained 2 episodes" in done.stdout


def test_train_render_shows_the_environment(in_process: Command) -> None:
    words = ["--render", "--preset", "cartpole-original", "--episodes", "2"]
    with ending_shortly():
        done = in_process("train", *words, environment={"SDL_VIDEODRIVER": "dummy"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "Trained 2 episodes" in done.stdout
