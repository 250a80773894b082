"""The process of a job, with all that it starts: begun, interrupted, killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from pathlib import Path

from bywire.core.child_process import start_python


def started(folder: Path) -> subprocess.Popen[bytes]:
    """Return a new process that waits for its order; no code of the served folder runs in it."""
    return start_python("bywire.server.job_process", untrusted=(folder,))


def interrupt(process: subprocess.Popen[bytes]) -> None:
    """Do what Ctrl-C does to a command."""
    if os.name == "posix":
        _signal(process, signal.SIGINT)
    elif process.poll() is None:
        process.terminate()


def kill(process: subprocess.Popen[bytes]) -> None:
    """End it at once, with all that it started."""
    if os.name == "posix":
        _signal(process, signal.SIGKILL)
    elif process.poll() is None:
        process.kill()


def _signal(process: subprocess.Popen[bytes], number: int) -> None:
    if process.poll() is None:
        with contextlib.suppress(OSError):
            os.killpg(process.pid, number)
