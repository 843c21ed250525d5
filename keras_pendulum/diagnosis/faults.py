"""The faults that a diagnosis can name, in words, and a finding: a fault that is shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple


class Fault(NamedTuple):
    """The explanation and the remedy of a fault."""

    explanation: str  # two sentences
    remedy: str
    explains: tuple[str, ...] = ()  # other faults: what shows them is a trace of this one


ADDED_CONSTANT = Fault(  # of `reward-scale`
    "A constant is added to the rewards, so all values are higher than possible. In an episode "
    "that never ends, this changes no decision.",
    "Leave the constant out, or keep it: it is no reason for a low return here. Train for longer, "
    "with a learning rate that falls.",
)

# `findings.find` leaves out what a fault explains in this order.
_TRACES = (
    "too-few-updates",
    "reward-scale",
    "no-bootstrapping",
    "narrow-starts",
    "overestimation",
    "torque-map",
    "observation-map",
    "untrained-outputs",
    "learning-rate",
)
FAULTS: dict[str, Fault] = {
    "bounded-output": Fault(
        "The last layer has an activation whose bounds exclude the values. Most returns are far "
        "outside of -1 to 1.",
        "Remove the activation of the last layer: Q-values need a linear head.",
        (*_TRACES, "broken-network"),
    ),
    "wrong-loss": Fault(
        "The loss compares other values than Q(s, a) with the target. So the outputs are not the "
        "values of their actions.",
        "Compare the output of the stored action, [B], with the target, [B].",
        (*_TRACES, "broken-network"),
    ),
    "wrong-target": Fault(
        "The values satisfy the equation of another target. So the policy is the best one of "
        "another task.",
        "Use r + γ·max Q(s′, ·), with the next state, its maximum over the actions, and a target "
        "network that is copied.",
        _TRACES,
    ),
    "missing-end": Fault(
        "The target adds γ·max Q(next) after the end of an episode, too. So a fall costs nothing, "
        "and all states have nearly the same value.",
        "Multiply γ·max Q(next) by 1 - terminated.",
        (*_TRACES, "broken-network", "not-converged"),
    ),
    "truncation-as-end": Fault(
        "A truncated episode is stored as one that ended. So the target of its last step has no "
        "γ·max Q(next), and states of long episodes get low values.",
        "Store `terminated` alone as the end: `terminated or truncated` only ends the loop.",
    ),
    "reward-sign": Fault(
        "The learned values are high where the exact values are low. So the agent learned to do "
        "what costs most.",
        "Check the sign of the reward where it is stored: the pendulum's reward is never positive, "
        "that of CartPole is 1.",
        ("observation-map", "overestimation"),
    ),
    "no-bootstrapping": Fault(
        "The values are the rewards of one step. The agent does not look ahead, so it cannot "
        "prepare what pays later.",
        "Add γ·max Q(next) to each target whose step did not terminate the episode. Truncation is "
        "not an end. If all of this is there, copy the online weights into the target network.",
        ("too-few-updates", "reward-scale", "other-discount"),
    ),
    "other-reward": Fault(
        "The recorded rewards are not those of the environment. So the agent learned another task.",
        "Remove the wrapper that changes the reward, or check that its best policy is good here, "
        "too.",
        ("reward-scale", "no-bootstrapping", "other-discount"),
    ),
    "other-discount": Fault(
        "The values fit another discount much better than the declared one. The agent looks ahead "
        "over another number of steps.",
        "Check the γ of the TD target against the one that you declare.",
        ("too-few-updates", "reward-scale"),
    ),
    "reward-scale": Fault(
        "The values are those of rewards with another size. Large ones need larger outputs than "
        "the network reaches in time, and small ones are below the noise of its initial weights.",
        "Scale the rewards so that the values are between 1 and 100 in size.",
        ("too-few-updates", "overestimation"),
    ),
    "untrained-outputs": Fault(
        "A few outputs differ from all others in every state, and the maximum picks them. They "
        "were never learned, so they still have their initial values, and every target uses them.",
        "Count the stored actions by index: each index must occur.",
        ("too-few-updates", "no-bootstrapping"),
    ),
    "observation-map": Fault(
        "The values fit the exact ones as soon as the observation is changed. So the agent sees "
        "another observation when it acts than when it learned.",
        "Give the agent the observation as the environment has it, in training and after: "
        "[cos θ, sin θ, θ̇] or [x, ẋ, θ, θ̇] in this order, with m, m/s, rad and rad/s.",
        ("too-few-updates", "narrow-starts", "other-gravity", "other-discount", "overestimation"),
    ),
    "torque-map": Fault(
        "The values are right, but each output behaves like another action than the one it stands "
        "for. So an index means another action when acting than when learning.",
        "Use one table from index to action for acting and for storing; store the index itself.",
        ("overestimation",),
    ),
    "too-few-updates": Fault(
        "The values are nearly as small as the initial ones. Each update carries a reward back by "
        "one step, so values that look far ahead need thousands of updates.",
        "Make more updates for each step of the environment, up to one for each step.",
        ("narrow-starts",),
    ),
    "misaligned-transitions": Fault(
        "Stored transitions are some that the task cannot make. So observation, action, reward and "
        "next observation are of different steps.",
        "Store (s, a, r, s') of one step; copy the observation before the environment changes it.",
        ("too-few-updates", "missing-end", "truncation-as-end"),
    ),
    "broken-network": Fault(
        "The outputs are not numbers, have no sensible size, or are the same for all actions. Such "
        "a network cannot choose an action, and more training does not repair it.",
        "Start again with a smaller learning rate, scaled observations and rewards, and a clipped "
        "gradient.",
        ("too-few-updates", "no-bootstrapping", "narrow-starts"),
    ),
    "other-gravity": Fault(
        "The values or the stored transitions are those of another gravity. The agent learned a "
        "different pendulum.",
        "Train at the gravity at which you evaluate, or declare the one of the training.",
    ),
    "overestimation": Fault(
        "The values of the network are higher than the returns of its policy. The maximum of noisy "
        "values is too high, and each target takes it over.",
        "Use a target network, double Q-learning and a replay buffer of many episodes.",
    ),
    "narrow-starts": Fault(
        "The values are right in a part of the states and wrong in the rest. The agent was never "
        "in the rest.",
        "Start the episodes in all parts of them, and make them long enough to leave the start.",
    ),
    "forgetting": Fault(
        "The replay buffer holds only the last episodes. The network forgets what no stored "
        "transition shows.",
        "Make the replay buffer larger: it should hold at least 14 000 transitions.",
    ),
    "exploration": Fault(
        "The share of random actions does not fall, or it falls before the values are learned. So "
        "the stored transitions do not show the results of good actions.",
        "Let ε fall from about 0.9 to 0.01, below 0.1 in the first half of the run.",
    ),
    "learning-rate": Fault(
        "One update changes the values by more than the difference between actions. The policy "
        "still jumps at the end of the run.",
        "Make the learning rate smaller, and let it fall to 0 at the end.",
    ),
    "not-converged": Fault(
        "The values do not satisfy the right equation yet, and no wrong one clearly better. So the "
        "training was too short, or something disturbed it that the network alone does not show.",
        "Train for longer, and look at the loss: it should fall until the end. If it does and the "
        "advantages still do not agree, check that the loss takes the output of the stored action. "
        "A record of the run shows what else it can be.",
    ),
}


class Repair(NamedTuple):
    """A change of the agent without training."""

    name: str  #: the change
    regret: float  #: with the change
    won: float  #: the return that the change gains

    def __str__(self) -> str:
        return f"{self.name}: regret {self.regret:.2f}"


@dataclass(frozen=True)
class Finding:
    """A fault that the evidence shows."""

    name: str  #: of the fault, such as `too-few-updates`
    evidence: str  #: the figure that shows the fault
    healthy: str  #: the same figure of a healthy network
    repair: Repair | None = None  #: the repair without training, where there is one
    variant: str = ""  #: which target, loss or head, such as `mean-next`
    text: Fault | None = None  #: of the variant
    proven: bool = False  #: whether stored actions show it, without a repair
    long_errors: Mapping[str, float] | None = None  #: over ten steps, where they are the evidence

    @property
    def title(self) -> str:
        """The name, with the variant where there is one."""
        return f"{self.name} ({self.variant})" if self.variant else self.name

    @property
    def cost(self) -> float | None:
        """The return that the fault costs, where a repair shows it."""
        return None if self.repair is None else self.repair.won

    @property
    def explanation(self) -> str:
        """The explanation of the fault, in two sentences."""
        return (self.text or FAULTS[self.name]).explanation

    @property
    def remedy(self) -> str:
        """The remedy of the fault."""
        return (self.text or FAULTS[self.name]).remedy

    @property
    def page(self) -> str:
        """The section of the docs."""
        return f"docs/my_dqn_does_not_learn.md#{self.name}"

    def as_json(self) -> dict[str, Any]:
        """Returns the finding as an object of JSON."""
        return {
            "name": self.name,
            "variant": self.variant,
            "evidence": self.evidence,
            "healthy": self.healthy,
            "cost": self.cost,
            "repair": self.repair.name if self.repair else None,
            "explanation": self.explanation,
            "remedy": self.remedy,
            "page": self.page,
        }
