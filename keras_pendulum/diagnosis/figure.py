"""The figure of a diagnosis: learned and exact values, outputs, torques and repairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.errors import one_line
from keras_pendulum.figures.style import own_style, plain_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from keras_pendulum.diagnosis.faults import Finding
    from keras_pendulum.diagnosis.measurement import Measurement

FONT_SIZE = 10


def draw_diagnosis(
    measurement: Measurement, findings: Sequence[Finding], notes: Sequence[Finding]
) -> Figure:
    """Returns a Matplotlib figure; without finite Q-values, only the repairs are drawn."""
    from matplotlib.figure import Figure

    with own_style(FONT_SIZE):
        has_q = measurement.policy.has_q_values and measurement.finite
        figure = Figure(figsize=(10, 8) if has_q else (6, 4), layout="constrained")
        names = [finding.name for finding in findings] or ["No finding"]
        title = f"{one_line(measurement.policy.name)}: {', '.join(names)}"
        figure.suptitle(plain_text(title, letters=90))
        if has_q:
            (values, outputs), (torques, repairs) = figure.subplots(2, 2)
            _draw_values(values, measurement)
            _draw_outputs(outputs, measurement)
            _draw_torques(torques, measurement)
        else:
            repairs = figure.subplots()
        _draw_repairs(repairs, measurement, [*findings, *notes])
    return figure


def _draw_values(axes: Axes, measurement: Measurement) -> None:
    exact = measurement.exact_q.max(axis=1)
    learned = measurement.learned_q.max(axis=1)
    axes.plot(exact, learned, ".", markersize=2, color="tab:blue")
    ends = [exact.min(), exact.max()]
    axes.plot(ends, ends, "--", color="black", label="healthy")
    axes.set(xlabel="Exact value of a state", ylabel="Learned value")
    axes.set_title(f"Values: slope {measurement.value.slope:.2f}")
    axes.legend(frameon=False)


def _draw_outputs(axes: Axes, measurement: Measurement) -> None:
    indices = np.arange(measurement.learned_q.shape[1])
    learned, exact = measurement.learned_q, measurement.exact_q
    axes.plot(indices, learned.mean(axis=0), "o-", markersize=3, color="tab:blue", label="learned")
    axes.plot(indices, exact.mean(axis=0), "--", color="black", label="exact")
    axes.set(xlabel="Output", ylabel="Mean value", title="Mean value of each output")
    axes.legend(frameon=False)


def _draw_torques(axes: Axes, measurement: Measurement) -> None:
    torques = measurement.torques
    limit = 4.0  # N·m; a network that has learned little has no torques to speak of
    found = np.clip(measurement.output_torques, -limit, limit)
    axes.plot(torques, found, "o", markersize=3, color="tab:blue", label="behaves like")
    axes.plot(torques, torques, "--", color="black", label="stands for")
    axes.set(xlabel="Torque of the output (N·m)", ylabel="Torque it behaves like (N·m)")
    axes.set_title("Torque of each output")
    axes.legend(frameon=False)


def _draw_repairs(axes: Axes, measurement: Measurement, findings: Sequence[Finding]) -> None:
    names, regrets = ["as it is"], [measurement.regret]
    for finding in findings:
        if finding.repair is not None:
            names.append(plain_text(finding.repair.name, letters=24))
            regrets.append(finding.repair.regret)
    axes.barh(names, regrets, height=0.6, color="tab:orange")
    axes.set_ylim(max(len(names), 3) - 0.5, -1)  # from the top, with room for the legend
    axes.axvline(measurement.regret_tolerance, color="black", linestyle="--", label="little")
    axes.set(xlabel="Regret (return below the best possible)", title="Repairs without training")
    axes.legend(frameon=False, loc="upper right")
