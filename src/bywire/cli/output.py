"""A command's output: results on standard output, everything else on standard error."""

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
    """Make sure that both streams exist and can print any text."""
    # Otherwise, with standard error closed, messages would appear among the results.
    sys.stdout = sys.stdout or io.StringIO()
    sys.stderr = sys.stderr or io.StringIO()
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def result(text: str) -> None:
    """Print to standard output without buffering, and ignore a closed pipe (``| head``).

    Raises
    ------
    FileError
        If writing fails, for example on a full disk.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _abandon()
    except OSError as error:
        _abandon()
        raise FileError(
            f"cannot write to standard output: {error.strerror}. Free some space, or redirect the "
            "output elsewhere",
            name="standard output",
        ) from None


def message(text: str) -> None:
    """Print a line for the user to standard error, with control characters escaped.

    bywire shortens a long text in the middle, because the advice is at the end.
    """
    from bywire.report.wording import clean

    with contextlib.suppress(OSError):
        print(f"bywire: {shortened(clean(text))}", file=sys.stderr, flush=True)


def flush() -> None:
    """Flush standard output, and ignore a closed pipe."""
    try:
        sys.stdout.flush()
    except OSError:
        _abandon()


def _abandon() -> None:
    """Discard further output, so that flushing the buffer at exit cannot fail again."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
