from __future__ import annotations

import numpy as np
import pytest
from conftest import Command

from keras_pendulum import live_plot
from keras_pendulum.episodes import EpisodeRecord
from keras_pendulum.errors import UserError

pygame = pytest.importorskip("pygame")


def record(episode: int) -> EpisodeRecord:
    return EpisodeRecord(episode, 1.0, 10.0 * episode, 0.5, 0.1, 10 * episode, episode, 0.1)


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> live_plot.LivePlot:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(live_plot, "_SECONDS_BETWEEN", 0.0)
    return live_plot.LivePlot()


def shown() -> np.ndarray:
    """The window's pixels."""
    return pygame.surfarray.array3d(pygame.display.get_surface())


def test_the_window_shows_the_curve_and_what_is_added_to_it(window: live_plot.LivePlot) -> None:
    window(record(0))
    window(record(1))
    before = shown()
    assert before.shape == (960, 540, 3)
    assert len(np.unique(before.reshape(-1, 3), axis=0)) > 10  # not an empty window
    window(record(2))
    assert (shown() != before).any()
    pygame.display.quit()


def test_at_the_end_it_shows_what_came_after_the_last_drawing(
    window: live_plot.LivePlot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window(record(0))
    before = shown()
    monkeypatch.setattr(live_plot, "_SECONDS_BETWEEN", 1e9)
    window(record(1))
    assert (shown() == before).all()
    window.finish()
    assert (shown() != before).any()
    pygame.display.quit()


def test_a_closed_window_stays_closed_and_the_run_goes_on(window: live_plot.LivePlot) -> None:
    window(record(0))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    window(record(1))
    assert not pygame.display.get_init()
    window(record(2))
    window.finish()
    assert not pygame.display.get_init()


def test_without_a_display_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(UserError, match="no display"):
        live_plot.LivePlot()


def test_the_command_says_so_in_one_line_and_trains(command: Command) -> None:
    nothing = {"DISPLAY": "", "WAYLAND_DISPLAY": "", "SDL_VIDEODRIVER": ""}
    words = ["--live", "--preset", "original", "--episodes", "2", "--hidden-units", "8"]
    done = command("train", *words, environment=nothing)
    assert done.returncode == 0
    assert done.stderr.startswith("no live plot: there is no display")
    assert done.stderr.count("\n") == 1
    assert "Trained 2 episodes" in done.stdout


def test_the_environment_can_be_shown_while_training(command: Command) -> None:
    words = ["--render", "--preset", "cartpole-original", "--episodes", "2"]
    done = command("train", *words, environment={"SDL_VIDEODRIVER": "dummy"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "Trained 2 episodes" in done.stdout
