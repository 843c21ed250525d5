"""The steps of a recorder: the share of random actions, the starts, and the return over time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keras_pendulum.diagnosis.recorded_steps import Steps
from keras_pendulum.diagnosis.signals import Array, distances, nearest
from keras_pendulum.optimum.known_dynamics import KnownDynamics

PARTS = 10  # of the run, for the share of random actions
BEGINNING = 200  # steps: an episode of the pendulum
_ROWS, _COMPARED = 4000, 500  # the last rows of a part, and how many of them are compared
_CLOSE = 0.5  # N·m or N, between efforts that count as the same
_SAME_TIME = 25  # steps, in which similar states follow each other
_AS_RANDOM = 0.77  # above: efforts in similar states differ nearly as random ones do
_HELD = 0.1  # below: hardly any effort differs from those before and after it
_DURATIONS = 50  # of an action; fewer are multiples of a number by chance
_DEALT = 20  # successive steps of a half
_LEVELS = np.linspace(-2, 2, 9)  # N·m, for an agent without outputs


class RandomShares(NamedTuple):
    """About the share of random actions in parts of a run."""

    tenths: Array  # [10]
    beginning: float  # of the first 200 steps
    lasting: float  # of the first 200 steps, if a random action lasts for some steps


class PlayedSteps(NamedTuple):
    """The steps that a program made."""

    steps: Steps
    effort: Array  # [N] N·m or N
    levels: Array  # [A]: the efforts among which a random action is drawn
    dynamics: KnownDynamics

    @classmethod
    def of(
        cls, steps: Steps, effort: Array, outputs: Array | None, dynamics: KnownDynamics
    ) -> PlayedSteps:
        """Returns the steps with their efforts [N]; `outputs` [A] are those of the agent."""
        levels = _LEVELS if outputs is None else outputs
        if outputs is not None:
            used = np.unique(effort)
            matched = len(np.unique(nearest(used, outputs)))
            smaller = matched < 0.7 * len(used) <= 0.7 * len(outputs)
            if smaller and np.ptp(used) > 2 * _CLOSE:  # they are not those of the outputs
                levels = used
        return cls(steps, effort, levels, dynamics)

    def random_shares(self) -> RandomShares | None:
        """Returns about the share of random actions in parts of the run; None if it is short.

        A greedy policy gives similar efforts in similar states and in the steps before and after,
        and some efforts more often than others. Random ones do neither. Each of the four
        comparisons shows about an upper bound, and the lowest one counts.
        """
        order = np.argsort(self.steps.time, kind="stable")
        if len(order) < 100 * PARTS:
            return None
        parts = [np.sort(rows[-_ROWS:]) for rows in np.array_split(order, PARTS)]
        tenths = np.array([min(self._shares(rows)) for rows in parts])
        beginning = self._shares(np.sort(order[:BEGINNING]))
        return RandomShares(tenths, min(beginning), beginning[0])

    def _shares(self, rows: NDArray[np.intp]) -> tuple[float, float]:
        """Returns two upper bounds; the second one holds only where no random action lasts.

        Where the efforts show that random actions last, both are the first one.
        """
        effort, levels = self.effort[rows], self.levels
        chance = float(np.mean(np.abs(levels[:, None] - levels) <= _CLOSE))
        compared = np.random.RandomState(0).permutation(len(rows))[:_COMPARED]
        seen, sizes = self.steps.observation[rows], self.dynamics.observation_sizes
        distance = distances(seen, sizes, compared)
        distance[np.abs(compared[:, None] - np.arange(len(rows))) < _SAME_TIME] = np.inf
        closest = distance.argmin(axis=1)
        follows = np.diff(rows) + np.diff(self.steps.time[rows]) == 2  # of the same environment

        def share(difference: Array) -> float:
            both_greedy = (np.mean(difference <= _CLOSE) - chance) / (1 - chance)
            return 1 - max(0.0, float(both_greedy)) ** 0.5

        in_states = share(np.abs(effort[compared] - effort[closest]))
        bound, lone = min(in_states, self._rare_share(rows)), self._lone_share(rows)
        if in_states > _AS_RANDOM and lone < _HELD:
            return bound, bound
        return bound, min(lone, share(np.abs(np.diff(effort)[follows])))

    def _lone_share(self, rows: NDArray[np.intp]) -> float:
        """Returns the share of random actions, were all random that differ from both neighbours.

        Only steps count whose neighbours have the same effort. A random action differs from it
        unless it is the same by chance. A greedy one seldom does.
        """
        time, effort = self.steps.time[rows], self.effort[rows]
        before, own, after = effort[:-2], effort[1:-1], effort[2:]
        # Of the same environment.
        follows = (rows[2:] - rows[:-2] == 2) & (time[2:] - time[:-2] == 2)
        counts = follows & (np.abs(before - after) <= _CLOSE)
        by_chance = np.abs(before[counts][:, None] - self.levels) > _CLOSE
        expected = by_chance.mean(axis=1).sum()
        differs = np.abs(own - before)[counts] > _CLOSE
        return float(differs.sum() / expected) if expected else 1.0

    def _rare_share(self, rows: NDArray[np.intp]) -> float:
        """Returns the share of random actions, were all efforts as frequent as the rare half.

        The steps are dealt to two halves, a few at a time: a random action that lasts belongs to
        one. A half shows which efforts are rare, and the other one how often they are: in the same
        steps, the rarest ones are rarer than they should be.
        """
        count = len(self.levels)
        number = nearest(self.effort[rows], self.levels)
        half = np.arange(len(rows)) // _DEALT % 2
        halves = [np.bincount(number[half == each], minlength=count) for each in (0, 1)]
        rare = [np.argsort(half, kind="stable")[: (count + 1) // 2] for half in halves]
        both = halves[0][rare[1]].mean() + halves[1][rare[0]].mean()
        return float(both * count / len(rows))

    def action_steps(self) -> int:
        """Returns for how many steps the program repeats each action; 1 where it does not."""
        changes = np.flatnonzero(np.diff(self.effort, prepend=self.effort[:1]))
        episode = np.cumsum(self._begins())[changes]
        durations = np.diff(changes)[np.diff(episode) == 0]
        return int(np.gcd.reduce(durations)) if len(durations) >= _DURATIONS else 1

    def _begins(self) -> NDArray[np.bool_]:
        """Returns whether an episode, or the kept part of it, begins with a row, [N]."""
        return np.asarray(self.steps.first | (np.diff(self.steps.time, prepend=-1) < 1))

    def episodes(self) -> list[slice]:
        """Returns the rows of each recorded episode, in order of time.

        Episodes that are much shorter than the usual one are left out, unless they terminated: they
        are not complete.
        """
        steps = self.steps
        starts = np.flatnonzero(self._begins())
        ends = np.append(starts[1:], len(steps.first))
        found = [
            slice(int(start), int(end))
            for start, end in zip(starts, ends, strict=True)
            if steps.first[start]
            and (steps.terminated[end - 1] or end - start >= 0.5 * np.median(ends - starts))
        ]
        return sorted(found, key=lambda rows: int(steps.time[rows.start]))

    def constant_episodes(self, episodes: list[slice]) -> tuple[float, float] | None:
        """Returns how often two steps have the same effort, where that shows a state that is old.

        The first share is that of two steps of the same episode, at any states. The second share
        is that of two steps at nearly the same state in two episodes. Returns None unless nearly
        all steps of an episode have one effort, and the second share is the lower one.
        """
        within = []
        for episode in episodes:
            _, counts = np.unique(self.effort[episode], return_counts=True)
            within.append(((counts / counts.sum()) ** 2).sum())
        same_episode = float(np.mean(within))
        if same_episode < 0.8:
            return None
        rows = np.concatenate([np.arange(each.start, each.stop) for each in episodes])
        numbers = np.repeat(np.arange(len(episodes)), [each.stop - each.start for each in episodes])
        rows, numbers = rows[-2 * _ROWS :], numbers[-2 * _ROWS :]
        compared = np.random.RandomState(0).permutation(len(rows))[:_COMPARED]
        seen, sizes = self.steps.observation[rows], self.dynamics.observation_sizes
        distance = distances(seen, sizes, compared)
        distance[numbers[compared][:, None] == numbers] = np.inf
        same = self.effort[rows[compared]] == self.effort[rows[distance.argmin(axis=1)]]
        same_state = float(np.mean(same))
        return (same_episode, same_state) if same_state < same_episode - 0.1 else None

    def curve(self) -> Array:
        """Returns the exact return of each episode, [E], as the task's learning curves show it."""
        states = self.dynamics.states_of(self.steps.observation)
        rewards = self.dynamics.outcomes(states, self.effort[:, None]).reward[:, 0]
        shown = self.dynamics.task.curve_value
        return np.array(
            [shown(float(rewards[rows].sum()), rows.stop - rows.start) for rows in self.episodes()]
        )

    def start_sectors(self) -> tuple[int, int]:
        """Returns in how many of 8 sectors of θ an episode starts, and the number of episodes."""
        theta = self.dynamics.states_of(self.steps.observation[self.steps.first])[:, 0]
        found = np.floor((theta + np.pi) / (2 * np.pi) * 8).clip(0, 7)
        return len(np.unique(found)), len(theta)
