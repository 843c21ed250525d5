"""The findings: the rules in their order, the most certain evidence first.

`benchmarks.diagnosis.faults` made the networks on which the thresholds of the rules were set, and
`benchmarks.diagnosis.single_faults` measures the rules on other seeds.
"""

from __future__ import annotations

from collections.abc import Callable

from keras_pendulum.diagnosis import task_rules, training_rules
from keras_pendulum.diagnosis.faults import FAULTS, Finding
from keras_pendulum.diagnosis.measurement import Measurement

RULES: tuple[Callable[[Measurement], Finding | None], ...] = (
    task_rules.not_finite,
    training_rules.stored_transitions,
    task_rules.reward_sign,
    task_rules.observation_map,
    task_rules.reward_size,
    task_rules.constant,
    task_rules.torque_map,
    training_rules.untrained_outputs,
    task_rules.no_lookahead,
    task_rules.other_task,
    task_rules.reward_scale,
    training_rules.too_few_updates,
    training_rules.learning_rate,
    training_rules.exploration,
    training_rules.overestimation,
    training_rules.forgetting,
    training_rules.narrow_starts,
    training_rules.saturated_layer,
    training_rules.misaligned,
)


def find(measurement: Measurement) -> list[Finding]:
    """Returns the findings of all rules, each name once.

    What another finding explains is left out.
    """
    found: dict[str, Finding] = {}
    for rule in RULES:
        finding = rule(measurement)
        if finding is not None:
            found.setdefault(finding.name, finding)
            if not measurement.finite:
                break
    for name, fault in FAULTS.items():
        if name in found:
            found = {other: each for other, each in found.items() if other not in fault.explains}
    if not found and (finding := training_rules.undetermined(measurement)):
        found[finding.name] = finding
    return list(found.values())
