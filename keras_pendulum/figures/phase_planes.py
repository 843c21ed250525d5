"""Phase planes as pictures: greedy efforts in the upper row, values in the lower one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.figures.style import SCALE
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.optimum.phase_plane import PhasePlane

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

ROW = 2.4  # inches, height of a panel
BETWEEN = 0.95  # two rows: the names and numbers of an axis, and the title of the next one


def draw_planes(figure: Figure, place: SubplotSpec, planes: Mapping[str, PhasePlane]) -> None:
    """Draws one column for each phase plane; the planes of a row have one scale.

    Args:
        figure: to draw on.
        place: in the figure.
        planes: at least one, by name; all of one task.
    """
    from matplotlib.colors import LinearSegmentedColormap

    grid = place.subgridspec(2, len(planes), wspace=0.34, hspace=BETWEEN / ROW)
    panels = [
        [figure.add_subplot(grid[row, column], title=name) for column, name in enumerate(planes)]
        for row in range(2)
    ]
    dynamics = next(iter(planes.values())).dynamics
    efforts, largest = [plane.effort for plane in planes.values()], dynamics.largest_effort
    colors = LinearSegmentedColormap.from_list("effort", SCALE)
    label = f"Greedy {dynamics.effort} ({dynamics.unit})"
    bar = _draw_row(panels[0], efforts, dynamics, label, cmap=colors, vmin=-largest, vmax=largest)
    bar.set_ticks(np.linspace(-largest, largest, 5).tolist())
    for axes, map_ in zip(panels[0], efforts, strict=True):
        _hatch_negative(axes, map_, _extent(dynamics))
    ends_of_bar = np.array([[-largest, -largest], [largest, largest]])
    _hatch_negative(bar.ax, ends_of_bar, (0, 1, -largest, largest))
    values = [plane.value for plane in planes.values()]
    # These colours become lighter and lighter, so that they are legible without colour.
    ends = {"vmin": np.min(values), "vmax": np.max(values)}
    _draw_row(panels[1], values, dynamics, "Discounted return (max Q)", cmap="viridis", **ends)


def _draw_row(
    panels: Sequence[Axes],
    maps: Sequence[NDArray[np.float64]],
    dynamics: KnownDynamics,
    label: str,
    **colors: Any,
) -> Colorbar:
    """Draws maps over θ and θ̇ with one colour bar."""
    angle, speed = dynamics.phase_ends
    end = "π" if angle == np.pi else f"{angle:.2f}"
    for axes, values in zip(panels, maps, strict=True):
        image = axes.imshow(
            values, origin="lower", extent=_extent(dynamics), aspect="auto", **colors
        )
        axes.set_yticks(np.linspace(-speed, speed, 5).tolist())
        axes.set_xticks([-angle, 0, angle], [f"−{end}", "0 (upright)", end])
        # What leans to the right is on the right.
        axes.set_xlim(-angle * dynamics.rightward, angle * dynamics.rightward)
        axes.set(xlabel="θ (rad)", ylabel="θ̇ (rad/s)")
    return axes.figure.colorbar(image, ax=panels, label=label, fraction=0.1, pad=0.03)


def _extent(dynamics: KnownDynamics) -> tuple[float, float, float, float]:
    """Returns the ends of the axes: left, right, bottom and top."""
    angle, speed = dynamics.phase_ends
    return (-angle, angle, -speed, speed)


def _hatch_negative(
    axes: Axes, efforts: NDArray[np.float64], extent: tuple[float, float, float, float]
) -> None:
    """Hatches the efforts below 0, which have the darkness of those above 0."""
    if efforts.min() < 0:
        levels = [2 * efforts.min(), -1e-9]
        hatched = axes.contourf(efforts, levels, extent=extent, colors="none", hatches=["//"])
        hatched.set_edgecolor("#ffffff99")
