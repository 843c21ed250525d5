"""The lines that the command `train` prints after a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from keras_pendulum.cli import shell_word
from keras_pendulum.config.config import Config
from keras_pendulum.config.presets import PRESETS
from keras_pendulum.environments.tasks import TASKS

if TYPE_CHECKING:
    from keras_pendulum.evaluate.score import Score
    from keras_pendulum.history import EpisodeRecord
    from keras_pendulum.train.run_folder import RunFolder
    from keras_pendulum.train.train_dqn import TrainingResult

# The presets that learn have 0.08 to 0.4, those of the two listings 0.005.
_FEW_UPDATES_PER_STEP = 0.05


def closing_lines(
    config: Config,
    result: TrainingResult,
    folder: RunFolder,
    seconds: float,
    *,
    new_episodes: int,
    score: Score | None,
) -> str:
    """Returns the lines.

    Args:
        config: the settings of the run.
        result: the run.
        folder: its folder.
        seconds: duration of the training in this process.
        new_episodes: number of episodes in this process; 0 after a resumed run that was finished.
        score: of the final weights; None for an interrupted run.
    """
    from keras_pendulum.evaluate.evaluation import random_return

    last = result.history[-1]
    total = f"{last.episode + 1} episodes ({last.environment_steps} steps, {last.updates} updates)"
    if not new_episodes:
        lines = [f"Nothing is left to train: this run has all of its {total}."]
    else:
        state = "Trained" if result.finished else "Interrupted after"
        lines = [f"{state} {total}; this took {seconds:.1f} s."]
    lines += _evaluations(result.history)
    if score is not None:
        steps = TASKS[score.environment].steps_per_episode
        random = random_return(score.environment, score.gravity, steps)
        lines += [score.summary(), f"Uniformly random actions on the same starts: {random:.2f}"]
        lines += _warnings(config, last, score.mean_return, random, folder)
    saved = ", ".join(file.name for file in folder.files if file.exists())
    lines.append(f"Saved in {folder.path}: {saved}")
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


def _warnings(
    config: Config, last: EpisodeRecord, mean: float, random: float, folder: RunFolder
) -> list[str]:
    """Returns a line for a run without updates, or for a policy that is worse than random.

    The line says why, and which setting to change.
    """
    if last.updates == 0:
        return [f"The policy has learned nothing, because {_why_no_update(config, last, folder)}"]
    if mean < random:
        return [f"The policy is worse than random actions. {_why_bad(config, last, folder)}"]
    return []


def _why_no_update(config: Config, last: EpisodeRecord, folder: RunFolder) -> str:
    episodes, warmup = last.episode + 1, config.warmup_episodes
    needed = max(_more_episodes(config), 2 * warmup)
    longer = f"Continue it with {_resume_words(folder)} --episodes {needed}"
    if config.train_frequency == "episode" and episodes <= warmup:
        return (
            f"the run made no update: the first one comes after {warmup + 1} episodes, and the run "
            f"has {episodes}. {longer}, or start another one with a smaller --warmup-episodes "
            f"(now {warmup})"
        )
    return (
        f"the run made no update: its {last.environment_steps} transitions are fewer than one "
        f"batch. {longer}, or start another one with a smaller --batch-size (now "
        f"{config.batch_size})"
    )


def _resume_words(folder: RunFolder) -> str:
    return f"--resume --out {shell_word(folder.path)}"


def _usual_episodes(config: Config) -> int:
    """Returns the number of episodes of the run's preset; 0 for an unknown preset."""
    return PRESETS[config.preset].episodes if config.preset in PRESETS else 0


def _more_episodes(config: Config) -> int:
    """Returns the number of episodes of the preset, for a run as long as that twice as many."""
    usual = _usual_episodes(config)
    return usual if usual > config.episodes else 2 * config.episodes


def _why_bad(config: Config, last: EpisodeRecord, folder: RunFolder) -> str:
    usual = _usual_episodes(config)
    if config.stored_index == "truncated":
        return (
            "With truncated indices, the values of two torques are never learned: try "
            "--stored-index exact"
        )
    updates_per_step = config.updates_per_episode / config.max_episode_steps
    if config.train_frequency == "episode" and updates_per_step < _FEW_UPDATES_PER_STEP:
        return (
            f"It had {last.updates} updates in {last.environment_steps} steps, which is little: "
            f"try a larger --updates-per-episode (now {config.updates_per_episode}; reference has "
            f"{Config.updates_per_episode})"
        )
    if last.episode + 1 < usual:
        return (
            f"It had {last.episode + 1} episodes; the preset {config.preset} has {usual}: "
            f"continue with {_resume_words(folder)} --episodes {usual}"
        )
    constant_rate = config.learning_rate_schedule == "constant" and config.average_updates == 1
    if constant_rate and config.train_frequency == "episode":
        return (
            "With a constant learning rate, the policy of the last episode may be a bad one: try "
            "--learning-rate-schedule cosine"
        )
    return (
        f"Learning may have diverged: try a smaller --learning-rate (now {config.learning_rate:g}) "
        "or another --seed"
    )


def _next_commands(
    config: Config, result: TrainingResult, folder: RunFolder, *, extend: bool
) -> dict[str, str]:
    """Returns the words of commands that can follow, by what they do."""
    weights = shell_word(folder.path / folder.weights.name)
    resume = f"train {_resume_words(folder)}"
    if not result.finished:
        return {"Continue": resume}
    commands = {"Extend it": f"{resume} --episodes {_more_episodes(config)}"} if extend else {}
    if folder.best.exists():
        best = shell_word(folder.path / folder.best.name)
        commands["Evaluate the best weights"] = f"evaluate {best}"
    commands["Watch it"] = f"evaluate {weights} --episodes 3 --render"
    if TASKS[config.environment].has_torque:
        commands["Play against it"] = f"play --against {weights}"
        shown = shell_word(folder.path) if folder.snapshots.exists() else weights
        commands["Take it to a browser"] = f"page {shown}"
    return commands
