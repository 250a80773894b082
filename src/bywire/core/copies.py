"""Copies of this process: others that begin with all that it has loaded."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from bywire.core.callers import is_command_line


def may_copy() -> bool:
    """Return whether processes may be forked from this one: a command's that runs no threads.

    What a thread held when its process was copied, nobody gives back in the copy. A program of
    others may have threads that Python knows nothing of; those of the libraries that commands
    load take care of themselves.
    """
    return sys.platform == "linux" and is_command_line() and threading.active_count() == 1


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Have Ctrl-C wait until the block ends; processes that it copies never hear it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
