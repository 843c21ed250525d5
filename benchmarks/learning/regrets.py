"""The statistic of the pages: the interquartile mean of the regrets of several training seeds."""

from __future__ import annotations

from collections.abc import Sequence

from keras_pendulum.study.statistics import interquartile_mean

STATISTIC = (
    "interquartile mean of the training seeds (without the best and the worst quarter), with its "
    "95 % interval"
)


def number(value: float) -> str:
    """Returns a regret with three digits, such as 1.79, 73.3 or 1218."""
    return f"{value:.{2 if value < 10 else 1 if value < 100 else 0}f}"


def mean_and_interval(regrets: Sequence[float]) -> tuple[str, str]:
    """Returns the interquartile mean and its 95 % interval, such as `1.17` and `1.06 to 1.23`."""
    mean = interquartile_mean(regrets)
    return number(mean.value), f"{number(mean.low)} to {number(mean.high)}"


def summary(regrets: Sequence[float]) -> str:
    """Returns the interquartile mean with its interval, and the worst regret."""
    mean, interval = mean_and_interval(regrets)
    return f"{mean} ({interval}), worst {number(max(regrets))}"
