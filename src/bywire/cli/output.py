"""Output of a command: results on standard output, everything else on standard error."""

from __future__ import annotations

import contextlib
import io
import os
import sys

from bywire.core.clean_text import shortened
from bywire.core.errors import FileError

INTERRUPTED = 130
"""exit status after Ctrl-C"""


def open_streams() -> None:
    """Make both streams exist and able to show any text."""
    # Otherwise, messages for a closed standard error would appear among the results.
    sys.stdout = sys.stdout or io.StringIO()
    sys.stderr = sys.stderr or io.StringIO()
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def result(text: str) -> None:
    """Print on standard output immediately; a closed pipe (``| head``) is not an error.

    Raises
    ------
    FileError
        If writing fails, for instance on a full disk.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _abandon()
    except OSError as error:
        _abandon()
        raise FileError(
            f"cannot write to standard output: {error.strerror}: make room there, or redirect it "
            "elsewhere"
        ) from None


def message(text: str) -> None:
    """Print a line for the user on standard error, with control characters escaped.

    A long text is shortened in its middle, because the next step is at its end.
    """
    from bywire.report.wording import clean

    with contextlib.suppress(OSError):
        print(f"bywire: {shortened(clean(text))}", file=sys.stderr, flush=True)


def flush() -> None:
    """Flush standard output if its reader is still there."""
    try:
        sys.stdout.flush()
    except OSError:
        _abandon()


def _abandon() -> None:
    """Redirect standard output to nowhere, so that its buffer does not fail again at exit."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
