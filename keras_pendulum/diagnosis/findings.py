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
    growth_rules,
    lasting_rules,
    output_rules,
    policy_rules,
    run_rules,
    training_rules,
    transition_rules,
)
from keras_pendulum.diagnosis.faults import FAULTS, Finding
from keras_pendulum.diagnosis.measurement import Measurement

RULES: tuple[Callable[[Measurement], Finding | None], ...] = (
    growth_rules.growth_beyond_ends,
    growth_rules.growth_everywhere,
    output_rules.not_finite,
    transition_rules.stored_transitions,
    output_rules.bounded_output,
    output_rules.lowest_mean,
    output_rules.batch_broadcast,
    output_rules.same_everywhere,
    run_rules.old_state,
    policy_rules.followed_policy,
    equation_rules.wrong_equation,
    acting_rules.observation_map,
    output_rules.reward_size,
    acting_rules.torque_map,
    acting_rules.small_torques,
    training_rules.untrained_outputs,
    training_rules.stored_rewards,
    training_rules.too_few_updates,
    training_rules.learning_rate,
    run_rules.exploration,
    training_rules.overestimation,
    transition_rules.forgetting,
    run_rules.narrow_starts,
    training_rules.saturated_layer,
    transition_rules.truncation_as_end,
)


_SHOWN_BY_REPAIR = ("torque-map", "observation-map")  # unless stored actions prove them


def find(measurement: Measurement) -> list[Finding]:
    """Returns the findings of all rules, each name once.

    What another finding explains is left out, unless the transitions prove it. So is a finding
    whose repair does not win half of the avoidable regret, where only the repair shows it; others
    lose the repair.
    """
    found: dict[str, Finding] = {}
    proof = ""  # the name of what the transitions prove
    for rule in RULES:
        finding = _with_working_repair(measurement, rule(measurement))
        if finding is not None:
            found.setdefault(finding.name, finding)
            if rule is transition_rules.stored_transitions:
                proof = finding.name
            if not measurement.finite:
                break
    for name, fault in FAULTS.items():
        if name in found:
            found = {
                other: each
                for other, each in found.items()
                if other not in fault.explains or other == proof
            }
    if not found:
        finding = lasting_rules.lasting_actions(measurement)
        finding = finding or run_rules.unsteady_return(measurement)
        if finding := finding or equation_rules.not_converged(measurement):
            found[finding.name] = finding
    return list(found.values())


def find_in_record(measurement: Measurement) -> list[Finding]:
    """Returns the findings of the record alone, for an agent without Q-values."""
    if measurement.record is None:
        return []
    rules = (
        transition_rules.stored_transitions,
        run_rules.old_state,
        run_rules.narrow_starts,
        transition_rules.truncation_as_end,
    )
    return [finding for rule in rules if (finding := rule(measurement)) is not None]


def _with_working_repair(m: Measurement, finding: Finding | None) -> Finding | None:
    if finding is None or finding.repair is None or m.regret <= m.regret_tolerance:
        return finding
    if finding.repair.won >= 0.5 * m.avoidable_regret:
        return finding
    if not finding.proven and finding.name in _SHOWN_BY_REPAIR:
        return None
    return replace(finding, repair=None)
