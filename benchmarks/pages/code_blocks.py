"""The blocks of docs about the code: its speed, its files, the recorded runs, the last regret."""

from __future__ import annotations

import re

from benchmarks.commands import COMMANDS, hours
from benchmarks.result_files import ROOT, Row, machine_of, markdown, rows_of

LAST_REGRET = "last_regret_reference"
DQN_FILES = (
    *("dqn/network.py", "dqn/losses.py", "dqn/target_network.py", "dqn/replay_buffer.py"),
    *("dqn/exploration.py", "dqn/policy.py", "dqn/agent.py", "dqn/random_streams.py"),
    *("train/loop.py", "train/run.py"),
)


def benchmarks() -> str:
    """Returns the list of the benchmarks in their order, and the hours of all."""
    rows = [
        {
            "command": f"`{command.line}`",
            "what it measures or makes": _title(
                (ROOT / "benchmarks" / f"{command.module.replace('.', '/')}.py").read_text("utf-8")
            ),
            "minutes": command.minutes,
            "extra": f"`{command.extra}`" if command.extra else "–",
        }
        for command in COMMANDS
    ]
    return f"{markdown(rows)}\nAll together take {hours(COMMANDS)} on two cores.\n"


def recorded_runs() -> str:
    """Returns how far the recorded runs are repeated, and where."""
    return f"{markdown(rows_of('recorded_run'))}\n{machine_of('recorded_run')}"


def speeds() -> str:
    """Returns the speeds beside other programs as a list."""
    first, ours = rows_of("original_run")
    here, peer, other = rows_of("learning")
    whole, regret = "seconds of the whole process", "mean regret"
    runs, nearer = len(here["regrets"]), "runs nearer to the optimum than here"
    small, large, step = rows_of("inner_loops")
    lines = (
        f"The original's run, with {ours['lines as recorded']} lines as recorded, takes "
        f"{ours['seconds']} s instead of {first['seconds']:.0f} s: {ours['times as fast']:.0f} "
        "times as fast.",
        f"A training of `reference` takes {here[whole]:.0f} s as a whole process. "
        f"Stable-Baselines3 takes {peer[whole]:.0f} s and sbx {other[whole]:.0f} s for as many "
        f"steps and updates with the same settings. The mean regrets of {runs} training seeds are "
        f"{here[regret]}, {peer[regret]} and {other[regret]}; Stable-Baselines3 is nearer to the "
        f"optimum with {peer[nearer]} of {runs} seeds, sbx with {other[nearer]}.",
        f"An update takes {small['ratio']} times as long as its matrix products take in PyTorch, "
        f"at batch 128 {large['ratio']} times.",
        f"A step of the acting loop, network included, takes {step['here']}; Gymnasium alone "
        f"takes {step['bare'].split(' (')[0]}.",
    )
    bullets = "".join(f"- {line}\n" for line in lines)
    return bullets + swingup_beside(rows_of("learning_swingup"))


def swingup_beside(rows: list[Row]) -> str:
    """Returns the duration and the regrets of `swingup` here and in Stable-Baselines3."""
    here, peer = rows
    whole, nearer = "seconds of the whole process", "runs nearer to the optimum than here"
    runs = len(here["regrets"])
    ours, theirs = (", ".join(map(str, row["regrets"])) for row in rows)
    return (
        f"- A training of `swingup` (g = 10) takes {here[whole]:.0f} s as a whole process. "
        f"Stable-Baselines3 takes {peer[whole]:.0f} s with the same numbers, but with its own "
        f"initial weights and without an average of the weights. The regrets of {runs} training "
        f"seeds are {ours} here and {theirs} there; Stable-Baselines3 is nearer to the optimum "
        f"with {peer[nearer]} of {runs} seeds.\n"
    )


def cartpole_speed() -> str:
    """Returns the speed beside the program in PyTorch."""
    cartpole, torch = rows_of("cartpole_speed")
    steps = "environment steps per second"
    return (
        f"The package makes {cartpole[steps]} environment steps per second, "
        f"{cartpole['times as fast']} times as many as the PyTorch program ({torch[steps]}). Both "
        "update after each step.\n"
    )


