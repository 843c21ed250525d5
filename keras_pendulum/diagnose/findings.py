"""The findings: the rules in their order, the most certain evidence first.

`benchmarks.faults` made the networks on which the thresholds of the rules were set, and
`benchmarks.diagnosis` measures the rules on other seeds.
"""

from __future__ import annotations

from collections.abc import Callable

from keras_pendulum.diagnose.evidence import Evidence, Finding
from keras_pendulum.diagnose.task_rules import (
    constant,
    no_lookahead,
    not_finite,
    observation_map,
    other_task,
    reward_scale,
    reward_sign,
    reward_size,
    torque_map,
)
from keras_pendulum.diagnose.training_rules import (
    exploration,
    forgetting,
    learning_rate,
    misaligned,
    narrow_starts,
    overestimation,
    saturated_layer,
    stored_transitions,
    too_few_updates,
    undetermined,
    untrained_outputs,
)

# The values of such a run are small, or stop at the rewards of one step.
_EXPLAINS: dict[str, tuple[str, ...]] = {
    "reward-sign": ("observation-map", "overestimation"),
    "no-bootstrapping": ("too-few-updates", "reward-scale", "other-discount"),
    "other-discount": ("too-few-updates", "reward-scale"),
    "reward-scale": ("too-few-updates",),
    "untrained-outputs": ("too-few-updates", "no-bootstrapping"),
    "observation-map": (
        "too-few-updates",
        "narrow-starts",
        "other-gravity",
        "other-discount",
        "overestimation",
    ),
    "torque-map": ("overestimation",),
    "too-few-updates": ("narrow-starts",),
    "misaligned-transitions": ("too-few-updates",),
    "broken-network": ("too-few-updates", "no-bootstrapping", "narrow-starts"),
}

RULES: tuple[Callable[[Evidence], Finding | None], ...] = (
    not_finite,
    stored_transitions,
    reward_sign,
    observation_map,
    reward_size,
    constant,
    torque_map,
    untrained_outputs,
    no_lookahead,
    other_task,
    reward_scale,
    too_few_updates,
    learning_rate,
    exploration,
    overestimation,
    forgetting,
    narrow_starts,
    saturated_layer,
    misaligned,
)


def find(evidence: Evidence) -> list[Finding]:
    """Returns the findings of all rules, each name once.

    What another finding explains is left out.
    """
    found: dict[str, Finding] = {}
    for rule in RULES:
        finding = rule(evidence)
        if finding is not None:
            found.setdefault(finding.name, finding)
            if not evidence.measurement.finite:
                break
    for name, explained in _EXPLAINS.items():
        if name in found:
            found = {other: each for other, each in found.items() if other not in explained}
    if not found and (finding := undetermined(evidence)):
        found[finding.name] = finding
    return list(found.values())
