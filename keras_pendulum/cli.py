"""The command line: its parser, one line per error, and the exit status."""

from __future__ import annotations

import argparse
import contextlib
import errno
import io
import json
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn

from keras_pendulum.completion import completes
from keras_pendulum.errors import UserError, did_you_mean, one_line


class OneLineParser(argparse.ArgumentParser):
    """An argument parser that prints errors as one line and supports shell completion.

    Args:
        help_all: adds the flag `--help-all`, which shows the hidden flags too.
        options: of argparse.
    """

    def __init__(self, help_all: bool = False, **options: Any) -> None:
        # With abbreviations, a new flag could make the user's own command ambiguous.
        super().__init__(allow_abbrev=False, **options)
        self._hidden: dict[argparse.Action, str | None] = {}  # help texts that `--help` leaves out
        self._values: dict[str, str] = {}  # flags by one of their values
        if help_all:
            self.add_argument("--help-all", action=_HelpAll, nargs=0, help="show all flags")

    def hide(self, action: argparse.Action) -> None:
        """Leaves a flag out of `--help`; `--help-all` and shell completion show it."""
        self._hidden[action] = action.help
        action.help = argparse.SUPPRESS

    def suggest_flag(self, flag: str, values: Iterable[str]) -> None:
        """Suggests the flag where one of its values is typed without it."""
        self._values |= dict.fromkeys(values, flag)

    def show_hidden(self) -> None:
        """Shows all flags from now on."""
        for action, text in self._hidden.items():
            action.help = text
        self._hidden = {}

    def error(self, message: str) -> NoReturn:
        """Prints the error and exits with status 2."""
        if message.endswith("expected one argument"):
            flag = message.split()[1].rstrip(":").split("/")[-1]
            message += f"; a value that begins with a minus needs {flag}=VALUE"
        self.exit(2, f"error: {one_line(message)}\n")

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        """Prints a message to standard error and exits."""
        if message:
            self._print_message(message, sys.stderr)
        raise _ParserExit(status)

    def parse_args(self, *words: Any) -> Any:  # type: ignore[override]
        """Parses the command line; prints completions and exits where a shell asks for them."""
        _prepare_output()
        if completes():
            import argcomplete

            self.show_hidden()
            argcomplete.autocomplete(self)
        arguments, unknown = self.parse_known_args(*words)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._suggestion(unknown)}")
        return arguments

    def _suggestion(self, words: list[str]) -> str:
        """Returns "; did you mean FLAG?" for the first mistyped flag among the words, or "".

        If the first word is the value of a flag, it is the flag with that value.
        """
        if words[0] in self._values:
            return f"; did you mean {self._values[words[0]]} {words[0]}?"
        known = [
            flag
            for action in self._actions
            if action.help != argparse.SUPPRESS or action in self._hidden
            for flag in action.option_strings
        ]
        flags = [word.partition("=")[0] for word in words if word.startswith("-")]
        return did_you_mean(flags[0], known) if flags else ""


class _ParserExit(SystemExit):
    """The end of a command after its help or an error of its arguments."""


class _HelpAll(argparse.Action):
    """The flag that prints the help with the hidden flags and exits."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        assert isinstance(parser, OneLineParser)
        parser.show_hidden()
        parser.print_help()
        parser.exit()


def add_activation_flag(parser: argparse.ArgumentParser) -> None:
    """Adds the flag for weights files that record no activation, such as those of Keras."""
    parser.add_argument(
        "--activation",
        choices=("tanh", "relu", "linear"),
        help="activation of the hidden layers [recorded in the file, else tanh]",
    )


def add_torques_flag(parser: argparse.ArgumentParser) -> None:
    """Adds the flag for agents whose outputs stand for other torques than `linspace(-2, 2, A)`."""
    parser.add_argument(
        "--torques",
        type=_numbers,
        metavar="N·m,…",
        help="torques that the outputs stand for, such as --torques=-2,0,2 [evenly spaced from -2 "
        "to 2]",
    )


def add_environment_flag(parser: argparse.ArgumentParser) -> None:
    """Adds the flag for agents that record no task."""
    parser.add_argument(
        "--environment",
        choices=("Pendulum-v1", "CartPole-v1"),
        metavar="NAME",
        help="Pendulum-v1 or CartPole-v1 [recorded in the file, else CartPole-v1 for an agent that "
        "takes four numbers]",
    )


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a list of numbers such as -2,0,2"
        ) from error


def run_command(command: Callable[[], int]) -> int:
    """Returns the exit status of `command`; a UserError is one line on stderr and status 2.

    A warning is one line on stderr too.
    """
    # No command opens a window of Matplotlib. A notebook exports a backend that other environments
    # do not have, and Keras imports Matplotlib.
    os.environ["MPLBACKEND"] = "Agg"
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _print_warning
            status = command()
        sys.stdout.flush()
        return status
    except UserError as error:
        problem = str(error)
    except _ParserExit:
        raise
    except SystemExit as error:
        problem = f"the agent's code exits (SystemExit: {error.code})"
    except KeyboardInterrupt:
        return 130
    except MemoryError:
        problem = "the memory is not large enough for this"
    except OSError as error:
        # The reader of the output has exited, or the disk is full. Without this, Python prints a
        # second error when it flushes.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 1
        if sys.platform == "win32" and error.errno == errno.EINVAL:  # a pipe without a reader
            return 1
        problem = one_line(str(error))
    print(f"error: {problem}", file=sys.stderr)
    return 2


@contextlib.contextmanager
def prints_to_stderr() -> Iterator[None]:
    """Sends what is printed in its `with` block to standard error, also by a library in C.

    A user's code may print, and the output of `--json` is one JSON object.
    """
    sys.stdout.flush()
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a stream is closed
            stdout = os.dup(1)
            stack.callback(os.close, stdout)
            stack.callback(os.dup2, stdout, 1)
            os.dup2(2, 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield


def print_json(value: dict[str, Any]) -> None:
    """Prints an object. Later prints of this process, such as at its end, go to standard error."""
    print(json.dumps(value), flush=True)
    if sys.stdout is sys.__stdout__:
        with contextlib.suppress(OSError):  # standard error is closed
            os.dup2(2, 1)


def _prepare_output() -> None:
    """Lets `print` succeed where the output is closed or cannot encode a character."""
    # A stream that the parent process has closed is None. `print` would take None for stdout.
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors != "replace":
        sys.stdout.reconfigure(errors="replace")


def _print_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"warning: {one_line(str(message))}", file=sys.stderr)


def nonempty_path(text: str) -> str:
    """Returns a path from the command line. Raises ArgumentTypeError for an empty one."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty")
    return text


def require_ending(flag: str, path: str, ending: str) -> None:
    """Raises UserError when the name of a file does not end in `ending`, such as ".png"."""
    if not path.lower().endswith(ending):
        raise UserError(f"{flag} is {path}: expected a name that ends in {ending}")


def shell_word(path: str | os.PathLike[str]) -> str:
    """Returns a path as a word of sh, cmd and PowerShell that no command takes for a flag."""
    word = os.fspath(path)
    if sys.platform == "win32":
        word = word.replace("\\", "/")
    if word.startswith("-"):
        word = f"./{word}"
    if re.fullmatch(r"[A-Za-z0-9_+=:./-]+", word):
        return word
    # Between double quotes, sh replaces these; cmd knows no single quotes.
    return shlex.quote(word) if set(word) & set('"$`\\!') else f'"{word}"'
