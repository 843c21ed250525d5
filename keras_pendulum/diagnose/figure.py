"""The figure of a diagnosis: learned and exact values, outputs, torques and repairs."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from keras_pendulum.errors import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from keras_pendulum.diagnose.evidence import Finding
    from keras_pendulum.diagnose.measurement import Measurement


def draw_diagnosis(
    measurement: Measurement, findings: Sequence[Finding], notes: Sequence[Finding]
) -> Figure:
    """Returns a Matplotlib figure; without finite Q-values, only the repairs are drawn."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"font.size": 10}):
        has_q = measurement.subject.raw_q is not None and measurement.finite
        figure = Figure(figsize=(10, 8) if has_q else (6, 4), layout="constrained")
        names = [finding.name for finding in findings] or ["No finding"]
        title = f"{one_line(measurement.subject.name)}: {', '.join(names)}"
        figure.suptitle(textwrap.fill(title, 90).replace("$", r"\$"))
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
    axes.set_xlabel("Exact value of a state")
    axes.set_ylabel("Learned value")
    axes.set_title(f"Values: slope {measurement.value.slope:.2f}", fontsize="medium")
    axes.legend(frameon=False)


def _draw_outputs(axes: Axes, measurement: Measurement) -> None:
    indices = np.arange(measurement.learned_q.shape[1])
    learned, exact = measurement.learned_q, measurement.exact_q
    axes.plot(indices, learned.mean(axis=0), "o-", markersize=3, color="tab:blue", label="learned")
    axes.plot(indices, exact.mean(axis=0), "--", color="black", label="exact")
    axes.set_xlabel("Output")
    axes.set_ylabel("Mean value")
    axes.set_title("Mean value of each output", fontsize="medium")
    axes.legend(frameon=False)


def _draw_torques(axes: Axes, measurement: Measurement) -> None:
    torques = measurement.subject.torques
    assert torques is not None
    limit = 4.0  # N·m; a network that has learned little has no torques to speak of
    found = np.clip(measurement.output_torques, -limit, limit)
    axes.plot(torques, found, "o", markersize=3, color="tab:blue", label="behaves like")
    axes.plot(torques, torques, "--", color="black", label="stands for")
    axes.set_xlabel("Torque of the output (N·m)")
    axes.set_ylabel("Torque it behaves like (N·m)")
    axes.set_title("Torque of each output", fontsize="medium")
    axes.legend(frameon=False)


def _draw_repairs(axes: Axes, measurement: Measurement, findings: Sequence[Finding]) -> None:
    names, regrets = ["as it is"], [measurement.regret]
    for finding in findings:
        if finding.repair is not None:
            names.append(textwrap.fill(finding.repair.name, 24).replace("$", r"\$"))
            regrets.append(finding.repair.regret)
    axes.barh(names, regrets, height=0.6, color="tab:orange")
    axes.set_ylim(max(len(names), 3) - 0.5, -1)  # from the top, with room for the legend
    axes.axvline(measurement.little, color="black", linestyle="--", label="little")
    axes.set_xlabel("Regret (return below the best possible)")
    axes.set_title("Repairs without training", fontsize="medium")
    axes.legend(frameon=False, loc="upper right")
