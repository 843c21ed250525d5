"""The figure of a diagnosis: learned and exact values, outputs, torques, equations or repairs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.diagnosis.equation import RIGHT
from keras_pendulum.errors import one_line
from keras_pendulum.figures.style import own_style, plain_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from keras_pendulum.diagnosis.faults import Finding, Repair
    from keras_pendulum.diagnosis.measurement import Measurement

FONT_SIZE = 10


_HEALTHY, _OWN, _GUILTY = "0.6", "tab:blue", "tab:red"  # colours
_OUTPUTS = ("untrained-outputs",)
_TORQUES = ("torque-map", "misaligned-transitions")
_VALUES = ("too-few-updates", "overestimation", "broken-network", "bounded-output")
_SHOWN_EQUATIONS = 4
_LARGEST_ERROR = 50.0  # percent, of a bar


def draw_diagnosis(
    measurement: Measurement, findings: Sequence[Finding], notes: Sequence[Finding]
) -> Figure:
    """Returns a Matplotlib figure; without finite Q-values, only the repairs are drawn.

    A red frame is around the panel that shows the first finding.
    """
    from matplotlib.figure import Figure

    with own_style(FONT_SIZE):
        has_q = measurement.policy.has_q_values and measurement.finite
        figure = Figure(figsize=(10, 8) if has_q else (6, 4), layout="constrained")
        names = [finding.title for finding in findings] or ["No finding"]
        title = f"{one_line(measurement.policy.name)}: {', '.join(names)}"
        figure.suptitle(plain_text(title, letters=90))
        repairs = [each.repair for each in (*findings, *notes) if each.repair is not None]
        if not has_q:
            _draw_repairs(figure.subplots(), measurement, repairs)
            return figure
        (values, outputs), (torques, last) = figure.subplots(2, 2)
        _draw_values(values, measurement)
        _draw_outputs(outputs, measurement)
        if measurement.dynamics.any_effort:
            _draw_torques(torques, measurement)
        else:
            _draw_differences(torques, measurement)
        if repairs:
            _draw_repairs(last, measurement, repairs)
        else:
            _draw_equations(last, measurement, [*findings, *notes])
        if findings:
            panels = {values: _VALUES, outputs: _OUTPUTS, torques: _TORQUES}
            guilty = (axes for axes, shown in panels.items() if findings[0].name in shown)
            for spine in next(guilty, last).spines.values():
                spine.set(visible=True, color=_GUILTY, linewidth=2.5)
    return figure


def _draw_values(axes: Axes, measurement: Measurement) -> None:
    exact = measurement.exact_q.max(axis=1)
    learned = measurement.learned_q.max(axis=1)
    # The axes depend on the task alone, so that pictures can be compared.
    ends = np.array([exact.min(), exact.max()])
    limits = ends + np.array([-0.2, 0.2]) * np.ptp(ends)
    axes.plot(ends, ends, color=_HEALTHY, linewidth=6, label="healthy")
    axes.plot(exact, np.clip(learned, *limits), ".", markersize=2, color=_OWN, label="own")
    axes.set(xlabel="Exact value of a state", ylabel="Learned value", xlim=limits, ylim=limits)
    outside = float(np.mean((learned < limits[0]) | (learned > limits[1])))
    beyond = f"; {outside:.0%} beyond the axis" if outside > 0.005 else ""
    axes.set_title(f"Values: slope {measurement.value.slope:.2g}{beyond}")
    axes.legend(frameon=False)


def _draw_outputs(axes: Axes, measurement: Measurement) -> None:
    indices = np.arange(measurement.learned_q.shape[1])
    learned, exact = measurement.learned_q, measurement.exact_q
    limit = 0.3 * measurement.value_spread
    deviations = [np.clip(q.mean(axis=0) - q.mean(), -limit, limit) for q in (exact, learned)]
    axes.plot(indices, deviations[0], color=_HEALTHY, linewidth=6, label="healthy")
    axes.plot(indices, deviations[1], "o-", markersize=3, color=_OWN, label="own")
    axes.set(xlabel="Output", ylabel="Mean value minus that of all outputs")
    axes.set(title="Mean value of each output", ylim=(-1.1 * limit, 1.1 * limit))
    axes.legend(frameon=False)


def _draw_torques(axes: Axes, measurement: Measurement) -> None:
    torques = measurement.efforts
    limit = 4.0  # N·m; a network that has learned little has no torques to speak of
    found = np.clip(measurement.output_efforts, -limit, limit)
    axes.plot(torques, torques, color=_HEALTHY, linewidth=6, label="healthy")
    axes.plot(torques, found, "o", markersize=3, color=_OWN, label="own")
    axes.set(xlabel="Torque of the output (N·m)", ylabel="Torque it behaves like (N·m)")
    axes.set(xlim=(-2.2, 2.2), ylim=(-limit - 0.2, limit + 0.2))
    axes.set_title("Torque of each output")
    axes.legend(frameon=False)


def _draw_differences(axes: Axes, measurement: Measurement) -> None:
    """Draws how much better the last action is than the first, in each state."""
    exact, learned = (q[:, -1] - q[:, 0] for q in (measurement.exact_q, measurement.learned_q))
    # A difference says most where it is large, and those are few: the axes show 98 % of them.
    limit = 1.1 * max(float(np.quantile(np.abs(exact), 0.98)), 1e-6)
    axes.plot([-limit, limit], [-limit, limit], color=_HEALTHY, linewidth=6, label="healthy")
    points = np.clip(exact, -limit, limit), np.clip(learned, -limit, limit)
    axes.plot(*points, ".", markersize=2, color=_OWN, label="own")
    axes.set(xlabel="Exact Q(s, right) - Q(s, left)", ylabel="Learned difference")
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit))
    axes.set_title("Difference of the actions in each state")
    axes.legend(frameon=False)


def _draw_equations(axes: Axes, measurement: Measurement, findings: Sequence[Finding]) -> None:
    """Draws the errors of the right equation and of those that fit best."""
    over_steps = next((each.long_errors for each in findings[:1] if each.long_errors), None)
    all_errors = over_steps or measurement.equation_errors
    nearest = dict(islice(all_errors.items(), 1 + _SHOWN_EQUATIONS))
    errors = {name.replace(f"{RIGHT} with", "…"): error for name, error in nearest.items()}
    shown = [min(100 * error, _LARGEST_ERROR) for error in errors.values()]
    names = [plain_text(name, letters=26) for name in errors]
    bars = axes.barh(names, shown, height=0.6, color=[_HEALTHY, *[_OWN] * (len(shown) - 1)])
    axes.bar_label(bars, [f" {_percent(error)}" for error in errors.values()])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set(xlim=(0, 1.2 * _LARGEST_ERROR), xlabel="Error (share of the spread of the values, %)")
    steps = ", over ten steps" if over_steps else ""
    axes.set_title(f"How well the values satisfy an equation{steps}")


def _percent(error: float) -> str:
    return f"{100 * error:.0f} %" if error < 10 else "above 1000 %"


def _draw_repairs(axes: Axes, measurement: Measurement, repairs: Sequence[Repair]) -> None:
    regrets = {"as it is": measurement.regret}
    regrets |= {plain_text(each.name, letters=24): each.regret for each in repairs}
    bars = axes.barh(list(regrets), list(regrets.values()), height=0.6, color="tab:orange")
    axes.bar_label(bars, [f" {regret:.1f}" for regret in regrets.values()])
    axes.set_ylim(max(len(regrets), 3) - 0.5, -1)  # from the top, with room for the legend
    axes.margins(x=0.15)
    tolerance = measurement.regret_tolerance
    axes.axvline(tolerance, color=_HEALTHY, linestyle="--", label="healthy: below")
    axes.set(xlabel="Regret (return below the best possible)", title="Repairs without training")
    axes.legend(frameon=False, loc="upper right")
