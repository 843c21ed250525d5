"""A diagnosis: its findings in order, as text, as JSON and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.measurement import Measurement

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The findings on an agent, the strongest first."""

    measurement: Measurement
    findings: list[Finding]  #: the strongest first
    notes: list[Finding]  #: faults that cost little
    limits: list[str]  #: what could not be determined
    assumptions: Sequence[str] = ()  #: say what was assumed of an agent that records less

    @property
    def verdict(self) -> str:
        """The answer in one line."""
        m = self.measurement
        regret = f"regret {m.regret:.2f}"
        if self.findings:
            first = self.findings[0]
            cost = "" if first.cost is None else f"; without it {first.cost:.1f} more return"
            return f"{first.title}: {first.evidence} (healthy: {first.healthy}); {regret}{cost}."
        allowed = f"Up to {m.regret_tolerance:.1f} counts as small: {m.discount_cost:.2f} from the "
        allowed += f"discount, and {m.regret_tolerance - m.discount_cost:.1f} of tolerance"
        if m.regret <= m.regret_tolerance:
            return f"No finding: {regret}. {allowed}."
        if not m.policy.has_q_values:
            same = np.ptp(m.first_efforts) == 0
            same_effort = f"it gives the same {m.dynamics.effort} at all starts"
            reason = same_effort if same else "no repair helps"
            return (
                f"Undetermined: {regret}. {allowed}. Nothing more can be said, because the agent "
                f"gives no Q-values and {reason}: give them with kp.q_function (docs/agents.md)."
            )
        right = m.right_agreement
        return (
            f"No finding, but {regret}. {allowed}. The values satisfy the right equation to "
            f"{100 * right.error:.0f} %, and their advantages agree with it by a correlation of "
            f"{right.correlation:.2f}. Train for longer, with a learning rate that falls."
        )

    @property
    def declared(self) -> str:
        """The declared task: gravity, discount, torques and size of the reward."""
        m = self.measurement
        gravity = m.task.gravity
        text = m.task.environment if gravity is None else f"g = {gravity:g}"
        text += f", γ = {m.discount:g}"
        if m.policy.actions is not None and m.dynamics.any_effort:
            text += f", {len(m.efforts)} torques from {m.efforts[0]:g} to {m.efforts[-1]:g} N·m"
        if m.policy.has_q_values:
            text += f", rewards times {m.reward_scale:g}"
        return text

    def summary(self) -> str:
        """Returns the text that `diagnose` prints; its first line is the answer."""
        measurement = self.measurement
        lines = [
            self.verdict,
            f"Agent {measurement.policy.name}, {self.declared}, {measurement.start_count} starts; "
            f"the discount alone costs {measurement.discount_cost:.2f}.",
            *(f"{sentence}." for sentence in self.assumptions),
        ]
        for number, finding in enumerate(self.findings, 1):
            lines += ["", f"{number}. {finding.title}", f"   Evidence: {finding.evidence}"]
            lines.append(f"   Healthy: {finding.healthy}")
            if finding.repair is not None:
                lines.append(f"   Repair without training: {finding.repair}")
            lines += [f"   {finding.explanation}", f"   Do: {finding.remedy}"]
            lines.append(f"   Read: {finding.page}")
        for note in self.notes:
            lines += ["", f"Note, costs little: {note.title}: {note.evidence}"]
        if self.limits:
            lines += ["", *(f"Not determined: {limit}." for limit in self.limits)]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `diagnose --json` prints; a number that is not finite is null."""
        measurement = self.measurement
        return {
            "agent": measurement.policy.name,
            "environment": measurement.task.environment,
            "gravity": measurement.task.gravity,
            "discount": measurement.discount,
            "starts": measurement.start_count,
            "regret": measurement.regret,
            "discount_regret": measurement.discount_cost,
            "little": measurement.regret_tolerance,
            "verdict": self.verdict,
            "findings": [finding.as_json() for finding in self.findings],
            "notes": [finding.as_json() for finding in self.notes],
            "limits": self.limits,
            "assumptions": list(self.assumptions),
            "signals": {
                name: value if math.isfinite(value) else None
                for name, value in _signals(measurement).items()
            },
        }

    def figure(self) -> Figure:
        """Returns a figure of learned and exact values, outputs, torques and repairs."""
        from keras_pendulum.diagnosis.figure import draw_diagnosis

        return draw_diagnosis(self.measurement, self.findings, self.notes)

    def __getstate__(self) -> dict[str, Any]:
        """Returns the state for pickle: everything is measured."""
        self.figure()
        self.as_json()
        return vars(self)


def _signals(m: Measurement) -> dict[str, float]:
    """Returns the signals of finite Q-values."""
    if not (m.policy.has_q_values and m.finite):
        return {}
    return {
        "value_slope": m.value.slope,
        "value_offset": m.value.offset,
        "value_correlation": m.value.correlation,
        "advantage_slope": m.advantage.slope,
        "advantage_correlation": m.advantage.correlation,
        "right_equation_error": m.right_agreement.error,
        "right_equation_correlation": m.right_agreement.correlation,
        "predicted_return": float(m.q_values(m.dynamics.observe(m.starts)).max(axis=1).mean()),
        "collected_return": float(m.episodes.returns_to_go(m.discount)[0].mean()),
        "largest_outlier": float(m.outliers.max()),
    }
