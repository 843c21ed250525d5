"""The diagnosis of an agent: from the agent and its declared task to ordered findings."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from keras_pendulum.config.config import Config
from keras_pendulum.diagnose import repairs
from keras_pendulum.diagnose.evidence import Evidence, Finding
from keras_pendulum.diagnose.findings import find
from keras_pendulum.diagnose.measurement import STARTS, Measurement, measure
from keras_pendulum.diagnose.run_record import RunRecord
from keras_pendulum.diagnose.subject import Subject
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError, UserError
from keras_pendulum.evaluate.agents import Agent, as_agent
from keras_pendulum.evaluate.evaluation import evaluation_gravity
from keras_pendulum.optimum.discounted import validate_discount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BARE_POLICY = "the agent has no Q-values, so only repairs could be tried"
_NO_RUN = (
    "learning rate, exploration and forgetting leave no sure trace in a network: diagnose the run "
    "folder for them"
)


@dataclass(frozen=True)
class Diagnosis:
    """The findings on an agent, the strongest first."""

    measurement: Measurement
    findings: list[Finding]  #: the strongest first
    notes: list[Finding]  #: what costs little
    limits: list[str]  #: what could not be determined

    @property
    def verdict(self) -> str:
        """The answer in one line."""
        measurement = self.measurement
        regret = f"regret {measurement.regret:.2f}"
        if not self.findings:
            little = f"up to {measurement.little:.1f} is little"
            if measurement.regret <= measurement.little:
                return f"No finding: {regret}, and {little}."
            return f"No finding, but {regret}, where {little}: train for longer."
        first = self.findings[0]
        cost = "" if first.cost is None else f"; without it {first.cost:.1f} more return"
        return f"{first.name}: {first.evidence} (healthy: {first.healthy}); {regret}{cost}."

    def summary(self) -> str:
        """Returns the text that `diagnose` prints; its first line is the answer."""
        subject = self.measurement.subject
        lines = [
            self.verdict,
            f"Agent {subject.name}, g = {subject.gravity:g}, γ = {subject.discount:g}, "
            f"{STARTS} starts; the discount alone costs {self.measurement.discount_cost:.2f}.",
        ]
        for number, finding in enumerate(self.findings, 1):
            lines += ["", f"{number}. {finding.name}", f"   Evidence: {finding.evidence}"]
            lines.append(f"   Healthy: {finding.healthy}")
            if finding.repair is not None:
                lines.append(
                    f"   Repair without training: {finding.repair.name}: regret "
                    f"{finding.repair.regret:.2f}"
                )
            lines += [f"   {finding.explanation}", f"   Do: {finding.remedy}"]
            lines.append(f"   Read: {finding.page}")
        for note in self.notes:
            lines += ["", f"Note, costs little: {note.name}: {note.evidence}"]
        lines += (
            ["", *(f"Not determined: {limit}." for limit in self.limits)] if self.limits else []
        )
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Returns the object that `diagnose --json` prints; a number that is not finite is null."""
        measurement = self.measurement
        subject = measurement.subject
        signals: dict[str, float] = {}
        if subject.raw_q is not None and measurement.finite:
            signals = {
                "value_slope": measurement.value.slope,
                "value_offset": measurement.value.offset,
                "value_correlation": measurement.value.correlation,
                "plane_value_slope": measurement.plane_value.slope,
                "plane_value_correlation": measurement.plane_value.correlation,
                "advantage_slope": measurement.advantage.slope,
                "advantage_correlation": measurement.advantage.correlation,
                "td_error": measurement.td_error,
                "predicted_return": measurement.predicted,
                "collected_return": measurement.collected,
                "asymmetry": measurement.asymmetry,
                "largest_outlier": float(measurement.outliers.max()),
                **{f"error_{name}": error for name, error in measurement.regions.items()},
            }
        return {
            "agent": subject.name,
            "gravity": subject.gravity,
            "discount": subject.discount,
            "starts": STARTS,
            "regret": measurement.regret,
            "discount_regret": measurement.discount_cost,
            "little": measurement.little,
            "verdict": self.verdict,
            "findings": [finding.as_json() for finding in self.findings],
            "notes": [finding.as_json() for finding in self.notes],
            "limits": self.limits,
            "signals": {
                name.replace(" ", "_"): value if math.isfinite(value) else None
                for name, value in signals.items()
            },
        }

    def figure(self) -> Figure:
        """Returns a figure of learned and exact values, outputs, torques and repairs."""
        from keras_pendulum.diagnose.figure import draw_diagnosis

        return draw_diagnosis(self.measurement, self.findings, self.notes)


