"""Commands of pages in copies of one process that has loaded bywire once.

Loading bywire and its libraries takes more computing time than most commands. A server loads them
once, and each command runs in a copy of the server (``fork``) with its own folder and output.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

_LOADED = (
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "pandas",
    "scipy.optimize",
    "scipy.signal",
    "xarray",
    "bywire.cli.app",
    "bywire.api.run",
    "bywire.report.bench_figures",
    "bywire.report.page",
    "bywire.report.result_folder",
)
_LISTENING = b"listening\n"


def can_fork() -> bool:
    """Return whether this system can copy a process."""
    return hasattr(os, "fork")


def run(arguments: list[str], folder: Path, settings: dict[str, str]) -> tuple[int, str]:
    """Run ``bywire`` with arguments in a folder, and return its exit status and output.

    ``settings``: environment variables of the command.
    """
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as output:
        job = {
            "arguments": arguments,
            "folder": str(folder),
            "output": output.name,
            "settings": settings,
        }
        with socket.socket(socket.AF_UNIX) as link:
            link.connect(_address())
            link.sendall(json.dumps(job).encode() + b"\n")
            status = link.makefile().read()
        if not status:
            raise RuntimeError(f"the server of commands ended during: bywire {arguments}")
        return int(status), output.read()


@cache
def _address() -> str:
    """Start the server, and return its address."""
    folder = tempfile.mkdtemp()
    address = str(Path(folder) / "commands")
    server = subprocess.Popen([sys.executable, __file__, address], stdout=subprocess.PIPE)
    assert server.stdout is not None
    if server.stdout.readline() != _LISTENING:
        raise RuntimeError("the server of commands did not start")
    atexit.register(server.terminate)
    return address


# --- In the server


def _serve(address: str) -> None:
    """Copy this process for each connection."""
    _load()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # no copy stays behind
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen(64)
        os.write(1, _LISTENING)
        while True:
            link, _ = listener.accept()
            if os.fork() == 0:
                listener.close()
                _answer(link)
                return
            link.close()


def _load() -> None:
    """Load bywire and its libraries like the command does."""
    from importlib import import_module

    from bywire.core.child_process import leave_out_working_folder
    from bywire.core.libraries import keep_one_thread, leave_out_dask, silence_matplotlib

    leave_out_working_folder()
    leave_out_dask()
    silence_matplotlib()
    keep_one_thread()
    for name in _LOADED:
        import_module(name)


def _answer(link: socket.socket) -> None:
    """Run one command in a copy of this copy, and send its exit status."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    job = json.loads(link.makefile().readline())
    copy = os.fork()
    if copy == 0:
        link.close()
        _command(job)
        return
    _, status = os.waitpid(copy, 0)
    link.sendall(str(os.waitstatus_to_exitcode(status)).encode())
    link.close()


def _command(job: dict[str, Any]) -> None:
    """Run a command as a process of its own would."""
    from bywire.cli.main import process

    os.environ.update(job["settings"])
    os.chdir(job["folder"])
    output = os.open(job["output"], os.O_WRONLY)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.close(output)
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(write_through=True)  # type: ignore[union-attr]
    sys.argv = ["bywire", *job["arguments"]]
    sys.modules["__main__"] = ModuleType("__main__")  # worker processes do not import this file
    process()


if __name__ == "__main__":
    _serve(sys.argv[1])
