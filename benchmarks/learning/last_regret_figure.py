"""The picture of `benchmarks.learning.last_regret`: the regret by seed, step, start and state."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.optimum.dynamics import TORQUES, step_all_torques
from keras_pendulum.optimum.value_iteration import value_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from benchmarks.learning.last_regret import Episodes

_STEPS = 60  # shown; later ones lose almost nothing
_STYLES = (
    {"color": "#0072B2", "hatch": None, "line": "-"},  # the preset
    {"color": "#E69F00", "hatch": "//", "line": "-."},  # what it is compared with
)
_CELLS = 48  # of the map, on each axis
_LINE = "line: the optimal torque changes its side"  # in the title, where it hides nothing


def draw(
    preset: str,
    gravity: float,
    runs: Mapping[str, Sequence[Episodes]],
    discount_alone: Episodes,
    value: NDArray[Any],
) -> bytes:
    """Returns a PNG with four panels.

    Args:
        preset: its name.
        gravity: m/s².
        runs: the episodes of each training seed, by arm; at most two arms, the preset's last.
        discount_alone: the episodes of the exact policy for the preset's discount.
        value: V without a discount, a table of `value_iteration`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8.5), layout="constrained")
    figure.suptitle(f"Where `{preset}` loses return: {len(runs[preset])} training seeds")
    by_seed, by_step, by_start, by_state = figure.subplots(2, 2).flat
    _draw_seeds(by_seed, runs, discount_alone)
    _draw_steps(by_step, runs, discount_alone)
    _draw_starts(by_start, runs[preset])
    _draw_states(by_state, runs[preset])
    for axes, reach in ((by_start, 1.0), (by_state, 8.0)):
        _draw_sides(axes, gravity, value, reach)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _styles(runs: Mapping[str, object]) -> dict[str, dict[str, Any]]:
    """Returns the style of each arm; the last arm is the preset."""
    return dict(zip(runs, reversed(_STYLES[: len(runs)]), strict=True))


def _draw_seeds(
    axes: Axes, runs: Mapping[str, Sequence[Episodes]], discount_alone: Episodes
) -> None:
    for i, (name, style) in enumerate(_styles(runs).items()):
        regrets = [run.lost.sum(axis=0).mean() for run in runs[name]]
        seeds = 100 + np.arange(len(regrets)) + 0.4 * (i - (len(runs) - 1) / 2)
        axes.bar(seeds, regrets, 0.4, color=style["color"], hatch=style["hatch"], label=name)
    level = discount_alone.lost.sum(axis=0).mean()
    axes.axhline(level, color="black", linestyle="--", label="the discount alone")
    axes.set(title="By training seed", xlabel="Training seed", ylabel="Mean regret")
    axes.set_xticks(100 + np.arange(len(regrets)))
    axes.set_ylim(top=1.35 * axes.get_ylim()[1])  # room for the legend above the bars
    axes.legend(loc="upper left")


def _draw_steps(
    axes: Axes, runs: Mapping[str, Sequence[Episodes]], discount_alone: Episodes
) -> None:
    for name, style in _styles(runs).items():
        lost = np.mean([run.lost for run in runs[name]], axis=(0, 2))  # [T]
        axes.plot(lost[:_STEPS], style["line"], color=style["color"], label=name)
    lost = discount_alone.lost.mean(axis=1)
    axes.plot(lost[:_STEPS], "--", color="black", label="the discount alone")
    axes.set(title="By step", xlabel="Step of the episode", ylabel="Regret per step")
    axes.legend()


def _draw_starts(axes: Axes, episodes: Sequence[Episodes]) -> None:
    regrets = np.mean([run.lost.sum(axis=0) for run in episodes], axis=0)  # [N]
    order = regrets.argsort()
    points = axes.scatter(
        episodes[0].theta[0][order],
        episodes[0].speed[0][order],
        c=regrets[order],
        s=22,
        cmap="viridis",
        vmin=0,
        vmax=np.quantile(regrets, 0.95),
    )
    axes.figure.colorbar(points, ax=axes, label="Mean regret of the start", extend="max")
    axes.set(title=f"By start; {_LINE}")


def _draw_states(axes: Axes, episodes: Sequence[Episodes]) -> None:
    theta, speed, lost = (
        np.concatenate([getattr(run, name).ravel() for run in episodes])
        for name in ("theta", "speed", "lost")
    )
    edges = np.linspace(-np.pi, np.pi, _CELLS + 1), np.linspace(-8, 8, _CELLS + 1)
    total, *_ = np.histogram2d(theta, speed, bins=edges, weights=np.maximum(lost, 0))
    share = 100 * total / total.sum()
    picture = axes.imshow(
        np.where(share > 0, share, np.nan).T,
        origin="lower",
        extent=(-np.pi, np.pi, -8, 8),
        aspect="auto",
        cmap="viridis",
        vmax=np.quantile(share, 0.995),
    )
    axes.figure.colorbar(picture, ax=axes, label="Share of the regret, %", extend="max")
    axes.set(title=f"By state; {_LINE}")


def _draw_sides(axes: Axes, gravity: float, value: NDArray[Any], reach: float) -> None:
    """Draws the lines on which the optimal torque changes its side; they include the watershed."""
    theta, speed = np.linspace(-np.pi, np.pi, 241), np.linspace(-reach, reach, 161)
    grid = np.meshgrid(theta, speed)
    states = grid[0].ravel(), grid[1].ravel()
    reward, next_theta, next_speed = step_all_torques(gravity, *states)
    best = (reward + value_at(value, next_theta, next_speed)).argmax(axis=1)
    axes.contour(theta, speed, TORQUES[best].reshape(grid[0].shape), [0.0], colors="#D55E00")
    axes.set(xlabel="θ, rad (0 is upright)", ylabel="θ̇, rad/s", ylim=(-reach, reach))
