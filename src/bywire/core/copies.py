"""Worker processes, which are copies of this process if that is safe, and always end with it."""

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
from bywire.core.callers import flags, is_command_line, use_flags
from bywire.core.child_process import safe_start
from bywire.core.errors import RunError
from bywire.core.libraries import keep_one_thread

_ENDING = 0.05  # time [s] for which the system may still list a joined thread


def may_copy() -> bool:
    """Return whether this process may fork, which requires a command's process with one thread.

    A copy has one thread. In the copy, a lock that another thread held stays locked forever.
    Threads of libraries also count, so the function asks the operating system. With
    `keep_one_thread`, the libraries that commands load start no threads. Other people's programs
    are never copied, because their locks are unknown.
    """
    if sys.platform != "linux" or not is_command_line() or threading.active_count() > 1:
        return False
    until = time.monotonic() + _ENDING
    while (is_threaded := _thread_count() > 1) and time.monotonic() < until:
        time.sleep(0.001)
    return not is_threaded


def _thread_count() -> int:
    """Return the operating system's count of this process's threads."""
    return len(os.listdir("/proc/self/task"))


class _WithoutMain(SpawnProcess):
    """A process that loads the functions that it needs, but not the calling program.

    Python would execute the program's file again in each process. Without a guard
    ``if __name__ == "__main__":``, this would repeat the call itself.
    """

    def start(self) -> None:
        """Start the process; its arguments must be defined in modules that it can import."""
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
    """Context that starts processes without copied state."""

    Process = _WithoutMain


@contextmanager
def processes(
    count: int, prepare: Callable[..., object], *arguments: Any, is_copied: bool
) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that end with the block, even if busy, or with this process.

    Ctrl-C reaches only this process.

    Parameters
    ----------
    count
        Number of processes, >= 1.
    prepare, arguments
        Function that each process calls first, and its arguments.
    is_copied
        Whether the processes are copies of this process, which already contain everything that it
        has loaded and computed. Other processes load the data that they need.
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
        with _interrupts_blocked() if is_copied else nullcontext():
            for _ in range(count):
                pool.submit(_nothing)  # starts a process
        workers += pool._processes.values()
        watch.start()
        yield pool
    finally:  # immediately, even after Ctrl-C, because nobody needs the unfinished results
        with ending:
            is_over.set()
            _end(pool)
        # Also end the pool's threads, because later copies require a single thread, and Python's
        # shutdown would race with the threads. End the watch first, which may use the pool's queue.
        if watch.ident is not None:
            watch.join()
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def processes_with_brakes(
    count: int, advice: str, prepare: Callable[..., object] | None = None, *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Yield `processes` with the brakes of this process, which are its copies if that is safe.

    Parameters
    ----------
    count, prepare, arguments
        See `processes`.
    advice
        Next step for the user when a process is killed.

    Raises
    ------
    RunError
        When a process is killed.
    """
    is_copied = may_copy()
    files = () if is_copied else loaded_files()  # a copy already has these files
    try:
        words = None if is_copied else flags()  # a copy already has the flags
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
    use_flags(words)
    if prepare is not None:
        prepare(*arguments)


def _break_off(
    pool: ProcessPoolExecutor,
    workers: Sequence[BaseProcess],
    is_over: threading.Event,
    ending: threading.Lock,
) -> None:
    """Break a pool when one of its processes is killed, at any point of its work.

    All processes send their results through one pipe. If a process is killed while it sends a
    result that is longer than the pipe's buffer, the pool waits for the rest of the result forever.
    The other processes wait for the pipe.
    """
    wait([process.sentinel for process in workers])
    with ending:
        if not is_over.is_set():
            _end(pool)


def _end(pool: ProcessPoolExecutor) -> None:
    """End a pool's processes, and close their pipe so that the pool's thread stops waiting."""
    workers = [*(pool._processes or {}).values()]
    for process in workers:
        process.kill()
    left = [process.sentinel for process in workers]
    while left:
        left = [each for each in left if each not in wait(left)]
    last_end: Connection = vars(pool._result_queue)["_writer"]
    if not last_end.closed:  # otherwise, its number may already belong to another file
        last_end.close()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C until the block ends; copies that start within the block never receive it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _nothing() -> None:
    """Do nothing; a pool starts a process for each job."""


def _begin(prepare: Callable[..., object], *arguments: Any) -> None:
    """Prepare a worker: ignore Ctrl-C, use one thread, and end with the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_one_thread()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare(*arguments)


def _prepare(prepared: bytes) -> None:
    """Prepare a process without copied state after ensuring that it ends with its parent."""
    prepare, arguments = ForkingPickler.loads(prepared)
    prepare(*arguments)


def _end_with_parent() -> None:
    """End this process when its parent is killed, because it would wait for jobs forever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
