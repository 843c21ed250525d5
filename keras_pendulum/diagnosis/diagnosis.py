"""The diagnosis of an agent: from the agent and its declared task to ordered findings."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.fields import Number
from keras_pendulum.diagnosis.equation_rules import shown_discount
from keras_pendulum.diagnosis.faults import Finding
from keras_pendulum.diagnosis.findings import find, find_in_record
from keras_pendulum.diagnosis.measurement import STARTS, Measurement
from keras_pendulum.diagnosis.repairs import find_by_repairs
from keras_pendulum.diagnosis.run_record import make_record, read_record
from keras_pendulum.dqn.network import DQN
from keras_pendulum.environments.task import Task
from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import ConfigError
from keras_pendulum.evaluate.evaluation import USUAL_GRAVITIES, find_task
from keras_pendulum.evaluate.policy import Policy
from keras_pendulum.evaluate.q_policies import q_function
from keras_pendulum.evaluate.sources import as_policy
from keras_pendulum.optimum.known_dynamics import KnownDynamics
from keras_pendulum.optimum.solutions import solution
from keras_pendulum.status import Report
from keras_pendulum.storage.run_folder import find_run_if_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STARTS_BY_SECONDS = ((2e-3, STARTS), (1e-2, 12), (math.inf, 4))  # of one call
_PLAYS = 10  # of all starts, at most, for a policy without Q-values
_BARE_POLICY = "without Q-values, faults of the training cannot be seen"
_NO_RUN = (
    "learning rate, exploration, narrow starts and a small replay buffer leave no sure trace in a "
    "network. A run folder, record= (--record) or transitions= shows them"
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
        """Returns the state for pickle: everything is measured, and the agent's code left out."""
        self.figure()
        self.as_json()
        return {**vars(self), "measurement": self.measurement.without_code()}


def diagnose(
    agent: Any,
    *,
    environment: str | None = None,
    gravity: float | None = None,
    discount: float | None = None,
    torques: ArrayLike | None = None,
    reward_scale: float | None = None,
    record: Any = None,
    transitions: Any = None,
    on_progress: Report = lambda share: None,
) -> Diagnosis:
    """Returns the diagnosis of an agent of Pendulum-v1 or CartPole-v1.

    Args:
        agent: what `evaluate_policy` takes, or a run folder (its history and replay buffer are
            used, too).
        environment: as in `evaluate_policy`.
        gravity: declared g in m/s²; None takes the recorded one, else the better one of 10 and 1,
            and the summary says so.
        discount: declared γ; None takes the recorded one, else the one that the values show, else
            0.9 (0.99 for CartPole), and the summary says so.
        torques: N·m of the outputs, as in `evaluate_policy`.
        reward_scale: declared factor on the rewards; None takes the recorded one, else 1.
        record: a `kp.Recorder` that was around the environment during the training, or the path of
            the file that its `save` wrote.
        transitions: the content of the program's replay buffer: five arrays (s, a, r, s′, done), or
            a list of such tuples. An action is the index of a torque, or a torque in N·m.
        on_progress: called with the share of the episodes that are played, 0 to 1, of a policy
            without Q-values. A slow one plays fewer starts, and the summary says how many.

    Raises ConfigError for a gravity, discount, torques or reward scale out of range, for a record
    or transitions that are not those of the environment, and as `evaluate_policy` does.

    >>> [finding.name for finding in kp.diagnose("original").findings]
    ['too-few-updates']
    """
    folder = find_run_if_folder(agent)
    if folder is not None and not (record is None and transitions is None):
        raise ConfigError(
            f"{folder.path} is a run folder, which has a record of its own: leave out record= and "
            "transitions=, or name its weights file"
        )
    if isinstance(agent, DQN) and not all(np.isfinite(each).all() for each in agent.get_weights()):
        agent = q_function(agent, name="DQN")  # no policy, but its values can be diagnosed
    source = agent if folder is None else folder.weights
    policy = as_policy(source, torques, environment=environment)
    unknown = gravity is None and policy.info.task is None
    if unknown and policy.has_q_values and not _are_finite(policy):
        gravity = USUAL_GRAVITIES[0]  # no task can be found by playing
    task, assumption = find_task(policy, gravity)
    dynamics = solution(task)
    if not isinstance(dynamics, KnownDynamics):
        raise ConfigError(
            f"{policy.name} belongs to {task.environment}; diagnose is for {' and '.join(TASKS)}"
        )
    if folder is None:
        outputs = None if policy.actions is None else dynamics.all_efforts(policy.actions)
        run = make_record(record, transitions, outputs, dynamics)
    else:
        run = read_record(folder)
    sentences = [assumption] if assumption else []
    declared = policy.info.discount if discount is None else discount
    if declared is not None:
        declared = Number(0, 1).validate("discount", declared)
    if reward_scale is None:
        reward_scale = policy.info.reward_scale
    reward_scale = Number(1e-6, 1e6).validate("reward_scale", reward_scale)
    starts = STARTS if policy.has_q_values else _start_count(policy)
    total, played = starts * _PLAYS, 0

    def report(count: int) -> None:
        nonlocal played
        played += count
        on_progress(min(1.0, played / total))

    gamma = task.usual_discount if declared is None else declared
    measurement = Measurement(policy, task, gamma, reward_scale, run, starts, report)
    if declared is None:
        if (shown := shown_discount(measurement)) is None:
            reason = f"{gamma:g} was assumed"
        else:
            reason = f"Its values fit {shown:g} better than {gamma:g}, so this was assumed"
            measurement = replace(measurement, discount=shown)
        sentences.append(
            f"The agent records no discount. {reason}: declare yours with discount= (--discount)"
        )
    return replace(diagnose_measurement(measurement), assumptions=sentences)


