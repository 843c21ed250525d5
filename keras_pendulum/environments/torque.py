"""The limit of the pendulum's torque."""

from __future__ import annotations

MAX_TORQUE = 2.0  # N·m
ROUNDING = 1e-5  # N·m; a larger excess over MAX_TORQUE is not one of float32
