"""The commands of the benchmarks, in the order in which `benchmarks.all` runs them.

A command comes after those whose files it reads: first the optima and the shipped networks, last
the pages. The minutes are usual ones of two cores.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

FOLDER = "FOLDER"  # an argument: the folder for networks that a later run of the command uses again
PYTHON = "PYTHON"  # an argument: the Python that runs the other libraries
_EXTRAS = {"stable_baselines3": "bench", "sbx": "peers"}  # package: its extra, where not `test`


@dataclass(frozen=True)
class Command:
    """One command: a module of benchmarks/ with its arguments."""

    module: str
    minutes: int
    arguments: tuple[str, ...] = ()
    results: tuple[str, ...] = ()  # names of its files in benchmarks/results
    packages: tuple[str, ...] = ()  # that it imports and that an extra installs
    needed: bool = False  # whether later commands read its files

    @property
    def name(self) -> str:
        """The module with the arguments that choose what is measured."""
        chosen = [each for each in self.arguments if each not in (FOLDER, PYTHON)]
        return " ".join([self.module, *chosen])

    @property
    def line(self) -> str:
        """The command as a user types it."""
        return " ".join(["python -m", f"benchmarks.{self.module}", *self.arguments])

    @property
    def extra(self) -> str:
        """The extra with its packages; empty if it needs none."""
        extras = [_EXTRAS.get(package, "test") for package in self.packages]
        return max(extras, key=["test", "bench", "peers"].index, default="")


COMMANDS = (
    Command("learning.shipped_optima", 2, needed=True),
    Command("learning.preset_results", 3, results=("quality",), packages=("psutil",), needed=True),
    Command("learning.study", 23, (FOLDER,), packages=("scipy", "distributed"), needed=True),
    Command("learning.departures", 90, (FOLDER, "swingup"), ("departures_swingup",), ("scipy",)),
    Command("learning.departures", 30, (FOLDER, "cartpole"), ("departures_cartpole",), ("scipy",)),
    Command("learning.rejected_settings", 8, (FOLDER,), results=("choosing",), packages=("scipy",)),
    Command("learning.last_regret", 3, ("reference",), ("last_regret_reference",), ("scipy",)),
    Command("learning.last_regret", 25, ("swingup", "4"), ("last_regret_swingup",), ("scipy",)),
    Command("learning.finer_torques", 1, results=("finer_torques",)),
    Command("learning.training_curves", 1, results=("training_curves",)),
    Command(
        "learning.example_programs",
        3,
        ("2",),
        ("example_programs",),
        ("psutil", "stable_baselines3"),
    ),
    Command(
        "learning.reference_beside_libraries",
        8,
        ("reference", "5", PYTHON),
        ("learning",),
        ("psutil", "stable_baselines3", "sbx"),
    ),
    Command(
        "learning.reference_beside_libraries",
        9,
        ("swingup", "3", PYTHON),
        ("learning_swingup",),
        ("psutil", "stable_baselines3"),
    ),
    Command(
        "learning.cartpole_beside_pytorch",
        1,
        results=("cartpole_speed", "cartpole_learning"),
        packages=("psutil", "torch"),
    ),
    Command("learning.cartpole_falls", 1, results=("cartpole_falls",)),
    Command("diagnosis.single_faults", 9, (FOLDER,), ("diagnosis",)),
    Command(
        "diagnosis.strangers",
        90,
        (FOLDER, "Pendulum-v1"),
        ("diagnosis_strangers",),
        ("torch",),
    ),
    Command(
        "diagnosis.strangers",
        90,
        (FOLDER, "CartPole-v1"),
        ("diagnosis_cartpole",),
        ("torch",),
    ),
    Command("diagnosis.fault_pairs", 5, (FOLDER,), ("diagnosis_pairs",)),
    Command(
        "diagnosis.healthy_networks",
        9,
        (FOLDER,),
        ("diagnosis_healthy",),
        ("torch", "stable_baselines3"),
    ),
    Command("recorded_runs.pendulum", 1, results=("recorded_run",)),
    Command("recorded_runs.cartpole", 1, results=("recorded_cartpole",)),
    Command("speed.original_run", 6, results=("original_run",), packages=("psutil",)),
    Command("speed.inner_loops", 1, results=("inner_loops",), packages=("psutil", "torch")),
    Command("speed.installation", 3, results=("installation",)),
    Command("speed.import_time", 1, results=("import_time",), packages=("psutil",)),
    Command("speed.recorder", 1, results=("recorder",), packages=("psutil",)),
    Command("speed.long_run", 2, results=("long_run",), packages=("psutil",)),
    Command("speed.saving", 2, results=("saving",), packages=("psutil",)),
    Command(
        "speed.study_cost",
        12,
        results=("study_cost",),
        packages=("psutil", "scipy", "distributed"),
    ),
    Command(
        "speed.study_scale",
        1,
        ("3000",),
        ("study_scale",),
        ("psutil", "scipy", "distributed"),
    ),
    Command("files.hostile_files", 27, results=("hostile_files",), packages=("psutil",)),
    Command("files.keras_files", 3, packages=("tf_keras",)),
    Command("pages.fault_pictures", 1, (FOLDER,)),
    Command("pages.first_run", 1, results=("first_run",), packages=("psutil",)),
    Command("pages.frames", 2, results=("frames",), packages=("selenium",)),
    Command("pages.screenshots", 1, packages=("pygame", "selenium")),
    Command("pages.thumbnails", 1, packages=("PIL",)),
    Command("pages.notebook", 1, packages=("nbclient", "ipykernel", "PIL")),
    Command("tables", 1, packages=("scipy",)),
)


def hours(commands: Sequence[Command]) -> str:
    """Returns the usual time of some commands, such as `8.0 hours`."""
    return f"{sum(command.minutes for command in commands) / 60:.1f} hours"