def diagnose(
    agent: Any,
    *,
    gravity: float | None = None,
    discount: float | None = None,
    torques: ArrayLike | None = None,
) -> Diagnosis:
    """Returns the diagnosis of an agent of Pendulum-v1.

    Args:
        agent: what `evaluate_policy` takes, or the folder of a run, which tells more.
        gravity: declared g in m/s²; None takes the recorded one, else 1.
        discount: declared γ; None takes the recorded one, else 0.9.
        torques: N·m of the outputs, as in `evaluate_policy`.

    Raises ConfigError for a gravity, discount or torques out of range and for CartPole, and as
    `evaluate_policy` does.
    """
    record = None
    if isinstance(agent, (str, os.PathLike)) and (checkpoint := _checkpoint(agent)) is not None:
        from keras_pendulum.diagnose.run_folder import read_record

        record = read_record(checkpoint)
        agent = checkpoint
    subject = make_subject(as_agent(agent, torques), gravity, discount)
    return diagnose_subject(subject, record)


def make_subject(
    agent: Agent, gravity: float | None = None, discount: float | None = None
) -> Subject:
    """Returns the agent with its declared task; see `diagnose`."""
    if not TASKS[agent.environment].has_torque:
        raise ConfigError(f"the agent belongs to {agent.environment}; diagnose is for Pendulum-v1")
    run = agent.provenance
    if discount is None:
        discount = agent.discount if agent.discount is not None else Config.discount
    declared = Config.gravity if run is None else run.gravity
    scale = 1.0
    if run is not None:
        declared = evaluation_gravity(run, gravity)
        try:
            scale = float(json.loads(run.config or "")["reward_scale"]) or 1.0
        except (ValueError, LookupError, TypeError, RecursionError):
            scale = 1.0
    network = agent.network if hasattr(agent.network, "activation") else None
    subject = Subject(
        agent.name,
        float(gravity if gravity is not None else declared or 1.0),
        validate_discount(discount),
        agent.act,
        agent.q_values,
        agent.torques,
        scale,
        network,
    )
    if agent.q_values is not None and agent.torques is not None:
        return subject.with_torques(agent.torques)  # never raises for a value that is not finite
    return subject


def diagnose_subject(subject: Subject, record: RunRecord | None = None) -> Diagnosis:
    """Returns the diagnosis of an agent whose task is declared."""
    return diagnose_measurement(measure(subject), record)


def diagnose_measurement(measurement: Measurement, record: RunRecord | None = None) -> Diagnosis:
    """Returns the diagnosis of a measured agent, without and with its run's record."""
    if measurement.subject.raw_q is None:
        return _diagnose_bare_policy(measurement)
    evidence = Evidence(measurement, record)
    little = measurement.finite and measurement.regret <= measurement.little
    found = find(evidence)
    found = [finding for finding in found if not (little and finding.name == "undetermined")]
    limits = [] if record is not None or little else [_NO_RUN]
    if not little:
        return Diagnosis(measurement, found, [], limits)
    # A repair that makes a good agent bad shows that there is no such fault.
    notes = [each for each in found if each.cost is None or each.cost >= -measurement.little]
    return Diagnosis(measurement, [], notes, limits)


def _diagnose_bare_policy(measurement: Measurement) -> Diagnosis:
    """Returns the diagnosis of a policy without Q-values, by repairs alone."""
    findings: list[Finding] = []
    if measurement.regret > measurement.little:
        tried = repairs.repair_bare_policy(measurement)
        name, best = min(tried, key=lambda item: item[1].regret)
        won = measurement.regret - best.regret
        if won > 0.5 * measurement.regret:
            evidence = f"with {best.name} the regret is {best.regret:.1f}"
            findings = [Finding(name, evidence, "no change helps", best, won)]
    return Diagnosis(measurement, findings, [], [_BARE_POLICY])


def _checkpoint(agent: str | os.PathLike[str]) -> Path | None:
    """Returns the checkpoint in the folder `agent`; None where it is no folder.

    Raises UserError for a folder without a run.
    """
    folder = Path(agent)
    try:
        if not folder.is_dir():
            return None
        name = TASKS["Pendulum-v1"].weights_name
        if not (folder / name).is_file():
            raise UserError(f"{folder}: holds no run of Pendulum-v1 (no {name})")
    except (OSError, ValueError):
        return None
    return folder / name
