"""The findings: the rules in their order, the most certain evidence first.

`benchmarks.diagnosis.faults` made the networks on which the thresholds of the rules were set, and
`benchmarks.diagnosis.single_faults` measures the rules on other seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from keras_pendulum.diagnosis import (
    acting_rules,
    equation_rules,
    output_rules,
    training_rules,
)
from keras_pendulum.diagnosis.faults import FAULTS, Finding
from keras_pendulum.diagnosis.measurement import Measurement

RULES: tuple[Callable[[Measurement], Finding | None], ...] = (
    output_rules.not_finite,
    training_rules.stored_transitions,
    output_rules.bounded_output,
    output_rules.batch_broadcast,
    output_rules.same_everywhere,
    equation_rules.wrong_equation,
    acting_rules.observation_map,
    output_rules.reward_size,
    acting_rules.torque_map,
    training_rules.untrained_outputs,
    training_rules.stored_rewards,
    training_rules.too_few_updates,
    training_rules.learning_rate,
    training_rules.exploration,
    training_rules.overestimation,
    training_rules.forgetting,
    training_rules.narrow_starts,
    training_rules.saturated_layer,
)


_SHOWN_BY_REPAIR = ("torque-map", "observation-map")  # without the record of the run


def find(measurement: Measurement) -> list[Finding]:
    """Returns the findings of all rules, each name once.

    What another finding explains is left out. So is a finding whose repair does not win half of
    the avoidable regret, where only the repair shows it; others lose the repair.
    """
    found: dict[str, Finding] = {}
    for rule in RULES:
        finding = _with_working_repair(measurement, rule(measurement))
        if finding is not None:
            found.setdefault(finding.name, finding)
            if not measurement.finite:
                break
    for name, fault in FAULTS.items():
        if name in found:
            found = {other: each for other, each in found.items() if other not in fault.explains}
    if not found and (finding := equation_rules.not_converged(measurement)):
        found[finding.name] = finding
    return list(found.values())


def _with_working_repair(m: Measurement, finding: Finding | None) -> Finding | None:
    if finding is None or finding.repair is None or m.regret <= m.regret_tolerance:
        return finding
    if finding.repair.won >= 0.5 * m.avoidable_regret:
        return finding
    if m.record is None and finding.name in _SHOWN_BY_REPAIR:
        return None
    return replace(finding, repair=None)
