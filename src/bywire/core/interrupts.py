"""Ctrl-C at the wrong moment: kept back where it would be lost, and noted where it is."""

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

_PAUSE = 0.2  # seconds until an interrupt that may have been swallowed is raised again


class _Interrupts:
    """Ctrl-C in a command: noted, raised, and raised again where a library swallowed it."""

    def __init__(self) -> None:
        self.arrived = False
        self._hook = sys.unraisablehook
        self._is_pending = False
        self._again: threading.Timer | None = None

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Be the handler of the signal."""
        timer, self._again = self._again, None
        if timer is not None and not timer.is_alive() and not self._is_pending:
            return  # the timer's own, which came too late
        self.arrived = True
        self._is_pending = _in_library(frame)
        if self._is_pending:
            self._raise_again()
        raise KeyboardInterrupt

    def swallowed(self, told: sys.UnraisableHookArgs) -> None:
        """Be the hook for what Python drops, as what is raised while a weak reference ends."""
        if isinstance(told.exc_value, KeyboardInterrupt):
            self._is_pending = True
            self._raise_again()
        else:
            self._hook(told)

    def _raise_again(self) -> None:
        self._again = threading.Timer(_PAUSE, _thread.interrupt_main)
        self._again.daemon = True
        self._again.start()

    def heard(self) -> None:
        """Raise it no more: somebody acts on it."""
        self._is_pending = False
        if self._again is not None:
            self._again.cancel()


def _in_library(frame: FrameType | None) -> bool:
    """Return whether CasADi has called what runs: it may swallow what is raised there."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] == "casadi":
            return True
        frame = frame.f_back
    return False


_current: list[_Interrupts] = []


def interrupt_heard() -> None:
    """Say that an interrupt is acted on, where KeyboardInterrupt was caught and work goes on."""
    for each in _current:
        each.heard()


@contextmanager
def interrupts_noted() -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether Ctrl-C was pressed since the block began.

    It raises KeyboardInterrupt, as ever; but CasADi may make an error of its own of what is raised
    where it calls Python, or nothing at all, and Python itself drops what is raised while it tidies
    up: then it is raised again until it is heard.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield lambda: False  # no interrupt arrives here
        return
    interrupts = _Interrupts()
    _current.append(interrupts)
    signal.signal(signal.SIGINT, interrupts.handle)
    hook, sys.unraisablehook = sys.unraisablehook, interrupts.swallowed
    try:
        yield lambda: interrupts.arrived
    finally:
        sys.unraisablehook = hook
        interrupts.heard()
        _current.remove(interrupts)
        signal.signal(signal.SIGINT, previous)


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Keep back Ctrl-C until the block ends; then raise KeyboardInterrupt.

    For building symbolic graphs: CasADi swallows what is raised while it looks at its arguments,
    a KeyboardInterrupt too, and the user's Ctrl-C would have no effect.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield  # no interrupt arrives here
        return
    arrived: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if arrived:
            previous(signal.SIGINT, None)  # notes it, where somebody does
            raise KeyboardInterrupt


class _Stops(threading.local):
    """Events of which any ends what a thread does; the main thread has none, it is interrupted."""

    events: tuple[threading.Event, ...] = ()


_stops = _Stops()


def _take(events: tuple[threading.Event, ...]) -> None:
    _stops.events = events


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt in a thread of `thread_pool` whose results nobody waits for any more.

    For loops that take long; between two calls of a kernel they ask.
    """
    if any(event.is_set() for event in _stops.events):
        raise KeyboardInterrupt


@contextmanager
def thread_pool(threads: int | None = None) -> Iterator[ThreadPoolExecutor]:
    """Yield a pool of threads that end within a moment where an exception leaves the block.

    Ctrl-C reaches the main thread alone. Threads that a thread of a pool starts end with it, too.

    Parameters
    ----------
    threads
        How many, >= 1; all cores by default.
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
