"""What the commands share: flags made from the Config, and errors told in one line."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import wraps
from typing import Any, NoReturn

from keras_pendulum.config import Config
from keras_pendulum.errors import ConfigError, UserError


class OneLineParser(argparse.ArgumentParser):
    """Tells a wrong flag in one line, without the usage, and lets a shell complete flags."""

    def error(self, message: str) -> NoReturn:
        """Leaves with exit status 2."""
        self.exit(2, f"error: {_one_line(message)}\n")

    def parse_args(self, *words: Any) -> Any:  # type: ignore[override]
        """As argparse; where a shell asks for completions, argcomplete answers and leaves."""
        _mend_output()
        if "_ARGCOMPLETE" in os.environ:
            import argcomplete

            argcomplete.autocomplete(self)
        return super().parse_args(*words)


class ControlC:
    """Within its `with` block Ctrl-C is a KeyboardInterrupt that does not get lost.

    pygame's C code may drop the exception on its way; `check` raises it again.
    """

    def __init__(self) -> None:
        self._came = False
        self._before = signal.getsignal(signal.SIGINT)

    def check(self) -> None:
        """Raises KeyboardInterrupt once Ctrl-C has been pressed."""
        if self._came:
            raise KeyboardInterrupt

    def __enter__(self) -> ControlC:
        if self._before is signal.default_int_handler:  # else it is ignored, or somebody else's
            signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *problem: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _note(self, number: int, frame: object) -> None:
        self._came = True
        self.check()


def run_command(command: Callable[[], int]) -> int:
    """Calls `command`; a user's mistake becomes one line on stderr and exit status 2."""
    try:
        status = command()
        sys.stdout.flush()
        return status
    except UserError as error:
        print(f"error: {_one_line(str(error))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except OSError as error:
        # Our output's reader has gone, or its disk is full: Python would complain once more when it
        # flushes.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 1
        print(f"error: {_one_line(str(error))}", file=sys.stderr)
        return 2


def _mend_output() -> None:
    """Nothing that is printed ends a command, whatever its output can show or was closed."""
    if sys.stdout is None:  # closed by whoever started us
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, for the whole process
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="replace")


def _one_line(message: str) -> str:
    return " ".join(message.splitlines())


def add_config_flags(parser: argparse.ArgumentParser, skip: Sequence[str] = ()) -> None:
    """One flag for each field of Config, unset unless it is typed."""
    group = parser.add_argument_group("settings (the defaults are those of the preset)")
    for spec in fields(Config):
        if spec.name not in skip:
            group.add_argument(
                f"--{spec.name.replace('_', '-')}",
                type=_reader(str(spec.type)),
                choices=spec.metadata["choices"],
                default=argparse.SUPPRESS,
                metavar=None if spec.metadata["choices"] else "N",
                help=f"{spec.metadata['meaning']} [reference: {_shown(spec.default)}]",
            )


def name(text: str) -> str:
    """A file's or folder's name from the command line; an empty one is a mistake of the shell's."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty")
    return text


def typed_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """The settings that were typed, by field name; the preset is not one of them."""
    names = {spec.name for spec in fields(Config)} - {"preset"}
    return {name: value for name, value in vars(arguments).items() if name in names}


def setting_from_text(field: str, text: str) -> Any:
    """The value of a field of Config that was typed as `field=text`.

    Raises ConfigError for an unknown field, or a text that is no value of its kind; the range is
    Config's to check.
    """
    spec = Config.__dataclass_fields__.get(field)
    if spec is None:
        raise ConfigError(f"unknown setting {field!r}")
    read = _reader(str(spec.type))
    try:
        return read(text)
    except ValueError as error:
        raise ConfigError(f"{field} is {text!r}; expected {read.__name__}") from error


def _reader(kind: str) -> Callable[[str], Any]:
    """What reads a typed value of a field's type; where there may be none, `none` is that."""
    plain, _, optional = kind.partition(" | ")
    read = _READERS[plain]

    @wraps(read)
    def read_or_none(text: str) -> Any:
        return None if text == "none" else read(text)

    return read_or_none if optional else read


def _whole_numbers(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(","))


_whole_numbers.__name__ = "list of whole numbers"  # what argparse calls it in its message
_READERS: dict[str, Callable[[str], Any]] = {
    "int": int,
    "float": float,
    "str": str,
    "tuple[int, ...]": _whole_numbers,
}


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
