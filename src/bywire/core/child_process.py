"""Child processes that never execute code from the working folder.

A user may run bywire within a downloaded folder. A file ``ziglang.py``, an executable ``cc`` or a
library ``libm.so`` in that folder must never run. An interpreter searches its working folder for
modules (``python -m``, ``python -c``). So does a search path with an empty or relative entry, such
as ``PATH=:/usr/bin``. Child processes therefore start elsewhere, and their search paths contain
only absolute folders. This module starts all processes except copies of this one.

There are two exceptions. First, Python loads modules before it executes bywire's first line. For
``python -m bywire``, it searches the working folder, but not for the command ``bywire`` and for
``python -P -m bywire``. Second, workers use the search path of a caller's script or notebook.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.machinery import PathFinder
from pathlib import Path

from bywire.core.scratch import process_folder

_LISTS = (
    "PATH",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "DYLD_FALLBACK_LIBRARY_PATH",
    "COMPILER_PATH",
    "LIBRARY_PATH",
    "CPATH",
    "C_INCLUDE_PATH",
    "CPLUS_INCLUDE_PATH",
    "HDF5_PLUGIN_PATH",
    "PYTHONPATH",
)
"""environment variables that list folders with programs, libraries, headers and modules"""
SAFE_PATH = "PYTHONSAFEPATH"
"""environment variable that prevents interpreters from searching the working folder for modules"""
_WARNINGS, _SILENT_TRACKER = "PYTHONWARNINGS", "ignore:resource_tracker:UserWarning"
_ROOT = str(Path(__file__).resolve().parents[2])
_ELSEWHERE = sys.prefix
"""working folder of child processes: this interpreter's folder, which must be trusted anyway"""


def _trusted_folders(
    entries: Iterable[str], untrusted: Sequence[str | Path] = (), *, keep: str = ""
) -> list[str]:
    """Return the absolute folders of a list, without the working folder and untrusted folders.

    Parameters
    ----------
    entries
        Folders, as listed in ``sys.path`` and ``PATH``.
    untrusted
        Other folders to leave out, such as the folder that a server publishes.
    keep
        A folder to keep in any case.
    """
    left_out = {os.path.realpath(each) for each in (os.curdir, *untrusted)} - {keep}
    return [
        each for each in entries if os.path.isabs(each) and os.path.realpath(each) not in left_out
    ]


def import_path(untrusted: Sequence[str | Path] = ()) -> list[str]:
    """Return the folders from which this process and its children may import.

    They include the folder from which bywire was imported. See `_trusted_folders`.
    """
    return _trusted_folders(sys.path, untrusted, keep=_ROOT)


def leave_out_working_folder() -> None:
    """Prevent this process and its Python children from importing from the working folder."""
    sys.path[:] = import_path()
    os.environ[SAFE_PATH] = "1"


@contextmanager
def safe_start() -> Iterator[None]:
    """Prevent interpreters that start within the block from searching the working folder.

    `multiprocessing` starts workers, a fork server and a resource tracker with ``python -c``. The
    workers then use this process's search path.
    """
    changes = {
        SAFE_PATH: "1",
        "PYTHONPATH": os.pathsep.join(import_path()),
        # The tracker would print the resources that a killed command could not release.
        _WARNINGS: ",".join(filter(None, (os.environ.get(_WARNINGS), _SILENT_TRACKER))),
    }
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def find_program(name: str) -> str | None:
    """Return the path of a program, found in one of the absolute folders of ``PATH``.

    The function returns a path such as ``./my-cc`` unchanged, because the user chose this file.
    """
    if os.path.dirname(name):
        program = shutil.which(name)
        return None if program is None else os.path.abspath(program)
    folders = _trusted_folders(os.environ.get("PATH", os.defpath).split(os.pathsep))
    return next(filter(None, (shutil.which(os.path.join(each, name)) for each in folders)), None)


def environment(untrusted: Sequence[str | Path] = ()) -> dict[str, str]:
    """Return a child's environment with absolute search paths; see `_trusted_folders`."""
    variables = dict(os.environ)
    for name in _LISTS:
        if name in variables:
            trusted = _trusted_folders(variables.pop(name).split(os.pathsep), untrusted)
            if trusted:  # an empty list would stand for the working folder
                variables[name] = os.pathsep.join(trusted)
    return {**variables, SAFE_PATH: "1"}


def python_command(*arguments: str) -> list[str]:
    """Return the command line of a Python process, which the caller starts with `environment`.

    Parameters
    ----------
    arguments
        ``-m MODULE`` or ``-c TEXT``, and the arguments after it.
    """
    return [sys.executable, "-P", *arguments]


def module_command(library: str, *arguments: str) -> tuple[str, ...] | None:
    """Return the command line of a library's program, or None if it is not installed.

    Examples
    --------
    >>> module_command("no_such_library") is None
    True
    """
    if PathFinder.find_spec(library, import_path()) is None:
        return None
    return tuple(python_command("-m", library, *arguments))


def start_python(
    module: str,
    *arguments: str,
    further: Mapping[str, str] | None = None,
    untrusted: Sequence[str | Path] = (),
    stderr: int | None = None,
    bufsize: int = -1,
) -> subprocess.Popen[bytes]:
    """Start one of bywire's modules, which communicates through standard input and output.

    Ctrl-C does not reach the process, so its parent must end it. It starts outside the working
    folder.

    Parameters
    ----------
    module, arguments
        Name of the module, and its command-line arguments.
    further
        Additional environment variables.
    untrusted
        See `_trusted_folders`.
    stderr, bufsize
        See `subprocess.Popen`.
    """
    path = os.pathsep.join(import_path(untrusted))
    return subprocess.Popen(
        python_command("-m", module, *arguments),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=stderr,
        bufsize=bufsize,
        cwd=_ELSEWHERE,
        start_new_session=True,
        env={**environment(untrusted), "PYTHONPATH": path, **(further or {})},
    )


def _tool_folders() -> dict[str, str]:
    """Return environment variables that give the extra's compiler a writable cache folder.

    By default, the compiler uses the user's cache folder, and fails if this folder is missing or
    read-only.
    """
    home = os.environ.get("HOME", "")
    above = os.environ.get("XDG_CACHE_HOME") or (os.path.join(home, ".cache") if home else "")
    if "ZIG_GLOBAL_CACHE_DIR" in os.environ or sys.platform == "win32" or _is_writable(above):
        return {}
    folder = str(process_folder() / "zig")
    return {"ZIG_GLOBAL_CACHE_DIR": folder, "ZIG_LOCAL_CACHE_DIR": folder}


def _is_writable(folder: str) -> bool:
    """Return whether a folder is writable, or can be created in a writable folder."""
    if not os.path.isabs(folder):
        return False
    there = next(each for each in Path(folder, "zig", "x").parents if each.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def run_program(command: Sequence[str], seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a program to its end outside the working folder; paths must be absolute.

    Raises
    ------
    OSError
        When the program does not start.
    TimeoutExpired
        When the program takes longer than ``seconds``.
    """
    return subprocess.run(
        command,
        cwd=_ELSEWHERE,
        env={**environment(), **_tool_folders()},
        timeout=seconds,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
