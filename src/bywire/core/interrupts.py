"""Ctrl-C at the wrong moment: kept back where it would be lost, and noted where it is."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_noted() -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether Ctrl-C was pressed since the block began.

    It raises KeyboardInterrupt, as ever; but a library that calls Python, as CasADi does, may make
    an error of its own of that, or nothing at all.
    """
    arrived: list[int] = []

    def note(number: int, _: object) -> None:
        arrived.append(number)
        raise KeyboardInterrupt

    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield lambda: False  # no interrupt arrives here
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(arrived)
    finally:
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
