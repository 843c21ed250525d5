"""The start of a film: hanging, upright, an angle, or that of a seed."""

from __future__ import annotations

import argparse
import logging
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.environments.tasks import TASKS
from keras_pendulum.errors import UserError
from keras_pendulum.optimum.optimal_return import best_return, optimal_return

if TYPE_CHECKING:
    import gymnasium

_log = logging.getLogger(__name__)

NAMES = {"hanging": 180.0, "upright": 0.0}  # angles in degrees


def parse_start(text: str) -> float:
    """Returns the angle in degrees. Raises ArgumentTypeError for any other text."""
    try:
        angle = NAMES[text] if text in NAMES else float(text)
    except ValueError:
        angle = math.nan
    if not -180 <= angle <= 180:  # written so that NaN fails too
        raise argparse.ArgumentTypeError(
            f"{text!r} is no start: expected hanging, upright, or an angle from -180 to 180 (°, 0 "
            "is upright)"
        )
    return angle


def reset(
    env: gymnasium.Env[Any, Any], seed: int, angle: float | None = None
) -> NDArray[np.float32]:
    """Resets the environment and returns the observation.

    Args:
        env: of TASKS.
        seed: the start, where there is no angle.
        angle: of the pendulum at rest, in degrees counterclockwise from upright.
    """
    observation, _ = env.reset(seed=seed)
    if angle is not None:
        theta = math.radians(angle)
        env.unwrapped.state = np.array([theta, 0.0])  # type: ignore[attr-defined]
        observation = np.array([math.cos(theta), math.sin(theta), 0.0], np.float32)
    return np.asarray(observation)


def require_pendulum(environment: str) -> None:
    """Raises UserError for CartPole, which has no angle to start from."""
    if not TASKS[environment].has_torque:
        raise UserError(f"--start belongs to Pendulum-v1; {environment} has none: use --seed")


def optimum_of_start(
    environment: str, gravity: float | None, seed: int, angle: float | None
) -> float:
    """Returns the optimal return of an episode from the start of `reset`.

    For an angle it is computed, which takes some 20 s.
    """
    if gravity is None:
        optimum = TASKS[environment].optimal_return
        assert optimum is not None  # only that of the pendulum is computed
        return optimum
    if angle is None:
        return float(optimal_return(gravity, [seed])[0])
    _log.warning("Computing the best possible return of the film's start: about 20 s")
    start = np.array([[math.radians(angle), 0.0]])
    return float(best_return(gravity, start, TASKS[environment].steps_per_episode)[0])


def describe_start(seed: int, angle: float | None) -> str:
    """Returns the start as films name it."""
    if angle is None:
        return f"start of seed {seed}"
    for name, named_angle in NAMES.items():
        if angle == named_angle:
            return f"start: {name}"
    return f"start: {angle:g}°"
