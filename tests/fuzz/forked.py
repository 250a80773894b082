"""Commands in a copy of this process: they begin at once, with all that is loaded here."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType


class Forked:
    """A command that runs; answers for a `subprocess.Popen` whose errors are read.

    Parameters
    ----------
    words
        The command, without its program.
    errors
        File that takes what it says of errors.
    folder, temporary
        Where it works, and where its temporary files go; as here unless given.
    """

    def __init__(
        self,
        words: Sequence[str],
        errors: Path,
        folder: Path | None = None,
        temporary: Path | None = None,
    ) -> None:
        self.returncode: int | None = None
        self._errors = errors
        errors.touch()  # it may be killed before it says anything
        sys.stdout.flush()
        self.pid = os.fork()
        if not self.pid:
            if folder is not None:
                os.chdir(folder)
            if temporary is not None:
                os.environ["TMPDIR"], tempfile.tempdir = str(temporary), None
            _run(words, errors)

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        self.poll(0)

    def poll(self, options: int = os.WNOHANG) -> int | None:
        """Return its status, once it has ended."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, options)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode

    def send_signal(self, sign: signal.Signals) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, sign)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float) -> tuple[str, str]:
        """Wait for its end, and return what it said."""
        give_up = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > give_up:
                raise subprocess.TimeoutExpired("bywire", timeout)
            time.sleep(0.005)
        return "", self._errors.read_text(encoding="utf-8")


def _run(words: Sequence[str], errors: Path) -> None:
    """Run a command and end."""
    status = 70
    try:
        for number, target in ((1, os.devnull), (2, str(errors))):
            file = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            os.dup2(file, number)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        sys.modules["__main__"] = ModuleType("__main__")  # workers would read that of the tests
        sys.argv = ["bywire", *words]
        from bywire.cli.main import main

        try:
            main()
            status = 0
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
        sys.stderr.flush()
    except BaseException:
        import traceback

        traceback.print_exc(file=sys.stderr)
        sys.stderr.flush()
    finally:
        os._exit(status)
