"""Ctrl-C at the wrong moment: kept back where it would be lost."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


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
            raise KeyboardInterrupt
