"""A Gymnasium wrapper that records the steps of a program, for `diagnose`."""

from __future__ import annotations

import os
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from keras_pendulum.diagnosis.recorded_steps import Steps, write_steps
from keras_pendulum.diagnosis.step_ring import NOTHING, RESET, STEP, TERMINATED, TRUNCATED, Ring


class Recorder(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment that records its last 200 000 steps, for `diagnose`.

    It changes nothing else. A vector environment is recorded, too: `Recorder(env)` is then a vector
    environment. Actions that a wrapper rescales are recorded as they act.

    Args:
        env: the environment, as the program uses it: put the recorder around all other wrappers,
            but for those that change the observations.

    Raises ConfigError for observations or actions that are not a few numbers.

    >>> import gymnasium
    >>> env = kp.Recorder(gymnasium.make("Pendulum-v1"))
    >>> observation, _ = env.reset(seed=0)
    >>> _ = env.step([0.5])
    >>> env.steps.action
    array([0.5], dtype=float32)
    """

    def __new__(cls, env: Any = None) -> Any:
        """Returns a recorder, of a vector environment where `env` is one."""
        if not isinstance(env, gymnasium.Env | VectorEnv | None):
            raise TypeError(
                f"env is a {type(env).__name__}; expected an environment of Gymnasium: "
                'kp.Recorder(gymnasium.make("Pendulum-v1"))'
            )
        return VectorRecorder(env) if isinstance(env, VectorEnv) else super().__new__(cls)

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._ring = Ring(env.observation_space, env.action_space, env.unwrapped.action_space)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._ring.add(observation, 0, 0, RESET)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Makes a step and records it."""
        result = self.env.step(action)
        observation, reward, terminated, truncated, _ = result
        ring = self._ring
        ring.count += 1
        ring.add(
            observation, action, reward, STEP + TERMINATED * terminated + TRUNCATED * truncated
        )
        return result

    @property
    def steps(self) -> Steps:
        """Copies of the recorded steps."""
        return self._ring.steps()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the recorded steps to a file, such as run.npz.

        Raises UserError without a step, where the path holds something else, and when the file
        system refuses.
        """
        write_steps(self.steps, path)


class VectorRecorder(VectorWrapper[Any, Any, Any, Any, Any]):
    """The recorder of a vector environment; `Recorder(env)` returns it."""

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        inner = getattr(env.unwrapped, "envs", None)  # those of other processes are not at hand
        acting = inner[0].unwrapped.action_space if inner else env.unwrapped.single_action_space
        size = (env.num_envs,)
        self._ring = Ring(env.observation_space, env.action_space, acting, size)
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._resets = np.zeros(env.num_envs, bool)  # whether the next step is a reset

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environments."""
        # Gymnasium removes the mask from the options.
        mask = np.zeros(self.num_envs, bool) | (options or {}).get("reset_mask", True)
        observations, info = self.env.reset(seed=seed, options=options)
        self._ring.add(observations, 0, 0, np.where(mask, RESET, NOTHING))
        self._resets &= ~mask
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Makes a step of each environment and records it."""
        result = self.env.step(actions)
        observations, rewards, terminated, truncated, info = result
        ended = np.logical_or(terminated, truncated)
        ends = TERMINATED * np.asarray(terminated) + TRUNCATED * np.asarray(truncated)
        kinds = np.where(self._resets, RESET, STEP + ends)
        last = observations
        if self._mode == AutoresetMode.SAME_STEP and ended.any():
            last = np.array(observations)
            for row in np.flatnonzero(ended):
                last[row] = info["final_obs"][row]
        self._ring.count += int(np.count_nonzero(~self._resets))
        self._ring.add(last, actions, rewards, kinds)
        if last is not observations:
            self._ring.add(observations, 0, 0, np.where(ended, RESET, NOTHING))
        if self._mode == AutoresetMode.NEXT_STEP:
            self._resets = ended
        return result

    @property
    def steps(self) -> Steps:
        """Copies of the recorded steps."""
        return self._ring.steps()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the recorded steps to a file, as `Recorder.save` does."""
        write_steps(self.steps, path)
