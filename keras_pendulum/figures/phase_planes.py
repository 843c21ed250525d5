"""Phase planes as pictures: greedy torques in the upper row, values in the lower one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.figures.style import SCALE
from keras_pendulum.optimum.phase_plane import EXTENT, PhasePlane

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec


def draw_planes(
    figure: Figure, place: SubplotSpec, planes: Mapping[str, PhasePlane], between: float
) -> None:
    """Draws one column for each phase plane; the planes of a row have one scale.

    Args:
        figure: to draw on.
        place: in the figure.
        planes: at least one, by name.
        between: the space between the two rows, as a share of a row's height.
    """
    from matplotlib.colors import LinearSegmentedColormap

    grid = place.subgridspec(2, len(planes), wspace=0.34, hspace=between)
    panels = [
        [figure.add_subplot(grid[row, column], title=name) for column, name in enumerate(planes)]
        for row in range(2)
    ]
    torques = [plane.torque for plane in planes.values()]
    colors = LinearSegmentedColormap.from_list("torque", SCALE)
    bar = _draw_row(panels[0], torques, "Greedy torque (N·m)", cmap=colors, vmin=-2.0, vmax=2.0)
    bar.set_ticks([-2, -1, 0, 1, 2])
    for axes, map_ in zip(panels[0], torques, strict=True):
        _hatch_clockwise(axes, map_)
    _hatch_clockwise(bar.ax, np.array([[-1.0, -1.0], [1.0, 1.0]]), (0, 1, -2, 2))
    values = [plane.value for plane in planes.values()]
    # These colours become lighter and lighter, so that they are legible without colour.
    ends = {"vmin": np.min(values), "vmax": np.max(values)}
    _draw_row(panels[1], values, "Discounted return (max Q)", cmap="viridis", **ends)


def _draw_row(
    panels: Sequence[Axes], maps: Sequence[NDArray[np.float64]], label: str, **colors: Any
) -> Colorbar:
    """Draws maps over θ and θ̇ with one colour bar."""
    for axes, values in zip(panels, maps, strict=True):
        image = axes.imshow(values, origin="lower", extent=EXTENT, aspect="auto", **colors)
        axes.set_yticks([-8, -4, 0, 4, 8])
        axes.set_xticks([-np.pi, 0, np.pi], ["−π", "0 (upright)", "π"])
        axes.set(xlabel="θ (rad)", ylabel="θ̇ (rad/s)")
    return axes.figure.colorbar(image, ax=panels, label=label, fraction=0.1, pad=0.03)


def _hatch_clockwise(
    axes: Axes, torques: NDArray[np.float64], extent: tuple[float, float, float, float] = EXTENT
) -> None:
    """Hatches the torques below 0, which have the darkness of those above 0."""
    if torques.min() < 0:
        hatched = axes.contourf(torques, [-3, -1e-9], extent=extent, colors="none", hatches=["//"])
        hatched.set_edgecolor("#ffffff99")
