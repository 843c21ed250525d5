"""The class of the motion of each task."""

from __future__ import annotations

from keras_pendulum.diagnosis.cartpole_motion import CartPoleMotion
from keras_pendulum.diagnosis.motion import Motion
from keras_pendulum.diagnosis.pendulum_motion import PendulumMotion
from keras_pendulum.optimum.known_dynamics import KnownDynamics


def motion_kind(dynamics: KnownDynamics) -> type[Motion]:
    """Returns the class of the motion of a task."""
    return PendulumMotion if dynamics.any_effort else CartPoleMotion
