"""What a command says: results on standard output, everything else on standard error."""

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
    """Make both streams usable: there, and able to show any text."""
    # Without this, a message for a closed standard error would land among the results.
    sys.stdout = sys.stdout or io.StringIO()
    sys.stderr = sys.stderr or io.StringIO()
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def result(text: str) -> None:
    """Print on standard output at once; a reader that has left (``| head``) is no error.

    Raises
    ------
    FileError
        When standard output cannot take it, for instance on a full disk.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _abandon()
    except OSError as error:
        _abandon()
        raise FileError(
            f"cannot write to standard output: {error.strerror}: make room there, or send it "
            "elsewhere"
        ) from None


def message(text: str) -> None:
    """Print a line for the user on standard error; control characters become harmless.

    What is too long to be read is shortened in its middle: what to do stands at the end.
    """
    from bywire.report.wording import clean

    with contextlib.suppress(OSError):
        print(f"bywire: {shortened(clean(text))}", file=sys.stderr, flush=True)


def flush() -> None:
    """Flush standard output, as far as somebody still reads it."""
    try:
        sys.stdout.flush()
    except OSError:
        _abandon()


def _abandon() -> None:
    """Let go of standard output, or what is left in its buffer fails once more at exit."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
