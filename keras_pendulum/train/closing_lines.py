"""The lines that the command `train` prints after a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from keras_pendulum.cli import shell_word
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import PRESETS

if TYPE_CHECKING:
    from keras_pendulum.history import EpisodeRecord
    from keras_pendulum.storage.run_folder import RunFolder
    from keras_pendulum.train.result import TrainingResult


def result_lines(
    config: Config, result: TrainingResult, folder: RunFolder, seconds: float, *, new_episodes: int
) -> str:
    """Returns the lines about the training and the score of its final weights.

    In this process, the training took `seconds` for `new_episodes`: 0 where a finished run was
    resumed.
    """
    from keras_pendulum.optimum.solutions import solution

    last = result.history[-1]
    total = f"{last.episode + 1} episodes ({last.environment_steps} steps, {last.updates} updates)"
    if not new_episodes:
        lines = [f"Nothing is left to train: this run has all of its {total}."]
    else:
        state = "Trained" if result.finished else "Interrupted after"
        lines = [f"{state} {total}; this took {seconds:.1f} s."]
    lines += _evaluations(result.history)
    score = result.score
    if score is not None:
        random = solution(score.task).random_return()
        lines += [score.summary(), f"Uniformly random actions on the same starts: {random:.2f}"]
        resume = f"--resume --out {shell_word(folder.path)}"
        if last.updates == 0:
            lines.append(_why_untrained(config, last, resume))
        elif score.mean_return < random:
            lines.append(
                "The policy is worse than random actions. See why with "
                f"python -m keras_pendulum.diagnose {shell_word(folder.path)}"
            )
    return "\n".join(lines)


def next_lines(
    config: Config, result: TrainingResult, folder: RunFolder, *, new_episodes: int
) -> str:
    """Returns the lines about the files of the run and about what can be done with them."""
    saved = ", ".join(file.name for file in folder.files if file.exists())
    lines = [f"Saved in {folder.path}: {saved}"]
    commands = _next_commands(config, result, folder, extend=not new_episodes)
    lines += [f"{what}: python -m keras_pendulum.{words}" for what, words in commands.items()]
    return "\n".join(lines)


def _evaluations(history: list[EpisodeRecord]) -> list[str]:
    """Returns a line with the best and the last evaluation during the run, if there was one."""
    evaluated = [record for record in history if not math.isnan(record.greedy_regret)]
    if not evaluated:
        return []
    from keras_pendulum.train.evaluations import SEEDS

    best = min(evaluated, key=lambda record: (record.greedy_regret, -record.episode))
    return [
        f"Evaluated {len(evaluated)} times on the starts of seeds {SEEDS.start} to {SEEDS[-1]}: "
        f"best regret {best.greedy_regret:.2f} after episode {best.episode}, last "
        f"{evaluated[-1].greedy_regret:.2f}"
    ]


def _why_untrained(config: Config, last: EpisodeRecord, resume: str) -> str:
    """Returns a line for a run without updates."""
    episodes, warmup = last.episode + 1, config.warmup_episodes
    if config.train_frequency == "episode" and episodes <= warmup:
        reason = f"the first one comes after {warmup + 1} episodes, and the run has {episodes}"
        setting = f"--warmup-episodes (now {warmup})"
    else:
        reason = f"its {last.environment_steps} transitions are fewer than one batch"
        setting = f"--batch-size (now {config.batch_size})"
    return (
        f"The policy has learned nothing, because the run made no update: {reason}. Continue it "
        f"with {resume} --episodes {max(_more_episodes(config), 2 * warmup)}, or start another one "
        f"with a smaller {setting}"
    )


def _more_episodes(config: Config) -> int:
    """Returns the number of episodes of the preset, for a run as long as that twice as many."""
    usual = PRESETS[config.preset].episodes if config.preset in PRESETS else 0
    return usual if usual > config.episodes else 2 * config.episodes


def _next_commands(
    config: Config, result: TrainingResult, folder: RunFolder, *, extend: bool
) -> dict[str, str]:
    """Returns the words of commands that can follow, by what they do."""
    weights = shell_word(folder.path / folder.weights.name)
    resume = f"train --resume --out {shell_word(folder.path)}"
    if not result.finished:
        return {"Continue": resume}
    commands = {"Extend it": f"{resume} --episodes {_more_episodes(config)}"} if extend else {}
    if folder.best.exists():
        best = shell_word(folder.path / folder.best.name)
        commands["Evaluate the best weights"] = f"evaluate {best}"
    commands["Watch it"] = f"evaluate {weights} --episodes 3 --render"
    commands["Play against it"] = f"play --against {weights}"
    shown = shell_word(folder.path) if folder.snapshots.exists() else weights
    commands["Take it to a browser"] = f"page {shown}"
    return commands
