from __future__ import annotations

import io
import math

import matplotlib.image
import numpy as np
import pytest
from figure_texts import figure_of, require_legible
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

import keras_pendulum as kp
from keras_pendulum.environments.pendulum import Pendulum
from keras_pendulum.figures import run_figure
from keras_pendulum.figures.style import CLOCKWISE, COUNTERCLOCKWISE, NO_TORQUE
from keras_pendulum.history import EpisodeRecord
from keras_pendulum.optimum.phase_plane import (
    PhasePlane,
    network_phase_plane,
    optimal_phase_plane,
    run_phase_planes,
)

LEVELS = {"best possible": -40.0, "optimal policy for γ = 0.9": -41.0, "random actions": -900.0}
TITLE = "reference, seed 0: regret 1.87\nPendulum-v1, g = 1 · keras_pendulum 0.1.0"


def make_history(episodes: int, evaluate_every: int = 0) -> list[EpisodeRecord]:
    """Returns records with a loss from episode 41 on, within one power of ten in 60 episodes."""
    return [
        EpisodeRecord(
            i,
            -5.0 + 4.8 * i / episodes,
            -1000.0,
            max(0.01, 0.99**i),
            math.nan if i < 41 else 0.3 * 0.98**i,
            200 * (i + 1),
            i,
            0.1,
            700.0 / (i + 1) if evaluate_every and (i + 1) % evaluate_every == 0 else math.nan,
        )
        for i in range(episodes)
    ]


@pytest.fixture(scope="module")
def planes() -> dict[str, PhasePlane]:
    return {
        "one": network_phase_plane(kp.DQN((8,)), Pendulum()),
        "two": optimal_phase_plane(Pendulum(), 0.5),
    }


def test_no_text_of_cartpole_planes_overlaps_another() -> None:
    network, config = kp.DQN((8,), 2, observation_size=4), kp.preset("cartpole")
    planes = run_phase_planes(network, config)
    figure = figure_of(lambda: run_figure.draw_phase_planes(planes))
    require_legible(figure)
    assert "Greedy force (N)" in {axes.get_ylabel() for axes in figure.axes}


@pytest.mark.parametrize(
    ("episodes", "every", "with_planes"),
    [(1, 0, False), (60, 0, True), (60, 10, False), (500, 50, True)],
)
def test_no_text_of_a_run_overlaps_another_or_leaves_the_picture(
    episodes: int, every: int, with_planes: bool, planes: dict[str, PhasePlane]
) -> None:
    history, shown = make_history(episodes, every), planes if with_planes else {}
    figure = figure_of(lambda: run_figure.draw_run(history, Pendulum(), LEVELS, shown, TITLE))
    require_legible(figure)
    # Colour bars have axes of their own.
    assert len(figure.axes) == 3 + bool(every) + 6 * with_planes
    assert [text.get_text() for text in figure.texts] == TITLE.splitlines()


def test_no_text_of_phase_planes_overlaps_another(planes: dict[str, PhasePlane]) -> None:
    require_legible(figure_of(lambda: run_figure.draw_phase_planes(planes)))


def test_torques_have_the_colours_of_the_other_pictures(planes: dict[str, PhasePlane]) -> None:
    figure = figure_of(lambda: run_figure.draw_phase_planes(planes))
    (image,) = figure.axes[0].get_images()
    for torque, color in ((-2.0, CLOCKWISE), (0.0, NO_TORQUE), (2.0, COUNTERCLOCKWISE)):
        assert image.to_rgba(np.array([torque]))[0] == pytest.approx(to_rgba(color), abs=0.01)


def test_epsilon_is_visible_from_the_first_episode_on() -> None:
    for episodes, marker in ((1, "o"), (2, "")):
        axes = Figure().subplots()
        run_figure._draw_epsilon(axes, make_history(episodes))
        assert axes.get_lines()[0].get_marker() == marker


@pytest.mark.parametrize(
    ("losses", "labels"),
    [
        ((0.3, 2e-6), {r"$\mathdefault{10^{-5}}$", r"$\mathdefault{10^{-1}}$"}),
        ((0.3, 2e-3), {"0.01", "0.1"}),
    ],
)
def test_labels_of_the_loss_have_one_form(losses: tuple[float, ...], labels: set[str]) -> None:
    history = [
        EpisodeRecord(i, -1.0, -200.0, 0.5, loss, 200, i, 0.1) for i, loss in enumerate(losses)
    ]
    axes = Figure().subplots()
    run_figure._draw_loss(axes, history)
    shown = {label.get_text() for label in axes.get_yticklabels()}
    assert labels <= shown
    assert not any("e-" in text for text in shown)
    assert len({text.startswith("$") for text in shown}) == 1


def test_picture_is_a_png() -> None:
    png = run_figure.draw_run(make_history(2), Pendulum(), LEVELS, {})
    assert matplotlib.image.imread(io.BytesIO(png)).shape[1] == 960


def test_greedy_regret_is_drawn_by_episode_with_its_best() -> None:
    regrets = {9: 800.0, 19: 0.0, 29: 20.0, 39: 0.0}
    evaluated = [
        EpisodeRecord(i, -1.0, -200.0, 0.5, 0.1, 200, i, 0.1, regret)
        for i, regret in regrets.items()
    ]
    axes = Figure().subplots()
    run_figure._draw_greedy_regret(axes, evaluated)
    curve, best = axes.get_lines()
    assert dict(zip(*map(np.asarray, curve.get_data()), strict=True)) == regrets
    assert list(np.asarray(best.get_xdata())) == [39]  # the later of two equals
    assert best.get_label() == "best: 0.00 after episode 39"
    low, high = axes.get_ylim()
    assert low < -0.05  # no point is on the frame
    assert high > 1000


def test_phase_planes_have_their_lowest_speed_at_the_bottom(planes: dict[str, PhasePlane]) -> None:
    figure = figure_of(lambda: run_figure.draw_phase_planes({"optimum": planes["two"]}))
    images = [image for axes in figure.axes for image in axes.get_images()]
    assert [image.origin for image in images] == ["lower", "lower"]
    assert images[0].get_extent() == pytest.approx((-math.pi, math.pi, -8, 8))
