"""Makes a process look like Windows to the modules of the package, and to them only.

A copy of this file, called `sitecustomize.py`, in a folder on PYTHONPATH is imported when Python
starts, also in all child processes. Other libraries still see the real system, which they need.

The package does not find the modules and names that Windows lacks, and `sys.platform` is "win32".
A folder cannot be opened, and an open file can neither be replaced nor removed. Text files have
Windows' encoding and line ends where the package names none. Each process that imports the package
adds its command line to `processes.txt` beside this file.
"""

from __future__ import annotations

import builtins
import errno
import importlib
import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

MISSING_MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
MISSING_NAMES = {
    "os": {
        *("chown", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid"),
        *("getloadavg", "getpgid", "getuid", "killpg", "mkfifo", "mknod", "nice", "openpty"),
        *("pread", "pwrite", "register_at_fork", "sched_getaffinity", "sched_setaffinity"),
        *("seteuid", "setsid", "setuid", "statvfs", "sysconf", "uname", "wait"),
        *("O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK"),
    },
    "signal": {
        *("alarm", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "sigpending"),
        *("sigwait", "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP"),
        *("SIGUSR1", "SIGUSR2", "SIG_BLOCK", "SIG_SETMASK", "SIG_UNBLOCK"),
    },
    "sys": {"abiflags"},
}


class WindowsModule(ModuleType):
    """A module without the names that Windows lacks; all else is the real module's."""

    def __init__(self, module: ModuleType, **replaced: Any) -> None:
        vars(self).update(_module=module, _replaced=replaced, __name__=module.__name__)

    def __getattr__(self, name: str) -> Any:
        if name in MISSING_NAMES[self.__name__]:
            raise AttributeError(f"Windows has no {self.__name__}.{name}")
        return self._replaced[name] if name in self._replaced else getattr(self._module, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module, name, value)

    def __reduce__(self) -> tuple[Any, ...]:  # Dask sends functions with their modules
        return importlib.import_module, (self.__name__,)


def is_package(namespace: dict[str, Any] | None) -> bool:
    return str((namespace or {}).get("__package__")).partition(".")[0] == "keras_pendulum"


def called_by_package() -> bool:
    """Returns whether the package called the caller of this function, also through pathlib."""
    frame = sys._getframe(2)
    while frame.f_back and frame.f_globals["__name__"].partition(".")[0] == "pathlib":
        frame = frame.f_back
    return is_package(frame.f_globals)


def simulate() -> None:
    import signal

    processes = Path(__file__).with_name("processes.txt")
    real_import, real_open, real_os_open = builtins.__import__, open, os.open

    def open_no_folder(path: Any, *arguments: Any, **options: Any) -> int:
        if os.path.isdir(path):  # noqa: PTH112
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return real_os_open(path, *arguments, **options)

    modules = {
        "os": WindowsModule(os, open=open_no_folder),
        "signal": WindowsModule(signal),
        "sys": WindowsModule(sys, platform="win32"),
    }
    recorded: list[str] = []

    def import_as_on_windows(
        name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
    ) -> Any:
        if is_package(globals):
            if not recorded:
                recorded.append(" ".join(sys.orig_argv) + "\n")
                with real_open(processes, "a", encoding="utf-8") as file:
                    file.write(recorded[0])
            if name in MISSING_MODULES:
                raise ModuleNotFoundError(f"Windows has no module {name}", name=name)
            if name in modules:
                return modules[name]
        return real_import(name, globals, locals, fromlist, level)

    def open_as_on_windows(
        file: Any,
        mode: str = "r",
        buffering: int = -1,
        encoding: str | None = None,
        errors: str | None = None,
        newline: str | None = None,
        *others: Any,
        **options: Any,
    ) -> Any:
        if called_by_package() and "b" not in mode:
            encoding = "cp1252" if encoding in (None, "locale") else encoding
            newline = "\r\n" if newline is None and set(mode) & set("wxa+") else newline
        return real_open(file, mode, buffering, encoding, errors, newline, *others, **options)

    def refuse_open_files(action: Callable[..., Any]) -> Callable[..., Any]:
        def act(*paths: Any, **options: Any) -> Any:
            if called_by_package():
                for path in paths:
                    if is_open(path):
                        raise PermissionError(errno.EACCES, "Permission denied", path)
            return action(*paths, **options)

        return act

    builtins.__import__ = import_as_on_windows
    builtins.open = io.open = open_as_on_windows
    for name in ("remove", "rename", "replace", "unlink"):
        setattr(os, name, refuse_open_files(getattr(os, name)))


def is_open(path: Any) -> bool:
    """Returns whether a process has the file open; False where the system does not show it."""
    try:
        wanted = os.stat(path)  # noqa: PTH116
    except OSError:
        return False
    for descriptor in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if os.path.samestat(descriptor.stat(), wanted):
                return True
        except OSError:  # closed meanwhile, or a process of another user
            pass
    return False


if __name__ == "sitecustomize":
    simulate()
