"""Processes that compute for this one: copies of it where that is safe, and never left alone."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from types import ModuleType
from typing import Any

from bywire.core.brake import load_brakes, loaded_files
from bywire.core.callers import flags, is_command_line, speak_in
from bywire.core.child_process import safe_start
from bywire.core.errors import RunError
from bywire.core.libraries import keep_one_thread

_ENDING = 0.05  # s for which a thread that was joined may still be there


def may_copy() -> bool:
    """Whether processes may be forked from this one: a command's, with a single thread.

    A copy has one thread. A lock that another thread held stays locked in it forever. The threads
    of libraries count too, so the operating system counts them; `keep_one_thread` has the libraries
    that commands load start none. A program of others is never copied: what it holds is unknown.
    """
    if sys.platform != "linux" or not is_command_line() or threading.active_count() > 1:
        return False
    until = time.monotonic() + _ENDING
    while (is_threaded := _thread_count() > 1) and time.monotonic() < until:
        time.sleep(0.001)
    return not is_threaded


def _thread_count() -> int:
    """Number of threads of this process, as the operating system counts them."""
    return len(os.listdir("/proc/self/task"))


class _WithoutMain(SpawnProcess):
    """A process that loads what it computes, and not the program that asked for it.

    Python would run that program's file again in each: what stands there beside the call and,
    where no ``if __name__ == "__main__":`` guards it, the call itself, which cannot be.
    """

    def start(self) -> None:
        """Start it; what it is given comes from modules that it can import."""
        main = sys.modules["__main__"]
        nameless = ModuleType("__main__")
        vars(nameless).update(vars(main), __spec__=None, __file__=None)
        sys.modules["__main__"] = nameless
        try:
            with safe_start():
                super().start()
        finally:
            sys.modules["__main__"] = main


class _Anew(SpawnContext):
    """Starts processes that load all anew."""

    Process = _WithoutMain


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
    with nullcontext() if is_copied else safe_start():
        pool = ProcessPoolExecutor(
            count,
            get_context("fork") if is_copied else _Anew(),
            initializer=_begin,
            initargs=(prepare, *arguments)
            if is_copied
            else (_prepare, bytes(ForkingPickler.dumps((prepare, arguments)))),
        )
    workers: list[BaseProcess] = []
    is_over, ending = threading.Event(), threading.Lock()
    watch = threading.Thread(target=_break_off, args=(pool, workers, is_over, ending), daemon=True)
    try:
        with _deaf_to_interrupts() if is_copied else nullcontext():
            for _ in range(count):
                pool.submit(_nothing)  # which starts them
        workers += pool._processes.values()
        watch.start()
        yield pool
    finally:  # at once, also after Ctrl-C: nobody waits for what they are at
        with ending:
            is_over.set()
            _end(pool)
        # With its threads: the next copies must find none, and Python's own end would meet them
        # while they close what it writes to. The watch first: it may be at the pool's queue.
        if watch.ident is not None:
            watch.join()
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def processes_with_brakes(
    count: int, advice: str, prepare: Callable[..., object] | None = None, *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Yield `processes` with the brakes of this one: copies of it where that is safe.

    Parameters
    ----------
    count, prepare, arguments
        As of `processes`.
    advice
        Next step when one of them is killed.

    Raises
    ------
    RunError
        When one of them is killed.
    """
    is_copied = may_copy()
    files = () if is_copied else loaded_files()  # a copy has them
    try:
        words = None if is_copied else flags()  # likewise
        with processes(
            count, _know, files, words, prepare, *arguments, is_copied=is_copied
        ) as pool:
            yield pool
    except BrokenProcessPool:
        raise RunError(
            f"a process of the study was killed, probably out of memory: {advice}"
        ) from None


def _know(
    files: Sequence[str],
    words: dict[str, str] | None,
    prepare: Callable[..., object] | None,
    *arguments: Any,
) -> None:
    load_brakes(files)
    speak_in(words)
    if prepare is not None:
        prepare(*arguments)


def _break_off(
    pool: ProcessPoolExecutor,
    workers: Sequence[BaseProcess],
    is_over: threading.Event,
    ending: threading.Lock,
) -> None:
    """Have a pool break when a process of it is killed, wherever that process was.

    All of them answer through one pipe. Where it is killed within an answer that is longer than the
    pipe holds, the pool, which would notice its end, waits for the rest of the answer, and the
    others wait for their turn.
    """
    wait([process.sentinel for process in workers])
    with ending:
        if not is_over.is_set():
            _end(pool)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool, and have its thread learn that no more answers come."""
    workers = [*(pool._processes or {}).values()]
    for process in workers:
        process.kill()
    left = [process.sentinel for process in workers]
    while left:
        left = [each for each in left if each not in wait(left)]
    last_end: Connection = vars(pool._result_queue)["_writer"]
    if not last_end.closed:  # its number may be another file's by now
        last_end.close()


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


def _prepare(prepared: bytes) -> None:
    """Prepare a process that loads all anew: only now, when it ends with its parent."""
    prepare, arguments = ForkingPickler.loads(prepared)
    prepare(*arguments)


def _end_with_parent() -> None:
    """End this process when the one that asked is killed: it would wait for jobs forever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
