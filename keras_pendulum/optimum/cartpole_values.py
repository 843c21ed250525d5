"""The optimal values of CartPole on a grid, by dynamic programming.

V is computed by value iteration, as Bellman describes it (1957, chapter III):

    V(s) = max over both pushes of 1 + γ V(s′),

where V of a terminated state is 0. The reward of the last step is 1, too, as in Gymnasium. Values
between grid points are interpolated linearly in all four numbers of the state. For γ < 1 the sweeps
begin above the optimum, with V = 1 / (1 - γ), and end when no value changes by more than
`TOLERANCE`. For γ = 1 there are 500 sweeps from V = 0: one for each step of an episode.

The mirrored state has the same value, V(-s) = V(s), so half of the grid is computed and stored.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.config.fields import Number
from keras_pendulum.environments.cartpole import CartPole
from keras_pendulum.optimum.cartpole_dynamics import (
    FORCES,
    LARGEST_ANGLE,
    LARGEST_POSITION,
    States,
    step_forces,
)
from keras_pendulum.optimum.stored_results import (
    Arrays,
    join_words,
    split_words,
    stored_or_computed,
)

SHAPE = (25, 25, 31, 31)  # points of x, ẋ, θ and θ̇
HALF = (int(np.prod(SHAPE)) + 1) // 2  # points that are stored
ENDS = np.array([LARGEST_POSITION, 3.0, LARGEST_ANGLE, 3.0])  # m, m/s, rad, rad/s
TOLERANCE = 1e-3
LOOKAHEAD = 4  # exact steps before V is interpolated: near a fall, the grid is coarse
LARGEST_SWEEPS = 1000
_STRIDES = np.cumprod([1, *SHAPE[:0:-1]])[::-1]

Table = NDArray[np.float32]  # V at the grid points, or [HALF] at the first half of them


def cartpole_value(discount: float) -> Table:
    """Returns half of V for a discount γ, 0 to 1.

    The package has those of the usual ones. Others take about 10 s, and are stored in the user's
    cache folder, if it can be written. Raises ConfigError for a discount out of range.
    """
    discount = Number(0, 1).validate("discount", discount) + 0.0  # -0.0 becomes 0.0
    return stored_or_computed(
        file_name(discount),
        lambda arrays: _unpack(arrays, discount),
        lambda: solve_cartpole(discount),
        pack,
        f"the exact values of CartPole for γ = {discount:g}, once: about 10 s",
    )


def file_name(discount: float) -> str:
    """Returns the name of the file of a discount, such as `cartpole_discount_0.99.npz`."""
    return f"cartpole_discount_{str(discount).removesuffix('.0')}.npz"


def pack(table: Table) -> Arrays:
    """Returns the arrays of a file: the two bytes of each value as float16."""
    return split_words(table.astype(np.float16).view(np.uint16))


def _unpack(arrays: Arrays, discount: float) -> Table | None:
    """Returns the table of a file's arrays; None where they cannot be right."""
    bits = join_words(arrays, (HALF,))
    if bits is None:
        return None
    table = bits.view(np.float16).astype(np.float32)
    valid = (table >= 1) & (table <= 1.001 * highest_value(discount))  # false for NaN
    return table if valid.all() else None


def highest_value(discount: float) -> float:
    """Returns the value of a pole that never falls; for γ = 1 that of an episode's 500 steps."""
    steps = CartPole.steps_per_episode
    return float(steps) if discount == 1 else 1 / (1 - discount)


def solve_cartpole(discount: float) -> Table:
    """Returns half of V for a discount γ by value iteration."""
    axes = [np.linspace(-end, end, count) for end, count in zip(ENDS, SHAPE, strict=True)]
    grid = np.stack([each.ravel() for each in np.meshgrid(*axes, indexing="ij")], axis=1)[:HALF]
    outcomes = step_forces(grid, FORCES)
    places = [_Place(outcomes.state[:, action]) for action in range(len(FORCES))]
    episodic = discount == 1
    value = np.full(HALF, 0 if episodic else highest_value(discount), np.float32)
    for _ in range(CartPole.steps_per_episode if episodic else LARGEST_SWEEPS):
        whole = whole_table(value)
        following = [
            np.where(outcomes.terminated[:, action], 0, place(whole))
            for action, place in enumerate(places)
        ]
        before, value = value, (1 + discount * np.maximum(*following)).astype(np.float32)
        if not episodic and np.abs(value - before).max() <= TOLERANCE:
            break
    return value


def cartpole_q(
    table: Table,
    discount: float,
    states: States,
    forces: NDArray[np.float64] = FORCES,
    lookahead: int = LOOKAHEAD,
) -> NDArray[np.float64]:
    """Returns the Q-values [N, A] of the optimum: 1 + γ V(next state).

    Args:
        table: V, `whole_table` of `cartpole_value` for the same discount.
        discount: γ.
        states: [N, 4].
        forces: N, of the first step, [A]. The later ones are those of V: the better of ±10 N.
        lookahead: exact steps of V.
    """
    outcomes = step_forces(states, forces)
    following = value_at(table, discount, outcomes.state.reshape(-1, 4), lookahead)
    following = following.reshape(outcomes.reward.shape)
    return outcomes.reward + discount * np.where(outcomes.terminated, 0, following)


def value_at(
    table: Table, discount: float, states: States, lookahead: int = LOOKAHEAD
) -> NDArray[np.float64]:
    """Returns V at states [N, 4]: the best rewards of some exact steps, and V after them.

    Beyond the ends of the grid it is that of the nearest point.
    """
    if not lookahead:
        return np.asarray(_Place(states)(table), np.float64)
    return np.asarray(cartpole_q(table, discount, states, FORCES, lookahead - 1).max(axis=1))


def whole_table(half: Table) -> Table:
    """Returns V at all grid points, of which the last half mirrors the first."""
    return np.concatenate([half, half[-2::-1]])


class _Place:
    """The places of N states between grid points."""

    def __init__(self, states: States) -> None:
        self.corner = np.zeros(len(states), np.int32)  # the lowest of 16
        self.weights = []  # of the upper neighbour, for each of the four numbers
        for number, (end, count) in enumerate(zip(ENDS, SHAPE, strict=True)):
            position = (states[:, number].clip(-end, end) + end) * ((count - 1) / (2 * end))
            lower = np.minimum(position.astype(np.int32), count - 2)
            self.corner = self.corner * count + lower
            self.weights.append((position - lower).astype(np.float32))

    def __call__(self, whole: Table, number: int = 0, shift: int = 0) -> NDArray[np.float32]:
        """Returns the values [N], interpolated in the numbers of the state from `number` on."""
        if number == len(SHAPE):
            return whole.take(self.corner + shift)
        low = self(whole, number + 1, shift)
        high = self(whole, number + 1, shift + int(_STRIDES[number]))
        interpolated: NDArray[np.float32] = low + self.weights[number] * (high - low)
        return interpolated