def _upright(task: Task) -> NDArray[np.float32]:
    """Returns an observation [1, D]."""
    return np.eye(1, task.observation_size, dtype=np.float32)


def _are_finite(policy: Policy) -> bool:
    return bool(np.isfinite(policy.q_values(_upright(policy.task))).all())


def _start_count(policy: Policy) -> int:
    """Returns the number of starts: fewer for a policy that needs long for one observation."""
    observation = _upright(policy.task)
    policy.act(observation)  # the first call may compile something
    began = time.perf_counter()
    policy.act(observation)
    seconds = time.perf_counter() - began
    return next(count for limit, count in _STARTS_BY_SECONDS if seconds < limit)


def diagnose_measurement(measurement: Measurement) -> Diagnosis:
    """Returns the diagnosis of an agent whose task is declared."""
    tolerance = measurement.regret_tolerance
    if not measurement.policy.has_q_values:
        shown = find_in_record(measurement)
        if measurement.regret <= tolerance:
            return Diagnosis(measurement, [], shown, [_BARE_POLICY])
        return Diagnosis(measurement, shown or find_by_repairs(measurement), [], [_BARE_POLICY])
    good = measurement.finite and measurement.regret <= tolerance
    found = find(measurement)
    if not good:
        return Diagnosis(measurement, found, [], [] if measurement.record else [_NO_RUN])
    # A repair that makes a good agent bad shows that there is no such fault.
    notes = [
        each
        for each in found
        if each.name != "not-converged" and (each.cost is None or each.cost >= -tolerance)
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
        "advantage_slope": m.advantage.slope,
        "advantage_correlation": m.advantage.correlation,
        "right_equation_error": m.right_agreement.error,
        "right_equation_correlation": m.right_agreement.correlation,
        "predicted_return": float(m.q_values(m.dynamics.observe(m.starts)).max(axis=1).mean()),
        "collected_return": float(m.episodes.returns_to_go(m.discount)[0].mean()),
        "largest_outlier": float(m.outliers.max()),
    }
