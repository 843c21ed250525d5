"""The table of docs/mnih_2015.md: the DQN of Mnih et al. 2015 beside the presets, line by line.

The numbers of the paper are those of its Methods and of its Extended Data Table 1.
"""

from __future__ import annotations

from collections.abc import Callable

import keras_pendulum as kp
from benchmarks.result_files import markdown

PRESETS = ("reference", "swingup", "cartpole")


def mnih_table() -> str:
    """Returns a row for each part of the algorithm."""
    columns = ("part", "Mnih et al. 2015", "here", "why", "code")
    rows = [
        dict(zip(columns, (part, paper, here, why, _link(code)), strict=True))
        for part, paper, here, why, code in _parts()
    ]
    return markdown(rows)


def _parts() -> list[tuple[str, str, str, str, str]]:
    """Returns part, paper, here, reason and file of each row."""
    return [
        (
            "observation",
            "the last 4 frames, 84 × 84 grey pixels each",
            "3 numbers of the pendulum, 4 of CartPole",
            "the state is given, so no convolution and no history is needed",
            "environments/pendulum.py",
        ),
        (
            "network",
            "3 convolutions, then 512 units, ReLU; an output for each action",
            _by_preset(lambda c: f"{', '.join(map(str, c.hidden_units))} units, {c.activation}"),
            "dense layers are enough for a few numbers; their sizes are those of the originals",
            "dqn/network.py",
        ),
        (
            "actions",
            "up to 18 of the joystick, each repeated for 4 frames",
            "41 torques, or 2 pushes; no repetition",
            "the torque is continuous and has to be divided into steps; each step counts",
            "environments/actions.py",
        ),
        (
            "reward",
            "clipped to -1 to 1",
            _by_preset(lambda c: f"times {c.reward_scale:g}"),
            "the paper needs one setting for all games. A clipped reward is another task, while a "
            "factor changes no policy",
            "train/loop.py",
        ),
        (
            "discount γ",
            "0.99",
            _by_preset(lambda c: f"{c.discount:g}"),
            "the values need fewer updates with a smaller γ; what it costs is known exactly",
            "config/presets.py",
        ),
        (
            "target",
            "r + γ·max Q(s′, ·; w⁻), and r alone at the end of an episode",
            "the same; a truncated episode does not end",
            "the number of steps is no part of the state (the paper's games end by themselves)",
            "dqn/losses.py",
        ),
        (
            "loss",
            "squared TD error, its gradient clipped to -1 to 1 (Huber)",
            _by_preset(lambda c: {"squared": "squared TD error"}.get(c.loss, "Huber")),
            "the rewards have a known scale, so large errors need no limit",
            "dqn/losses.py",
        ),
        (
            "optimizer",
            "RMSProp, learning rate 0.00025, momentum 0.95",
            _by_preset(
                lambda c: f"{c.optimizer}, {c.learning_rate:g} to {c.learning_rate_min:g}, cosine"
            ),
            "Adam came in the same year. A learning rate that falls ends the jumps of the policy",
            "train/run.py",
        ),
        (
            "batch",
            "32",
            _by_preset(lambda c: str(c.batch_size)),
            "a larger batch is less noisy, and takes longer",
            "dqn/replay_buffer.py",
        ),
        (
            "replay buffer",
            "the last 1 000 000 frames",
            _by_preset(lambda c: _spaced(c.replay_capacity)),
            "the runs are shorter",
            "dqn/replay_buffer.py",
        ),
        (
            "steps before the first update",
            "50 000, random",
            _by_preset(lambda c: f"at most {_spaced(c.warmup_episodes * c.max_episode_steps)}"),
            "a larger share of a shorter run",
            "train/loop.py",
        ),
        (
            "updates",
            "1 after every 4 actions",
            _by_preset(
                lambda c: f"{c.updates_per_episode} after up to {c.max_episode_steps} steps"
            ),
            "updates between episodes run in one compiled call, which is much faster",
            "dqn/agent.py",
        ),
        (
            "target network",
            "copied every 10 000 updates",
            _by_preset(lambda c: f"{c.target_update}, τ = {c.tau:g}"),
            "it follows without jumps (Lillicrap et al. 2016); `target_update=hard` copies",
            "dqn/target_network.py",
        ),
        (
            "ε",
            "1 to 0.1, linear in the first 1 000 000 frames",
            _by_preset(lambda c: f"{c.epsilon_start:g} to {c.epsilon_min:g}, by {_schedule(c)}"),
            "the schedules of the originals",
            "dqn/exploration.py",
        ),
        (
            "length of a run",
            "50 000 000 frames",
            _by_preset(lambda c: f"at most {_spaced(c.episodes * c.max_episode_steps)} steps"),
            "the tasks are small",
            "config/presets.py",
        ),
        (
            "final weights",
            "those of the network",
            _by_preset(
                lambda c: (
                    "the last ones"
                    if c.average_updates == 1
                    else f"an average of {c.average_updates} updates"
                )
            ),
            "an average is less noisy than the weights of one update",
            "dqn/agent.py",
        ),
        (
            "evaluation",
            "ε = 0.05, random starts, beside a human player",
            "greedy, 100 fixed starts, beside the exact optimum",
            "the tasks are solved exactly, so the regret is known",
            "evaluate/evaluation.py",
        ),
    ]


def _by_preset(text: Callable[[kp.Config], str]) -> str:
    """Returns a text for each preset, or one where all are the same."""
    texts = {name: text(kp.preset(name)) for name in PRESETS}
    if len(set(texts.values())) == 1:
        return next(iter(texts.values()))
    return "; ".join(f"`{name}`: {each}" for name, each in texts.items())


def _schedule(config: kp.Config) -> str:
    if config.epsilon_schedule == "steps":
        return f"steps, 1/e in {config.epsilon_decay_steps:g}"
    return f"{config.epsilon_decay:g} per episode"


def _spaced(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def _link(code: str) -> str:
    return f"[{code}](../keras_pendulum/{code})"
