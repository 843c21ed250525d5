"""The rule that follows the policy whose value a wrong target learns.

A target that takes the mean of the next values learns the value of random actions; one that takes
the lowest, that of the worst ones. Over one step, the sides of such an equation differ little from
those of the right one; over ten steps, they differ more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from keras_pendulum.diagnosis.equation import RIGHT, Equation, NextAction, percent
from keras_pendulum.diagnosis.equation_rules import HEALTHY, RIGHT_ERROR, obeyed_equation
from keras_pendulum.diagnosis.faults import Fault, Finding
from keras_pendulum.diagnosis.lasting_rules import may_last
from keras_pendulum.diagnosis.measurement import Measurement
from keras_pendulum.diagnosis.rollouts import roll_out
from keras_pendulum.diagnosis.target_equations import TARGETS

_STEPS = 10
_REPEATS = 4  # of each state, because a policy may be random
_LARGEST_ERROR = 0.8
_SHARE = 0.7  # of the error of the right equation
_SHARE_OF_BOTH = 0.9  # the same where one step fits better, too, and advantages have been learned
_LEARNED = 0.4  # correlation of the advantages
_SHARE_OF_SECOND = 0.95  # of that of the next best equation, in both errors together
_CLEAR_SHARE = 0.6  # of the error of the right equation: then one of these, even if two fit alike
_POSITION = (0.6, 1.28)  # of the values on the way from the right targets, 0, to its own, 1
_NEARLY = 1.03  # times the lowest error of one step
_LOWER = -0.25  # spreads: how much lower the values are than those of the greedy policy


class _LongAgreement(NamedTuple):
    error: float  # root mean square of Q minus target, as a share of the spread of Q
    mean: float  # of Q minus target, as a share of the spread


def followed_policy(m: Measurement) -> Finding | None:
    """Finds values that are those of another policy than the greedy one."""
    if not (m.task.never_terminates and m.finite) or m.right_agreement.error < RIGHT_ERROR:
        return None
    found = obeyed_equation(m)
    if found is not None and found.equation.next_action is None:
        return None
    right = _over_steps(m, lambda q, random: q.argmax(axis=1))
    if right.mean > _LOWER:
        return None
    errors = {each: _over_steps(m, each.next_action).error for each in TARGETS if each.next_action}
    # Over many steps, a fixed action leads to states that no run has met. So one step counts, too.
    both = {
        each: (m.equation_errors[each.formula] * error) ** 0.5 for each, error in errors.items()
    }
    position = {each.formula: own.position for own, each in m.agreements}
    low, high = _POSITION
    lowest = next(each for each in both if each.variant == "min-next")

    def equation_of(nearest: Equation) -> Equation | None:
        """Returns the equation whose values these are; those beyond the mean are the lowest."""
        place = position[nearest.formula]
        if low < place < high:
            return nearest
        return lowest if place >= high and nearest.variant == "mean-next" else None

    near = sorted(filter(equation_of, both), key=both.__getitem__)
    if not near or (equation := equation_of(near[0])) is None:
        return None
    others = [each for each in near if equation_of(each) is not equation]
    own, one_step = errors[near[0]], m.equation_errors[near[0].formula]
    fits = one_step < equation.share * m.right_agreement.error
    learned = m.right_agreement.correlation > _LEARNED
    share = _SHARE_OF_BOTH if fits and learned else _SHARE
    is_clear = not others or both[near[0]] <= _SHARE_OF_SECOND * both[others[0]]
    if not is_clear and own > _CLEAR_SHARE * right.error:
        return None
    best_of_one_step = min(m.equation_errors[each.formula] for each in errors)
    # Over ten steps, the mean of random actions smooths the network's own errors, too.
    if equation.variant == "mean-next" and one_step > _NEARLY * best_of_one_step:
        return None
    if own > min(_LARGEST_ERROR, share * right.error) or may_last(m, one_step):
        return None
    evidence = (
        f"over {_STEPS} steps, the values satisfy {near[0].formula} to {percent(own)} and "
        f"{RIGHT} to {percent(right.error)}"
    )
    if equation is not near[0]:
        evidence += "; in one step, they are lower than both"
    text = Fault(equation.explanation, equation.remedy)
    long_errors = {RIGHT: right.error} | {
        each.formula: errors[each] for each in sorted(errors, key=errors.__getitem__)
    }
    return Finding(
        equation.name,
        evidence,
        HEALTHY,
        variant=equation.variant,
        text=text,
        long_errors=long_errors,
    )


def _over_steps(m: Measurement, next_action: NextAction) -> _LongAgreement:
    """Returns how well the values agree with ten rewards and the value after them."""
    rollouts = roll_out(m, next_action, _STEPS, _REPEATS)
    error = (rollouts.q - rollouts.target(m.discount)).reshape(-1, _REPEATS).mean(axis=1)
    error /= m.backup.spread
    return _LongAgreement(float(np.sqrt(np.mean(error**2))), float(error.mean()))
