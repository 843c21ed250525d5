"""The diagnosis of an agent: from the agent and its declared task to ordered findings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from keras_pendulum.config.config import Config
from keras_pendulum.config.fields import Number
from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.findings import find
from keras_pendulum.diagnosis.measurement import STARTS, Measurement
from keras_pendulum.diagnosis.repairs import find_by_repairs
from keras_pendulum.diagnosis.run_record import read_record
from keras_pendulum.diagnosis.states import observe
from keras_pendulum.environments.pendulum import require_pendulum
from keras_pendulum.evaluate.evaluation import find_task
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.storage.run_folder import find_run_if_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BARE_POLICY = "without Q-values, faults of the training cannot be seen"
_NO_RUN = (
    "learning rate, exploration and forgetting leave no sure trace in a network: diagnose the run "
    "folder for them"
)


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
        measurement = self.measurement
        regret = f"regret {measurement.regret:.2f}"
        if not self.findings:
            little, by_discount = measurement.regret_tolerance, measurement.discount_cost
            allowed = f"Up to {little:.1f} counts as small: {by_discount:.2f} from the discount, "
            allowed += f"and {little - by_discount:.1f} of tolerance"
            if measurement.regret <= little:
                return f"No finding: {regret}. {allowed}."
            if not measurement.policy.has_q_values:
                return (
                    f"Undetermined: {regret}. {allowed}. The agent gives no Q-values, so only "
                    "repairs were tried: give them with kp.q_function (docs/agents.md)."
                )
            return f"No finding, but {regret}. {allowed}. Train for longer."
        first = self.findings[0]
        cost = "" if first.cost is None else f"; without it {first.cost:.1f} more return"
        return f"{first.name}: {first.evidence} (healthy: {first.healthy}); {regret}{cost}."

    def summary(self) -> str:
        """Returns the text that `diagnose` prints; its first line is the answer."""
        measurement = self.measurement
        lines = [
            self.verdict,
            f"Agent {measurement.policy.name}, g = {measurement.task.gravity:g}, "
            f"γ = {measurement.discount:g}, {STARTS} starts; "
            f"the discount alone costs {measurement.discount_cost:.2f}.",
            *(f"{sentence}." for sentence in self.assumptions),
        ]
        for number, finding in enumerate(self.findings, 1):
            lines += ["", f"{number}. {finding.name}", f"   Evidence: {finding.evidence}"]
            lines.append(f"   Healthy: {finding.healthy}")
            if finding.repair is not None:
                lines.append(f"   Repair without training: {finding.repair}")
            lines += [f"   {finding.explanation}", f"   Do: {finding.remedy}"]
            lines.append(f"   Read: {finding.page}")
        for note in self.notes:
            lines += ["", f"Note, costs little: {note.name}: {note.evidence}"]
        if self.limits:
            lines += ["", *(f"Not determined: {limit}." for limit in self.limits)]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `diagnose --json` prints; a number that is not finite is null."""
        measurement = self.measurement
        return {
            "agent": measurement.policy.name,
            "gravity": measurement.task.gravity,
            "discount": measurement.discount,
            "starts": STARTS,
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
        """Returns the state for pickle: everything is measured, and the agent's code left out."""
        self.figure()
        self.as_json()
        return {**vars(self), "measurement": self.measurement.without_code()}


def diagnose(
    agent: Any,
    *,
    gravity: float | None = None,
    discount: float | None = None,
    torques: ArrayLike | None = None,
) -> Diagnosis:
    """Returns the diagnosis of an agent of Pendulum-v1.

    Args:
        agent: what `evaluate_policy` takes, or a run folder (its history and replay buffer are
            used, too).
        gravity: declared g in m/s²; None takes the recorded one, else the better one of 10 and 1,
            and the summary says so.
        discount: declared γ; None takes the recorded one, else 0.9, and the
            summary says so.
        torques: N·m of the outputs, as in `evaluate_policy`.

    Raises ConfigError for a gravity, discount or torques out of range and for CartPole, and as
    `evaluate_policy` does.

    >>> [finding.name for finding in kp.diagnose("original").findings]
    ['too-few-updates']
    """
    folder = find_run_if_folder(agent)
    record = None if folder is None else read_record(folder)
    policy = as_policy(agent if folder is None else folder.weights, torques)
    found, assumption = find_task(policy, gravity)
    task = require_pendulum(found, policy.name, "diagnose is for Pendulum-v1")
    sentences = [assumption] if assumption else []
    if discount is None and (discount := policy.info.discount) is None:
        discount = Config.discount
        sentences.append(
            f"The agent records no discount. {discount:g} was assumed: declare yours with "
            "discount= (--discount)"
        )
    discount = Number(0, 1).validate("discount", discount)
    scale = policy.info.reward_scale
    diagnosis = diagnose_measurement(Measurement(policy, task, discount, scale, record))
    return replace(diagnosis, assumptions=sentences)


def diagnose_measurement(measurement: Measurement) -> Diagnosis:
    """Returns the diagnosis of an agent whose task is declared."""
    tolerance = measurement.regret_tolerance
    if not measurement.policy.has_q_values:
        findings = find_by_repairs(measurement) if measurement.regret > tolerance else []
        return Diagnosis(measurement, findings, [], [_BARE_POLICY])
    good = measurement.finite and measurement.regret <= tolerance
    found = find(measurement)
    if not good:
        return Diagnosis(measurement, found, [], [] if measurement.record else [_NO_RUN])
    # A repair that makes a good agent bad shows that there is no such fault.
    notes = [
        each
        for each in found
        if each.name != "undetermined" and (each.cost is None or each.cost >= -tolerance)
    ]
    return Diagnosis(measurement, [], notes, [])


def _signals(m: Measurement) -> dict[str, float]:
    """Returns the signals of finite Q-values."""
    if not (m.policy.has_q_values and m.finite):
        return {}
    return {
        "value_slope": m.value.slope,
        "value_offset": m.value.offset,
        "value_correlation": m.value.correlation,
        "plane_value_slope": m.plane_value.slope,
        "plane_value_correlation": m.plane_value.correlation,
        "advantage_slope": m.advantage.slope,
        "advantage_correlation": m.advantage.correlation,
        "td_error": m.td_error,
        "predicted_return": float(m.q_values(observe(m.starts)).max(axis=1).mean()),
        "collected_return": float(m.episodes.returns_to_go(m.discount)[0].mean()),
        "asymmetry": m.asymmetry,
        "largest_outlier": float(m.outliers.max()),
        **{f"error_{name.replace(' ', '_')}": error for name, error in m.regions.items()},
    }
