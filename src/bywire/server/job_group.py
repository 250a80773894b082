"""The process of a job, with all that it starts: begun, interrupted, killed."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys


def started() -> subprocess.Popen[bytes]:
    """Return a new process that waits for its order."""
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        # -P: a module in the folder that is served must not run in place of a library's.
        [sys.executable, "-P", "-m", "bywire.server.job_process"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
        start_new_session=True,  # Ctrl-C reaches the server, which ends its jobs
    )  # fmt: skip


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
