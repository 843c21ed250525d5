"""The limit of the pendulum's torque."""

from __future__ import annotations

MAX_TORQUE = 2.0  # N·m


ROUNDING = 1e-5  # N·m; a larger excess over MAX_TORQUE is not one of float32


def require_torque(torque: float) -> None:
    """Raises ValueError for a torque (N·m) that is not finite or outside ±2 N·m."""
    if not abs(torque) <= MAX_TORQUE:  # written so that NaN fails too
        raise ValueError(f"torque {torque} N·m; expected a number from -2 to 2")
