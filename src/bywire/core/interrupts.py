"""Ctrl-C at the wrong time: deferred if it would be lost, and raised again if it was lost."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from types import FrameType

from bywire.core.machine import worker_count

_PAUSE = 0.2  # seconds before an interrupt that may have been swallowed is raised again


class _Interrupts:
    """Handler of Ctrl-C in a command, which raises an interrupt again if a library swallowed it."""

    def __init__(self) -> None:
        self.arrived = False
        self._hook = sys.unraisablehook
        self._is_pending = False
        self._again: threading.Timer | None = None

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal."""
        timer, self._again = self._again, None
        if timer is not None and not timer.is_alive() and not self._is_pending:
            return  # our timer sent the signal after the interrupt had been handled
        self.arrived = True
        self._is_pending = _in_library(frame)
        if self._is_pending:
            self._raise_again()
        raise KeyboardInterrupt

    def swallowed(self, dropped: sys.UnraisableHookArgs) -> None:
        """Handle exceptions that Python drops, such as those in a weak reference's callback."""
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            self._is_pending = True
            self._raise_again()
        else:
            self._hook(dropped)

    def _raise_again(self) -> None:
        self._again = threading.Timer(_PAUSE, _thread.interrupt_main)
        self._again.daemon = True
        self._again.start()

    def handled(self) -> None:
        """Stop raising the interrupt again, because the program acts on it."""
        self._is_pending = False
        if self._again is not None:
            self._again.cancel()


def _in_library(frame: FrameType | None) -> bool:
    """Return whether CasADi called the running code; it may swallow exceptions raised there."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] == "casadi":
            return True
        frame = frame.f_back
    return False


_current: list[_Interrupts] = []


def interrupt_handled() -> None:
    """Declare an interrupt handled, for a caller that caught KeyboardInterrupt and continues."""
    for each in _current:
        each.handled()


@contextmanager
def interrupts_noted() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether Ctrl-C was pressed since the block began.

    Ctrl-C raises KeyboardInterrupt as usual. However, if CasADi calls Python, it may replace this
    exception with an error of its own, or drop it. Python itself drops exceptions that are raised
    during cleanup. In these cases, the interrupt is raised again until it is handled.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield lambda: False  # interrupts never reach this thread
        return
    interrupts = _Interrupts()
    _current.append(interrupts)
    signal.signal(signal.SIGINT, interrupts.handle)
    hook, sys.unraisablehook = sys.unraisablehook, interrupts.swallowed
    try:
        yield lambda: interrupts.arrived
    finally:
        sys.unraisablehook = hook
        interrupts.handled()
        _current.remove(interrupts)
        signal.signal(signal.SIGINT, previous)


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer Ctrl-C until the block ends, and then raise KeyboardInterrupt.

    Use it while building symbolic graphs. CasADi swallows exceptions that are raised while it
    inspects its arguments, including KeyboardInterrupt, so the user's Ctrl-C would have no effect.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield  # interrupts never reach this thread
        return
    arrived: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if arrived:
            previous(signal.SIGINT, None)  # an enclosing `interrupts_noted` records it
            raise KeyboardInterrupt


class _Stops(threading.local):
    """Events that stop a thread's work; the main thread has none, because Ctrl-C reaches it."""

    events: tuple[threading.Event, ...] = ()


_stops = _Stops()


def _take(events: tuple[threading.Event, ...]) -> None:
    _stops.events = events


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt in a thread of `thread_pool` whose results are no longer needed.

    Long loops call this between two calls of a kernel.
    """
    if any(event.is_set() for event in _stops.events):
        raise KeyboardInterrupt


@contextmanager
def thread_pool(threads: int | None = None) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads that end promptly when an exception leaves the block.

    Ctrl-C reaches only the main thread. Threads that are started by a pool's thread also end with
    it.

    Parameters
    ----------
    threads
        Number of threads, >= 1. Default: one per core.
    """
    stop = threading.Event()
    pool = ThreadPoolExecutor(
        worker_count(threads), initializer=_take, initargs=((*_stops.events, stop),)
    )
    try:
        yield pool
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