def finer_torques() -> str:
    """Returns what torques between the 41 can gain."""
    rows = rows_of("finer_torques")
    mean, largest = (max(row[f"{kind} gain"] for row in rows) for kind in ("mean", "largest"))
    return (
        f"On average it is at most {mean:.4f}, from a single start at most {largest:.2f} "
        "(`python -m benchmarks.learning.finer_torques`).\n"
    )


def last_regret_shares() -> str:
    """Returns the shares of the regret of the earlier `reference`."""
    before = {row["part of the regret"]: float(row["before"]) for row in rows_of(LAST_REGRET)}
    after = {row["part of the regret"]: float(row["reference"]) for row in rows_of(LAST_REGRET)}
    total, new_total = before["mean regret"], after["mean regret"]
    near_hanging = next(part for part in before if part.startswith("starts within"))

    def share(part: str) -> str:
        return f"{before[part] / total:.0%}"

    return (
        f"- **By step.** {share('until the pendulum is upright')} of the regret arose until the "
        f"pendulum was upright, {share('in its first 5 steps')} in the first five steps.\n"
        f"- **By start.** The {near_hanging.replace(' (', ', ').rstrip(')')}, had "
        f"{share(near_hanging)} of the regret.\n"
        f"- **By torque.** {share('torque to the wrong side')} came from torques to the wrong "
        f"side, {share('right side, torque too small')} from torques that are too small.\n"
        "- **By seed.** The worst twentieth of the starts had "
        f"{share('the worst 5 % of the starts')} of the regret.\n"
        f"- **Now.** The discount alone costs "
        f"{after['the discount alone: the exact policy for γ'] / new_total:.0%} of the regret of "
        "the present preset.\n"
    )


def file_tests() -> str:
    """Returns the measured tests of the files."""
    hostile = rows_of("hostile_files")
    counts = ("files", "refused", "loaded, equal", "loaded, other", "crashed", "over 10 s")
    kinds = {
        name: [row for row in hostile if row["file"].startswith("damaged at random") == damaged]
        for name, damaged in {"hostile files": False, "files damaged at random": True}.items()
    }
    table = [
        {"files of": name, **{count: sum(row[count] for row in rows) for count in counts}}
        for name, rows in kinds.items()
    ]
    memory = max(row["memory, MB"] for row in hostile)
    child = max(row["memory of the child, MB"] for row in hostile)
    early, late, whole = rows_of("long_run")
    (saving,) = rows_of("saving")
    lines = (
        f"The calling process grew by at most {memory} MB, the reading process by {child:.0f} MB "
        "(`python -m benchmarks.files.hostile_files`). A file that loaded with other numbers has "
        "no checksum, so no reader can notice.",
        f"5000 episodes with a checkpoint every 10: {early['resident memory, MB']} MB at the "
        f"beginning and {late['resident memory, MB']} MB at the end, "
        f"{early['ms per episode']:.1f} and {late['ms per episode']:.1f} ms per episode, at most "
        f"{late['open files']} open files; the checkpoint grows from {early['checkpoint, MB']:.1f} "
        f"to {late['checkpoint, MB']:.1f} MB, by its history "
        "(`python -m benchmarks.speed.long_run 5000`).",
        f"The {saving['checkpoints']} checkpoints of a default run take "
        f"{saving['all checkpoints, s']} s, {saving['% of the training']} % of its training; the "
        f"run waits {saving['wait for one, ms']} ms for each "
        "(`python -m benchmarks.speed.saving`).",
    )
    assert whole["episodes"] == "all"
    return markdown(table) + "\n" + "".join(f"- {line}\n" for line in lines)


def dqn_files() -> str:
    """Returns the files that are the DQN, with what each is and its number of lines."""
    package = ROOT / "keras_pendulum"
    texts = {name: (package / name).read_text("utf-8") for name in DQN_FILES}
    rows = [
        {"file": f"`{name}`", "what it is": _title(text), "lines": len(text.splitlines())}
        for name, text in texts.items()
    ]
    total = sum(len(text.splitlines()) for text in texts.values())
    return f"**Only the DQN** is {total} lines, in reading order:\n\n{markdown(rows)}"


def _title(source: str) -> str:
    """Returns the first line of a module's docstring without its full stop."""
    found = re.match(r'"""(.*?)\.?(?:"""|\n)', source)
    return found.group(1) if found else ""
