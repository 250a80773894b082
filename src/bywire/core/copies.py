"""Processes that compute for this one: copies of it where that is safe, and never left alone."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from multiprocessing import active_children, get_context, parent_process
from typing import Any

from bywire.core.blas import keep_one_thread
from bywire.core.callers import is_command_line


def may_copy() -> bool:
    """Return whether processes may be forked from this one: a command's that runs no threads.

    What a thread held when its process was copied, nobody gives back in the copy. A program of
    others may have threads that Python knows nothing of; those of the libraries that commands
    load take care of themselves.
    """
    return sys.platform == "linux" and is_command_line() and threading.active_count() == 1


@contextmanager
def processes(
    count: int, prepare: Callable[..., object], *arguments: Any, is_copied: bool
) -> Iterator[ProcessPoolExecutor]:
    """Yield processes that end with the block, whatever they are at, and with this process.

    Ctrl-C is for this process alone.

    Parameters
    ----------
    count
        How many, >= 1.
    prepare, arguments
        What each of them calls first.
    is_copied
        Whether they are copies of this process, which begin with all that it has loaded and
        computed; others load what they need anew.
    """
    others = active_children()
    pool = ProcessPoolExecutor(
        count, get_context("fork" if is_copied else "spawn"), initializer=_begin,
        initargs=(prepare, *arguments),
    )  # fmt: skip
    try:
        with _deaf_to_interrupts() if is_copied else nullcontext():
            pool.submit(_nothing)  # which starts them
        yield pool
    finally:  # at once, also after Ctrl-C: nobody waits for what they are at
        for process in set(active_children()).difference(others):
            process.terminate()
        pool.shutdown(wait=is_copied, cancel_futures=True)  # its threads, for the next copies


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Have Ctrl-C wait until the block ends; processes that it copies never hear it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _nothing() -> None:
    """Be a job that has a pool start its processes."""


def _begin(prepare: Callable[..., object], *arguments: Any) -> None:
    """Prepare a process of a core: Ctrl-C is for the one that asked, with which it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_one_thread()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare(*arguments)


def _end_with_parent() -> None:
    """End this process when the one that asked is killed: it would wait for jobs forever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
