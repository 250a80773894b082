"""Processes that bywire starts, none of which takes code from the working folder.

Somebody who looks at a downloaded folder is in it, and a file ``ziglang.py``, an executable ``cc``
or a library ``libm.so`` there must never run. An interpreter looks in its working folder for
modules (``python -m``, ``python -c``), and so does every list of folders with an empty or relative
entry, such as ``PATH=:/usr/bin``. Children of bywire therefore start elsewhere, and their lists
hold absolute folders alone. All processes but copies of this one are started here.

Two limits: what Python loads before its first line of ours (``python -m bywire`` looks in the
working folder, the command ``bywire`` and ``python -P -m bywire`` do not), and folders that a
caller's own script or notebook has on its path, which workers of that program share.
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
"""environment variable with which no interpreter looks for modules where it was started"""
_WARNINGS, _SILENT_TRACKER = "PYTHONWARNINGS", "ignore:resource_tracker:UserWarning"
_ROOT = str(Path(__file__).resolve().parents[2])
_ELSEWHERE = sys.prefix
"""where children start: what runs this process stands there, and no folder of somebody else"""


def _trusted_folders(
    entries: Iterable[str], untrusted: Sequence[str | Path] = (), *, keep: str = ""
) -> list[str]:
    """Return the absolute folders of a list but the working folder and further ones.

    Parameters
    ----------
    entries
        Folders, as ``sys.path`` and ``PATH`` list them.
    untrusted
        Further folders that are left out, such as the one that is served.
    keep
        A folder that stays, even if it is one of those.
    """
    left_out = {os.path.realpath(each) for each in (os.curdir, *untrusted)} - {keep}
    return [
        each for each in entries if os.path.isabs(each) and os.path.realpath(each) not in left_out
    ]


def import_path(untrusted: Sequence[str | Path] = ()) -> list[str]:
    """Return where this process and its children may import from; see `_trusted_folders`.

    The folder that bywire itself was imported from stays.
    """
    return _trusted_folders(sys.path, untrusted, keep=_ROOT)


def leave_out_working_folder() -> None:
    """Have this process, and every Python process below it, not import from the working folder."""
    sys.path[:] = import_path()
    os.environ[SAFE_PATH] = "1"


@contextmanager
def safe_start() -> Iterator[None]:
    """Have interpreters that are started within the block not look in the working folder.

    For `multiprocessing`, which starts workers, a server that forks, and a tracker of resources by
    ``python -c``. Workers then take the path of this process.
    """
    changes = {
        SAFE_PATH: "1",
        "PYTHONPATH": os.pathsep.join(import_path()),
        # The tracker complains on standard error of what a killed command could not tidy up.
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
    """Return the path of a program, looked for in the absolute folders of ``PATH`` alone.

    A path (``./my-cc``) is taken as it stands: who writes one means it.
    """
    if os.path.dirname(name):
        found = shutil.which(name)
        return None if found is None else os.path.abspath(found)
    folders = _trusted_folders(os.environ.get("PATH", os.defpath).split(os.pathsep))
    return next(filter(None, (shutil.which(os.path.join(each, name)) for each in folders)), None)


def environment(untrusted: Sequence[str | Path] = ()) -> dict[str, str]:
    """Return the environment of a child: lists of folders are absolute, see `_trusted_folders`."""
    made = dict(os.environ)
    for name in _LISTS:
        if name in made:
            kept = _trusted_folders(made.pop(name).split(os.pathsep), untrusted)
            made |= {name: os.pathsep.join(kept)} if kept else {}  # an empty one is the folder
    return {**made, SAFE_PATH: "1"}


def python_command(*arguments: str) -> list[str]:
    """Return the command line of a Python process, which takes `environment` and starts anywhere.

    Parameters
    ----------
    arguments
        ``-m MODULE`` or ``-c TEXT``, and what follows.
    """
    return [sys.executable, "-P", *arguments]


def module_command(library: str, *arguments: str) -> tuple[str, ...] | None:
    """Return the command line of a program that a library brings; None where it is not installed.

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
    """Start a module of ours, which talks through its standard input and output.

    Ctrl-C does not reach it: whoever starts it ends it. It begins outside of the working folder.

    Parameters
    ----------
    module, arguments
        Its name, and what follows it on the command line.
    further
        Further variables of its environment.
    untrusted
        See `_trusted_folders`.
    stderr, bufsize
        As `subprocess.Popen` has them.
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
    """Return variables that lead the extra's compiler to a folder that it can write to.

    It keeps what it makes in the user's cache folder, and ends where there is none, or where that
    is on a read-only disk.
    """
    home = os.environ.get("HOME", "")
    above = os.environ.get("XDG_CACHE_HOME") or (os.path.join(home, ".cache") if home else "")
    if "ZIG_GLOBAL_CACHE_DIR" in os.environ or sys.platform == "win32" or _is_writable(above):
        return {}
    folder = str(process_folder() / "zig")
    return {"ZIG_GLOBAL_CACHE_DIR": folder, "ZIG_LOCAL_CACHE_DIR": folder}


def _is_writable(folder: str) -> bool:
    """Return whether a folder can be written to, or be made in one that can."""
    if not os.path.isabs(folder):
        return False
    there = next(each for each in Path(folder, "zig", "x").parents if each.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def run_program(command: Sequence[str], seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a program to its end, outside of the working folder: its paths must be absolute.

    Raises
    ------
    OSError
        When it does not start.
    TimeoutExpired
        When it takes longer.
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
