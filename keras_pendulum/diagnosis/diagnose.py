"""Diagnoses an agent on the task that its author declares, or that has to be assumed."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keras_pendulum.config.fields import Number
from keras_pendulum.diagnosis.diagnosis import Diagnosis
from keras_pendulum.diagnosis.equation_rules import shown_discount
from keras_pendulum.diagnosis.findings import find, find_in_record
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.played_agent import STARTS
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

_STARTS_BY_SECONDS = ((2e-3, STARTS), (1e-2, 12), (math.inf, 4))  # of one call
_PLAYS = 10  # of all starts, at most, for a policy without Q-values
_BARE_POLICY = "without Q-values, faults of the training cannot be seen"
_NO_RUN = (
    "learning rate, exploration, narrow starts and a small replay buffer leave no sure trace in a "
    "network. A run folder, record= (--record) or transitions= shows them"
)


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
    if (
        gravity is None
        and policy.info.task is None
        and policy.has_q_values
        and not np.isfinite(policy.q_values(_upright(policy.task))).all()
    ):
        gravity = USUAL_GRAVITIES[0]  # no task can be found by playing
    task, assumption = find_task(policy, gravity)
    dynamics = solution(task)
    if not isinstance(dynamics, KnownDynamics):
        raise ConfigError(
            f"{policy.name} belongs to {task.environment}; diagnose is for {' and '.join(TASKS)}"
        )
    if folder is None:
        outputs = None if policy.actions is None else dynamics.efforts(policy.actions.values)
        run = make_record(record, transitions, outputs, dynamics)
    else:
        run = read_record(folder)
    sentences = [assumption] if assumption else []
    if policy.has_q_values and _has_random_values(policy):
        sentences.append(
            "Asked twice, the agent gives two values for one observation: is dropout still on? "
            "Hand in the network as it is after the training (model.eval() in PyTorch)"
        )
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


def _has_random_values(policy: Policy) -> bool:
    first, second = (policy.q_values(_upright(policy.task)) for _ in range(2))
    return not np.allclose(first, second, rtol=1e-3, equal_nan=True)


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
