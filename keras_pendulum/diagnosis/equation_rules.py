"""The rules that ask which equation the values obey.

Each rule returns a finding, or None. `findings` says where the limits come from.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis import repairs
from keras_pendulum.diagnosis.acting_rules import SAME_ACTIONS, match_actions
from keras_pendulum.diagnosis.backup import Agreement
from keras_pendulum.diagnosis.equation import RIGHT, Equation, percent
from keras_pendulum.diagnosis.faults import Fault, Finding, Repair
from keras_pendulum.diagnosis.lasting_rules import may_last
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.rollouts import FewSteps, few_steps

RIGHT_ERROR = 0.03  # below, no other equation is of interest
_RIGHT_VALUES = 0.9  # correlation with the exact values
_FEW_STEPS = 0.25  # error of the rewards of a few steps; that of rewards of another size is larger
_LIKE_FEW_STEPS = 0.1  # error of the rewards of a few steps that leaves no doubt
_BY_CHANCE = 0.4  # correlation of advantages that have not been learned
_BY_CHANCE_OF_TWO = 0.2  # the same of the two actions of CartPole
_OTHER_SLOPE = 1.7  # times the slope that the equation says
_CLEARLY_BEST = 0.9  # share of the error of other observations that one has at most
_ALIKE = 0.15  # less correlation of the advantages: then another observation fits as well
_FITS_BETTER = 0.8  # share of the error of the usual γ that another one has at most
_AS_WELL = 1.5  # times the error of another equation with the usual γ, which declares more
_DIVERGED = 20.0  # spreads above the best possible value: no fixed point is there
HEALTHY = f"{RIGHT} to 1 to 7 %"


def wrong_equation(m: Measurement) -> Finding | None:
    """Finds another equation that the values obey clearly better than the right one."""
    if (found := obeyed_equation(m)) is None:
        return None
    right, own, equation = m.right_agreement, found.agreement, found.equation
    evidence = f"the values satisfy {equation.formula} to {percent(own.error)} and {RIGHT} to "
    evidence += percent(right.error)
    text = Fault(equation.explanation, equation.remedy) if equation.explanation else None
    return Finding(
        equation.name, evidence, HEALTHY, found.repair, equation.variant, text, found.proven
    )


def shown_discount(m: Measurement) -> float | None:
    """Returns another γ than the usual one, which was assumed, if the values show it.

    They obey its equation best, or a larger γ fits better than the usual one. A smaller γ fits the
    values of a short training, too.
    """
    if not (m.policy.has_q_values and m.finite):
        return None
    found, right = obeyed_equation(m), m.right_agreement
    if found is not None and found.equation.discount is not None:
        return found.equation.discount
    largest = min(_FITS_BETTER * right.error, _AS_WELL * found.agreement.error if found else np.inf)
    larger = [
        (own.error, equation.discount)
        for own, equation in m.agreements
        if equation.discount is not None
        and m.discount < equation.discount < 1
        and own.error < largest
    ]
    return min(larger)[1] if larger else None


class Obeyed(NamedTuple):
    """A wrong equation, and what shows it."""

    agreement: Agreement
    equation: Equation
    repair: Repair | None
    proven: bool


def obeyed_equation(m: Measurement) -> Obeyed | None:
    """Returns the equation that the values obey clearly better than the right one."""
    right = m.right_agreement
    if right.error < RIGHT_ERROR:
        return None
    agreements, ends = m.agreements, not m.task.never_terminates

    @cache
    def observations() -> list[Agreement]:
        return [
            own
            for own, equation in agreements
            if equation.name == "observation-map" and equation.explains(own, right, ends)
        ]

    def fits_by_chance(own: Agreement) -> bool:
        """Returns whether another observation explains the values about as well, too."""
        return any(
            other is not own
            and other.error < own.error / _CLEARLY_BEST
            and other.correlation > own.correlation - _ALIKE
            for other in observations()
        )

    @cache
    def acts_as_stored() -> bool:
        actions = match_actions(m)
        return actions is not None and actions.declared > SAME_ACTIONS

    @cache
    def short_training() -> FewSteps:
        return few_steps(m)

    def is_short_training(equation: Equation) -> bool:
        """Returns whether values of the declared task that look few steps ahead fit better."""
        if not m.task.never_terminates:
            return False
        few = short_training()
        if equation.slope is not None:
            return few.error < _FEW_STEPS
        if equation.discount is None or equation.discount > m.discount:
            return False
        error = few.rollouts.q - few.rollouts.target(equation.discount)
        return float(np.sqrt(np.mean(error**2))) / m.backup.spread > 0.5 * few.error

    def is_refuted(own: Agreement, equation: Equation) -> bool:
        """Returns whether the exact values or the record show that this equation is not its own."""
        if m.excess > _DIVERGED and equation.variant != "frozen-target":
            return True
        if equation.name == "observation-map":
            # There are many, so some fit by chance. In CartPole, several fit alike in any case.
            by_chance = not ends and fits_by_chance(own)
            if by_chance or m.value.correlation > _RIGHT_VALUES:
                return True
        # The first values of a right program pass those with an index. But they learn actions.
        not_learned = _BY_CHANCE_OF_TWO if ends else _BY_CHANCE
        if equation.variant == "index-for-value" and m.advantage.correlation > not_learned:
            return True
        # The values of a few steps, which a short training has, obey one with smaller rewards.
        if equation.slope is not None and m.value.slope > _OTHER_SLOPE * equation.slope:
            return True
        if m.record is None:
            return False
        if equation.name in ("observation-map", "torque-map"):
            return acts_as_stored()
        return equation.name == "other-gravity"  # the transitions have shown which one acted

    if ends:  # there are hundreds of observations, so they come last
        agreements = sorted(agreements, key=lambda item: item[1].name == "observation-map")
    for own, equation in agreements:
        if is_refuted(own, equation) or not equation.explains(own, right, ends):
            continue
        if is_short_training(equation) or (not equation.offset and may_last(m, own.error)):
            continue
        repair = _repair(m, equation)
        # A network that sees CartPole wrongly may have learned too little to balance with a repair.
        proven = ends and (
            (equation.name == "torque-map" and right.correlation < -0.6)
            or (own.error < 0.15 and own.correlation > 0.9 and right.correlation < 0.5)
        )
        if repair is not None and repair.won < 0.5 * m.avoidable_regret and not proven:
            continue  # another equation may explain the values as well
        return Obeyed(own, equation, repair, proven)
    return None


def not_converged(m: Measurement) -> Finding | None:
    """Says that the values obey no equation yet."""
    right = m.right_agreement
    if right.error < 0.1 and right.correlation > 0.5:  # near the fixed point of the right equation
        return None
    evidence = (
        f"the values satisfy {RIGHT} to {percent(right.error)}, and no other equation "
        f"clearly better; correlation of the advantages {right.correlation:.2f}"
    )
    if m.task.never_terminates and m.finite:
        few = few_steps(m)
        if few.error < min(_LIKE_FEW_STEPS, 0.3 * right.error):
            evidence += f"; the values are the rewards of {few.steps} steps to "
            evidence += f"{percent(few.error)}, so few copies of the target network were made"
    return Finding("not-converged", evidence, f"{HEALTHY}; above 0.7")


def _repair(m: Measurement, equation: Equation) -> Repair | None:
    if equation.name == "observation-map":
        return repairs.change_observations(m, equation.label)
    if equation.name == "torque-map":
        return repairs.change_efforts(m, -m.efforts, equation.label)
    return None
