"""An episode that a caller plays one effort at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import gymnasium

    from keras_pendulum.figures.scene import Observation
    from keras_pendulum.play.played_task import PlayedTask


class ManualEpisode:
    """One episode of a task from the start `reset(seed=seed)`."""

    def __init__(self, task: PlayedTask, env: gymnasium.Env[Any, Any], seed: int) -> None:
        self._task, self._env = task, env
        self.observation: Observation = env.reset(seed=seed)[0]  # [D]
        self.effort = 0.0  # of the last step: a torque in N·m, or a force in N
        self.steps = 0
        self.reward = 0.0  # of the last step
        self.total_reward = 0.0  # the undiscounted return so far
        self.done = False
        self.path = [task.scene.state(self.observation)]  # of the phase plane, from the start on

    def step(self, effort: float) -> None:
        """Takes one step. Raises ValueError for an impossible effort."""
        action = self._task.action(effort)
        self.observation, reward, terminated, truncated, _ = self._env.step(action)
        self.effort, self.reward = effort, float(reward)
        self.total_reward += self.reward
        self.steps += 1
        self.path.append(self._task.scene.state(self.observation))
        self.done = terminated or truncated

    def __str__(self) -> str:
        return (
            f"Step: {self.steps}, {self._task.scene.effort.capitalize()}: {self.effort:g}, "
            f"Reward: {self.reward:.3f}, Return: {self.total_reward:.3f}"
        )
